"""Cuts a pose stream into tosses, pose by pose, from release to rest.

    start   free fall over the board in two successive frames, every corner off the board
    end     nine successive displacements too small to see, the body flat on a face
    caught  in the air for as long as separates two motions, and not falling meanwhile
    none    set for a noisy tracker: what does not go on falling
    reject  too short, never touching the board, deep in it, pushed while in the air, or with a frame missing

Velocities look one frame ahead, so a toss comes out one frame after its last. A missing frame is a gap: nothing is interpolated
over it. Where stamps were closed up over lost frames (`closed_up`), a motion that is cut out gets those periods back that its
flights give away. One class serves live streams and recordings, and its state can be written down and taken up again.
"""

from bisect import bisect_left
from collections.abc import Mapping, Sequence
from itertools import pairwise
from math import dist, inf, nan
from typing import Any, NamedTuple

import numpy as np

from contact_curation.errors import InvalidValueError
from contact_curation.geometry.scalars import IDENTITY, Quaternion, ScalarPose, Vector, compose
from contact_curation.motion.calibration import NO_CORRECTION, CornerHeights, RigCalibration
from contact_curation.motion.pose_noise import TrackerScale
from contact_curation.motion.pose_stream import PoseRun, finite, reading_state, stamped_pose, whole, whole_or_none
from contact_curation.motion.scales import TossedBody, scale_of
from contact_curation.motion.segmenter_config import SegmenterConfig
from contact_curation.motion.smoothing import noise_growth
from contact_curation.motion.survey.lost_frames import lost_frames
from contact_curation.motion.toss import NANOSECONDS, Rejected, Toss
from contact_curation.motion.toss_rules import (
    MEMORY,
    WIDEST_STRIDE,
    FallDetector,
    Frame,
    Motion,
    cut,
    may_fall,
    reasons_against,
    stride_at,
)

DOUBTFUL = 1.2
"""Times the noise of ContactNets' rig, that of accelerations by rate counted in: from there on it may look like free fall."""

CONFIRMED, FALLING = 0.1, 0.85
"""Where noise may look like free fall a toss is none unless it falls over so long a time [s] by that share of gravity."""

HELD, LOOKED_AFTER, HALVES = 0.5, 16, 5
"""A body that falls by less than that share of gravity is held; it is looked at after every so many frames of a motion, over at
least so many of them, whose halves have three."""

KEPT = MEMORY * WIDEST_STRIDE
"""Frames that are remembered while there is no toss."""

STEPS = 15
"""So many last stamp differences give a stream's frame period."""


class AtRate(NamedTuple):
    """What the rules are at a frame period.

    Attributes:
        period: frame period [s].
        stride: free fall is looked for in every so many frames.
        frames_at_rest: number of successive displacements of a body at rest.
        fall_tolerances: of `SegmenterBounds.fall_tolerances` [m/s^2].
        doubtful: whether noise may look like free fall.
    """

    period: float
    stride: int
    frames_at_rest: int
    fall_tolerances: tuple[float, float]
    doubtful: bool


class Eventful(NamedTuple):
    """Poses of a run by index, ascending, that may change more than what a segmenter remembers; the others cannot.

    Attributes:
        idle: while there is no toss.
        tossing: during a toss, as long as the newest displacement was none of a body at rest.
        unconfirmed: so many frames of a toss are eventful: noise may have begun it.
    """

    idle: list[int]
    tossing: list[int]
    unconfirmed: int


SURELY = 1e-9
"""Share by which a number is over or under a bound beyond rounding."""


class TossSegmenter:
    """Cuts one body's poses into tosses.

    Args:
        config: the rules.
        body: what is tossed.
        source: where the poses come from; part of the toss ids.
        rig: what tracked: heights count from its board, and motions are judged as it corrects them, but come out as recorded.
        tracked: the frame that was tracked, in the body's about its centre of mass.
    """

    def __init__(
        self,
        config: SegmenterConfig,
        body: TossedBody,
        *,
        source: str,
        rig: RigCalibration = NO_CORRECTION,
        tracked: ScalarPose = IDENTITY,
    ) -> None:
        self.config = config
        self._rig = rig
        self._tracked = tracked
        self._body_scale = scale_of(body)
        self._take_bounds(config.tracker)
        self.body = body.name
        self.source = source
        self._polytope = body.polytope
        self._heights = CornerHeights(self._polytope.vertices, rig)
        self._run: list[Frame] = []
        self._fall = FallDetector()
        self._steps_ns: list[int] = []
        self._start: int | None = None
        self._still = 0
        self._moved_ns: int | None = None
        self._outside = False

    @property
    def tossing(self) -> bool:
        """Whether a toss has started and not ended yet."""
        return self._start is not None

    def expected(self) -> Toss | None:
        """The toss that the next frame completes, but for its last velocities; None while none is about to end."""
        if self._start is None or self._still < self._frames_at_rest:
            return None
        return self._so_far()

    def nearing_end(self) -> Toss | None:
        """The toss so far, at the frame where the body has rested for half the time that ends a toss; else None."""
        if self._start is None or self._still != self._frames_at_rest // 2:
            return None
        return self._so_far()

    def _so_far(self) -> Toss | None:
        """The toss up to the newest frame, whose velocities are not final; None where frames may have to be opened up."""
        if self.config.closed_up:
            return None
        return cut(self._run, self._motion_start, len(self._run), self.body, self.source, self.config).toss

    def use(self, tracker: TrackerScale) -> tuple[Toss | Rejected, ...]:
        """Takes the bounds for so noisy a tracker, and looks again at the motion in progress: noise alone may have begun it.

        Returns:
            What ended.
        """
        run, self._outside = self._run, self._outside or self.tossing
        self._take_bounds(tracker)
        self._run, self._fall, self._start, self._still = [], FallDetector(), None, 0
        return tuple(ended for frame in run for ended in self.push(*frame))

    def push(self, stamp_ns: int, position: Vector, orientation_wxyz: Quaternion) -> tuple[Toss | Rejected, ...]:
        """Takes in the next pose.

        Args:
            stamp_ns: header stamp, later than the last.
            position: of the body in the board's frame [m]; finite.
            orientation_wxyz: body to board, of unit norm (`pose_stream.checked_pose`).

        Returns:
            What ended with this pose.

        Raises:
            InvalidValueError: the stamp is not later than the last.
        """
        closed = self._closed_by_gap(stamp_ns)
        self._run.append(Frame(stamp_ns, position, orientation_wxyz))
        self._fall.push(stamp_ns, position[2])
        if self._start is None:
            self._look_for_start()
            return closed
        return self._look_for_end()

    def push_run(self, run: PoseRun) -> tuple[Toss | Rejected, ...]:
        """The same as `push` of each pose: those that can begin and end nothing are only remembered.

        Raises:
            InvalidValueError: a stamp is not later than the last.
        """
        frames, ended, at = list(map(Frame._make, run.one_by_one())), list[Toss | Rejected](), 0
        eventful: Eventful | None = None
        while at < len(frames):
            if len(self._run) >= KEPT and len(self._steps_ns) == STEPS:
                eventful = eventful or self._eventful(run, at)
                stop = self._uneventful_until(eventful, at, len(frames))
                if stop > at:
                    self._remember(frames[at:stop])
                    at = stop
                    continue
            ended += self.push(*frames[at])
            at += 1
        return tuple(ended)

    def reset(self, why: str) -> tuple[Toss | Rejected, ...]:
        """Ends the run of frames, e.g. because the clock jumped back; a toss that is not at rest yet is rejected for `why`."""
        ended = self._close(why)
        self._steps_ns, self._moved_ns, self._outside = [], None, False
        return ended

    def flush(self) -> tuple[Toss | Rejected, ...]:
        """Ends the stream."""
        return self.reset("end: found the end of the stream, expected the body at rest")

    def snapshot(self) -> dict[str, Any]:
        """The state as plain numbers, lists and None: JSON keeps it exactly."""
        return {
            "run": [[frame.stamp_ns, *frame.position, *frame.orientation_wxyz] for frame in self._run],
            "steps_ns": list(self._steps_ns),
            "start": self._start,
            "still": self._still,
            "moved_ns": self._moved_ns,
            "outside": self._outside,
            "tracker": [self.tracker.position, self.tracker.turn],
        }

    def restore(self, snapshot: Mapping[str, Any]) -> None:
        """Takes up the state of `snapshot`, which a segmenter of the same configuration gave.

        Raises:
            InvalidValueError: it is no such state.
        """
        with reading_state("segmenter", snapshot, "TossSegmenter.snapshot"):
            run = [Frame(*stamped_pose(row)) for row in snapshot["run"]]
            steps_ns, start = [whole(step_ns) for step_ns in snapshot["steps_ns"]], whole_or_none(snapshot["start"])
            still, moved_ns, outside = whole(snapshot["still"]), whole_or_none(snapshot["moved_ns"]), bool(snapshot["outside"])
            position, turn = snapshot.get("tracker", (self.tracker.position, self.tracker.turn))  # older states have none
            tracker = TrackerScale(finite(position), finite(turn))
            if start is not None and not 0 <= start < len(run):
                raise ValueError(f"start {start} of {len(run)} frames")
        self._run, self._steps_ns, self._start, self._still = run, steps_ns, start, still
        self._moved_ns, self._outside = moved_ns, outside
        self._take_bounds(tracker)
        self._fall = _detector_after(run)

    def _eventful(self, run: PoseRun, first: int) -> Eventful:
        """Which poses of a run, from index `first` on, may be eventful, whatever happens before; gaps are."""
        before = self._run[-KEPT:]
        stamps = np.append([frame.stamp_ns for frame in before], run.stamps_ns[first:])
        positions = np.concatenate([[frame.position for frame in before], run.positions[first:]])
        steps = np.append(self._steps_ns, np.diff(stamps[KEPT - 1 :]))
        periods = np.sort(np.lib.stride_tricks.sliding_window_view(steps, STEPS), axis=1)[:, (STEPS - 1) // 2] / NANOSECONDS
        if self.config.frame_period is not None:
            periods[:] = self.config.frame_period
        shortest, steps = float(periods.min()) or 1.0 / NANOSECONDS, steps[STEPS:]
        gaps = (steps <= 0) | (steps > (1.0 - SURELY) * self.config.largest_gap * NANOSECONDS * periods[:-1])
        falls, strides = (
            np.zeros(len(gaps), dtype=bool),
            {one: stride_at(one) for one in np.unique(periods).tolist() if one > 0.0},
        )
        for stride in set(strides.values()):
            tolerances, behind = self._bounds.fall_tolerances(stride * shortest), KEPT - MEMORY * stride
            falls |= may_fall(stamps[behind:], positions[behind:, 2], self._bounds.gravity, *tolerances, stride)
        moved = np.square(np.diff(positions[KEPT - 1 :], axis=0)).sum(axis=1)
        rests = moved <= (1.0 + SURELY) * self._bounds.rest_displacement**2
        noisiest = min((period * stride for period, stride in strides.items()), default=shortest)
        doubtful = self._bounds.acceleration_noise(noisiest) > (1.0 - SURELY) * DOUBTFUL
        unconfirmed = 2 * max(round(0.5 * CONFIRMED / shortest), 1) + 1 if doubtful else 0
        idle, tossing = (np.flatnonzero(gaps | some) + first for some in (falls, rests))
        return Eventful(idle.tolist(), tossing.tolist(), unconfirmed)

    def _uneventful_until(self, eventful: Eventful, at: int, end: int) -> int:
        """Index of the next pose that may be eventful; `at` or less if it is that one."""
        places = eventful.idle if self._start is None else eventful.tossing
        place = bisect_left(places, at)
        stop = places[place] if place < len(places) else end
        if self._start is None:
            return stop
        frames = len(self._run) - self._start
        if self._still or frames < eventful.unconfirmed:
            return at
        return min(stop, at + self.config.most_frames - frames, at + LOOKED_AFTER - 1 - frames % LOOKED_AFTER)

    def _remember(self, frames: Sequence[Frame]) -> None:
        """Takes in frames that are not eventful."""
        stamps = [frame.stamp_ns for frame in (self._run[-1], *frames)]
        self._steps_ns = [*self._steps_ns, *(later - earlier for earlier, later in pairwise(stamps))][-STEPS:]
        self._run += frames
        if self._start is None:
            if self.config.bounded and not self._outside:
                self._outside = not all(self.config.over_board(*frame.position[:2]) for frame in frames)
            del self._run[:-KEPT]
        self._fall = _detector_after(self._run)

    def _take_bounds(self, tracker: TrackerScale) -> None:
        self.tracker, self._bounds = tracker, self.config.bounds(self._body_scale, tracker)
        self._at_rate = AtRate(nan, 1, 0, (0.0, 0.0), doubtful=False)  # of no rate yet

    def _closed_by_gap(self, stamp_ns: int) -> tuple[Toss | Rejected, ...]:
        """Ends the run where a frame is missing before `stamp_ns`."""
        if not self._run:
            return ()
        step_ns = stamp_ns - self._run[-1].stamp_ns
        if step_ns <= 0:
            raise InvalidValueError("stamp of a pose", f"{stamp_ns} ns", f"one after {self._run[-1].stamp_ns} ns")
        largest_ns = self.config.largest_gap * self._period_ns(step_ns)
        self._steps_ns = [*self._steps_ns[1 - STEPS :], step_ns]
        if step_ns <= largest_ns:
            return ()
        frame = len(self._run) - (self._start or 0)
        return self._close(
            f"gap: found {step_ns / NANOSECONDS:.4g} s before frame {frame}, expected at most {largest_ns / NANOSECONDS:.4g} s"
        )

    def _period_ns(self, step_ns: int) -> float:
        """The frame period as configured, or as the steps before `step_ns` say."""
        if self.config.frame_period is not None:
            return self.config.frame_period * NANOSECONDS
        if not self._steps_ns:
            return step_ns
        return sorted(self._steps_ns)[(len(self._steps_ns) - 1) // 2]

    @property
    def _period(self) -> float:
        """The frame period, as far as it is known [s]."""
        return self._period_ns(self._run[-1].stamp_ns - self._run[-2].stamp_ns) / NANOSECONDS

    @property
    def _rules(self) -> AtRate:
        """The rules at the frame period so far."""
        period = self._period
        if period != self._at_rate.period:
            still = round(self.config.rest_frames * noise_growth(period))
            stride = stride_at(period)
            doubtful = self._bounds.acceleration_noise(stride * period) > DOUBTFUL
            self._at_rate = AtRate(period, stride, still, self._bounds.fall_tolerances(stride * period), doubtful=doubtful)
        return self._at_rate

    @property
    def _frames_at_rest(self) -> int:
        """Over so many a body is at rest: as long, in time, as at the rate that the rules are made for."""
        return self._rules.frames_at_rest

    def _look_for_start(self) -> None:
        """Starts a toss at the frame two strides back, whose acceleration and that a stride later are known by now."""
        del self._run[:-KEPT]
        config, bounds = self.config, self._bounds
        if config.bounded and not config.over_board(*self._run[-1].position[:2]):
            self._outside = True
        if len(self._run) < 3:
            return
        stride = self._rules.stride
        fall = self._fall if stride == 1 else _detector_after(self._run, stride)
        if len(self._run) <= 2 * stride or not fall.falls(bounds.gravity, *self._rules.fall_tolerances):
            return
        first, second = self._run[-1 - 2 * stride], self._run[-1 - stride]
        settled = self._moved_ns is None or first.stamp_ns - self._moved_ns >= bounds.settle_time * NANOSECONDS
        if not settled:  # still the motion before: it bounces, or goes on after a gap
            if not self._rules.doubtful or _acceleration(self._run) < -HELD * bounds.gravity:
                self._moved_ns = first.stamp_ns
        elif self._may_start(first, second):
            self._start, self._still, self._outside = len(self._run) - 1 - 2 * stride, 0, False
            for before, after in pairwise(self._run[self._start :]):
                self._count_still(before, after)

    def _may_start(self, first: Frame, second: Frame) -> bool:
        config = self.config
        return (
            config.over_board(*first.position[:2])
            and (self._outside or not config.bounded)
            and min(self._corner_heights(first)) > self._bounds.release_clearance
            and min(self._corner_heights(second)) > self._bounds.release_clearance
        )

    def _look_for_end(self) -> tuple[Toss | Rejected, ...]:
        """Ends a toss at the frame before the last when it came to rest there, gives it up, or finds that it was none."""
        if self._was_no_fall():
            self._start, self._still = None, 0
            return ()
        frames_at_rest = self._frames_at_rest
        if self._still >= frames_at_rest:
            return (self._ended(len(self._run) - 1),)
        self._count_still(self._run[-2], self._run[-1])
        frames = len(self._run) - self._motion_start
        if frames > self.config.most_frames and self._still < frames_at_rest:
            return (self._given_up(f"frames: found {frames} without rest, expected rest within {self.config.most_frames}"),)
        if frames % LOOKED_AFTER == 0 and self._still < frames_at_rest and self._is_held():
            held = f"{self._bounds.settle_time:.2g} s in the air"
            caught = self._given_up(f"caught: found the body held for {held}, expected rest on the board")
            self._moved_ns = None  # for so long nothing fell: the next fall is another motion
            return (caught,)
        return ()

    def _is_held(self) -> bool:
        """Whether the body has been in the air for the time that separates two motions, and has not fallen meanwhile.

        In neither half of it: slow trackers miss impacts, and over one a body that falls seems to be held.
        """
        newest_ns, airborne = self._run[-1].stamp_ns, list[Frame]()
        for frame in self._run[: self._motion_start : -1]:
            if min(self._corner_heights(frame)) <= self._bounds.airborne_clearance:
                return False
            airborne.append(frame)
            if len(airborne) >= HALVES and newest_ns - frame.stamp_ns >= self._bounds.settle_time * NANOSECONDS:
                middle, highest = len(airborne) // 2, -HELD * self._bounds.gravity
                later, earlier = airborne[middle::-1], airborne[: middle - 1 : -1]
                return min(_acceleration(later), _acceleration(earlier)) > highest
        return False

    def _was_no_fall(self) -> bool:
        """Whether a toss that noise began turns out to be held: it comes to rest in the air, or does not go on falling.

        The latter is looked at once, over its first `CONFIRMED`, if it is in the air for all of it.
        """
        rules = self._rules
        if not rules.doubtful:
            return False
        half = max(round(0.5 * CONFIRMED / rules.period), 1)
        resting = self._still >= rules.frames_at_rest
        if not (resting or len(self._run) - self._motion_start == 2 * half + 1):
            return False
        seen = self._run[self._motion_start :]
        if min(min(self._corner_heights(frame)) for frame in seen) <= self._bounds.airborne_clearance:
            return False
        return resting or _acceleration(seen) > -FALLING * self._bounds.gravity

    def _count_still(self, before: Frame, after: Frame) -> None:
        """Counts the successive displacements, up to the newest, of a body at rest.

        One may be as long as the tracker's noise makes it; together they lead nowhere that those of a quiet body may not.
        """
        (a, b, c), (x, y, z) = before.position, after.position
        moved = sum(((x - a) * (x - a), (y - b) * (y - b), (z - c) * (z - c)))
        still = moved <= self._bounds.rest_displacement**2 and self._is_low(after) and self._is_flat(after)
        self._still = self._still + 1 if still else 0
        if not still:
            return
        frames = self._frames_at_rest
        if self._still >= frames < len(self._run):
            first, *others = self._run[-1 - frames :]
            if max(dist(first.position, other.position) for other in others) > self._bounds.rest_travel:
                self._still = frames - 1

    def _is_low(self, frame: Frame) -> bool:
        """Whether the tracked frame is under `rest_height`."""
        highest = self.config.rest_height
        if highest == inf:
            return True
        return compose(ScalarPose(frame.position, frame.orientation_wxyz), self._tracked).position[2] < highest

    def _is_flat(self, frame: Frame) -> bool:
        heights = sorted(self._corner_heights(frame))
        return heights[2] - heights[0] <= self._bounds.flat_tolerance

    def _corner_heights(self, frame: Frame) -> list[float]:
        return self._heights(frame.position, frame.orientation_wxyz)

    def _close(self, why: str) -> tuple[Toss | Rejected, ...]:
        """Ends the run; its toss is complete if it rests, else rejected."""
        ended: tuple[Toss | Rejected, ...] = ()
        if self._start is not None:
            resting = self._still >= self._frames_at_rest
            ended = (self._ended(len(self._run)) if resting else self._given_up(why),)
        self._run, self._fall = [], FallDetector()
        return ended

    def _ended(self, stop: int) -> Toss | Rejected:
        motion = self._cut(stop)
        reasons = reasons_against(motion, self._polytope, self._bounds, self._rig)
        return Rejected(motion.toss, reasons) if reasons else motion.toss

    def _given_up(self, why: str) -> Rejected:
        return Rejected(self._cut(len(self._run)).toss, (why,))

    @property
    def _motion_start(self) -> int:
        return self._start or 0

    def _cut(self, stop: int) -> Motion:
        """The motion up to frame `stop`; the run goes on without it."""
        run = self._reopened(stop) if self.config.closed_up else self._run
        motion = cut(run, self._motion_start, stop, self.body, self.source, self.config)
        self._moved_ns = self._run[stop - 1].stamp_ns
        self._start, self._still = None, 0
        return motion

    def _reopened(self, stop: int) -> list[Frame]:
        """The run, from the motion on with the periods that were closed up."""
        first = self._motion_start
        moving = self._run[first:stop]
        positions, orientations = (np.array([getattr(frame, name) for frame in moving]) for name in Frame._fields[1:])
        lost = lost_frames(positions, orientations, self._period, self._bounds.reach, self._bounds.gravity)
        later = np.rint(np.cumsum(np.append(0, lost)) * self._period * NANOSECONDS).astype(int).tolist()
        later += [later[-1]] * (len(self._run) - stop)
        reopened = [frame._replace(stamp_ns=frame.stamp_ns + by) for frame, by in zip(self._run[first:], later, strict=True)]
        return self._run[:first] + reopened


def _acceleration(frames: Sequence[Frame]) -> float:
    """Vertical, by the first, the middle and the last frame [m/s^2]."""
    first, middle, last = frames[0], frames[len(frames) // 2], frames[-1]
    rises = [(b.position[2] - a.position[2]) / (b.stamp_ns - a.stamp_ns) for a, b in ((first, middle), (middle, last))]
    return 2.0 * (rises[1] - rises[0]) / (last.stamp_ns - first.stamp_ns) * NANOSECONDS**2


def _detector_after(run: Sequence[Frame], stride: int = 1) -> FallDetector:
    """The detector that has seen every `stride`-th frame of a run, the last one too."""
    fall = FallDetector()
    for frame in run[-1 : -1 - MEMORY * stride : -stride][::-1]:
        fall.push(frame.stamp_ns, frame.position[2])
    return fall
