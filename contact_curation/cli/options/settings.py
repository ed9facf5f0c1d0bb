"""`--set gates.depth=0.01`: every field of every stage's configuration, by the names the nodes' ROS parameters have too."""

import argparse
import dataclasses
from collections.abc import Mapping, Sequence
from enum import Enum
from typing import Any, Union, get_args, get_origin, get_type_hints

from contact_curation.errors import ContactCurationError, InvalidValueError

EXAMPLES = ("gates.depth=0.01", "segmenter.settle_time=0.5", "simulation.longest=6")
"""The help names the first one of a stage that the verb has."""

OF_THE_BODY = "gravity"
"""A field that the stages take from the body, whatever else is said of it."""

BOOLEANS = {"true": True, "false": False}


def add_settings(parser: argparse.ArgumentParser, stages: Sequence[str]) -> None:
    """Adds the option; `stages` are the names of those that may be changed."""
    example = next(each for each in EXAMPLES if each.partition(".")[0] in stages)
    parser.add_argument(
        "--set",
        dest="settings",
        metavar="STAGE.FIELD=VALUE",
        action="append",
        default=[],
        help=f"change a field of a stage ({', '.join(stages)}), e.g. {example}; repeatable; docs/ros/reference.md lists most",
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
        if name == OF_THE_BODY:
            raise InvalidValueError("--set", setting, f"no {OF_THE_BODY} here: it is the body's, in the file of --body")
        changed[stage] = _changed(changed[stage], name, text, setting)
    return changed


def _changed(config: Any, path: str, text: str, setting: str) -> Any:
    """A copy with the field at `path`, which may lie in a configuration inside this one, set to what `text` says."""
    name, _, rest = path.partition(".")
    fields = {field.name for field in dataclasses.fields(config)}
    if name not in fields:
        raise InvalidValueError("--set", setting, f"one of the fields {', '.join(sorted(fields))}")
    if rest:
        inner = getattr(config, name)
        if not dataclasses.is_dataclass(inner):
            raise InvalidValueError("--set", setting, f"no field inside {name}")
        return dataclasses.replace(config, **{name: _changed(inner, rest, text, setting)})
    kind = get_type_hints(type(config))[name]
    try:
        value = _value(kind, text)
    except (ValueError, KeyError, TypeError) as error:
        raise InvalidValueError("--set", setting, f"a value of type {_said(kind)}") from error
    try:
        return dataclasses.replace(config, **{name: value})
    except InvalidValueError as error:
        raise ContactCurationError(f"--set {setting}: {error}") from error


def _said(kind: Any) -> str:
    """A type as a user would say it: `float`, `tuple[float, float]`, `one of circular, polyhedral`."""
    if isinstance(kind, type) and issubclass(kind, Enum):
        return f"one of {', '.join(str(each.value) for each in kind)}"
    return kind.__name__ if type(kind) is type else str(kind).replace("NoneType", "none").replace("None", "none")


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
