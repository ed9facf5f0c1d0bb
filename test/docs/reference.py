"""docs/reference.md, made of the nodes and of the interface package.

python -m test.docs.reference          writes it
"""

import inspect
import os
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple
from unittest import mock

import rclpy
from rclpy.node import Node

from contact_curation.nodes.door import StageNode
from test.conftest import REPOSITORY

PAGE = REPOSITORY / "docs" / "reference.md"
MSG_DEFS = REPOSITORY / "msg_defs"
NODES = [
    "pose_ingest",
    "fisher_scorer",
    "curator",
    "trainer",
    "throw_designer",
    "sim_arm",
    "sim_camera",
    "dashboard",
    "session_recorder",
    "player",
]

RCLPYS_OWN = ("start_type_description_service",)

NEEDED = {
    "player": {"bag": str(REPOSITORY / "bags" / "golden.mcap")},
    "dashboard": {"web_port": "0", "recording": "session.rrd"},
    "session_recorder": {"bag": "session.mcap"},
}
"""Parameters without which a node does not start."""

HEAD = """# Parameters and messages

Written by `python -m test.docs.reference` from the nodes and from `msg_defs`; a test holds it to them. What they are for
is told in [nodes.md](nodes.md).

"""


class Parameter(NamedTuple):
    """As it is declared."""

    name: str
    default: Any
    description: str
    constraint: str
    fixed: bool


def page() -> str:
    """The whole of it."""
    there = [name for name in NODES if (REPOSITORY / "contact_curation" / "nodes" / f"{name}.py").is_file()]
    return HEAD + "\n".join([*(_node_section(name) for name in there), *_interfaces()])


def declared(name: str) -> list[Parameter]:
    """The parameters of a node of this name, sorted; it runs for a moment."""
    module = import_module(f"contact_curation.nodes.{name}")
    classes = [found for _, found in inspect.getmembers(module, inspect.isclass) if found.__module__ == module.__name__]
    (made,) = (found for found in classes if issubclass(found, StageNode))
    found: dict[str, Parameter] = {}
    usual = Node.declare_parameter

    def noted(self: Node, name: str, value: Any = None, descriptor: Any = None, *rest: Any, **more: Any) -> Any:
        if descriptor is not None and name not in RCLPYS_OWN:
            found[name] = Parameter(name, value, descriptor.description, _constraint(descriptor), descriptor.read_only)
        return usual(self, name, value, descriptor, *rest, **more)

    with _elsewhere(), mock.patch.object(Node, "declare_parameter", noted):
        rclpy.init(
            args=["--ros-args", *(word for key, value in NEEDED.get(name, {}).items() for word in ("-p", f"{key}:={value}"))]
        )
        try:
            node = made()
            node.close()
            node.destroy_node()
        finally:
            rclpy.try_shutdown()
    return sorted(found.values())


@contextmanager
def _elsewhere() -> Iterator[None]:
    """In an empty folder, for nodes keep their stores where they are started, and among no other nodes."""
    before = Path.cwd()
    with tempfile.TemporaryDirectory() as folder, mock.patch.dict(os.environ, {"ROS_DOMAIN_ID": "78"}):
        os.chdir(folder)
        try:
            yield
        finally:
            os.chdir(before)


def _constraint(descriptor: Any) -> str:
    ranges = [*descriptor.integer_range, *descriptor.floating_point_range]
    limits = [f"{one.from_value:g} to {one.to_value:g}" for one in ranges]
    return ", ".join([*limits, *([descriptor.additional_constraints] if descriptor.additional_constraints else [])])


def _node_section(name: str) -> str:
    lines = [f"## {name}", "", "| parameter | default | |", "|---|---|---|"]
    for one in declared(name):
        told = "; ".join(
            part
            for part in (one.description.rstrip("."), one.constraint, "" if one.fixed else "can be changed at any time")
            if part
        )
        lines.append(f"| `{one.name}` | {_value(one.default)} | {told.replace('|', chr(92) + '|')} |")
    return "\n".join([*lines, ""])


def _value(value: Any) -> str:
    if isinstance(value, bool | int):
        return str(value).lower()
    if isinstance(value, float):
        return f"{value:g}" if f"{value:g}" not in ("inf", "-inf") else f"{value:g}".replace("inf", ".inf")
    if isinstance(value, list | tuple):
        return f"[{', '.join(_value(each) for each in value)}]"
    return f"`{value}`" if value != "" else ""


def _interfaces() -> list[str]:
    lines = ["## contact_curation_msgs", ""]
    for path in sorted(path for kind in ("msg", "srv", "action") for path in MSG_DEFS.glob(f"{kind}/*")):
        lines += [f"### {path.parent.name}/{path.stem}", "", "```", path.read_text().strip(), "```", ""]
    return lines


if __name__ == "__main__":
    PAGE.write_text(page())
    sys.exit(0)
