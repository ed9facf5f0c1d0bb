"""Toss messages as bytes (CDR), written from arrays and read as arrays.

rclpy makes an object of every stamp, pose and vector, about 600 of a toss. Making them, turning them into bytes, and making
them again where they are heard takes about as long as scoring the toss does.

    00 01 00 00 | the fields in their order, little-endian, each aligned to its size as counted from behind these four bytes
"""

import struct
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from contact_curation_msgs.msg import Toss as TossMessage
from numpy.typing import NDArray
from std_msgs.msg import Header

from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array
from contact_curation.motion.toss import NANOSECONDS, Toss
from contact_curation.nodes.messages.headers import Stamped, header_message

EXPECTED_TOSS = "_expected_toss"
"""Topic with a toss before it is announced, so that it is scored by then: when it nears its end, when the next pose will
complete it, and when it is complete, to be scored while it is judged and stored. Its number is 0, and no gate has seen it. The
first two times its last velocities are not known yet. A hidden topic, and nobody has to hear it."""

LITTLE_ENDIAN = b"\x00\x01\x00\x00"


@dataclass(frozen=True, eq=False)
class TossArrays:
    """The fields of a Toss message, with arrays in place of sequences of objects.

    Attributes:
        stamps: (T, 2) seconds and nanoseconds.
        poses: (T, 7) positions and orientations in xyzw.
        linear_velocities: (T, 3).
        body_angular_velocities: (T, 3).
    """

    FORMAT_VERSION: ClassVar[int] = TossMessage.FORMAT_VERSION
    format_version: int
    header: Header
    toss_id: str
    body: str
    source: str
    sequence: int
    frame_period: float
    stamps: NDArray[np.int32]
    poses: Array
    linear_velocities: Array
    body_angular_velocities: Array


def toss_bytes(toss: Toss, sequence: int, board_frame: str) -> bytes:
    """The bytes of `toss_message`, which rclpy publishes as they are."""
    writer = _Writer()
    stamps = np.stack(np.divmod(toss.stamps_ns, NANOSECONDS), axis=1)
    writer.numbers("I", TossMessage.FORMAT_VERSION)
    writer.numbers("i", *stamps[0])
    for text in (board_frame, toss.toss_id, toss.body, toss.source):
        writer.text(text)
    writer.numbers("Q", sequence)
    writer.numbers("d", toss.frame_period)
    writer.rows("i", stamps)
    writer.rows("d", np.concatenate([toss.positions, np.roll(toss.orientations_wxyz, -1, axis=1)], axis=1))
    writer.rows("d", toss.linear_velocities)
    writer.rows("d", toss.angular_velocities)
    return LITTLE_ENDIAN + bytes(writer.written)


def toss_in(data: bytes) -> TossArrays:
    """Reads the bytes of a Toss message, which `toss.toss_of` checks.

    Raises:
        InvalidValueError: they are none, or in another byte order.
    """
    if data[:2] != LITTLE_ENDIAN[:2]:  # the two bytes behind are options, in which some middlewares count their padding
        raise InvalidValueError("bytes of a toss", data[: len(LITTLE_ENDIAN)].hex(" "), LITTLE_ENDIAN.hex(" "))
    reader = _Reader(data[len(LITTLE_ENDIAN) :])
    try:
        (version,), (seconds, nanoseconds) = reader.numbers("I"), reader.numbers("i", 2)
        frame, toss_id, body, source = (reader.text() for _ in range(4))
        (sequence,), (period,) = reader.numbers("Q"), reader.numbers("d")
        header = header_message(Stamped(seconds * NANOSECONDS + nanoseconds, frame))
        arrays = reader.rows("i", 2), reader.rows("d", 7), reader.rows("d", 3), reader.rows("d", 3)
    except (struct.error, ValueError) as error:
        raise InvalidValueError("bytes of a toss", error, "a contact_curation_msgs/Toss") from error
    return TossArrays(version, header, toss_id, body, source, sequence, period, *arrays)


class _Writer:
    def __init__(self) -> None:
        self.written = bytearray()

    def numbers(self, kind: str, *numbers: float) -> None:
        self._align(kind)
        self.written += struct.pack(f"<{len(numbers)}{kind}", *numbers)

    def text(self, text: str) -> None:
        encoded = text.encode() + b"\0"
        self.numbers("I", len(encoded))
        self.written += encoded

    def rows(self, kind: str, rows: NDArray[Any]) -> None:
        self.numbers("I", len(rows))
        self._align(kind)
        self.written += np.asarray(rows, f"<{kind}").tobytes()

    def _align(self, kind: str) -> None:
        self.written += bytes(-len(self.written) % struct.calcsize(f"<{kind}"))


class _Reader:
    def __init__(self, data: bytes) -> None:
        self._data = data
        self._at = 0

    def numbers(self, kind: str, count: int = 1) -> tuple[Any, ...]:
        self._align(kind)
        numbers = struct.unpack_from(f"<{count}{kind}", self._data, self._at)
        self._at += struct.calcsize(f"<{count}{kind}")
        return numbers

    def text(self) -> str:
        (length,) = self.numbers("I")
        text = self._data[self._at : self._at + length - 1].decode()
        self._at += length
        return text

    def rows(self, kind: str, width: int) -> NDArray[Any]:
        (count,) = self.numbers("I")
        if not count:
            return np.empty((0, width), f"<{kind}")
        self._align(kind)
        rows = np.frombuffer(self._data, f"<{kind}", count * width, self._at).reshape(count, width)
        self._at += rows.nbytes
        return rows

    def _align(self, kind: str) -> None:
        self._at += -self._at % struct.calcsize(f"<{kind}")
