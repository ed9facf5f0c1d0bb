"""Finds the selected tosses in a bag: the log times of its motions and of their surroundings.

Tosses have header stamps, messages are recorded with log times, and the two may differ by years. So stamps and log times of the
poses are noted while the recording is read, and the stamps of a toss are looked up there.

A toss must be the same whether it is cut from the part or from the whole recording. How it is cut depends on what came before:
an unfinished motion, the frame period, and on a bounded board whether the body was away from it. `Surroundings.NEAR` takes
somewhat less than the time that separates two motions, so that it contains no part of another one; `FAR` takes everything up
to the next motion.
"""

from array import array
from bisect import bisect_right
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from enum import Enum
from itertools import chain
from typing import NamedTuple

import numpy as np

from contact_curation.contact.body import Body
from contact_curation.motion.pose_noise import TrackerScale
from contact_curation.motion.toss import NANOSECONDS
from contact_curation.storage.bags.reader import BagReader
from contact_curation.storage.bags.records import BagMessage
from contact_curation.storage.inputs.bag_tosses import BagTosses, bag_tosses, in_order_of_stamps
from contact_curation.storage.inputs.pose_messages import Measured, stamp_ns_of
from contact_curation.storage.inputs.pose_runs import measured_runs
from contact_curation.storage.inputs.pose_source import PoseSource
from contact_curation.storage.inputs.records import Found, InputsConfig
from contact_curation.storage.provenance import TossProvenance


class Window(NamedTuple):
    """A range of log times [ns], including both ends."""

    first_ns: int
    last_ns: int

    def wider(self, by_ns: int) -> "Window":
        return Window(self.first_ns - by_ns, self.last_ns + by_ns)


class Places(NamedTuple):
    """A range of messages by their index among those of the body's topic, including both ends."""

    low: int
    high: int


class Windows:
    """Windows of log times; overlapping ones are joined."""

    def __init__(self, windows: Iterable[Window]) -> None:
        self._joined: list[Window] = []
        for one in sorted(windows):
            if self._joined and one.first_ns <= self._joined[-1].last_ns:
                before = self._joined.pop()
                one = Window(before.first_ns, max(before.last_ns, one.last_ns))
            self._joined.append(one)
        self._starts = [one.first_ns for one in self._joined]

    def holds(self, log_time_ns: int) -> bool:
        """Whether a time is in one of the windows."""
        place = bisect_right(self._starts, log_time_ns) - 1
        return place >= 0 and log_time_ns <= self._joined[place].last_ns

    def over(self, log_time_ns: int) -> bool:
        """Whether all windows end before a time."""
        return not self._joined or self._joined[-1].last_ns < log_time_ns


class PoseTimes:
    """Stamps and log times of the messages of one topic, in the order in which their poses are taken."""

    def __init__(self) -> None:
        self._stamps, self._logs = array("q"), array("q")

    def __len__(self) -> int:
        return len(self._stamps)

    def note(self, stamp_ns: int, log_time_ns: int) -> None:
        """Notes the stamp and log time of a message [ns]."""
        self._stamps.append(stamp_ns)
        self._logs.append(log_time_ns)

    def places(self, first_ns: int, last_ns: int, end: int) -> Places | None:
        """Finds the messages with the poses of a toss.

        Args:
            first_ns: its first stamp [ns].
            last_ns: its last stamp [ns].
            end: number of messages that had been read when the toss was complete.

        Returns:
            The range of messages; None if no message has such stamps.
        """
        stamps = np.frombuffer(self._stamps, dtype=np.int64)[:end]
        starts = np.flatnonzero(stamps == first_ns)
        if not len(starts):  # only the first stamp is noted of a message with several transforms
            starts = np.flatnonzero(stamps <= first_ns)
        if not len(starts):
            return None
        low = int(starts[-1])
        inside = np.flatnonzero((stamps[low:] >= first_ns) & (stamps[low:] <= last_ns))
        return Places(low, low + int(inside.max(initial=0)))

    def with_margins(self, places: Places, before_ns: int, after_ns: int) -> Places:
        """Extends a range of messages by times before and after it [ns], by the stamps."""
        stamps = np.frombuffer(self._stamps, dtype=np.int64)
        low, high = places
        first_ns, last_ns = int(stamps[low]), int(stamps[high])
        while low > 0 and first_ns - before_ns <= stamps[low - 1] <= last_ns:
            low -= 1
        while high + 1 < len(stamps) and first_ns <= stamps[high + 1] <= last_ns + after_ns:
            high += 1
        return Places(low, high)

    def window(self, places: Places) -> Window:
        """The window of log times of a range of messages."""
        logs = np.frombuffer(self._logs, dtype=np.int64)[places.low : places.high + 1]
        return Window(int(logs.min()), int(logs.max()))


SHARE_OF_SETTLE_TIME = 0.8


class Surroundings(Enum):
    """How much of the recording around a toss is taken."""

    NEAR = "near"
    FAR = "far"


@dataclass(frozen=True, eq=False)
class Motion:
    """A toss or a rejected motion, without its poses.

    Attributes:
        toss_id: id of the toss.
        digest: digest of its content.
        places: range of its messages.
    """

    toss_id: str
    digest: str
    places: Places


@dataclass(frozen=True, eq=False)
class Survey:
    """The motions of a bag.

    Attributes:
        origin: the bag.
        source: the topics with the body's poses.
        motions: motions in their order.
        settle_ns: time that separates two motions [ns].
        times: stamps and log times of the poses.
        left_out: what could not be used of the bag, one line each.
        noise: how noisy the tracker is for the bounds, at the end.
    """

    origin: TossProvenance
    source: PoseSource
    motions: tuple[Motion, ...]
    settle_ns: int
    times: PoseTimes
    left_out: tuple[str, ...]
    noise: TrackerScale

    def wanted(self, wanted: Mapping[str, object]) -> tuple[Motion, ...]:
        """The motions with the given ids; of two with the same id the last one, which is whole if one of them is."""
        return tuple({motion.toss_id: motion for motion in self.motions if motion.toss_id in wanted}.values())

    def window(self, motion: Motion, surroundings: Surroundings) -> Window:
        """The window of log times of a motion with its surroundings."""
        if surroundings is Surroundings.NEAR:
            margin_ns = int(SHARE_OF_SETTLE_TIME * self.settle_ns)
            return self.times.window(self.times.with_margins(motion.places, margin_ns, margin_ns))
        place = self.motions.index(motion)
        low = self.motions[place - 1].places.high + 1 if place else 0
        high = self.motions[place + 1].places.low - 1 if place + 1 < len(self.motions) else len(self.times) - 1
        return self.times.window(Places(min(low, motion.places.low), max(high, motion.places.high)))


def survey(reader: BagReader, body: Body, config: InputsConfig, advance: Callable[[int], None]) -> Survey:
    """Reads a bag's poses and finds its motions.

    Raises:
        MissingTopicError: no topic, or more than one, may contain the body's poses.
    """
    tosses = bag_tosses(reader, body, config)
    times, motions, topic = PoseTimes(), list[Motion](), tosses.source.body.name

    def read(message: BagMessage) -> tuple[Measured, ...]:
        measured = tosses.measured(message)
        if message.topic == topic and not measured and tosses.source.camera is not None:  # an image that waits for its camera
            times.note(stamp_ns_of(message.message.header), message.log_time_ns)
        return measured

    in_order = in_order_of_stamps(measured_runs(reader, tosses.source, read))
    for message in chain.from_iterable(one.messages() for one in in_order):
        if message.topic == topic and message.measured:
            times.note(message.measured[0].stamp_ns, message.log_time_ns)
        for found in tosses.taken(message.measured, message.topic):
            motions += _located(found, times)
            advance(1)
    motions += [motion for found in tosses.rest() for motion in _located(found, times)]
    left_out = tuple(f"{reader.path}: {line}" for line in (*tosses.left_out(), *reader.losses))
    settle_ns = round(tosses.settle_time * NANOSECONDS)
    return Survey(tosses.origin, tosses.source, tuple(motions), settle_ns, times, left_out, tosses.tracker)


def digests_in(reader: BagReader, body: Body, config: InputsConfig) -> dict[str, str]:
    """The digests of all motions of a bag, by their ids."""
    tosses: BagTosses = bag_tosses(reader, body, config)
    found = [one for message in tosses.messages(reader) for one in tosses.taken(message.measured, message.topic)]
    return {one.toss.toss_id: one.toss.digest() for one in (*found, *tosses.rest())}


def _located(found: Found, times: PoseTimes) -> list[Motion]:
    toss = found.toss
    places = times.places(int(toss.stamps_ns[0]), int(toss.stamps_ns[-1]), len(times))
    return [Motion(toss.toss_id, toss.digest(), places)] if places is not None else []
