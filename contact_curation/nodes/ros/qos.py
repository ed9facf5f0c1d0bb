"""The qualities of service of the graph's topics."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager

from rcl_interfaces.msg import SetParametersResult
from rclpy._rclpy_pybind11 import RCLError
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.qos_overriding_options import InvalidQosOverridesError, QoSOverridingOptions

from contact_curation.errors import InvalidValueError
from contact_curation.storage.bags.records import OfferedQos

AS_OFFERED = QoSOverridingOptions([])
"""Of subscriptions that follow what publishers offer: no parameter overrides them."""

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


def overridable() -> QoSOverridingOptions:
    """History, depth and reliability by the parameters that ROS has for them: `qos_overrides.TOPIC.publisher.depth`."""
    return QoSOverridingOptions.with_default_policies(callback=_judged)


@contextmanager
def overrides_checked() -> Iterator[None]:
    """Makes overrides that are none one line.

    Raises:
        InvalidValueError: there is one.
    """
    try:
        yield
    except RCLError:
        raise
    except (InvalidQosOverridesError, RuntimeError) as error:
        accepted = "history keep_last or keep_all, depth 1 or more, reliability reliable or best_effort"
        raise InvalidValueError("qos_overrides", str(error), accepted) from error


def _judged(qos: QoSProfile) -> SetParametersResult:
    sound = qos.depth >= 1 or qos.history == HistoryPolicy.KEEP_ALL
    return SetParametersResult(successful=sound, reason=f"depth {qos.depth}")
