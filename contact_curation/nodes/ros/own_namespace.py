"""Which topics are a node's own: those of its namespace, so that two graphs in two namespaces of one domain do not mix.

In the root namespace all topics are. What is shared by all namespaces is `/diagnostics`, where each status has the full name of
its node, and `/clock`, which rclpy listens to by that name: `-r /clock:=clock` gives a namespace a clock of its own.
"""

from collections.abc import Container

from rclpy.node import Node


def is_own(node: Node, name: str, named: Container[str] = ()) -> bool:
    """Whether a topic or node is in a node's namespace, or was named by its user.

    Args:
        node: node that asks.
        name: absolute.
        named: absolute names that hold wherever they are.
    """
    namespace = node.get_namespace().rstrip("/")
    return name in named or name.startswith(f"{namespace}/")


def own_name(node: Node, name: str) -> str:
    """A recorded absolute name, placed in a node's namespace."""
    return f"{node.get_namespace().rstrip('/')}{name}"
