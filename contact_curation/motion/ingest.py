"""Turns measured poses into tosses that may be scored: track, even stamps, segment, calibrate, check."""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from contact_curation.geometry.scalars import inverse, vector
from contact_curation.motion.body_tracker import BodyPose, BodyTracker, ClockJump, TrackerConfig, TrackerEvent, body_poses
from contact_curation.motion.calibration import NO_CORRECTION, RigCalibration, apply_calibration
from contact_curation.motion.even_stamps import StampEvener
from contact_curation.motion.gate_config import GateConfig
from contact_curation.motion.gates import inspect
from contact_curation.motion.pose_noise import RIG, PoseNoise, TrackerScale, scattering, spans_of
from contact_curation.motion.pose_stream import BadPose, FramePose, FrameRun, PoseRun, counted, reading_state, whole_or_none
from contact_curation.motion.scales import TossedBody
from contact_curation.motion.segmenter import TossSegmenter
from contact_curation.motion.segmenter_config import SegmenterConfig
from contact_curation.motion.survey.lost_frames import MOST
from contact_curation.motion.toss import NANOSECONDS, Rejected, Toss

IngestEvent = Toss | Rejected | BadPose


@dataclass(frozen=True)
class IngestConfig:
    """The stages' configurations.

    Attributes:
        tracker: frames.
        segmenter: when a motion is a toss.
        gates: what a toss must pass.
        rig: what tracked; its marker is applied to poses, so that velocities are those of the centre of mass, its board and
            length scale to motions once they are cut, since rules of cutting may be a recording's own. The centre of mass is
            described in metres, and is moved to in the length of the poses.
    """

    tracker: TrackerConfig
    segmenter: SegmenterConfig = field(default_factory=SegmenterConfig)
    gates: GateConfig = field(default_factory=GateConfig)
    rig: RigCalibration = NO_CORRECTION


class TossIngest:
    """Turns the measurements of one body into tosses; the one thing that live nodes and readers of recordings share.

    Args:
        config: of the stages.
        body: what is tossed.
        source: where the poses come from, e.g. a topic; part of the toss ids.
        placed: hears every pose on the board, in order; nobody by default.
        complete: hears every toss before the gates have judged it; nobody by default.

    Attributes:
        counts: how often what happened: "poses", "tosses", "rejected", stamps that were "evened", and kinds of bad poses.
        noise: how much the poses scatter.
    """

    def __init__(
        self,
        config: IngestConfig,
        body: TossedBody,
        *,
        source: str,
        placed: Callable[[BodyPose], None] | None = None,
        complete: Callable[[Toss], None] = lambda toss: None,
    ) -> None:
        self.config = config
        self._placed = placed
        self._complete = complete
        self._body = body
        self._rig = config.rig.without_marker
        in_poses = vector(place / config.rig.scale for place in config.tracker.center_of_mass)
        self._tracker = BodyTracker(replace(config.tracker, center_of_mass=in_poses), config.rig.marker)
        self._stamps = StampEvener(config.tracker.body_frame)
        tracked = inverse(self._tracker.center)
        self._segmenter = TossSegmenter(config.segmenter, body, source=source, rig=self._rig, tracked=tracked)
        self._outcomes: Counter[str] = Counter()
        self.noise = PoseNoise()
        self._first_ns: int | None = None
        self._noisy_ns: int | None = None
        reopened = MOST + 1.5 if config.segmenter.closed_up else 0.0  # gaps of which the segmenter knows none
        largest_gap = max(config.gates.largest_gap, config.segmenter.largest_gap, reopened)
        self._gates = replace(config.gates, largest_gap=largest_gap)

    @property
    def counts(self) -> Counter[str]:
        """How many poses, tosses and faults there were, by name. May be asked for by another thread."""
        parts = (self._tracker.counts, self._stamps.counts, self._outcomes)
        counts = sum((one.copy() for one in parts), Counter[str]())  # each at once, while another thread counts
        counts["poses"] -= self._stamps.counts["stamp"]
        return +counts

    def noise_warning(self) -> str:
        """One line where the poses are much noisier than the segmenter expects; else nothing."""
        return self.noise.warning(self.tracker.position)

    @property
    def tracker(self) -> TrackerScale:
        """How noisy a tracker the bounds are for."""
        return self._segmenter.tracker

    @property
    def noise_done(self) -> str:
        """For how much measured noise the bounds are, one line; nothing where they are those for ContactNets' rig."""
        tracker = self.tracker
        if self.config.segmenter.tracker_noise is not None or tracker == RIG:
            return ""
        noise = f"{tracker.position:.2g} times the noise of ContactNets' rig ({tracker.turn:.2g} times that of orientations)"
        since = f"from {(self._noisy_ns or 0) / NANOSECONDS:.1f} s after the first pose on"
        bounds = f"the bounds of segmenting and quality checks are those for {noise}"
        return f"{scattering(self.noise.multiple)}: {since} {bounds}; segmenter.tracker_noise sets it for all poses"

    @property
    def stamps_done(self) -> str:
        """What was done to the stamps, one line; nothing where all are as they came."""
        return self._stamps.done

    @property
    def tossing(self) -> bool:
        """Whether a toss has started and not ended yet."""
        return self._segmenter.tossing

    def expected(self) -> Toss | None:
        """The toss that the next pose completes, but for its last velocities and the gates; None while none is about to end."""
        return self._calibrated(self._segmenter.expected())

    def nearing_end(self) -> Toss | None:
        """The toss so far, once, when the body has rested for half the time that ends a toss; else None."""
        return self._calibrated(self._segmenter.nearing_end())

    def _calibrated(self, toss: Toss | None) -> Toss | None:
        return None if toss is None else apply_calibration(toss, self._rig)

    @property
    def needed_frames(self) -> frozenset[str]:
        """Frames whose moving poses may change a pose of the body."""
        return self._tracker.needed_frames

    @property
    def size(self) -> int:
        """Poses of the rig in a `snapshot`: most of it where an arm moves."""
        return self._tracker.size

    def push(self, measured: FramePose | BadPose) -> tuple[IngestEvent, ...]:
        """Takes in a measurement of the body or the rig; gives what became complete, in order."""
        return tuple(self._followed(self._tracker.push(measured)))

    def push_run(self, measured: FrameRun) -> tuple[IngestEvent, ...]:
        """The same as `push` of each of its poses: what is certain of many poses at once is done with arrays."""
        placed = self._tracker.push_run(measured) if self._placed is None else None
        if placed is None:
            return tuple(event for one in measured.frame_poses() for event in self.push(one))
        events: list[IngestEvent] = []
        for given in self._stamps.push_run(placed):
            events += self._segmented_run(given) if isinstance(given, PoseRun) else self._segmented((given,))
        return tuple(events)

    def flush(self) -> tuple[IngestEvent, ...]:
        """Ends the stream; a toss that is not at rest is rejected."""
        ended = [*self._followed(self._tracker.flush()), *self._segmented(self._stamps.flush())]
        return (*ended, *self._judged(self._segmenter.flush()))

    def snapshot(self) -> dict[str, Any]:
        """The state as plain numbers, lists and names: JSON keeps it exactly."""
        return {
            "tracker": self._tracker.snapshot(),
            "stamps": self._stamps.snapshot(),
            "segmenter": self._segmenter.snapshot(),
            "outcomes": dict(self._outcomes),
            "noise": self.noise.snapshot() | {"first_ns": self._first_ns, "noisy_ns": self._noisy_ns},
        }

    def restore(self, snapshot: Mapping[str, Any]) -> None:
        """Takes up the state of `snapshot`, which an ingest of the same configuration gave.

        Raises:
            InvalidValueError: it is no such state.
        """
        with reading_state("ingest", snapshot, "TossIngest.snapshot"):
            tracker, segmenter, outcomes = snapshot["tracker"], snapshot["segmenter"], counted(snapshot["outcomes"])
            stamps, noise = snapshot.get("stamps"), snapshot.get("noise")  # states of before there was one go on without
            since = None if noise is None else (whole_or_none(noise["first_ns"]), whole_or_none(noise["noisy_ns"]))
        self._tracker.restore(tracker)
        if stamps is not None:
            self._stamps.restore(stamps)
        if noise is not None and since is not None:
            self.noise.restore(noise)
            self._first_ns, self._noisy_ns = since
        self._segmenter.restore(segmenter)
        self._outcomes = outcomes

    def _followed(self, events: Iterable[TrackerEvent]) -> list[IngestEvent]:
        """What the segmenter makes of the tracker's events."""
        followed: list[IngestEvent] = []
        for event in events:
            if isinstance(event, BodyPose):
                followed += self._segmented(self._stamps.push(event))
            elif isinstance(event, ClockJump):
                followed += self._segmented(self._stamps.flush())
                self.noise.reset()
                why = f"clock: found a jump back by {event.back:.3f} s, expected stamps that go on"
                followed += self._judged(self._segmenter.reset(why))
            else:
                followed.append(event)
        return followed

    def _segmented(self, poses: Iterable[BodyPose | BadPose]) -> list[IngestEvent]:
        """What the segmenter makes of poses whose stamps go on."""
        ended: list[IngestEvent] = []
        for pose in poses:
            if isinstance(pose, BadPose):
                ended.append(pose)
                continue
            if self._placed is not None:
                self._placed(pose)
            self.noise.push(pose.stamp_ns, pose.pose.position, pose.pose.orientation_wxyz)
            if motions := self._noise_followed(pose.stamp_ns):
                ended += self._judged(motions)
            if motions := self._segmenter.push(pose.stamp_ns, pose.pose.position, pose.pose.orientation_wxyz):
                ended += self._judged(motions)
        return ended

    def _segmented_run(self, run: PoseRun) -> list[IngestEvent]:
        """The same for a run, cut where the measured noise changes the segmenter's bounds."""
        ended: list[IngestEvent] = []
        self._first_ns = int(run.stamps_ns[0]) if self._first_ns is None else self._first_ns
        while len(run):
            if self.config.segmenter.tracker_noise is None and self.noise.scale != self._segmenter.tracker:
                taken = len(spans_of(run)[0])  # the bounds follow when the motion in progress ends
                ended += self._segmented(body_poses(run.part(0, taken)))
            else:
                known = self.noise.scale
                taken = self.noise.push_run(run)
                steady = taken if self.noise.scale == known else taken - 1
                ended += self._judged(self._segmenter.push_run(run.part(0, steady)))
                if steady < taken:
                    ended += self._judged(self._noise_followed(int(run.stamps_ns[steady])))
                    ended += self._judged(self._segmenter.push_run(run.part(steady, taken)))
            run = run.part(taken, len(run))
        return ended

    def _noise_followed(self, stamp_ns: int) -> tuple[Toss | Rejected, ...]:
        """Takes the bounds for the measured noise, where the user has said nothing; within a motion only wider ones."""
        self._first_ns = stamp_ns if self._first_ns is None else self._first_ns
        measured, taken = self.noise.scale, self._segmenter.tracker
        if measured is taken or measured == taken or self.config.segmenter.tracker_noise is not None:
            return ()
        if self._segmenter.tossing and measured.position <= taken.position and measured.turn <= taken.turn:
            return ()
        if self._noisy_ns is None:
            self._noisy_ns = stamp_ns - self._first_ns
        return self._segmenter.use(measured)

    def _judged(self, motions: Iterable[Toss | Rejected]) -> Iterator[Toss | Rejected]:
        """Motions, counted and calibrated, tosses after the gates."""
        for motion in motions:
            if isinstance(motion, Rejected):
                toss, reasons = apply_calibration(motion.toss, self._rig), motion.reasons
            else:
                toss = apply_calibration(motion, self._rig)
                self._complete(toss)
                reasons = inspect(toss, self._body, self._gates, self.tracker)
            self._outcomes["rejected" if reasons else "tosses"] += 1
            yield Rejected(toss, reasons) if reasons else toss
