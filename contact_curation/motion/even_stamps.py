"""Even stamps where a driver stamps poses when it receives them, late by what varies, and not when they were taken.

    s_n = t_n + d_n,  t_n = t_n-1 + k_n T        s stamp, t exposure, d delay, T frame period, k - 1 frames missing

A velocity from such stamps is off by its own share of (d_n - d_n-1) / T. Stamps whose steps are one period within `EVEN` pass
as they are, at once. Others wait for those within `AHEAD`, and come out on a line that follows the lower quartile of their
delays slowly: neither a late frame nor a row of them moves it, and its steps are even to microseconds. A delay
that stays is a missing frame, or another rate, for which a new line is begun.

Not every uneven stamp is wrong: two cameras may take turns. Where the body moves, the third differences of its positions over
its own stamps are compared with those over even ones; stamps over which the motion is smoother stay as they are.

Nothing depends on when something is pushed: live streams and recordings come out alike, and the state can be written down.
"""

from collections import Counter, deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import accumulate, islice, pairwise
from math import dist, log, prod, sqrt
from statistics import fmean, median, pstdev
from typing import Any

from contact_curation.geometry.scalars import ScalarPose, Vector
from contact_curation.motion.body_tracker import BodyPose, body_poses
from contact_curation.motion.pose_noise import RIG_NOISE
from contact_curation.motion.pose_stream import (
    BadPose,
    PoseRun,
    counted,
    finite,
    reading_state,
    stamped_pose,
    whole,
    whole_or_none,
)
from contact_curation.motion.toss import NANOSECONDS

EVEN = 250_000
"""[ns] Steps of an even stream differ by no more from multiples of its period; ContactNets' differ by up to 0.203 ms."""

UNSTEADY = 85_000
"""[ns] Nor is their root mean square, over the last hundred or so: ContactNets' is 0.044 ms, and never over 0.071 ms."""

MOST_UNSTEADY = float(UNSTEADY) ** 2
"""[ns^2] The same, squared."""

PAUSE = 200_000_000
"""[ns] After a longer step a line is begun anew, with the period that was."""

FARTHEST_BACK = 10_000_000
"""[ns] Stamps that go back by more belong to poses that come out of order."""

LOOK = 16
"""Steps that say whether a stream begins evenly."""

AHEAD, LOCK = 250_000_000, 500_000_000
"""[ns] A line looks so far ahead; so much begins one whose period is not known yet."""

CALM = 64
"""After so many even steps stamps pass again."""

FEWEST, MOST = 9, 1024
"""Frames that a line can go through; so many wait at most, whatever their stamps."""

LEAST_GAIN = 1e-2
"""A line of n frames is moved by the share g = 4 / n, or this, of what stamps are off it; g^2 / 4 moves its step."""

MEMORY = 1e-2
"""Weight of the newest step in the period of an even stream, and in the mean square of what steps are off."""

FASTEST = 1_000_000
"""[ns] No stream has a shorter period: poses that come faster have piled up."""

OTHER_RATE = 0.1
"""A period that differs by a larger share from the one that was is another one."""

LOSS_MEMORY, MOST_LOST = 0.95, 3.0
"""What a missing frame counts after the next one; so many are no missing frames but another rate."""

MORE_EVEN = 0.8
"""Stamps that are off a line by a smaller share than this in the mean, where frames are missing, say that they are."""

TOLD_APART = 4.0 * RIG_NOISE
"""[m] A body that moves less within what steps differ says nothing about its stamps."""

DECIDED, SUREST = -8.0, 64.0
"""Weighed in logarithms, at most 1 a frame: from where on stamps stay as they are; more than the latter is not remembered."""

LEAST_SAID = 1e-5
"""[s] of scatter: of less, which is that of stamps in whole microseconds, nothing is said."""

KEPT = 4096
"""So many last delays tell how much stamps scatter."""

REMEMBERED = 4
"""Last poses, whose third differences weigh their stamps."""


@dataclass(slots=True)
class _Line:
    """Where frames are in time, one by one.

    Attributes:
        origin_ns: a stamp; times count from it.
        time: of the last frame [ns].
        step: to the next [ns].
        frames: that it was made of.
    """

    origin_ns: int
    time: float
    step: float
    frames: int

    def delays(self, poses: Iterable[BodyPose]) -> list[float]:
        """What the stamps of the next frames are off it [ns]."""
        return [one.stamp_ns - self.origin_ns - self.time - self.step * n for n, one in enumerate(poses, start=1)]


class StampEvener:
    """Gives the poses of one body stamps that the motion between them agrees with.

    Args:
        child: the body's frame, for reports.

    Attributes:
        counts: how many stamps were "evened", moved by `LEAST_SAID` or more, and left out since each is not later than the
            last ("stamp").
        rate: at which they were evened last [Hz]; 0 where none were. No part of the state.
    """

    def __init__(self, child: str) -> None:
        self._child = child
        self.counts: Counter[str] = Counter()
        self.rate = 0.0
        self._delays: deque[float] = deque(maxlen=KEPT)
        self._given_ns: int | None = None
        self._held: deque[BodyPose] = deque()
        self._last: deque[BodyPose] = deque(maxlen=REMEMBERED)
        self._line: _Line | None = None
        self._period, self._passing, self._calm = 0.0, False, 0
        self._lost, self._score, self._unsteady = 0.0, 0.0, 0.0

    @property
    def scatter(self) -> float:
        """Standard deviation of the last stamps that were evened [s]; no part of the state. Any thread may ask for it."""
        delays = tuple(self._delays)  # at once: no other thread adds to it meanwhile
        return pstdev(delays) / NANOSECONDS if delays else 0.0

    @property
    def done(self) -> str:
        """What was found in the stamps, and done; nothing where all are as they came."""
        evened = self.counts["evened"]
        if not evened or self.scatter < LEAST_SAID:
            return ""
        even = f"an even {self.rate:.4g} Hz: {evened} poses took even stamps"
        return f"header stamps jitter by {1e3 * self.scatter:.2g} ms (standard deviation) about {even}"

    def push(self, pose: BodyPose) -> list[BodyPose | BadPose]:
        """Takes in the next pose as it came; gives those whose stamps are certain now, in order."""
        step_ns = pose.stamp_ns - self._last[-1].stamp_ns if self._last else PAUSE + 1
        if step_ns == 0 or step_ns < (0 if self._passing else -FARTHEST_BACK):
            return [self._bad(pose.stamp_ns, -step_ns)]
        ended = self._ended() if step_ns > PAUSE else []
        self._remember(pose)
        if self._passing:
            if self._goes_on(step_ns):
                return [*ended, self._given(pose, pose.stamp_ns)]
            self._passing, self._line = False, _Line(pose.stamp_ns - step_ns, 0.0, self._period, round(4.0 / LEAST_GAIN))
            self._calm, self._lost = 0, 0.0
        self._held.append(pose)
        self._weigh()
        if self._line is None:
            return [*ended, *self._begun()]
        self._calm = self._calm + 1 if self._is_even(step_ns) else 0
        return [*ended, *self._followed(self._line)]

    def push_run(self, run: PoseRun) -> Iterator[PoseRun | BodyPose | BadPose]:
        """The same for successive poses: those whose stamps pass as they are come out in runs."""
        at, stamps, poses = 0, run.stamps_ns.tolist(), list[BodyPose]()
        while at < len(stamps):
            stop = self._pass_as_they_are(run, stamps, at)
            if stop > at:
                yield run.part(at, stop)
            if stop < len(stamps):
                poses = poses or body_poses(run)
                yield from self.push(poses[stop])
            at = stop + 1

    def flush(self) -> list[BodyPose | BadPose]:
        """Ends the stream, or what of it belongs together; what comes next is another one."""
        ended = self._ended()
        self._forget()
        self._given_ns = None
        return ended

    def snapshot(self) -> dict[str, Any]:
        """The state as plain numbers, lists and None: JSON keeps it exactly."""
        line = self._line
        return {
            "held": _rows(self._held),
            "last": _rows(self._last),
            "line": None if line is None else [line.origin_ns, line.time, line.step, line.frames],
            "numbers": [self._period, self._passing, self._calm, self._lost, self._score, self._unsteady],
            "given_ns": self._given_ns,
            "counts": dict(self.counts),
        }

    def restore(self, snapshot: Mapping[str, Any]) -> None:
        """Takes up the state of `snapshot`.

        Raises:
            InvalidValueError: it is no such state.
        """
        with reading_state("stamps", snapshot, "StampEvener.snapshot"):
            held, last = (_poses(snapshot[name]) for name in ("held", "last"))
            line = None if snapshot["line"] is None else _line(*snapshot["line"])
            period, passing, calm, lost, score, unsteady = snapshot["numbers"]
            period, lost, score, unsteady = (finite(number) for number in (period, lost, score, unsteady))
            passing, calm = bool(passing), whole(calm)
            given_ns, counts = whole_or_none(snapshot["given_ns"]), counted(snapshot["counts"])
        self._forget()
        self._held.extend(held)
        self._last.extend(last)
        self._line, self._period, self._passing, self._calm = line, period, passing, calm
        self._lost, self._score, self._unsteady, self._given_ns, self.counts = lost, score, unsteady, given_ns, counts

    def _forget(self) -> None:
        """Knows nothing of a stream."""
        self._held.clear()
        self._last.clear()
        self._line = None
        self._period, self._passing, self._calm = 0.0, False, 0
        self._lost, self._score, self._unsteady = 0.0, 0.0, 0.0

    def _is_even(self, step_ns: float) -> bool:
        """Whether the step, and those before it, are what an even stream has."""
        even, self._unsteady = _evenness(step_ns, self._period, self._unsteady)
        return even

    def _goes_on(self, step_ns: int) -> bool:
        """Whether a stream whose stamps pass goes on evenly, or after a pause."""
        if step_ns > PAUSE:
            return True
        if not (step_ns < 1.5 * self._period and self._is_even(step_ns)):
            return False
        self._period += MEMORY * (step_ns - self._period)
        return True

    def _pass_as_they_are(self, run: PoseRun, stamps: list[int], start: int) -> int:
        """Takes in poses from index `start` on, up to the first one whose stamp may not pass as it is; gives its index."""
        if not (self._passing and self._last) or (self._given_ns is not None and stamps[start] <= self._given_ns):
            return start
        stop, last_ns, period, unsteady = start, self._last[-1].stamp_ns, self._period, self._unsteady
        for stamp_ns in islice(stamps, start, None):  # as `_goes_on`, which would take twice as long
            step_ns = stamp_ns - last_ns
            if step_ns > PAUSE:
                self._calm = 0
            else:
                even, next_unsteady = _evenness(step_ns, period, unsteady) if 0 < step_ns < 1.5 * period else (False, unsteady)
                if not even:
                    break
                unsteady, period = next_unsteady, period + MEMORY * (step_ns - period)
            last_ns, stop = stamp_ns, stop + 1
        self._period, self._unsteady = period, unsteady
        for pose in body_poses(run.part(max(start, stop - REMEMBERED), stop)):
            self._remember(pose)
            self._given_ns = pose.stamp_ns
        return stop

    def _holds(self, span_ns: int) -> bool:
        """Whether the poses that wait span so much, and are enough."""
        waiting = len(self._held)
        return waiting > FEWEST and (self._held[-1].stamp_ns - self._held[0].stamp_ns >= span_ns or waiting >= MOST)

    def _begun(self) -> list[BodyPose | BadPose]:
        """Passes a stream that begins evenly, or begins a line."""
        if len(self._held) <= LOOK:
            return []
        if self._begins_evenly():
            return self._pass(self._as_they_are())
        if not self._holds(AHEAD if self._period else LOCK):
            return []
        line = _line_through(self._held, self._period)
        if self._period and abs(line.step / self._period - 1.0) > OTHER_RATE:
            self._period = 0.0  # another rate
            return []
        self._line, self._calm, self._lost = line, 0, 0.0
        return self._followed(line)

    def _begins_evenly(self) -> bool:
        steps = [later.stamp_ns - earlier.stamp_ns for earlier, later in pairwise(self._held)]
        known, self._period = self._period, max(float(median(steps)), FASTEST)
        unsteady, self._unsteady = self._unsteady, 0.0
        if self._period > FASTEST and all(self._is_even(step) for step in steps):
            return True
        self._period, self._unsteady = known, unsteady
        return False

    @property
    def _none_off(self) -> bool:
        """Whether frames were missing before the poses that wait, and no stamp is off."""
        return self._line is not None and not self._line.time and len(self._held) <= self._calm

    def _followed(self, line: _Line) -> list[BodyPose | BadPose]:
        """The poses that enough others have come after; all, where the stream goes on evenly."""
        if self._none_off and (len(self._held) > LOOK or self._holds(AHEAD)):
            return self._pass(self._as_they_are())
        if self._calm >= CALM:
            return self._pass(self._ended())
        given: list[BodyPose | BadPose] = []
        while self._line is not None and self._holds(AHEAD):
            given += self._next(line, ahead=True)
        return given

    def _pass(self, given: list[BodyPose | BadPose]) -> list[BodyPose | BadPose]:
        """From here on stamps pass as they are."""
        self._passing, self._line = True, None
        return given

    def _next(self, line: _Line, *, ahead: bool) -> list[BodyPose | BadPose]:
        """The first of the waiting poses, on the line, which is led by them if they reach far `ahead`; none at another rate."""
        delays = line.delays(self._held)
        off = sorted(delays)[len(delays) // 4]
        if len(delays) >= FEWEST and min(delays) > 0.5 * line.step:
            missing = round(min(delays) / line.step)
            line.time += missing * line.step
            off, self._lost = off - missing * line.step, self._lost + 1.0
        if ahead and (off < -0.5 * line.step or self._lost > MOST_LOST):
            self._line, self._period, self._lost = None, 0.0, 0.0
            return []
        if abs(off) > 0.5 * line.step or not ahead:
            off = 0.0
        self._period = line.step
        self._lost *= LOSS_MEMORY
        gain = max(4.0 / line.frames, LEAST_GAIN)
        line.time += line.step + gain * off
        line.step, line.frames = line.step + 0.25 * gain**2 * off, line.frames + 1
        first = self._held.popleft()
        if self._score < DECIDED:
            return [self._given(first, first.stamp_ns)]
        stamp_ns = line.origin_ns + round(line.time)
        self.counts["evened"] += abs(first.stamp_ns - stamp_ns) >= LEAST_SAID * NANOSECONDS
        self._delays.append(first.stamp_ns - stamp_ns)
        self.rate = NANOSECONDS / line.step
        return [self._given(first, stamp_ns)]

    def _ended(self) -> list[BodyPose | BadPose]:
        """All that wait, as far as is known of them."""
        if self._line is None and len(self._held) >= FEWEST and not self._begins_evenly():
            self._line = _line_through(self._held, self._period)
        given = self._as_they_are() if self._none_off else []
        while self._line is not None and self._held:
            given += self._next(self._line, ahead=False)
        given += self._as_they_are()
        self._line, self._calm = None, 0
        return given

    def _as_they_are(self) -> list[BodyPose | BadPose]:
        given = [self._given(one, one.stamp_ns) for one in self._held]
        self._held.clear()
        return given

    def _given(self, pose: BodyPose, stamp_ns: int) -> BodyPose | BadPose:
        if self._given_ns is not None and stamp_ns <= self._given_ns:
            return self._bad(stamp_ns, self._given_ns - stamp_ns)
        self._given_ns = stamp_ns
        return pose if stamp_ns == pose.stamp_ns else BodyPose(stamp_ns, pose.pose)

    def _bad(self, stamp_ns: int, back_ns: int) -> BadPose:
        self.counts["stamp"] += 1
        return BadPose(stamp_ns, self._child, _bad_stamp(stamp_ns, back_ns), "stamp")

    def _remember(self, pose: BodyPose) -> None:
        if self._last and pose.stamp_ns - self._last[-1].stamp_ns > PAUSE:
            self._last.clear()
        self._last.append(pose)

    def _weigh(self) -> None:
        """Weighs the stamps of the last four poses against even ones, by how far their positions are off a parabola."""
        stamps = [one.stamp_ns - self._last[0].stamp_ns for one in self._last]
        if len(set(stamps)) < 4 or stamps[-1] <= 0:
            return
        mean = stamps[-1] / 3.0
        uneven = max(abs(later - earlier - mean) for earlier, later in pairwise(stamps))
        places = [one.pose.position for one in self._last]
        if dist(places[0], places[-1]) * uneven < TOLD_APART * stamps[-1]:
            return
        own, even = _bent(stamps, places), _bent((0, 1, 2, 3), places)
        if own > 0.0 and even > 0.0:
            weight = self._score + min(max(log(own / even), -1.0), 1.0)
            self._score = min(max(weight, -SUREST), SUREST)


def _evenness(step_ns: float, period: float, unsteady: float) -> tuple[bool, float]:
    """Whether a step, and those before it, are what an even stream has, and how unsteady it is with this one [ns^2]."""
    off = abs(step_ns - max(round(step_ns / period), 1) * period)
    unsteady += MEMORY * (min(off, EVEN) ** 2 - unsteady)
    return off <= EVEN and unsteady <= MOST_UNSTEADY, unsteady


def _bent(times: Sequence[float], places: Sequence[Vector]) -> float:
    """How far four positions are off any parabola over their times, in units in which white noise is itself [m]."""
    weights = [1.0 / prod(time - other for other in times if other != time) for time in times]
    size = sqrt(sum(weight * weight for weight in weights))
    return dist(
        [sum(w * p for w, p in zip(weights, axis, strict=True)) / size for axis in zip(*places, strict=True)], [0.0] * 3
    )


def _line_through(poses: Sequence[BodyPose], period: float) -> _Line:
    """The line through frames up to the one before them, without missing ones or with those that make them more even.

    Args:
        poses: at least `FEWEST`.
        period: that is expected [ns]; 0 where nothing is.
    """
    origin_ns = poses[0].stamp_ns
    stamps = [one.stamp_ns - origin_ns for one in poses]
    frames, last = list(range(len(stamps))), len(stamps) - 1
    steps = [period] if period else [stamps[-1] / (last + missing) for missing in range(1, round(MOST_LOST) + 1)]
    counted = [found for step in steps if 0 < (found := _with_missing(stamps, max(step, FASTEST)))[-1] - last <= MOST_LOST]
    whole_line, *lines = [_resistant(stamps, numbers, period) for numbers in (frames, *counted)]
    best = min(lines, default=whole_line)
    _, before, step = best if best[0] < MORE_EVEN * whole_line[0] else whole_line
    return _Line(origin_ns, before, step, len(stamps))


def _with_missing(stamps: Sequence[int], step: float) -> list[int]:
    """Numbers of the frames, where so many are missing that all later ones are late by whole steps."""
    late = [stamp - step * n for n, stamp in enumerate(stamps)]
    least = list(accumulate(reversed(late), min))[::-1]  # of it and all later ones
    surest = len(late) - FEWEST
    return [n + round((least[min(n, surest)] - least[0]) / step) for n in range(len(late))]


def _resistant(stamps: Sequence[int], frames: Sequence[int], period: float) -> tuple[float, float, float]:
    """Tukey's resistant line, with quartiles: how far stamps are off it in the mean, where it begins, and its step [ns]."""
    step = period or stamps[-1] / frames[-1]
    third = len(stamps) // 3
    for _ in range(4):
        off = [stamp - step * n for n, stamp in zip(frames, stamps, strict=True)]
        first, last = (sorted(part)[third // 4] for part in (off[:third], off[-third:]))
        step = max(step + (last - first) / (frames[-1] + 1 - third), FASTEST)
    off = sorted(stamp - step * n for n, stamp in zip(frames, stamps, strict=True))
    quartile = off[len(off) // 4]
    return fmean(abs(one - quartile) for one in off), quartile - step, step


def _bad_stamp(stamp_ns: int, back_ns: int) -> str:
    """What is wrong with a stamp that is not later than the one before, and what to do."""
    if stamp_ns == 0 and back_ns == 0:
        return "stamp: found header stamps of 0, expected the time of each pose: fill header.stamp"
    if back_ns == 0:
        return "stamp: found the same one twice, expected a later one: is the topic published twice, or by a coarse clock?"
    return f"stamp: found one that goes back by {back_ns / NANOSECONDS:.6f} s, expected a later one"


def _rows(poses: Iterable[BodyPose]) -> list[list[float]]:
    return [[one.stamp_ns, *one.pose.position, *one.pose.orientation_wxyz] for one in poses]


def _poses(rows: Iterable[Any]) -> list[BodyPose]:
    found = [stamped_pose(row) for row in rows]
    return [BodyPose(stamp_ns, ScalarPose(position, orientation)) for stamp_ns, position, orientation in found]


def _line(origin_ns: Any, time: Any, step: Any, frames: Any) -> _Line:
    return _Line(whole(origin_ns), finite(time), finite(step), whole(frames))
