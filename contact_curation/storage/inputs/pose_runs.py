"""Reads the poses of a bag's messages; messages of the same layout are decoded together, directly from their CDR bytes.

Most messages of a topic differ only in stamps and numbers. Of the messages with the same length the first one is read field by
field, which gives the layout: the positions of stamps and numbers, and the bytes that must be equal in all others
(encapsulation, names of frames, lengths; not padding). Messages with other bytes there, messages that are cut off and messages
that contain no valid pose are decoded one by one (`bags.decoding`, `pose_source`). The result is the same in both ways.
"""

import struct
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import batched, pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from contact_curation.geometry.poses import QUATERNION_TOLERANCE
from contact_curation.motion.pose_stream import FARTHEST, FrameRun, PoseRun
from contact_curation.motion.toss import NANOSECONDS
from contact_curation.storage.bags.decoding import Reading
from contact_curation.storage.bags.reader import BagReader
from contact_curation.storage.bags.records import BagMessage, Channel, StoredMessage
from contact_curation.storage.inputs.pose_messages import ODOMETRY, POSE, POSE_WITH_COVARIANCE, TF, Measured
from contact_curation.storage.inputs.pose_source import PoseSource

TOGETHER = 1024
"""Largest number of messages that are decoded together; their poses are in memory at the same time."""

FEWEST = 8
"""Smallest number of messages of one length for which determining a layout saves time."""

LAYOUTS = 4
"""Largest number of layouts that are tried for one length; a TF topic with several publishers has several."""

LITTLE_ENDIAN = b"\x00\x01"
"""First bytes of plain CDR in little-endian byte order."""

ENCAPSULATION, POSE_BYTES, LONGEST_END = 4, 56, 3
"""Number of bytes before the message, of a position and orientation, and, at most, after the last field."""

WXYZ = [6, 3, 4, 5]
"""Where the orientation stands among the numbers of a pose."""

UINT32 = struct.Struct("<I")


class MeasuredMessage(NamedTuple):
    """The poses in one message.

    Attributes:
        topic: topic of the message.
        log_time_ns: log time of the message [ns].
        measured: each pose, or the reason why it cannot be used.
    """

    topic: str
    log_time_ns: int
    measured: tuple[Measured, ...]

    def messages(self) -> "list[MeasuredMessage]":
        """The message, as a run of one."""
        return [self]


class MeasuredRun(NamedTuple):
    """Successive messages of a topic with one pose each, of the same frames.

    Attributes:
        topic: topic of the messages.
        log_times_ns: (N,) log times of the messages [ns].
        measured: N poses that do not hold for all times.
    """

    topic: str
    log_times_ns: NDArray[np.int64]
    measured: FrameRun

    def part(self, start: int, stop: int) -> "MeasuredRun":
        """The messages from index `start` to before `stop`."""
        return MeasuredRun(self.topic, self.log_times_ns[start:stop], self.measured.part(start, stop))

    def messages(self) -> list[MeasuredMessage]:
        """The same messages one by one."""
        poses = self.measured.frame_poses()
        return [MeasuredMessage(self.topic, *one) for one in zip(self.log_times_ns.tolist(), zip(poses), strict=True)]


def measured_runs(
    reader: BagReader, source: PoseSource, read_one: Callable[[BagMessage], tuple[Measured, ...]]
) -> Iterator[MeasuredMessage | MeasuredRun]:
    """Yields the poses of each message on the topics of `source`, in order of log time, in runs where it can.

    Args:
        reader: the bag.
        source: topics with poses, and the frames that are of interest.
        read_one: returns the poses in one decoded message; called for messages that cannot be decoded together with others.

    Raises:
        MissingTopicError: the bag does not contain one of the topics.
    """
    reading, runs = reader.runs(source.topics)
    for run in runs:
        for part in batched(run, TOGETHER):
            found = _together(part, reading, source)
            for start, stop in pairwise((0, *(np.flatnonzero(np.diff(found.which)) + 1).tolist(), len(part))):
                which, first = int(found.which[start]), int(found.rows[start])
                if which == ALONE:
                    for message in reading.decoded(part[start:stop]):
                        yield MeasuredMessage(message.topic, message.log_time_ns, read_one(message))
                else:
                    yield from found.decoded[which].messages(part[start:stop], range(first, first + stop - start))


@dataclass(frozen=True, eq=False)
class _Decoded:
    """The poses in messages of one layout.

    Attributes:
        columns: the first, second, ... pose of each message.
        static: whether they hold for all times.
    """

    columns: list[FrameRun]
    static: bool

    def messages(self, stored: Sequence[StoredMessage], rows: range) -> Iterator[MeasuredMessage | MeasuredRun]:
        """Successive messages, of which these are the rows of the columns."""
        topic, log_times_ns = stored[0].channel.topic, [one.log_time_ns for one in stored]
        columns = [column.part(rows.start, rows.stop) for column in self.columns]
        if len(columns) == 1 and not self.static and len(stored) >= FEWEST:
            yield MeasuredRun(topic, np.array(log_times_ns, dtype=np.int64), columns[0])
            return
        poses = [column.frame_poses(static=self.static) for column in columns]
        measured = zip(*poses, strict=True) if poses else [()] * len(stored)
        yield from (MeasuredMessage(topic, *one) for one in zip(log_times_ns, measured, strict=True))


ALONE = -1
"""In place of a number in `_Found.which`: the message is decoded one by one."""


@dataclass(frozen=True, eq=False)
class _Found:
    """Where the poses of N messages are.

    Attributes:
        decoded: messages that have the same layout.
        which: (N,) the index of those among which a message is; `ALONE` for none.
        rows: (N,) in which row of them; successive messages of the same ones are in successive rows.
    """

    decoded: list[_Decoded]
    which: NDArray[np.int64]
    rows: NDArray[np.int64]


def _together(part: Sequence[StoredMessage], reading: Reading, source: PoseSource) -> _Found:
    """Decodes the messages that have the same layout as others."""
    alike: dict[tuple[Channel, int], list[int]] = defaultdict(list)
    for place, stored in enumerate(part):
        alike[stored.channel, len(stored.data)].append(place)
    found = _Found([], np.full(len(part), ALONE), np.zeros(len(part), dtype=np.int64))
    for (channel, length), places in alike.items():
        walk = WALKS.get(reading.type_hash(channel)) if len(places) >= FEWEST else None
        if walk is None or source.type_of(channel.topic) != channel.type or length > reading.longest:
            continue
        if not reading.has_decoded(channel):  # decoding the first message one by one checks the type's definition
            places = places[1:]
        block = np.frombuffer(b"".join([part[place].data for place in places]), np.uint8).reshape(len(places), length)
        left = np.arange(len(places))
        for _ in range(LAYOUTS):
            layout = layout_of(block[left[0]].tobytes(), walk)
            fits = layout.fits(block[left]) if layout else np.zeros(len(left), dtype=bool)
            fits[0] = True  # without a layout this message is decoded one by one
            if layout:
                fitting = left[fits]
                decoded, sound = layout.poses_in(block[fitting], channel.topic, source)
                at = np.array(places)[fitting[sound]]
                found.which[at], found.rows[at] = len(found.decoded), np.flatnonzero(sound)
                found.decoded.append(decoded)
            left = left[~fits]
            if len(left) < FEWEST:
                break
    return found


@dataclass(frozen=True)
class PosePlace:
    """The position of a pose in a message.

    Attributes:
        stamp_at: offset of the stamp's first byte.
        numbers_at: offset of the first byte of position (3) and orientation xyzw (4).
        parent, child: names of the pose's frames; child is empty for messages without one.
    """

    stamp_at: int
    numbers_at: int
    parent: str
    child: str


@dataclass(frozen=True)
class Layout:
    """The common structure of messages of one length.

    Attributes:
        constants: offset and content of the bytes that are equal in all of them.
        places: position of each pose.
    """

    constants: tuple[tuple[int, bytes], ...]
    places: tuple[PosePlace, ...]

    def fits(self, block: NDArray[np.uint8]) -> NDArray[np.bool_]:
        """Says which of the messages, given as bytes (N, length), have this layout: booleans (N,)."""
        same = np.ones(len(block), dtype=bool)
        for start, constant in self.constants:
            same &= (block[:, start : start + len(constant)] == np.frombuffer(constant, np.uint8)).all(axis=1)
        return same

    def poses_in(self, block: NDArray[np.uint8], topic: str, source: PoseSource) -> tuple[_Decoded, NDArray[np.bool_]]:
        """The poses in messages (N, length) of this layout, and which messages (N,) contain no invalid pose."""
        columns: list[FrameRun] = []
        good = np.ones(len(block), dtype=bool)
        for place in self.places:
            stamps, numbers, sound = _read(block, place)
            good &= sound
            frames = source.frames(topic, place.parent, place.child)
            if frames is not None:
                columns.append(FrameRun(*frames, PoseRun(stamps, numbers[:, :3], numbers[:, WXYZ])))
        return _Decoded(columns, source.is_static(topic)), good


def _read(block: NDArray[np.uint8], place: PosePlace) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.bool_]]:
    """Stamps (N,) [ns], positions [m] and orientations xyzw (N, 7), and if `pose_stream.checked_pose` accepts them (N,)."""
    clock = np.ascontiguousarray(block[:, place.stamp_at : place.stamp_at + 8])
    seconds, nanoseconds = clock.view("<i4")[:, 0], clock.view("<u4")[:, 1]
    numbers = np.ascontiguousarray(block[:, place.numbers_at : place.numbers_at + POSE_BYTES]).view("<f8")
    x, y, z, w = numbers[:, 3:].T
    with np.errstate(over="ignore", invalid="ignore"):
        norms = np.sqrt(w * w + x * x + y * y + z * z)
        sound = np.isfinite(norms) & (np.abs(norms - 1.0) <= QUATERNION_TOLERANCE)
        sound &= (np.abs(numbers[:, :3]) <= FARTHEST).all(axis=1)
    return seconds.astype(np.int64) * NANOSECONDS + nanoseconds, numbers, sound


class _OtherwiseError(Exception):
    """A message is not encoded as expected, so that it gives no layout."""


class _Walk:
    """Reads a message field by field, and collects the bytes that are equal in all messages of its layout."""

    def __init__(self, data: bytes) -> None:
        self.data = data
        self.at = ENCAPSULATION
        self.constants = [(0, data[:ENCAPSULATION])]

    def align(self, size: int) -> None:
        """Moves to the next multiple of `size`, counted from the first byte after the encapsulation."""
        self.at += -(self.at - ENCAPSULATION) % size

    def skip(self, size: int) -> int:
        """Moves past a field of `size` bytes; returns the offset of its first byte."""
        begin, self.at = self.at, self.at + size
        if self.at > len(self.data):
            raise _OtherwiseError
        return begin

    def count(self) -> int:
        """Reads a length, which is equal in all messages of the layout."""
        self.align(4)
        begin = self.skip(4)
        self.constants.append((begin, self.data[begin : self.at]))
        return int(UINT32.unpack_from(self.data, begin)[0])

    def text(self) -> str:
        """Reads a string, which is equal in all messages of the layout."""
        length = self.count()
        begin = self.skip(length)
        text = self.data[begin : self.at]
        if not text.endswith(b"\x00"):
            raise _OtherwiseError
        self.constants.append((begin, text))
        try:
            return text[:-1].decode()
        except UnicodeDecodeError as error:
            raise _OtherwiseError from error

    def stamp(self) -> int:
        """Moves past a stamp; returns its offset."""
        self.align(4)
        return self.skip(8)

    def doubles(self, number: int) -> int:
        """Moves past `number` float64 values; returns the offset of the first."""
        self.align(8)
        return self.skip(8 * number)


def _odometry(walk: _Walk) -> tuple[PosePlace, ...]:
    stamp_at, parent, child = walk.stamp(), walk.text(), walk.text()
    numbers_at = walk.doubles(7)
    walk.doubles(36 + 6 + 36)  # covariance, twist, covariance
    return (PosePlace(stamp_at, numbers_at, parent, child),)


def _pose(walk: _Walk) -> tuple[PosePlace, ...]:
    stamp_at, parent = walk.stamp(), walk.text()
    return (PosePlace(stamp_at, walk.doubles(7), parent, ""),)


def _pose_with_covariance(walk: _Walk) -> tuple[PosePlace, ...]:
    places = _pose(walk)
    walk.doubles(36)
    return places


def _transforms(walk: _Walk) -> tuple[PosePlace, ...]:
    places = []
    for _ in range(walk.count()):
        stamp_at, parent, child = walk.stamp(), walk.text(), walk.text()
        places.append(PosePlace(stamp_at, walk.doubles(7), parent, child))
    return tuple(places)


type Walk = Callable[[_Walk], tuple[PosePlace, ...]]

HASHES = {
    ODOMETRY: "RIHS01_3cc97dc7fb7502f8714462c526d369e35b603cfc34d946e3f2eda2766dfec6e0",
    POSE: "RIHS01_10f3786d7d40fd2b54367835614bff85d4ad3b5dab62bf8bca0cc232d73b4cd8",
    POSE_WITH_COVARIANCE: "RIHS01_26432f9803e43727d3c8f668d1fdb3c630f548af631e2f4e31382371bfea3b6e",
    TF: "RIHS01_e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087",
}
"""Type hashes of ROS 2's own definitions, for which the functions above are valid; a bag may define these types differently."""

WALKS: dict[str, Walk] = {
    HASHES[ODOMETRY]: _odometry,
    HASHES[POSE]: _pose,
    HASHES[POSE_WITH_COVARIANCE]: _pose_with_covariance,
    HASHES[TF]: _transforms,
}


def layout_of(data: bytes, walk: Walk) -> Layout | None:
    """The layout of a message; None if it must be decoded one by one."""
    if not data.startswith(LITTLE_ENDIAN) or len(data) < ENCAPSULATION:
        return None
    walked = _Walk(data)
    try:
        places = walk(walked)
    except _OtherwiseError:
        return None
    return Layout(tuple(walked.constants), places) if len(data) - walked.at <= LONGEST_END else None
