"""Stamps and frames of messages; the library's stamps are integers in nanoseconds."""

from typing import Any

from builtin_interfaces.msg import Time
from std_msgs.msg import Header

from contact_curation.errors import InvalidValueError
from contact_curation.motion.toss import NANOSECONDS
from contact_curation.stages.records import Stamped as Stamped


def check_format(message: Any) -> None:
    """Refuses a message whose format is newer than the installed interface package.

    Raises:
        InvalidValueError: its `format_version` is above `FORMAT_VERSION`.
    """
    newest = type(message).FORMAT_VERSION
    if message.format_version > newest:
        name = type(message).__name__
        raise InvalidValueError(
            f"format of {name}", f"version {message.format_version}", f"at most {newest}: update contact_curation"
        )


def time_message(stamp_ns: int) -> Time:
    """Converts a stamp [ns] to a message."""
    seconds, nanoseconds = divmod(int(stamp_ns), NANOSECONDS)
    return Time(sec=seconds, nanosec=nanoseconds)


def nanoseconds_of(time: Any) -> int:
    """The stamp of a message [ns]."""
    return int(time.sec) * NANOSECONDS + int(time.nanosec)


def header_message(stamped: Stamped) -> Header:
    """Makes a header from stamp and frame."""
    return Header(stamp=time_message(stamped.stamp_ns), frame_id=stamped.frame_id)


def stamped_of(header: Any) -> Stamped:
    """Reads stamp and frame of a message's header."""
    return Stamped(nanoseconds_of(header.stamp), str(header.frame_id))
