"""The quality of service (QoS) of the graph's topics."""

import re
import warnings
from collections.abc import Iterable, Iterator
from contextlib import contextmanager

from rcl_interfaces.msg import SetParametersResult
from rclpy._rclpy_pybind11 import RCLError
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.qos_overriding_options import InvalidQosOverridesError, QoSOverridingOptions

from contact_curation.errors import InvalidValueError
from contact_curation.storage.bags.records import OfferedQos

AS_OFFERED = QoSOverridingOptions([])
"""Overrides of subscriptions that follow their publishers: none, because no parameter may change them."""

OF_RCLPY = re.compile(r"Provided QoS overrides for (\w+) `(\S+)` .*: (.+)")
"""rclpy's words for an override that was refused."""

RESULTS_DEPTH = 256
"""Number of results that a late subscriber receives from the topic; services give all of them."""


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
