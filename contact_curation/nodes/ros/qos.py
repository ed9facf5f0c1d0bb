"""The qualities of service of the graph's topics."""

from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

RESULTS_KEPT = 256
"""Results that a late listener still gets from the topic; services give all of them."""


def kept(depth: int) -> QoSProfile:
    """Reliable, and the last `depth` messages are there for whoever comes late."""
    return profile(depth, reliable=True, latched=True)


def profile(depth: int, *, reliable: bool, latched: bool) -> QoSProfile:
    """A profile of the last `depth` messages."""
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=depth,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
    )
