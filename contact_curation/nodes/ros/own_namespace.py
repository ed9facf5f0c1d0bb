"""Decides which topics belong to a node: those of its namespace, so that two graphs in two namespaces of a domain do not mix.

For a node in the root namespace these are all topics. All namespaces share `/diagnostics`, where each status has the full name
of its node, and `/clock`, to which rclpy subscribes by this name: `-r /clock:=clock` gives a namespace its own clock.
"""

from collections.abc import Container

from rclpy.node import Node


def is_own(node: Node, name: str, named: Container[str] = ()) -> bool:
    """Whether a topic or node is in a node's namespace, or was named by the user.

    Args:
        node: node whose namespace counts.
        name: absolute name of the topic or node.
        named: absolute names that are accepted in any namespace.
    """
    namespace = node.get_namespace().rstrip("/")
    return name in named or name.startswith(f"{namespace}/")


def own_name(node: Node, name: str) -> str:
    """Moves a recorded absolute name into a node's namespace."""
    return f"{node.get_namespace().rstrip('/')}{name}"


def action_name(node: Node, name: str) -> str:
    """The full name of an action, with the node's remaps: rclpy remaps topics and services, but no actions (Jazzy)."""
    return str(node.resolve_service_name(name))
