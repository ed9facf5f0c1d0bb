"""The qualities of service of the graph's topics."""

from collections.abc import Iterable

from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

from contact_curation.storage.bags.records import OfferedQos

RESULTS_DEPTH = 256
"""Results that a late listener still gets from the topic; services give all of them."""


def latched(depth: int) -> QoSProfile:
    """Reliable and transient local: late subscribers receive the last `depth` messages."""
    return profile(depth, reliable=True, latched=True)


def profile(depth: int, *, reliable: bool, latched: bool) -> QoSProfile:
    """A profile of the last `depth` messages."""
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=depth,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
    )


def offered(profiles: Iterable[QoSProfile]) -> OfferedQos:
    """What all publishers of a topic offer: reliable if all are, latched if all keep messages for late subscribers."""
    known = list(profiles)
    return OfferedQos(
        latched=all(one.durability == DurabilityPolicy.TRANSIENT_LOCAL for one in known),
        reliable=all(one.reliability == ReliabilityPolicy.RELIABLE for one in known),
    )
