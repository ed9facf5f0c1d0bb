"""Makes the definition text of a message type from its installed class, as recordings contain it (`ros2msg`).

Constants and default values are left out, because the serialised messages do not depend on them.
"""

import re
from typing import Any

from contact_curation.nodes.ros.message_types import message_class

SEPARATOR = "=" * 80
WORDS = {"boolean": "bool", "octet": "byte", "float": "float32", "double": "float64"}
"""Primitive types by their names in message classes, and their names in definitions."""

FIELD = re.compile(r"(?:sequence<(?P<element>[^,]+?)(?:, (?P<bound>\d+))?>|(?P<item>[^\[]+)\[(?P<size>\d+)\]|(?P<plain>.+))")
BOUNDED = re.compile(r"(w?string)<(\d+)>")


def definition_text(type_name: str) -> str:
    """The definition of `type_name`, e.g. `nav_msgs/msg/Odometry`, followed by those of the types of its fields.

    Raises:
        MissingDependencyError: a type is not installed.
    """
    own: dict[str, str] = {}
    waiting = [type_name]
    while waiting:
        name = waiting.pop(0)
        if name in own:
            continue
        own[name], parts = _own_text(message_class(name))
        waiting += parts
    first, *others = own
    texts = [own[first], *(f"{SEPARATOR}\nMSG: {name.replace('/msg/', '/')}\n{own[name]}" for name in others)]
    return "".join(texts)


def _own_text(kind: Any) -> tuple[str, list[str]]:
    """One line per field, and the message types of the fields."""
    lines, parts = [], []
    for field, declared in kind.get_fields_and_field_types().items():
        element, suffix = _split(declared)
        lines.append(f"{WORDS.get(element, BOUNDED.sub(r'\1<=\2', element))}{suffix} {field}\n")
        if "/" in element:
            parts.append(element.replace("/", "/msg/"))
    return "".join(lines), parts


def _split(declared: str) -> tuple[str, str]:
    """Splits a field's type into the element type and the array suffix."""
    found = FIELD.fullmatch(declared)
    assert found is not None  # the last alternative of the pattern matches anything
    if found["element"]:
        return found["element"], f"[<={found['bound']}]" if found["bound"] else "[]"
    return (found["item"], f"[{found['size']}]") if found["item"] else (found["plain"], "")
