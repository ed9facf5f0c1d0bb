"""Reads the tosses of a bag: finds topics, turns messages into poses, and poses into tosses."""

from collections import defaultdict, deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from itertools import chain, pairwise, takewhile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from contact_curation.contact.body import Body
from contact_curation.errors import MissingTopicError, UnreadableInputError
from contact_curation.motion.body_tracker import MOST_LISTED, BodyPose
from contact_curation.motion.ingest import IngestConfig, IngestEvent, TossIngest
from contact_curation.motion.pose_noise import TrackerScale
from contact_curation.motion.pose_stream import LOWEST_RATE, BadPose, FramePose
from contact_curation.motion.scales import scale_of
from contact_curation.motion.toss import NANOSECONDS, Rejected
from contact_curation.storage.bags.reader import BagReader
from contact_curation.storage.bags.records import BagMessage, Channel
from contact_curation.storage.inputs.pose_messages import BODY_PREFIX, ODOMETRY, TRANSFORM, Measured, frame_name
from contact_curation.storage.inputs.pose_runs import MeasuredMessage, MeasuredRun, measured_runs
from contact_curation.storage.inputs.pose_source import PoseSource, TypedTopic, find_pose_source, is_of_another
from contact_curation.storage.inputs.recording_notes import (
    NUMBERS_NOTE,
    RULES_NOTE,
    RecordedNumbers,
    recorded_numbers,
    with_recorded_rules,
)
from contact_curation.storage.inputs.records import Found, InputReading, InputsConfig, InputSummary, Problem
from contact_curation.storage.provenance import TossProvenance

MOTION = ", expected motions that fall freely (in metres, z up on the board) and come to rest"
CHECK = "; `contact-curation check` says why"
UNNUMBERED = RecordedNumbers()

NAMES_AT, BEHIND_NAMES = 12, {ODOMETRY: 680, TRANSFORM: 56}
"""[bytes] Where the names of frames begin, after the stamp, in CDR and in ROS 1; and what numbers are after them."""

LONGEST_STEP = 0.5
"""[s] Poses further apart are not successive ones."""

OVERTAKEN_NS, MOST_WAITING = 300_000_000, 1024
"""[ns] A message that was logged within this time before another one may have a later stamp; so many wait for it at most."""

ROOM = 0.75
"""Shortest time between two stamps, relative to the shortest between others, at which both can be right."""

STEPS, FEWEST_STEPS, EVENLY = 64, 16, 0.4
"""Where the shortest step between the last stamps, once they are sorted, is a smaller share of the median, they jitter."""


def read_bag_tosses(path: Path, body: Body, config: InputsConfig) -> InputReading:
    """The tosses of one bag, as they complete; then what was left out.

    Raises:
        UnreadableInputError: the input is no bag.
        MissingTopicError: no topic, or more than one, may contain the body's poses.
    """
    with BagReader(path) as reader:
        tosses = bag_tosses(reader, body, config)
        for one in tosses.runs(reader):
            yield from tosses.taken_run(one) if isinstance(one, MeasuredRun) else tosses.taken(one.measured, one.topic)
        yield from tosses.rest()
        yield from (Problem(str(path), line) for line in tosses.left_out())
        return tosses.summary(reader.losses)


MOST_LOSSES = 3
"""Losses that an error lists."""


def bag_tosses(
    reader: BagReader, body: Body, config: InputsConfig, placed: Callable[[BodyPose], None] | None = None
) -> "BagTosses":
    """What follows the messages of a bag, in the order of their log times; `placed` hears every pose on the board.

    Raises:
        MissingTopicError: no topic, or more than one, may contain the body's poses.
        UnreadableInputError: the same for a damaged bag, with what was lost.
    """
    topics = [TypedTopic(info.name, info.type) for info in reader.topics if info.count != 0]
    try:
        source = find_pose_source(reader.path, topics, body.name, config.poses)
    except MissingTopicError as error:
        if not reader.losses:
            raise
        why = str(error).removeprefix(f"{reader.path}: ")  # perhaps only since the bag is damaged
        more = [f"and {len(reader.losses) - MOST_LOSSES} more"] if len(reader.losses) > MOST_LOSSES else []
        raise UnreadableInputError(reader.path, "; ".join((*reader.losses[:MOST_LOSSES], *more, why))) from error
    source = source.of_children(_children(reader, source))
    rules = with_recorded_rules(config.segmenter, reader.note(RULES_NOTE))
    origin = TossProvenance(str(reader.path), reader.sha256, source.body.name)
    numbers = recorded_numbers(reader.note(NUMBERS_NOTE))
    return BagTosses(origin, source, body, replace(config, segmenter=rules), numbers, placed)


def _children(reader: BagReader, source: PoseSource) -> frozenset[str]:
    """Whose poses the messages of the body's topic have, if they say so: all of them, or those up to the body's first.

    Of messages with the same names only one is decoded.
    """
    if not source.has_children:
        return frozenset()
    reading, runs = reader.runs([source.body.name])
    seen: set[tuple[Channel, bytes]] = set()
    children: set[str] = set()
    for stored in chain.from_iterable(runs):
        names = stored.channel, stored.data[NAMES_AT : -BEHIND_NAMES[source.body.type]]
        if names not in seen:
            seen.add(names)
            decoded = reading.decoded([stored])
            own = [getattr(one.message, "child_frame_id", None) for one in decoded]  # None: the bag has its own definition
            children.update(frame_name(str(child)) for child in own if child is not None)
            if any(source.is_own(child) for child in children):
                break
    return frozenset(children)


def in_order_of_stamps(messages: Iterable[MeasuredMessage | MeasuredRun]) -> Iterator[MeasuredMessage | MeasuredRun]:
    """Messages in order of log time, where those that overtook others of their topic change places with them.

    A recorder logs messages when it receives them. What is in order already comes out as it was; stamps that go back by more
    than `OVERTAKEN_NS` are another run of a clock, and stay where they are, as do wrong stamps: they fit no hole in the others.
    So do stamps that jitter, whose order is not that of the poses; `even_stamps` corrects them.
    """
    waiting: list[MeasuredMessage] = []
    rest: MeasuredRun | None = None  # of a run, in place of `waiting` until a message comes that may overtake some of it
    topics: defaultdict[str, _Stamps] = defaultdict(_Stamps)
    for one in messages:
        if isinstance(one, MeasuredRun) and (settled := _settled(one, topics[one.topic].newest_ns)):
            yield from waiting
            yield from _joined(rest, one.part(0, settled))
            waiting, rest = [], one.part(settled, len(one.log_times_ns))
            topics[one.topic].go_on(one.measured.poses.stamps_ns)
            continue
        if rest is not None:
            waiting, rest = rest.messages(), None
        for message in one.messages():
            yield from _overtaking(message, waiting, topics[message.topic])
    yield from waiting
    if rest is not None:
        yield rest


def _joined(first: MeasuredRun | None, second: MeasuredRun) -> Iterator[MeasuredRun]:
    """Two successive runs as one, where they are of the same topic and frames."""
    if first is None:
        yield second
    elif (first.topic, *first.measured.frames) != (second.topic, *second.measured.frames):
        yield from (first, second)
    else:
        log_times_ns = np.concatenate([first.log_times_ns, second.log_times_ns])
        yield MeasuredRun(first.topic, log_times_ns, first.measured.followed_by(second.measured))


@dataclass(slots=True)
class _Stamps:
    """The stamps of a topic in the order in which they came.

    Attributes:
        newest_ns: up to which they are in order; None where there is none.
        last: the last of them.
    """

    newest_ns: int | None = None
    last: deque[int] = field(default_factory=lambda: deque(maxlen=STEPS + 1))

    def go_on(self, stamps_ns: NDArray[np.int64]) -> None:
        """Takes in stamps that do not go back."""
        self.newest_ns = int(stamps_ns[-1])
        self.last.extend(stamps_ns[-STEPS - 1 :].tolist())

    @property
    def jitter(self) -> bool:
        """Whether steps differ so much that their order is not certain."""
        steps = sorted(after - before for before, after in pairwise(sorted(self.last)) if after > before)
        return len(steps) >= FEWEST_STEPS and steps[0] < EVENLY * steps[len(steps) // 2]


def _settled(run: MeasuredRun, newest_ns: int | None) -> int:
    """How many first messages of a run nothing can overtake any more, nor what waits for it; 0 where its stamps go back."""
    stamps, late_ns = run.measured.poses.stamps_ns, int(run.log_times_ns[-1]) - OVERTAKEN_NS
    goes_back = np.any(np.diff(stamps, prepend=stamps[0] if newest_ns is None else newest_ns) < 0)
    return 0 if goes_back else int(np.searchsorted(run.log_times_ns, late_ns))


def _overtaking(message: MeasuredMessage, waiting: list[MeasuredMessage], stamps: _Stamps) -> Iterator[MeasuredMessage]:
    """Puts a message among those that wait, where it belongs; yields those that nothing can overtake any more."""
    late_ns = message.log_time_ns - OVERTAKEN_NS
    while waiting and (waiting[0].log_time_ns < late_ns or len(waiting) >= MOST_WAITING):
        yield waiting.pop(0)
    waiting.append(message)
    stamp_ns = _stamp_of(message)
    if stamp_ns is None:
        return
    back_ns = 0 if stamps.newest_ns is None else stamps.newest_ns - stamp_ns
    stamps.last.append(stamp_ns)
    if not 0 < back_ns <= OVERTAKEN_NS:
        stamps.newest_ns = stamp_ns
    elif not stamps.jitter:
        _put_back(waiting, stamp_ns)


def _put_back(waiting: list[MeasuredMessage], stamp_ns: int) -> None:
    """Moves the last message before those of its topic with later stamps, if there is room for it between them."""
    topic, last = waiting[-1].topic, len(waiting) - 1
    stamps = {place: stamp for place, one in enumerate(waiting[:-1]) if one.topic == topic and (stamp := _stamp_of(one))}
    later = list(takewhile(lambda place: stamps[place] > stamp_ns, reversed(stamps)))[::-1]
    earlier = [stamp for stamp in stamps.values() if stamp <= stamp_ns]
    steps = [after - before for before, after in pairwise(stamps.values()) if after > before]
    room = min(stamps[later[0]] - stamp_ns, stamp_ns - max(earlier, default=stamp_ns - OVERTAKEN_NS)) if later else 0
    if room < ROOM * min(steps, default=1):
        return
    places = [*later, last]
    moved = [waiting[last], *(waiting[place] for place in later)]
    for place, one in zip(places, moved, strict=True):
        waiting[place] = one


def _stamp_of(message: MeasuredMessage) -> int | None:
    """The stamp of the poses of a message, of several tags or frames, too; None where it has none, several or is static."""
    stamps = {one.stamp_ns for one in message.measured}
    moving = any(isinstance(one, FramePose) and not one.static for one in message.measured)
    return stamps.pop() if moving and len(stamps) == 1 else None


class BagTosses:
    """Follows the messages of one bag.

    Attributes:
        origin: the bag.
        source: the topics to read.
        settle_time: settle time that separates two motions, from the bag's own rules if it has any [s].
    """

    def __init__(
        self,
        origin: TossProvenance,
        source: PoseSource,
        body: Body,
        config: InputsConfig,
        numbers: RecordedNumbers = UNNUMBERED,
        placed: Callable[[BodyPose], None] | None = None,
    ) -> None:
        tracker = replace(config.poses.tracker(body, source.board_frame), recorded=True)
        stages = IngestConfig(tracker, config.segmenter, config.gates, config.rig)
        self.origin = origin
        self.source = source
        self.settle_time = config.segmenter.bounds(scale_of(body), config.segmenter.tracker).settle_time
        self._body = body.name
        self._of_another = is_of_another(source.body.name, body.name, config.poses)
        self._numbers = numbers
        self._detections = config.poses.detections(body.name)
        self._ingest = TossIngest(stages, body, source=source.body.name, placed=placed)
        self._frames: set[str] = set()
        self._children, self._carrying = set[str](), set[str]()
        self._parent: str | None = None
        self._first_ns: int | None = None
        self._last_ns: int | None = None
        self._steps, self._stepped = 0, 0.0
        self._bad: dict[str, BadPose] = {}
        self._bad_counts: dict[str, int] = {}

    def messages(self, reader: BagReader) -> Iterator[MeasuredMessage]:
        """The poses in a bag's messages, in order of log time and each topic's stamps; nothing takes note of them."""
        for one in self.runs(reader):
            yield from one.messages()

    def runs(self, reader: BagReader) -> Iterator[MeasuredMessage | MeasuredRun]:
        """The same in runs, where messages are alike."""
        return in_order_of_stamps(measured_runs(reader, self.source, self.measured))

    def taken(self, found: Iterable[Measured], topic: str) -> Iterator[Found]:
        """Yields the tosses and rejected motions that the poses in a message of a topic complete."""
        for measured in found:
            if isinstance(measured, FramePose):
                self._frames.update((measured.parent, measured.child))
                self._children.add(measured.child)
                self._carrying.update(() if measured.static else (measured.parent,))
            if isinstance(measured, FramePose) and topic == self.source.body.name:
                self._parent = measured.parent if self._parent is None else self._parent
                self._first_ns = measured.stamp_ns if self._first_ns is None else self._first_ns
                step = 0.0 if self._last_ns is None else (measured.stamp_ns - self._last_ns) / NANOSECONDS
                if 0.0 < step < LONGEST_STEP:
                    self._steps, self._stepped = self._steps + 1, self._stepped + step
                self._last_ns = measured.stamp_ns
            if events := self._ingest.push(measured):
                yield from self._found(events)

    def taken_run(self, run: MeasuredRun) -> Iterator[Found]:
        """Yields the tosses and rejected motions that successive messages complete."""
        found, stamps = run.measured, run.measured.poses.stamps_ns
        self._frames.update((found.parent, found.child))
        self._children.add(found.child)
        if run.topic == self.source.body.name:
            self._parent = found.parent if self._parent is None else self._parent
            self._first_ns = int(stamps[0]) if self._first_ns is None else self._first_ns
            steps = np.diff(stamps if self._last_ns is None else np.append(self._last_ns, stamps)) / NANOSECONDS
            steps = steps[(steps > 0.0) & (steps < LONGEST_STEP)]
            self._steps += len(steps)
            self._stepped = float(np.cumsum(np.append(self._stepped, steps))[-1])  # one by one, as `taken` adds them
            self._last_ns = int(stamps[-1])
        yield from self._found(self._ingest.push_run(found))

    def rest(self) -> Iterator[Found]:
        """What the end of the bag completes."""
        if self._detections is not None:
            yield from self.taken(self._detections.ended(), self.source.body.name)
        yield from self._found(self._ingest.flush())

    def left_out(self) -> Iterator[str]:
        """Lines about poses of another body, a low rate, jitter, noise, each kind of poses left out, and a lack of tosses."""
        if self._of_another:
            yield f"found no topic named after {self._body}, expected one, or a name for it: took {self.source.body.name}"
        if self.source.is_mixed:
            listed = ", ".join(f"'{name}'" for name in sorted(self.source.children))
            yield f"{self.source.body.name} has poses of {listed}, none of them {self._body}'s: name one with --body-frame"
        if self.taken_as_on_board:
            wanted = f"nothing in the recording leads to the board '{self.source.wanted_board}'"
            yield f"poses are given in frame '{self._parent}' and {wanted}: taken as given on it; if so, say --board-frame ''"
        if self._steps and self._steps < LOWEST_RATE * self._stepped:
            rate = self._steps / self._stepped
            yield f"found poses of {self.source.body.name} at {rate:.3g} Hz, expected 60 Hz or more: tosses may go unseen"
        if self.stamps_done:
            yield f"found that {self.stamps_done}; stamp poses with the time of exposure, not of reception"
        if warning := self._ingest.noise_warning():
            yield warning
        elif self.noise_done:
            yield f"found {self.noise_done}"
        for kind, first in self._bad.items():
            which = f"the first one, of '{first.child}' at {first.stamp_ns / NANOSECONDS:.6f} s"
            yield f"{self._bad_counts[kind]} poses were left out, {which}, for this: {first.why}"
        poses = self._ingest.counts["poses"]
        if not self._ingest.counts["tosses"] + self._ingest.counts["rejected"]:
            seen = ", ".join(sorted(name for name in self._frames if name)[:MOST_LISTED]) or "no frame"
            wanted = MOTION if poses else f": found {seen}, expected frames {self.source.body_frame} and {self._board}"
            if not poses and self._bad and self._parent is None:
                wanted = ", since all were left out"
            elif not poses and self.source.other_tags:
                wanted += f", or poses of tags from {' or '.join(self.source.other_tags)} (--topic)"
            elif self.only_inverted:
                wanted = f": {self.only_inverted}"
            elif not poses:
                wanted += " (--body-frame, --board-frame)"
            yield f"found no toss in {poses} poses of {self.source.body.name}{wanted}{CHECK if poses else ''}"

    @property
    def stamps_done(self) -> str:
        """One line that says how stamps were corrected; empty if they were not."""
        return self._ingest.stamps_done

    @property
    def tracker(self) -> TrackerScale:
        """The tracker's noise that the bounds are for, at the end of the recording."""
        return self._ingest.tracker

    @property
    def noise_done(self) -> str:
        """One line that says how the bounds follow the measured noise; empty if they are those for ContactNets' rig."""
        return self._ingest.noise_done

    @property
    def bad_poses(self) -> tuple[dict[str, int], dict[str, str]]:
        """Number of poses that were left out by kind, and the reason for the first of each kind."""
        return dict(self._bad_counts), {kind: one.why for kind, one in self._bad.items()}

    @property
    def taken_as_on_board(self) -> bool:
        """Whether poses in another frame count as given on the board, because no transform leads to it."""
        wanted = self.source.wanted_board
        names = {wanted, wanted.removeprefix(BODY_PREFIX)}
        return bool(wanted) and not self.source.board_frame and self._parent is not None and self._parent not in names

    @property
    def only_inverted(self) -> str:
        """What is wrong where others move in the body's frame, and nothing has a pose of it, one line; else empty."""
        frame = self.source.body_frame
        if frame not in self._carrying - self._children:
            return ""
        return f"found poses of others in {frame}, expected those of {frame} in others: publish the inverse"

    @property
    def _board(self) -> str:
        return self.source.board_frame or "of the board"

    def summary(self, losses: tuple[str, ...]) -> InputSummary:
        origin, counts = self.origin, dict(self._ingest.counts)
        return InputSummary(origin.input, origin.input_sha256, origin.topic, self._first_ns, self._last_ns, counts, losses)

    def measured(self, message: BagMessage) -> tuple[Measured, ...]:
        """The poses in a message, or the reason why there is none."""
        try:
            return self.source.measured(message.topic, message.message, self._detections)
        except (AttributeError, TypeError, ValueError) as error:  # a bag may define a well-known type in another way
            why = f"{message.type}: found fields that are not its own ({error}), expected the type of ROS"
            return (BadPose(message.log_time_ns, message.topic, why, "type"),)

    def _found(self, events: Iterable[IngestEvent]) -> Iterator[Found]:
        for event in events:
            if isinstance(event, BadPose):
                self._bad.setdefault(event.kind, event)
                self._bad_counts[event.kind] = self._bad_counts.get(event.kind, 0) + 1
            else:
                toss = event.toss if isinstance(event, Rejected) else event
                number = self._numbers.number_at(int(toss.stamps_ns[0]))
                yield Found(event, replace(self.origin, number=number))
