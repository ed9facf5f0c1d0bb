"""The fields of frozen config dataclasses: their paths, types, defaults and descriptions.

A field is described once, in its class's docstring; the options of commands and the parameters of nodes are made of it.
"""

import dataclasses
import inspect
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import fields, is_dataclass, replace
from enum import Enum
from math import inf, isfinite
from numbers import Integral, Real
from pathlib import Path
from typing import Any, NamedTuple, Union, get_args, get_origin, get_type_hints

from contact_curation.errors import InvalidValueError, UnknownNameError

_ATTRIBUTE = re.compile(r"^    (\w+(?:, \w+)*): (.+(?:\n {8,}.+)*)", re.MULTILINE)
CITATION = re.compile(r"\s*\(method\.md [^)]*\)")
_BOOLEANS = {"true": True, "false": False}


def ranged(default: Any, least: float, most: float) -> Any:
    """A dataclass field whose ROS parameter takes numbers from `least` to `most`; the class itself may accept fewer."""
    return dataclasses.field(default=default, metadata={"range": (least, most)})


def whole_number(name: str, value: object, least: int = 0, most: float = inf) -> int:
    """The whole number from `least` to `most` that a value is; NumPy's are whole numbers, too, and truth values are none.

    Raises:
        InvalidValueError: it is another value; the message begins with `name`.
    """
    if type(value) is bool or not isinstance(value, Integral) or not least <= int(value) <= most:
        bounds = f"of at least {least}" if most == inf else f"from {least} to {most}"
        raise InvalidValueError(name, _shown(value), f"a whole number {bounds}")
    return int(value)


def truth_value(name: str, value: object) -> bool:
    """The truth value that a value is, NumPy's too; the text "no" would count as true.

    Raises:
        InvalidValueError: it is another value; the message begins with `name`.
    """
    if type(value).__name__ not in ("bool", "bool_"):  # NumPy's; its import takes long
        raise InvalidValueError(name, _shown(value), "True or False")
    return bool(value)


def set_whole_numbers(config: object, names: Iterable[str], least: int = 0, most: float = inf, prefix: str = "") -> None:
    """Checks fields of a frozen config in its `__post_init__` and makes them Python's whole numbers, as `whole_number` does.

    Args:
        config: itself.
        names: of the fields.
        least, most: accepted numbers.
        prefix: stands before the names in messages.

    Raises:
        InvalidValueError: as of `whole_number`.
    """
    for name in names:
        object.__setattr__(config, name, whole_number(prefix + name, getattr(config, name), least, most))


def check_positive(config: object, names: Iterable[str], prefix: str = "", unit: str = "", *, infinite: bool = False) -> None:
    """Checks that fields of a config are numbers above 0; truth values are none. Those of NumPy become Python's.

    Args:
        config: itself, in its `__post_init__`.
        names: of the fields.
        prefix: stands before the names in messages.
        unit: stands after what is expected, such as "of metres".
        infinite: whether infinity is accepted, for a bound that does not apply.

    Raises:
        InvalidValueError: one is another value.
    """
    for name in names:
        value = getattr(config, name)
        if not (infinite and isinstance(value, float) and value == inf):
            _check_number(prefix + name, value, f"a positive number {unit}".rstrip(), least_excluded=True)
            _make_plain(config, name)


def check_not_negative(config: object, names: Iterable[str], prefix: str = "") -> None:
    """Checks that fields of a config are finite numbers of at least 0; the rest as of `check_positive`."""
    for name in names:
        _check_number(prefix + name, getattr(config, name), "a number of at least 0", least_excluded=False)
        _make_plain(config, name)


def _check_number(name: str, value: Any, expected: str, *, least_excluded: bool) -> None:
    is_number = type(value) is not bool and isinstance(value, Real) and isfinite(value)
    if not is_number or value < 0 or (least_excluded and value == 0):
        raise InvalidValueError(name, _shown(value), expected)


def _make_plain(config: object, name: str) -> None:
    """Makes a number of a config a float where JSON cannot hold it, such as NumPy's float32 or a fraction."""
    value = getattr(config, name)
    if not isinstance(value, int | float):
        object.__setattr__(config, name, float(value))


def _shown(value: object) -> object:
    return repr(value) if isinstance(value, str) else value


class ConfigField(NamedTuple):
    """One field that is no config itself.

    Attributes:
        path: names with dots between them, e.g. ``gates.depth``.
        kind: its type.
        default: its value in the config at hand.
        description: what the class's docstring says of it; may be empty.
        bounds: that the field itself says (`ranged`); None where it says none.
    """

    path: str
    kind: Any
    default: Any
    description: str
    bounds: tuple[float, float] | None = None


def plain_values(record: Any) -> dict[str, object]:
    """The fields of a dataclass by name, with arrays as lists, as JSON and YAML have them."""
    values = {field.name: getattr(record, field.name) for field in fields(record)}
    return {name: value.tolist() if hasattr(value, "tolist") else value for name, value in values.items()}


def fields_of(config: Any, prefix: str = "") -> Iterator[ConfigField]:
    """Every field of a config and of the configs inside it."""
    kinds, described = get_type_hints(type(config)), descriptions_of(type(config))
    for field in fields(config):
        value = getattr(config, field.name)
        if is_dataclass(value):
            yield from fields_of(value, f"{prefix}{field.name}.")
        else:
            said = described.get(field.name, "")
            yield ConfigField(f"{prefix}{field.name}", kinds[field.name], value, said, field.metadata.get("range"))


def changed_fields(config: Any, default: Any, prefix: str = "") -> Iterator[str]:
    """The fields with another value than in a config of the same class, `gates.depth=0.01` for the prefix `gates.`."""
    for field, before in zip(fields_of(config, prefix), fields_of(default, prefix), strict=True):
        if field.default != before.default:
            yield f"{field.path}={word_of(field.default)}"


def word_of(value: Any) -> str:
    """A value as `parsed` takes it."""
    if isinstance(value, tuple | list):
        return ",".join(map(word_of, value))
    plain = value.value if isinstance(value, Enum) else value
    return str(plain).lower() if plain is None or isinstance(plain, bool) else str(plain)


def field_of(config: Any, path: str) -> ConfigField:
    """The field at a path.

    Raises:
        InvalidValueError: there is none.
    """
    found = {field.path: field for field in fields_of(config)}
    if path not in found:
        raise UnknownNameError("field", path, found)
    return found[path]


def with_fields[Config](config: Config, values: Mapping[str, Any]) -> Config:
    """A copy with the fields at some paths changed, all at once.

    Raises:
        InvalidValueError: the class does not accept the values.
    """
    changed: dict[str, Any] = {}
    inside: dict[str, dict[str, Any]] = {}
    for path, value in values.items():
        name, _, rest = path.partition(".")
        if rest:
            inside.setdefault(name, {})[rest] = value
        else:
            changed[name] = value
    changed |= {name: with_fields(getattr(config, name), own) for name, own in inside.items()}
    return replace(config, **changed)  # type: ignore[type-var]


def with_field(config: Any, path: str, value: Any) -> Any:
    """A copy with one field changed; errors as of `with_fields`."""
    return with_fields(config, {path: value})


LOWEST, HIGHEST = (-1e9, 0.0, 1.0), (1e9, 1e6, 180.0, 90.0, 1.0, 0.5)
"""Bounds that ranges of fields have, the widest first."""


def accepted_range(config: Any, field: ConfigField) -> tuple[float, float] | None:
    """The bounds that a field says, or the smallest and largest of some usual ones within which its class accepts a number.

    The bounds themselves may be excluded.

    Returns:
        None where nothing can be said: the field holds no finite number, or every number is accepted.
    """
    if field.bounds is not None:
        return field.bounds
    if type(field.default) not in (int, float) or not isfinite(field.default):
        return None

    def accepts(value: float) -> bool:
        try:
            with_field(config, field.path, type(field.default)(value))
        except (InvalidValueError, ValueError, ArithmeticError):
            return False
        return True

    step = 0 if type(field.default) is int else 1e-9  # bounds of numbers with a point may be excluded
    low = next((one for one in LOWEST if one <= field.default and (accepts(one) or accepts(one + step))), None)
    high = next((one for one in HIGHEST if one >= field.default and (accepts(one) or accepts(one - step))), None)
    known = low is not None and high is not None and low < high and (low, high) != (LOWEST[0], HIGHEST[0])
    return (low, high) if known else None  # type: ignore[return-value]


def parsed(kind: Any, text: str) -> Any:
    """`text` as a value of a field's type: numbers with commas between them for a tuple, ``none`` for None.

    Raises:
        ValueError, KeyError, TypeError: it is none.
    """
    if get_origin(kind) is tuple:
        return tuple(parsed(part, word) for part, word in zip(get_args(kind), text.split(","), strict=True))
    if get_origin(kind) is Union or type(None) in get_args(kind):
        return None if text == "none" else parsed(next(part for part in get_args(kind) if part is not type(None)), text)
    if kind is bool:
        return _BOOLEANS[text.lower()]
    if isinstance(kind, type) and issubclass(kind, Enum | int | float | str | Path):
        return kind(text)
    raise TypeError(kind)


def kind_in_words(kind: Any) -> str:
    """A type as a user would say it: `float`, `tuple[float, float]`, `one of circular, polyhedral`."""
    if isinstance(kind, type) and issubclass(kind, Enum):
        return f"one of {', '.join(str(each.value) for each in kind)}"
    return kind.__name__ if type(kind) is type else str(kind).replace("NoneType", "none").replace("None", "none")


def descriptions_of(config: type) -> dict[str, str]:
    """The descriptions of a config's attributes in its docstring, by their names, without citations of docs/method.md."""
    section = CITATION.sub("", (inspect.getdoc(config) or "").partition("Attributes:\n")[2])
    return {name: " ".join(text.split()) for names, text in _ATTRIBUTE.findall(section) for name in names.split(", ")}
