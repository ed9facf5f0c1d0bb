"""What one recording holds: its topics, the measurements of the body as they came, the poses on the board, and the motions.

Nothing is judged here. Only pose topics are read, and of a long recording only its first messages, so that the answer comes
within seconds whatever else a bag holds.
"""

import sys
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from contact_curation.errors import ContactCurationError, MissingTopicError
from contact_curation.geometry.quaternions import Array
from contact_curation.geometry.scalars import ScalarPose
from contact_curation.motion.body_tracker import BodyPose
from contact_curation.motion.calibration import calibrated_poses
from contact_curation.motion.pose_noise import RIG, TrackerScale
from contact_curation.motion.pose_stream import BadPose, FramePose
from contact_curation.motion.survey.carried import Carried
from contact_curation.motion.survey.series import PoseSeries, series_of
from contact_curation.motion.tags.fit import TagFit, tag_fit
from contact_curation.motion.toss import Rejected, Toss
from contact_curation.pipeline.reading import ReadingConfig
from contact_curation.storage.bags.reader import BagReader
from contact_curation.storage.bags.records import TopicInfo
from contact_curation.storage.inputs.bag_tosses import BagTosses, bag_tosses
from contact_curation.storage.inputs.inputs import is_contactnets, open_inputs
from contact_curation.storage.inputs.pose_runs import MeasuredMessage
from contact_curation.storage.inputs.pose_source import PoseSource
from contact_curation.storage.inputs.records import Found, Problem
from contact_curation.storage.inputs.tag_detections import tag_images

IMAGES = 60
"""Of which is looked at how corners fit."""

OTHERS = 5
"""Times as many messages are read in all, where a robot's transforms, for instance, come beside those of the body."""


@dataclass(frozen=True, eq=False)
class Measurements:
    """N measurements of the body in the order in which they were recorded, good or bad.

    Attributes:
        stamps_ns: (N,) header stamps.
        logged_ns: (N,) log times.
        positions: (N, 3) in the frame that they are given in; NaN of bad ones.
        orientations_wxyz: (N, 4) likewise.
        frames: (N,) names of these frames; empty of bad ones.
    """

    stamps_ns: NDArray[np.int64]
    logged_ns: NDArray[np.int64]
    positions: Array
    orientations_wxyz: Array
    frames: NDArray[np.str_]

    def __len__(self) -> int:
        return len(self.stamps_ns)


NO_MEASUREMENTS = Measurements(
    np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros((0, 4)), np.zeros(0, np.str_)
)


@dataclass(frozen=True, eq=False)
class Recording:
    """One input.

    Attributes:
        path: as given.
        unreadable: why it cannot be read; empty where it can.
        no_topic: why no topic can hold the body's poses; empty where one can.
        topics: what is in a bag.
        source: the topics that are read; None of other inputs.
        counted: messages that were read of each topic.
        whole: whether it was read to its end.
        measured: what was measured of the body.
        parents: frames that these are given in, and how often.
        frames: all that were named.
        bad: by kind, how many measurements could not be used.
        why_bad: by kind, the first reason.
        series: poses on the board, as configured to be corrected.
        outcomes: tosses and rejected motions.
        losses: what could not be read, one line each.
        taken_as_on_board: whether poses in another frame than the board's are taken as given on it.
        only_inverted: what is wrong where others move in the body's frame, and nothing has a pose of it; else empty.
        stamps_done: what was done to header stamps that jitter; empty where all are as they came.
        tracker: how noisy a tracker the bounds of segmenter and quality checks were for, in the end.
        tags: how well detected corners fit the tag map; None without one.
        carried: the poses on the board that were measured in frames that transforms move.
    """

    path: str
    unreadable: str = ""
    no_topic: str = ""
    topics: tuple[TopicInfo, ...] = ()
    source: PoseSource | None = None
    counted: Mapping[str, int] = field(default_factory=dict)
    whole: bool = True
    measured: Measurements = NO_MEASUREMENTS
    parents: Mapping[str, int] = field(default_factory=dict)
    frames: frozenset[str] = frozenset()
    bad: Mapping[str, int] = field(default_factory=dict)
    why_bad: Mapping[str, str] = field(default_factory=dict)
    series: tuple[PoseSeries, ...] = ()
    outcomes: tuple[Toss | Rejected, ...] = ()
    losses: tuple[str, ...] = ()
    taken_as_on_board: bool = False
    only_inverted: str = ""
    stamps_done: str = ""
    tracker: TrackerScale = RIG
    tags: TagFit | None = None
    carried: tuple[Carried, ...] = ()

    @property
    def name(self) -> str:
        return Path(self.path).name

    @property
    def poses(self) -> int:
        """On the board."""
        return sum(len(one) for one in self.series)


def read_recording(path: Path, config: ReadingConfig, most_messages: int) -> Recording:
    """Reads one input as far as `most_messages` of the body go; one that cannot be read says why."""
    try:
        if is_contactnets(path):
            return _of_files(path, config, most_messages)
        with BagReader(path) as reader:
            return _of_bag(path, reader, config, most_messages)
    except (ContactCurationError, OSError) as error:
        return Recording(str(path), unreadable=str(error).removeprefix(f"{path}: "))


def _of_files(path: Path, config: ReadingConfig, most_frames: int) -> Recording:
    outcomes: list[Toss | Rejected] = []
    problems: list[str] = []
    inputs = open_inputs([path], config.body, config.inputs)
    whole = True
    frames = 0
    for item in inputs:
        if isinstance(item, Problem):
            problems.append(item.what)
            continue
        outcomes.append(item)
        frames += len(series_of(item))
        if frames > most_frames:
            whole = False
            break
    if not outcomes:
        return Recording(str(path), unreadable="; ".join(problems))
    series = tuple(series_of(one) for one in outcomes)
    return Recording(str(path), whole=whole, series=series, outcomes=tuple(outcomes), losses=tuple(problems))


def _of_bag(path: Path, reader: BagReader, config: ReadingConfig, most_messages: int) -> Recording:
    placed: list[BodyPose] = []
    try:
        tosses = bag_tosses(reader, config.body, config.inputs, placed.append)
    except MissingTopicError as error:
        return Recording(str(path), no_topic=str(error).removeprefix(f"{path}: "), topics=reader.topics, losses=reader.losses)
    watched = _Watched(tosses)
    most = min(OTHERS * most_messages, sys.maxsize)
    outcomes: list[Toss | Rejected] = []
    for message in islice(tosses.messages(reader), most):
        outcomes += [found.outcome for found in watched.of(message)]
        if watched.of_body == most_messages:
            break
    whole = watched.of_body < most_messages and sum(watched.counted.values()) < most
    rest = [found.outcome for found in tosses.rest()]  # gives up what waits for the board, too
    outcomes += rest if whole else []  # the motion in progress is cut here, not in the recording
    series = _series(placed, config)
    bad, why = tosses.bad_poses
    return Recording(
        path=str(path),
        topics=reader.topics,
        source=tosses.source,
        counted=watched.counted,
        whole=whole,
        measured=watched.measurements(),
        parents=watched.parents,
        frames=frozenset(watched.frames),
        bad=bad,
        why_bad=why,
        series=series,
        outcomes=tuple(outcomes),
        losses=reader.losses,
        taken_as_on_board=tosses.taken_as_on_board,
        only_inverted=tosses.only_inverted,
        stamps_done=tosses.stamps_done,
        tracker=tosses.tracker,
        tags=_tag_fit(reader, tosses, watched.counted, config),
        carried=_carried(placed),
    )


def _tag_fit(reader: BagReader, tosses: BagTosses, counted: Mapping[str, int], config: ReadingConfig) -> TagFit | None:
    """How corners fit in images from all over what was read."""
    source, poses = tosses.source, config.inputs.poses
    detections = poses.detections(config.body.name)
    if detections is None or source.camera is None:
        return None
    images, camera = counted.get(source.body.name, 0), source.camera.name
    messages = islice(reader.messages([source.body.name, camera]), images + counted.get(camera, 0))
    told = ((one.topic == camera, one.message) for one in messages)
    sample = tag_images(told, max(images // IMAGES, 1), any_frame=bool(poses.camera_info))
    return tag_fit(sample, detections.rig, poses.tags, rectified=poses.rectified)


def _series(placed: Sequence[BodyPose], config: ReadingConfig) -> tuple[PoseSeries, ...]:
    """The poses on the board, placed with the rig's marker; a new series begins where the clock jumps back."""
    if not placed:
        return ()
    stamps = np.array([one.stamp_ns for one in placed], dtype=np.int64)
    positions = np.array([one.pose.position for one in placed])
    orientations = np.array([one.pose.orientation_wxyz for one in placed])
    positions, orientations = calibrated_poses(positions, orientations, config.inputs.rig.without_marker)
    parts = np.split(np.arange(len(stamps)), np.flatnonzero(np.diff(stamps) <= 0) + 1)
    return tuple(PoseSeries(stamps[part], positions[part], orientations[part]) for part in parts)


def _carried(placed: Sequence[BodyPose]) -> tuple[Carried, ...]:
    """Those that were measured in a frame that moves, by frame; others begin where the clock jumps back."""
    found = []
    for frame in dict.fromkeys(one.carrier.frame for one in placed if one.carrier is not None):
        own = [(one, one.carrier.pose) for one in placed if one.carrier is not None and one.carrier.frame == frame]
        stamps = np.array([one.stamp_ns for one, _ in own], dtype=np.int64)
        bodies, carriers = _columns([one.pose for one, _ in own]), _columns([pose for _, pose in own])
        for part in np.split(np.arange(len(stamps)), np.flatnonzero(np.diff(stamps) <= 0) + 1):
            body, carrier = (PoseSeries(stamps[part], *(each[part] for each in one)) for one in (bodies, carriers))
            found.append(Carried(frame, body, carrier))
    return tuple(found)


def _columns(poses: Sequence[ScalarPose]) -> tuple[Array, Array]:
    return np.array([one.position for one in poses]), np.array([one.orientation_wxyz for one in poses])


class _Watched:
    """Notes what passes on its way to the tosses."""

    def __init__(self, tosses: BagTosses) -> None:
        self._tosses = tosses
        self._rows: list[tuple[int, int, str, float, float, float, float, float, float, float]] = []
        self.counted: Counter[str] = Counter()
        self.of_body = 0
        self.parents: Counter[str] = Counter()
        self.frames: set[str] = set()

    def of(self, message: MeasuredMessage) -> list[Found]:
        """What became complete with a message."""
        self.counted[message.topic] += 1
        source, before = self._tosses.source, len(self._rows)
        for one in message.measured:
            if isinstance(one, FramePose):
                self.frames.update((one.parent, one.child))
            if one.child != source.body_frame or (message.topic != source.body.name):
                continue
            if isinstance(one, FramePose):
                self.parents[one.parent] += 1
                self._rows.append(
                    (one.stamp_ns, message.log_time_ns, one.parent, *one.pose.position, *one.pose.orientation_wxyz)
                )
            elif isinstance(one, BadPose):
                self._rows.append((one.stamp_ns, message.log_time_ns, "", *(float("nan"),) * 7))
        self.of_body += len(self._rows) > before
        return list(self._tosses.taken(message.measured, message.topic))

    def measurements(self) -> Measurements:
        """All that was measured of the body."""
        if not self._rows:
            return NO_MEASUREMENTS
        stamps, logged, frames, *rest = zip(*self._rows, strict=True)
        poses = np.array(rest, dtype=float).T
        return Measurements(
            np.array(stamps, np.int64), np.array(logged, np.int64), poses[:, :3], poses[:, 3:], np.array(frames, np.str_)
        )
