"""The fields of configs as ROS parameters have them: by their paths, as values of few types.

A field that may be None takes 0.0 for None, because a ROS parameter has one type.
"""

from collections.abc import Mapping
from enum import Enum
from typing import Any

from contact_curation.configs import fields_of, with_fields


def as_parameter(value: Any) -> Any:
    """A field's value as a ROS parameter has it."""
    if value is None:
        return 0.0
    if isinstance(value, Enum):
        return value.value
    return list(value) if isinstance(value, tuple) else value


def as_field(value: Any, like: Any) -> Any:
    """A parameter's value as the field that holds `like` has it."""
    if like is None:
        return value or None
    if isinstance(like, Enum):
        return type(like)(value)
    return tuple(value) if isinstance(like, tuple) else value


def with_parameters[Config](config: Config, parameters: Mapping[str, Any], prefix: str = "") -> Config:
    """The config with those of its fields changed that parameters are given for.

    Args:
        config: the defaults.
        parameters: values by name; those of other things are passed over.
        prefix: what the names of the config's parameters begin with, dot included.

    Raises:
        InvalidValueError: the config does not accept a value.
    """
    fields = [field for field in fields_of(config) if prefix + field.path in parameters]
    return with_fields(config, {field.path: as_field(parameters[prefix + field.path], field.default) for field in fields})
