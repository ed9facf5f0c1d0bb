"""The words of `ros2` that the documentation uses, where that command is not installed.

    python -m test.graph.parts.ros2_command run PACKAGE NODE [WORD ...]
    python -m test.graph.parts.ros2_command service call NAME TYPE [YAML]
    python -m test.graph.parts.ros2_command action send_goal [--feedback] NAME TYPE YAML

A node that is run gets the words of the variable ROS2_RUN_MORE, too. Answers are written as Python shows them.
"""

import os
import shlex
import sys
from collections.abc import Callable
from importlib import import_module
from typing import Any

import rclpy
import yaml
from rclpy.action import ActionClient
from rclpy.node import Node

LONGEST = 90.0
"""Time for a service or an action to be there [s]."""


def interface(name: str) -> Any:
    """The class of an interface such as std_srvs/srv/Trigger."""
    package, kind, word = name.split("/")
    return getattr(import_module(f"{package}.{kind}"), word)


def filled(message: Any, values: dict[str, Any]) -> Any:
    """The message with its fields set."""
    for name, value in values.items():
        old = getattr(message, name)  # raises where there is no such field
        setattr(message, name, filled(old, value) if isinstance(value, dict) else type(old)(value))
    return message


def run(package: str, executable: str, *words: str) -> None:
    """Becomes the node."""
    assert package == "contact_curation"
    more = shlex.split(os.environ.get("ROS2_RUN_MORE", ""))
    os.execv(sys.executable, [sys.executable, "-m", f"contact_curation.nodes.{executable}", *words, *more])


def call(node: Node, name: str, kind: str, values: str = "{}") -> Any:
    """Calls a service; its answer."""
    client = node.create_client(interface(kind), name)
    assert client.wait_for_service(LONGEST), f"no service {name}"
    return _of(node, client.call_async(filled(interface(kind).Request(), yaml.safe_load(values))))


def send_goal(node: Node, *words: str) -> Any:
    """Sends a goal; its result."""
    name, kind, values = (word for word in words if word != "--feedback")
    client = ActionClient(node, interface(kind), name)
    assert client.wait_for_server(LONGEST), f"no action {name}"
    goal = _of(node, client.send_goal_async(filled(interface(kind).Goal(), yaml.safe_load(values))))
    return _of(node, goal.get_result_async()).result


def _of(node: Node, future: Any) -> Any:
    rclpy.spin_until_future_complete(node, future)
    return future.result()


def main() -> None:
    """Does what the words say."""
    if sys.argv[1] == "run":
        run(*sys.argv[2:])
    words = sys.argv[1:]
    verbs: dict[str, Callable[..., Any]] = {"service call": call, "action send_goal": send_goal}
    rclpy.init(args=[])
    answer = verbs[" ".join(words[:2])](Node("ros2_command"), *words[2:])
    sys.stdout.write(f"{answer}\n")
    rclpy.try_shutdown()


if __name__ == "__main__":
    main()
