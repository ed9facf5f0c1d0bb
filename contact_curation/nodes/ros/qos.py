"""The quality of service (QoS) of the graph's topics, and subscriptions that follow that of their publishers.

A reliable subscriber receives nothing from a best-effort publisher, and only a transient local subscriber receives earlier
messages. A subscription's QoS is fixed, so it is replaced when a publisher comes that it cannot hear.
"""

import re
import time
import warnings
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any, NamedTuple

from rcl_interfaces.msg import SetParametersResult
from rclpy._rclpy_pybind11 import RCLError
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.qos_overriding_options import InvalidQosOverridesError, QoSOverridingOptions
from rclpy.subscription import Subscription

from contact_curation.errors import InvalidValueError
from contact_curation.nodes.ros.message_types import message_class
from contact_curation.storage.bags.records import OfferedQos

AS_OFFERED = QoSOverridingOptions([])
"""Overrides of subscriptions that follow their publishers: none, because no parameter may change them."""

OF_RCLPY = re.compile(r"Provided QoS overrides for (\w+) `(\S+)` .*: (.+)")
"""rclpy's words for an override that was refused."""

BOTH = 2.0
"""Time for which a subscription and the one that replaces it are both there [s]: publishers must discover the new one."""

RECENT = 1024
"""Number of messages that are remembered by their time of publication, for a new subscription may receive them again."""

RESULTS_DEPTH = 256
"""Number of results that a late subscriber receives from the topic; services give all of them."""

TRUTH_DEPTH = 2000
"""Depth of `ground_truth`: how many frames a subscriber may lag behind."""


def latched(depth: int) -> QoSProfile:
    """A reliable and transient local profile: late subscribers receive the last `depth` messages."""
    return profile(depth, reliable=True, latched=True)


def profile(depth: int, *, reliable: bool, latched: bool) -> QoSProfile:
    """A profile that keeps the last `depth` messages."""
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=depth,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
    )


def offered(profiles: Iterable[QoSProfile]) -> OfferedQos:
    """The QoS that all publishers of a topic offer: reliable if all are, latched if all are transient local."""
    known = list(profiles)
    return OfferedQos(
        latched=all(one.durability == DurabilityPolicy.TRANSIENT_LOCAL for one in known),
        reliable=all(one.reliability == ReliabilityPolicy.RELIABLE for one in known),
    )


def overridable() -> QoSOverridingOptions:
    """Lets ROS parameters such as `qos_overrides.TOPIC.publisher.depth` override history, depth and reliability."""
    return QoSOverridingOptions.with_default_policies(callback=_judged)


class Offer(NamedTuple):
    """Type and quality of service of a topic's publishers.

    Attributes:
        type: ROS type name.
        qos: quality of service that all of them offer.
    """

    type: str
    qos: OfferedQos


Callback = Callable[[Any, Mapping[str, int]], None]
"""Called with a message and what the middleware says about it."""


class FollowedTopic:
    """A subscription with the QoS of its publishers. No message is lost, and none comes twice, while it is replaced.

    It stays when publishers go: a best-effort subscription hears reliable publishers, too.

    Args:
        node: node that subscribes.
        name: of the topic.
        depth: depth of the queue.
        listener: gives, for an offer, what is called with each message.
        how: further arguments of `create_subscription`.

    Attributes:
        offer: that is subscribed to; None while nothing is.
    """

    def __init__(self, node: Node, name: str, depth: int, listener: Callable[[Offer], Callback], **how: Any) -> None:
        self._node, self._name, self._depth, self._listener, self._how = node, name, depth, listener, how
        self._publishers: frozenset[bytes] = frozenset()
        self._new: Subscription | None = None
        self._old: Subscription | None = None
        self._replaced = 0.0
        self._once: set[int] = set()
        self._recent: deque[int] = deque(maxlen=RECENT)
        self.offer: Offer | None = None

    def follow(self, kind: str) -> None:
        """Looks at the publishers of a type and subscribes to them; cheap, to be called often."""
        if self._old is not None:
            if time.monotonic() - self._replaced < BOTH:
                return
            self._end_old()
        infos = [info for info in self._node.get_publishers_info_by_topic(self._name) if info.topic_type == kind]
        publishers = frozenset(bytes(info.endpoint_gid) for info in infos)
        if not publishers:
            return
        qos = offered(info.qos_profile for info in infos)
        if self.offer is not None and self.offer.type == kind and publishers & self._publishers:
            heard = self.offer.qos
            qos = OfferedQos(latched=qos.latched and heard.latched, reliable=qos.reliable and heard.reliable)
        self._publishers = publishers
        if self.offer != (kind, qos):
            self._subscribe(Offer(kind, qos))

    def leave(self) -> None:
        """Ends the subscription once all messages that have come are taken."""
        self._end_old()
        self._old, self._new, self.offer = self._new, None, None
        self._end_old()

    def _subscribe(self, offer: Offer) -> None:
        arrived, message_type = self._listener(offer), message_class(offer.type)
        if self.offer is not None and self.offer.type != offer.type:
            self.leave()  # a topic has one type in a process

        def on_message(message: Any, info: Mapping[str, int]) -> None:
            if self._old is not None and on_message is not self._old.callback:
                self._drain(self._old)  # what it has heard came before
            published_ns = info["source_timestamp"]
            if published_ns in self._once:
                self._once.remove(published_ns)
                return
            if published_ns and self._old is not None:
                self._once.add(published_ns)
            self._recent.append(published_ns)
            arrived(message, info)

        qos = profile(self._depth, reliable=offer.qos.reliable, latched=offer.qos.latched)
        self._old, self._replaced, self._once = self._new, time.monotonic(), {*self._recent} - {0}
        self._new = self._node.create_subscription(
            message_type, self._name, on_message, qos, qos_overriding_options=AS_OFFERED, **self._how
        )
        self.offer = offer

    def _drain(self, subscription: Subscription) -> None:
        for _ in range(self._depth):
            with subscription.handle:
                waiting = subscription.handle.take_message(subscription.msg_type, subscription.raw)
            if waiting is None:
                return
            subscription.callback(*waiting)

    def _end_old(self) -> None:
        if self._old is not None:
            self._drain(self._old)
            self._node.destroy_subscription(self._old)
            self._old = None


@contextmanager
def overrides_checked() -> Iterator[None]:
    """Refuses invalid QoS overrides in one line.

    Raises:
        InvalidValueError: an override has an invalid value.
    """
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "A zero depth", UserWarning)  # from rclpy, before the depth is judged
            yield
    except RCLError:
        raise
    except (InvalidQosOverridesError, RuntimeError) as error:
        accepted = "history keep_last or keep_all, depth 1 or more, reliability reliable or best_effort"
        raise InvalidValueError("qos_overrides", OF_RCLPY.sub(r"\3 of \1 \2", str(error)), accepted) from error


def _judged(qos: QoSProfile) -> SetParametersResult:
    sound = qos.depth >= 1 or qos.history == HistoryPolicy.KEEP_ALL
    return SetParametersResult(successful=sound, reason=f"depth {qos.depth}")
