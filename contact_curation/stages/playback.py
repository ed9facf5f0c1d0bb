"""A recording as live messages: which is due when, as recorded time runs at a rate, stands still, jumps, or begins again.

Times of the steady clock are passed in, in nanoseconds.
"""

import threading
from collections.abc import Callable, Mapping, Sequence

from contact_curation.errors import InvalidValueError, MissingTopicError
from contact_curation.motion.toss import NANOSECONDS
from contact_curation.storage.bags.reader import BagReader
from contact_curation.storage.bags.records import RawMessage

RESULTS = "contact_curation_msgs/"
"""Beginning of the types of the nodes' results. Recorded ones mix with those that live nodes compute."""

CLOCK = "rosgraph_msgs/msg/Clock"


class PlaybackClock:
    """Maps recorded time to the steady clock; may be used from several threads.

    Args:
        rate: recorded seconds a second.
        paused: whether it stands still at first.
    """

    def __init__(self, rate: float, paused: bool) -> None:
        self._lock = threading.Lock()
        self._rate = checked_rate(rate)
        self._paused = paused
        self._recorded_ns = 0
        self._steady_ns = 0
        self._begun = False

    @property
    def begun(self) -> bool:
        """Whether there is a recorded time yet."""
        return self._begun

    @property
    def paused(self) -> bool:
        """Whether it stands still."""
        return self._paused

    def begin(self, recorded_ns: int, steady_ns: int) -> None:
        """Jumps to a recorded time."""
        with self._lock:
            self._recorded_ns, self._steady_ns, self._begun = recorded_ns, steady_ns, True

    def pause(self, paused: bool, steady_ns: int) -> None:
        """Stands still, or goes on from where it stood."""
        with self._lock:
            self._recorded_ns, self._steady_ns = self._now(steady_ns), steady_ns
            self._paused = paused

    def set_rate(self, rate: float, steady_ns: int) -> None:
        """Goes on at another rate.

        Raises:
            InvalidValueError: the rate is not positive.
        """
        with self._lock:
            self._recorded_ns, self._steady_ns = self._now(steady_ns), steady_ns
            self._rate = checked_rate(rate)

    def now(self, steady_ns: int) -> int:
        """Recorded time [ns]."""
        with self._lock:
            return self._now(steady_ns)

    def wait_ns(self, recorded_ns: int, steady_ns: int) -> float:
        """How long until a recorded time, by the steady clock; infinite while it stands still; not positive: it is due."""
        with self._lock:
            ahead = recorded_ns - self._now(steady_ns)
            if ahead > 0 and self._paused:
                return float("inf")
            return ahead / self._rate

    def _now(self, steady_ns: int) -> int:
        return self._recorded_ns + (0 if self._paused else int((steady_ns - self._steady_ns) * self._rate))


def checked_rate(rate: float) -> float:
    """The rate, if time can run at it."""
    if not 0.0 < rate < float("inf"):
        raise InvalidValueError("rate", rate, "a positive number")
    return rate


class Playback:
    """Gives the messages of a recording when they are due; controlled from any thread, played on one.

    Args:
        reader: of the recording.
        clock: that says when a message is due.
        now: a steady clock [ns].
        start_offset: seconds left out at the start.
        loop: begin again at the end.
        fast: do not wait between messages.
    """

    def __init__(
        self, reader: BagReader, clock: PlaybackClock, now: Callable[[], int], start_offset: float, *, loop: bool, fast: bool
    ) -> None:
        self._reader, self._clock, self._now = reader, clock, now
        self._offset, self._loop, self._fast = start_offset, loop, fast
        self._changed = threading.Condition()
        self._jump: float | None = None
        self.stopped = False

    def play(
        self, topics: Sequence[str], publish: Callable[[RawMessage], None], end: Callable[[], None], *, stay: bool
    ) -> None:
        """Plays the recording, once or again and again, until it is stopped.

        Args:
            topics: that are played.
            publish: takes each message when it is due.
            end: called at each end of the recording.
            stay: wait for a jump at the end.

        Raises:
            InvalidValueError: the recording is shorter than the start offset.
        """
        offset: float | None = self._offset
        while offset is not None and not self.stopped:
            length = self._pass(offset, topics, publish)
            offset = self._jumped_to()
            if offset is None and length is not None and self._offset > length:
                raise InvalidValueError("start_offset", self._offset, f"at most the recording's {length:.1f} s")
            if offset is None and self._loop and not self.stopped:
                offset = self._offset
            if offset is None:
                end()
                offset = self._jumped_to(wait=stay)

    def stop(self) -> None:
        """Ends it as soon as possible."""
        with self._changed:
            self.stopped = True
            self._changed.notify_all()

    def jump(self, seconds: float) -> None:
        """Goes on so many seconds behind the recording's start."""
        with self._changed:
            self._jump = seconds
            self._changed.notify_all()

    def pause(self, paused: bool) -> None:
        """Stands still, or goes on."""
        with self._changed:
            self._clock.pause(paused, self._now())
            self._changed.notify_all()

    def set_rate(self, rate: float) -> None:
        """Goes on at another rate; InvalidValueError where it is not positive."""
        with self._changed:
            self._clock.set_rate(rate, self._now())
            self._changed.notify_all()

    def wait_until(self, holds: Callable[[], bool], seconds: float, every: float) -> None:
        """Waits until something holds that is looked at every so many seconds, until it is stopped, but no longer than this."""
        end_ns = self._now() + int(seconds * NANOSECONDS)
        with self._changed:
            while not self.stopped and self._now() < end_ns and not holds():
                self._changed.wait(every)

    def _pass(self, offset: float, topics: Sequence[str], publish: Callable[[RawMessage], None]) -> float | None:
        """Plays from `offset` [s] to the end, to a jump, or until stopped; how long the recording is [s], if it came so far."""
        first_ns: int | None = None
        start_ns = last_ns = 0
        for message in self._reader.raw_messages(list(topics)):
            last_ns = message.log_time_ns
            if first_ns is None:
                first_ns = message.log_time_ns
                start_ns = first_ns + int(offset * NANOSECONDS)
                self._clock.begin(start_ns, self._now())
            # What was latched is sent in any case: it holds for what comes later.
            if message.log_time_ns < start_ns and not self._reader.qos(message.topic).latched:
                continue
            if not self._due(message.log_time_ns):
                return None
            publish(message)
        return None if first_ns is None else (last_ns - first_ns) / NANOSECONDS

    def _due(self, recorded_ns: int) -> bool:
        """Waits until a message is due; False when there is something else to do."""
        with self._changed:
            while not (self.stopped or self._jump is not None):
                if self._fast and not self._clock.paused:
                    return True
                wait_ns = self._clock.wait_ns(recorded_ns, self._now())
                if wait_ns <= 0.0:
                    return True
                self._changed.wait(None if wait_ns == float("inf") else wait_ns / NANOSECONDS)
            return False

    def _jumped_to(self, wait: bool = False) -> float | None:
        """Where it was told to jump to [s], if it was; it may wait for that."""
        with self._changed:
            self._changed.wait_for(lambda: self.stopped or not wait or self._jump is not None)
            offset, self._jump = self._jump, None
        return offset


def played_topics(reader: BagReader, wanted: Sequence[str], *, own_clock: bool = False) -> dict[str, str]:
    """The types of the recorded topics that are to be played, by name.

    Args:
        reader: of the recording.
        wanted: topics to play; empty: all but results of the nodes and, beside an own clock, recorded clocks.
        own_clock: whether the player publishes a clock itself.

    Raises:
        MissingTopicError: a topic is wanted that was not recorded.
    """
    recorded = {info.name: info.type for info in reader.topics}
    missing = sorted(set(wanted) - set(recorded))
    if missing:
        raise MissingTopicError(reader.path, ", ".join(missing), list(recorded))
    if wanted:
        return {name: recorded[name] for name in recorded if name in wanted}
    made_anew = (RESULTS, CLOCK) if own_clock else (RESULTS,)
    return {name: kind for name, kind in recorded.items() if not kind.startswith(made_anew)}


def new_names(reader: BagReader, pairs: Sequence[str]) -> Mapping[str, str]:
    """Topics by their recorded names, from `old:=new`.

    Raises:
        InvalidValueError: a pair is not of this form.
        MissingTopicError: a topic is to be renamed that was not recorded.
    """
    names: dict[str, str] = {}
    for pair in pairs:
        old, arrow, new = pair.partition(":=")
        if not (old and arrow and new):
            raise InvalidValueError("remap", repr(pair), "old:=new")
        names[f"/{old.lstrip('/')}"] = new
    recorded = [info.name for info in reader.topics]
    missing = sorted(set(names) - set(recorded))
    if missing:
        raise MissingTopicError(reader.path, ", ".join(missing), recorded)
    return names
