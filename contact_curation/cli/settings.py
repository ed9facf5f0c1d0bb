"""`--set gates.depth=0.01`: every field of every stage's configuration, by the names the nodes' ROS parameters have too."""

import argparse
import dataclasses
from collections.abc import Mapping, Sequence
from enum import Enum
from typing import Any, Union, get_args, get_origin, get_type_hints

from contact_curation.errors import InvalidValueError

BOOLEANS = {"true": True, "false": False}


def add_settings(parser: argparse.ArgumentParser, stages: Sequence[str]) -> None:
    """Adds the option; `stages` are the names of those that may be changed."""
    parser.add_argument(
        "--set",
        dest="settings",
        metavar="STAGE.FIELD=VALUE",
        action="append",
        default=[],
        help=f"change a field of a stage ({', '.join(stages)}), e.g. gates.depth=0.01; repeatable; docs/commands.md lists them",
    )


def with_settings(stages: Mapping[str, Any], settings: Sequence[str]) -> dict[str, Any]:
    """The configurations with the settings in place of their defaults.

    Raises:
        InvalidValueError: a setting names no field, or its value is not one.
    """
    changed = dict(stages)
    for setting in settings:
        path, equals, text = setting.partition("=")
        stage, _, name = path.partition(".")
        if not equals or stage not in changed:
            raise InvalidValueError("--set", setting, f"STAGE.FIELD=VALUE with a stage of {', '.join(changed)}")
        changed[stage] = _changed(changed[stage], name, text, setting)
    return changed


def _changed(config: Any, path: str, text: str, setting: str) -> Any:
    """A copy with the field at `path`, which may lie in a configuration inside this one, set to what `text` says."""
    name, _, rest = path.partition(".")
    fields = {field.name for field in dataclasses.fields(config)}
    if name not in fields:
        raise InvalidValueError("--set", setting, f"a field of {', '.join(sorted(fields))}")
    if rest:
        inner = getattr(config, name)
        if not dataclasses.is_dataclass(inner):
            raise InvalidValueError("--set", setting, f"no field inside {name}")
        return dataclasses.replace(config, **{name: _changed(inner, rest, text, setting)})
    try:
        value = _value(get_type_hints(type(config))[name], text)
    except (ValueError, KeyError, TypeError) as error:
        raise InvalidValueError("--set", setting, f"a value of type {get_type_hints(type(config))[name]}") from error
    return dataclasses.replace(config, **{name: value})


def _value(kind: Any, text: str) -> Any:
    """`text` as a value of the type."""
    if get_origin(kind) is tuple:
        return tuple(_value(part, word) for part, word in zip(get_args(kind), text.split(","), strict=True))
    if get_origin(kind) is Union or type(None) in get_args(kind):
        return None if text == "none" else _value(next(part for part in get_args(kind) if part is not type(None)), text)
    if kind is bool:
        return BOOLEANS[text.lower()]
    if isinstance(kind, type) and issubclass(kind, Enum | int | float | str):
        return kind(text)
    raise TypeError(kind)
