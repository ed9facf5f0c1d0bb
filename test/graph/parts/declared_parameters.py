"""The parameters that the nodes declare, and config/nodes.yaml as it follows from them.

python -m test.graph.parts.declared_parameters contact_curation/config/nodes.yaml
"""

import os
import sys
from collections.abc import Iterator
from contextlib import chdir, contextmanager
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from textwrap import wrap
from typing import Any, NamedTuple
from unittest import mock

import rclpy
import yaml
from rcl_interfaces.msg import ParameterDescriptor
from rclpy.node import Node

from contact_curation.configs import HIGHEST
from contact_curation.errors import ContactCurationError
from contact_curation.nodes.container import node_of
from contact_curation.session.free_domain import free_domain

NODES = (
    *("pose_ingest", "fisher_scorer", "curator", "trainer", "throw_designer", "sim_arm", "trajectory_thrower", "sim_camera"),
    *("dashboard", "session_recorder", "player"),
)
SET = {"throw_designer": ["thrower:=arm"], "dashboard": ["web_port:=0", "grpc_port:=0"]}
"""So that everything is declared, and nothing served."""

OF_RCLPY = ("use_sim_time", "start_type_description_service", "qos_overrides.")
WIDTH = 128
HEAD = """\
# Every parameter of every node, with its default; `ros2 param describe` says more of types and bounds.
# Copy what you change: what a file does not set keeps its default.
#     contact-curation online --params-file my_nodes.yaml
#     ros2 launch contact_curation online.launch.py params_file:=my_nodes.yaml
#     ros2 run contact_curation pose_ingest --ros-args --params-file my_nodes.yaml
# Made by `python -m test.graph.parts.declared_parameters FILE`; a test compares.
"""


class Declared(NamedTuple):
    """A parameter as its node declares it.

    Attributes:
        name: of the parameter.
        default: its value if none is given.
        description: for people.
        constraint: what values it may have; empty if any.
        fixed: whether it keeps the value that the node was started with.
    """

    name: str
    default: Any
    description: str
    constraint: str
    fixed: bool


@cache
def all_declared() -> dict[str, list[Declared]]:
    """What each node declares; nodes are made once in a process."""
    with in_empty_folder(), free_domain() as domain, mock.patch.dict(os.environ, ROS_AUTOMATIC_DISCOVERY_RANGE="LOCALHOST"):
        return {node: declared(node, domain) for node in NODES}


def declared(node: str, domain: int) -> list[Declared]:
    """What a node declares when it is made, in its order; the node keeps its files in the current folder, and is taken down."""
    found: list[Declared] = []
    arguments = [word for setting in SET.get(node, []) for word in ("-p", setting)]
    rclpy.init(args=["--ros-args", *arguments], domain_id=domain)
    try:
        with _noted(found):
            made = node_of(node)
        made.close()
        made.destroy_node()
    except ContactCurationError:  # a node that asks for a file does so once all is declared
        pass
    finally:
        rclpy.try_shutdown()
    return found


@contextmanager
def _noted(found: list[Declared]) -> Iterator[None]:
    original = Node.declare_parameter

    def declare(self: Node, name: str, value: Any = None, descriptor: Any = None, *more: Any, **others: Any) -> Any:
        described = descriptor or ParameterDescriptor()
        if not name.startswith(OF_RCLPY):
            found.append(Declared(name, value, described.description, _constraint(described), described.read_only))
        return original(self, name, value, *([descriptor] if descriptor else []), *more, **others)

    with mock.patch.object(Node, "declare_parameter", declare):
        yield


def _constraint(descriptor: ParameterDescriptor) -> str:
    ranges = [*descriptor.integer_range, *descriptor.floating_point_range]
    limits = [_limits(one.from_value, one.to_value) for one in ranges]
    return ", ".join([*limits, *([descriptor.additional_constraints] if descriptor.additional_constraints else [])])


def _limits(low: float, high: float) -> str:
    return f"at least {low:.15g}" if high == HIGHEST[0] else f"{low:.15g} to {high:.15g}"


@contextmanager
def in_empty_folder() -> Iterator[None]:
    """For nodes keep their stores where they are started."""
    with TemporaryDirectory() as folder, chdir(folder):
        yield


def nodes_yaml() -> str:
    """The file."""
    return HEAD + "".join(f"/**/{node}:\n  ros__parameters:\n{_lines(found)}" for node, found in all_declared().items())


def _lines(parameters: list[Declared]) -> str:
    lines: list[str] = []
    for one in parameters:
        setting = f"    {one.name}: {_text(one.default)}"
        commented = f"{setting:<44}  # {one.description}"
        if one.description and len(commented) > WIDTH:
            lines += wrap(one.description, WIDTH, initial_indent="    # ", subsequent_indent="    # ")
            commented = setting
        lines.append(commented if one.description else setting)
    return "".join(f"{line}\n" for line in lines)


def _text(value: Any) -> str:
    """A value on one line."""
    return str(yaml.safe_dump(value, default_flow_style=True, width=float("inf"))).removesuffix("...\n").strip()


def main() -> None:
    """Writes the file; the middleware has the standard output for itself."""
    Path(sys.argv[1]).write_text(nodes_yaml())


if __name__ == "__main__":
    main()
