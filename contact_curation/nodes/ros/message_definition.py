"""The definition text of a message type, as bags carry it (`ros2msg`), from its installed class.

Constants and default values are left out: no byte of a message depends on them.
"""

import re
from typing import Any

from contact_curation.nodes.ros.message_types import message_class

SEPARATOR = "=" * 80
WORDS = {"boolean": "bool", "octet": "byte", "float": "float32", "double": "float64"}
"""What a class calls primitive types, and what definitions call them."""

FIELD = re.compile(r"(?:sequence<(?P<element>[^,]+?)(?:, (?P<bound>\d+))?>|(?P<item>[^\[]+)\[(?P<size>\d+)\]|(?P<plain>.+))")
BOUNDED = re.compile(r"(w?string)<(\d+)>")


def definition_text(type_name: str) -> str:
    """The definition of `type_name`, e.g. `nav_msgs/msg/Odometry`, and behind it those of the types it is made of.

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
    """A line per field, and the message types among the fields."""
    lines, parts = [], []
    for field, declared in kind.get_fields_and_field_types().items():
        element, suffix = _split(declared)
        lines.append(f"{WORDS.get(element, BOUNDED.sub(r'\1<=\2', element))}{suffix} {field}\n")
        if "/" in element:
            parts.append(element.replace("/", "/msg/"))
    return "".join(lines), parts


def _split(declared: str) -> tuple[str, str]:
    """A field's element type, and what makes an array of it."""
    found = FIELD.fullmatch(declared)
    assert found is not None  # the last alternative takes anything
    if found["element"]:
        return found["element"], f"[<={found['bound']}]" if found["bound"] else "[]"
    return (found["item"], f"[{found['size']}]") if found["item"] else (found["plain"], "")
