"""Executable `container`: several nodes in one process, with the names, parameters and stores that they have alone.

    container pose_ingest fisher_scorer curator --ros-args --params-file nodes.yaml -p curator:top:=32

Between them `toss` and `toss_information` are handed over without the middleware (`ros/hand_over.py`). They share one executor,
which no callback blocks, because each node works on a thread of its own. They also share their end: a signal ends all of them,
and so does the failure of one; started again, each continues where it was.

The executor is rclpy's single-threaded one. With its events executor (rclpy 7.1.6, Fast DDS) the process stands still when a
thread publishes to a subscription of the same process; it also installs signal handlers of its own, and dies by a segmentation
fault if a task raises (github.com/ros2/rclpy, issue 1641), or if entities end while events arrive (issue 1644).
"""

import sys
from collections.abc import Callable, Sequence
from functools import partial
from importlib import import_module

import rclpy.utilities

from contact_curation.errors import InvalidValueError, UnknownNameError
from contact_curation.nodes.ros.hand_over import hand_over
from contact_curation.nodes.ros.node_main import StageNode, refuse, run_together

SHARING = ("pose_ingest", "fisher_scorer", "curator", "trainer", "throw_designer", "session_recorder")
"""The nodes that may share a process. The others render, serve pages, keep simulated time, or play recordings."""

DEFAULT = ("pose_ingest", "fisher_scorer", "curator")
SHARED = ("store", "checkpoint", "bag")
"""Parameters that name a file of one node."""


def chosen(words: Sequence[str]) -> dict[str, Callable[[], StageNode]]:
    """The nodes that a command line asks for, each with what makes it.

    Args:
        words: arguments of the command line, the program's name first.

    Raises:
        InvalidValueError: a node is named twice, or a word would give all nodes one name or one file.
    """
    names = rclpy.utilities.remove_ros_args(words)[1:] or DEFAULT
    for name in names:
        if name not in SHARING:
            raise UnknownNameError("node", name, SHARING)
    if len(set(names)) < len(names):
        raise InvalidValueError("nodes", " ".join(names), "each node once")
    for word in words:
        if word.startswith("__node:="):
            raise InvalidValueError("-r", word, f"a name for one node, such as {names[0]}:{word}")
        if word.partition(":=")[0] in SHARED and len(names) > 1:
            raise InvalidValueError("-p", word, f"a file for one node, such as -p {names[0]}:{word}")
    return {name: partial(node_of, name) for name in names}


def node_of(name: str) -> StageNode:
    """A new node by the name of its module, after which its class is named."""
    node: StageNode = getattr(import_module(f"contact_curation.nodes.{name}"), name.title().replace("_", ""))()
    return node


def _connect(nodes: Sequence[StageNode]) -> None:
    direct = hand_over(nodes)
    if direct:
        nodes[0].get_logger().info(f"handed over in this process: {', '.join(sorted(direct))}")


def main() -> int:
    """Runs the nodes."""
    try:
        makers = chosen(sys.argv)
    except InvalidValueError as error:
        return refuse("container", error)
    return run_together(makers, "container", _connect)


if __name__ == "__main__":
    sys.exit(main())
