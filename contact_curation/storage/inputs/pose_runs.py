"""The poses of a bag's messages: runs of one layout are decoded together, straight from the CDR; others one by one.

Messages of one topic mostly differ in stamps and numbers only. The first of those with the same length says where these are,
and what else must be the same: encapsulation, names of frames, lengths. Whatever differs, is cut off or is no pose goes the
long way (`bags.decoding`, `pose_source`), so that it comes out as if there were no shortcut. Padding is not looked at.
"""

import struct
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import batched
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from contact_curation.geometry.poses import QUATERNION_TOLERANCE
from contact_curation.geometry.scalars import ScalarPose
from contact_curation.motion.pose_stream import FARTHEST, FramePose
from contact_curation.motion.toss import NANOSECONDS
from contact_curation.storage.bags.decoding import Reading
from contact_curation.storage.bags.reader import BagReader
from contact_curation.storage.bags.records import BagMessage, Channel, StoredMessage
from contact_curation.storage.inputs.pose_messages import ODOMETRY, POSE, POSE_WITH_COVARIANCE, TF, Measured
from contact_curation.storage.inputs.pose_source import PoseSource

TOGETHER = 1024
"""Most messages that are decoded together; memory holds the poses of so many."""

FEWEST = 8
"""Messages of one length for which a layout pays."""

LAYOUTS = 4
"""Layouts of one length that are tried, as of a TF topic on which several publishers take turns."""

LITTLE_ENDIAN = b"\x00\x01"
"""Beginning of plain CDR whose numbers have their lowest byte first."""

ENCAPSULATION, POSE_BYTES, LONGEST_END = 4, 56, 3
"""Bytes before the message, of position and orientation, and behind the last field at most."""

UINT32 = struct.Struct("<I")


class MeasuredMessage(NamedTuple):
    """The poses in a message, or why there is none."""

    topic: str
    log_time_ns: int
    measured: tuple[Measured, ...]


def measured_messages(
    reader: BagReader, source: PoseSource, long_way: Callable[[BagMessage], tuple[Measured, ...]]
) -> Iterator[MeasuredMessage]:
    """The poses in a bag's messages of the topics of `source`, message by message in order of log time.

    Args:
        reader: the bag.
        source: topics.
        long_way: gives the poses in a decoded message.

    Raises:
        MissingTopicError: the bag lacks one of the topics.
    """
    reading, runs = reader.runs(source.topics)
    for run in runs:
        for part in batched(run, TOGETHER):
            found = _together(part, reading, source) if len(part) >= FEWEST else {}
            for place, stored in enumerate(part):
                if place in found:
                    yield MeasuredMessage(stored.channel.topic, stored.log_time_ns, found[place])
                else:
                    for message in reading.decoded((stored,)):
                        yield MeasuredMessage(message.topic, message.log_time_ns, long_way(message))


def _together(part: Sequence[StoredMessage], reading: Reading, source: PoseSource) -> dict[int, tuple[Measured, ...]]:
    """The poses in the messages that have the layout of others, by the messages' places."""
    alike: dict[tuple[Channel, int], list[int]] = defaultdict(list)
    for place, stored in enumerate(part):
        alike[stored.channel, len(stored.data)].append(place)
    found: dict[int, tuple[Measured, ...]] = {}
    for (channel, length), places in alike.items():
        walk = WALKS.get(reading.type_hash(channel)) if len(places) >= FEWEST else None
        if walk is None or source.type_of(channel.topic) != channel.type or length > reading.longest:
            continue
        if not reading.has_decoded(channel):  # the first message goes the long way, on which the definition is looked at
            places = places[1:]
        block = np.frombuffer(b"".join([part[place].data for place in places]), np.uint8).reshape(len(places), length)
        left = np.arange(len(places))
        for _ in range(LAYOUTS):
            layout = layout_of(block[left[0]].tobytes(), walk)
            fits = layout.fits(block[left]) if layout else np.zeros(len(left), dtype=bool)
            fits[0] = True  # no other message can have a layout that is none
            if layout:
                fitting = left[fits]
                poses = layout.poses_in(block[fitting], channel.topic, source)
                found |= {places[row]: own for row, own in zip(fitting.tolist(), poses) if own is not None}
            left = left[~fits]
            if len(left) < FEWEST:
                break
    return found


@dataclass(frozen=True)
class PosePlace:
    """Where in a message a pose is: its stamp and its numbers, by their first bytes; and its frames."""

    stamp_at: int
    numbers_at: int
    parent: str
    child: str


@dataclass(frozen=True)
class Layout:
    """What messages of one length have in common.

    Attributes:
        constants: bytes that they share, by their first.
        places: of the poses.
    """

    constants: tuple[tuple[int, bytes], ...]
    places: tuple[PosePlace, ...]

    def fits(self, block: NDArray[np.uint8]) -> NDArray[np.bool_]:
        """Which of the messages (N, length) have this layout (N,)."""
        same = np.ones(len(block), dtype=bool)
        for start, constant in self.constants:
            same &= (block[:, start : start + len(constant)] == np.frombuffer(constant, np.uint8)).all(axis=1)
        return same

    def poses_in(self, block: NDArray[np.uint8], topic: str, source: PoseSource) -> list[tuple[Measured, ...] | None]:
        """The poses in messages (N, length) of this layout; None for a message in which one is no pose."""
        columns: list[list[Measured]] = []
        good = np.ones(len(block), dtype=bool)
        for place in self.places:
            stamps, numbers, sound = _read(block, place)
            good &= sound
            frames = source.frames(topic, place.parent, place.child)
            if frames is not None:
                columns.append(_frame_poses(stamps, numbers, *frames, static=source.is_static(topic)))
        rows: Iterable[tuple[Measured, ...]] = zip(*columns) if columns else [()] * len(block)
        return [row if sound else None for row, sound in zip(rows, good.tolist(), strict=True)]


def _read(block: NDArray[np.uint8], place: PosePlace) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.bool_]]:
    """Stamps (N,) [ns], positions and orientations xyzw (N, 7), and which `pose_stream.checked_pose` takes (N,)."""
    clock = np.ascontiguousarray(block[:, place.stamp_at : place.stamp_at + 8])
    seconds, nanoseconds = clock.view("<i4")[:, 0], clock.view("<u4")[:, 1]
    numbers = np.ascontiguousarray(block[:, place.numbers_at : place.numbers_at + POSE_BYTES]).view("<f8")
    x, y, z, w = numbers[:, 3:].T
    with np.errstate(over="ignore", invalid="ignore"):
        norms = np.sqrt(w * w + x * x + y * y + z * z)
        sound = np.isfinite(norms) & (np.abs(norms - 1.0) <= QUATERNION_TOLERANCE)
        sound &= (np.abs(numbers[:, :3]) <= FARTHEST).all(axis=1)
    return seconds.astype(np.int64) * NANOSECONDS + nanoseconds, numbers, sound


def _frame_poses(
    stamps: NDArray[np.int64], numbers: NDArray[np.float64], parent: str, child: str, *, static: bool
) -> list[Measured]:
    return [
        FramePose(stamp_ns, parent, child, ScalarPose((x, y, z), (w, qx, qy, qz)), static)
        for stamp_ns, (x, y, z, qx, qy, qz, w) in zip(stamps.tolist(), numbers.tolist(), strict=True)
    ]


class _OtherwiseError(Exception):
    """A message is not what it should be: it has no layout."""


class _Walk:
    """Goes through a message field by field, and notes what is the same in others of its layout."""

    def __init__(self, data: bytes) -> None:
        self.data = data
        self.at = ENCAPSULATION
        self.constants = [(0, data[:ENCAPSULATION])]

    def align(self, size: int) -> None:
        """Goes on to the next multiple of `size` from the message's first byte."""
        self.at += -(self.at - ENCAPSULATION) % size

    def skip(self, size: int) -> int:
        """Goes over a field; returns where it begins."""
        begin, self.at = self.at, self.at + size
        if self.at > len(self.data):
            raise _OtherwiseError
        return begin

    def count(self) -> int:
        """A length, which is the same in all."""
        self.align(4)
        begin = self.skip(4)
        self.constants.append((begin, self.data[begin : self.at]))
        return int(UINT32.unpack_from(self.data, begin)[0])

    def text(self) -> str:
        """A text, which is the same in all."""
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
        """A stamp's place."""
        self.align(4)
        return self.skip(8)

    def doubles(self, number: int) -> int:
        """The place of so many."""
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
"""ROS 2's hashes of the definitions that the layouts hold for: a bag may define these types otherwise."""

WALKS: dict[str, Walk] = {
    HASHES[ODOMETRY]: _odometry,
    HASHES[POSE]: _pose,
    HASHES[POSE_WITH_COVARIANCE]: _pose_with_covariance,
    HASHES[TF]: _transforms,
}


def layout_of(data: bytes, walk: Walk) -> Layout | None:
    """The layout of messages like this one; None where it goes the long way."""
    if not data.startswith(LITTLE_ENDIAN) or len(data) < ENCAPSULATION:
        return None
    walked = _Walk(data)
    try:
        places = walk(walked)
    except _OtherwiseError:
        return None
    return Layout(tuple(walked.constants), places) if len(data) - walked.at <= LONGEST_END else None
