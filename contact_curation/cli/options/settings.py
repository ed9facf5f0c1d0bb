"""Options that are fields of configs.

`--set gates.depth=0.01` changes any field of any stage, with the names of the nodes' ROS parameters. The most used fields have
options of their own. Help and defaults come from the configs.
"""

import argparse
import re
from collections.abc import Callable, Mapping, Sequence
from enum import Enum
from typing import Any, get_args, get_origin

from contact_curation.configs import ConfigField, field_of, fields_of, kind_in_words, parsed, with_field, with_fields
from contact_curation.errors import ContactCurationError, InvalidValueError, UnknownNameError

EXAMPLES = ("gates.depth=0.01", "segmenter.settle_time=0.5", "simulation.longest=6")
"""Examples for the help, which shows the first one for a stage of the verb."""

OF_CODE = re.compile(r"(: )?one of `[A-Z]+`(; )?|`")
"""Parts of a description that are only for readers of the code; the help lists the choices itself."""

OF_THE_BODY = "gravity"
"""A field that always comes from the body."""


def add_settings(parser: argparse.ArgumentParser, stages: Sequence[str]) -> None:
    """Adds `--set`; `stages` are the names of the stages that may be changed."""
    example = next(each for each in EXAMPLES if each.partition(".")[0] in stages)
    parser.set_defaults(stages=tuple(stages))
    parser.add_argument(
        "--set",
        dest="settings",
        metavar="STAGE.FIELD=VALUE",
        action="append",
        default=[],
        help=f"change a field of a stage ({', '.join(stages)}), e.g. {example}; repeatable; docs/ros/reference.md",
    )


def with_settings(stages: Mapping[str, Any], settings: Sequence[str]) -> dict[str, Any]:
    """The configurations with the settings in place of their defaults.

    Raises:
        InvalidValueError: a setting names no field, or its value is invalid.
    """
    values: dict[str, dict[str, Any]] = {}
    said: dict[str, list[str]] = {}
    for setting in settings:
        path, equals, text = setting.partition("=")
        stage, _, name = path.partition(".")
        if not equals or not name:
            raise InvalidValueError("--set", setting, f"STAGE.FIELD=VALUE with a stage of {', '.join(stages)}")
        if stage not in stages:
            raise UnknownNameError("stage in --set", stage, stages)
        if name == OF_THE_BODY:
            raise InvalidValueError("--set", setting, f"no {OF_THE_BODY} here: it is the body's, in the file of --body")
        values.setdefault(stage, {})[name] = _value(stages[stage], stage, name, text)
        said.setdefault(stage, []).append(f"--set {setting}")
    changed = dict(stages)
    for stage, own in values.items():
        try:
            changed[stage] = with_fields(stages[stage], own)  # all at once: a bound may need another one to be changed, too
        except InvalidValueError as error:
            raise ContactCurationError(f"{' '.join(said[stage])}: {error}") from error
    return changed


def _value(config: Any, stage: str, name: str, text: str) -> Any:
    """The value of `text` for the field at a path of a stage's config."""
    fields = {field.path: field for field in fields_of(config)}
    if name not in fields:
        raise UnknownNameError("field in --set", f"{stage}.{name}", [f"{stage}.{path}" for path in fields])
    kind, setting = fields[name].kind, f"{stage}.{name}={text}"
    try:
        return parsed(kind, text)
    except (ValueError, KeyError, TypeError) as error:
        raise InvalidValueError("--set", setting, f"a value of type {kind_in_words(kind)}") from error


def add_fields(
    group: argparse._ActionsContainer,
    config: Any,
    *paths: str,
    choices: Mapping[str, Sequence[str]] | None = None,
    told: Mapping[str, str] | None = None,
    also: Mapping[str, Sequence[str]] | None = None,
    shown: Mapping[str, str] | None = None,
) -> None:
    """Adds options for fields of a config; help and default come from the config's class, which also checks the values.

    A boolean field becomes a switch, a sequence an option with several values. An option that was not given is None, and
    `with_options` then leaves the field unchanged.

    Args:
        group: group of options.
        config: config with the defaults.
        paths: paths of fields; the last name of a path is the name of the option.
        choices: accepted words by path, for fields whose type does not determine them.
        told: help texts by path, in place of those of the class.
        also: further names of the option by path.
        shown: placeholder of the value in the help by path.
    """
    for path in paths:
        field = field_of(config, path)
        name = path.rpartition(".")[2]
        words = (f"--{name.replace('_', '-')}", *(also or {}).get(path, ()))
        text = (told or {}).get(path) or OF_CODE.sub("", field.description).rstrip(".").replace("%", "%%")
        if field.kind is bool:
            group.add_argument(*words, dest=name, action="store_true", default=None, help=text)
            continue
        accepted = (choices or {}).get(path) or _choices(field.kind)
        unsaid = field.default in (None, "", ()) or "(default" in text
        several: dict[str, Any] = {"nargs": "+", "action": "extend"} if _is_sequence(field.kind) else {}
        shape = "N" if int in (field.kind, *get_args(field.kind)) else name.rpartition("_")[2].upper()
        group.add_argument(
            *words,
            dest=name,
            type=str if accepted else _judged_by(config, field),
            choices=accepted or None,
            metavar=None if accepted else (shown or {}).get(path, shape),
            help=text if unsaid else f"{text} (default {_plain(field.default)})",
            **several,
        )


def with_options(config: Any, arguments: argparse.Namespace, *paths: str) -> Any:
    """The config with the values of the options of `add_fields` that were given.

    Raises:
        InvalidValueError: the class does not accept this combination of values.
    """
    values = {}
    for path in paths:
        given = getattr(arguments, path.rpartition(".")[2])
        if given is not None:
            kind = field_of(config, path).kind
            values[path] = parsed(kind, given) if isinstance(given, str) else tuple(given) if _is_sequence(kind) else given
    return with_fields(config, values)


def _is_sequence(kind: Any) -> bool:
    """Whether a field has a variable number of values."""
    return get_origin(kind) is tuple and Ellipsis in get_args(kind)


def _judged_by(config: Any, field: ConfigField) -> Callable[[str], Any]:
    """A function that parses an option's value and lets the config's class check it."""
    kind = get_args(field.kind)[0] if _is_sequence(field.kind) else field.kind

    def value(text: str) -> Any:
        try:
            found = parsed(kind, text)
            with_field(config, field.path, (found,) if _is_sequence(field.kind) else found)
        except (InvalidValueError, ValueError, KeyError, TypeError) as error:
            why = str(error).partition(", expected ")[2] if isinstance(error, InvalidValueError) else ""
            raise argparse.ArgumentTypeError(f"found {text}, expected {why or kind_in_words(kind)}") from error
        return found

    return value


def _choices(kind: Any) -> list[str]:
    return [str(each.value) for each in kind] if isinstance(kind, type) and issubclass(kind, Enum) else []


def _plain(value: Any) -> str:
    if isinstance(value, Enum):
        return str(value.value)
    return f"{value:g}" if isinstance(value, float) else str(value)
