"""Hands numbered messages over inside a process: from the thread that publishes to the listeners, without the middleware.

rclpy has no intra-process transport: even within a process a message is serialized, sent, received and read again, and waits
for the executor. `catch_up.CatchUp` takes every message once by its number, from whichever thread it comes. So a publisher
whose listener lives in the same process calls it first and publishes afterwards, for everybody else; the copy that comes back
through the middleware is known by its number and dropped.
"""

from collections.abc import Callable, Sequence
from typing import Any

from rclpy.node import Node

from contact_curation.nodes.ros.catch_up import CatchUp


def hand_over(nodes: Sequence[Node]) -> dict[str, int]:
    """Connects publishers with the `CatchUp` listeners of their topics.

    Args:
        nodes: nodes of this process.

    Returns:
        Number of listeners by topic that are called directly.
    """
    listeners: dict[str, list[Callable[[Any], None]]] = {}
    for node in nodes:
        for subscription in node.subscriptions:
            callback = subscription.callback
            if isinstance(getattr(callback, "__self__", None), CatchUp):
                listeners.setdefault(subscription.topic_name, []).append(callback)
    connected: dict[str, int] = {}
    for node in nodes:
        for publisher in node.publishers:
            if takers := listeners.get(publisher.topic_name):
                publisher.publish = _Direct(publisher.publish, takers)
                connected[publisher.topic_name] = len(takers)
    return connected


class _Direct:
    """Publishes a message after it was given to the listeners of this process.

    Args:
        publish: publishes to everybody.
        listeners: called first, on the thread that publishes.
    """

    def __init__(self, publish: Callable[[Any], None], listeners: Sequence[Callable[[Any], None]]) -> None:
        self._publish = publish
        self._listeners = tuple(listeners)

    def __call__(self, message: Any) -> None:
        for listener in self._listeners:
            listener(message)
        self._publish(message)
