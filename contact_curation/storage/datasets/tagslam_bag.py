"""Writes stored tosses as the bag that a TagSLAM rig would have recorded.

    /tagslam/odom/body_<name>   nav_msgs/Odometry in `map` at the tosses' frame rate, with covariance and without twist
    /tf_static                  the board `body_surface` in `map`, latched; it has no odometry, because it does not move

The board has an arbitrary tilted pose in the map, so that readers must use the frames. Stamps are the tracker's, recovered from
the velocities, and each toss is rotated back to the rig's board (`motion.restored_toss`). So the bag's median-filtered
differences are the velocities of the files. The date is made up, and log times equal the stamps. Between successive tosses
there is a time without poses, as if the tracker had been stopped. The frames just before and after each toss are made up
(`motion.lead_in`), because ContactNets' files begin at the detected release.
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from math import cos, inf, pi, sin
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.typesys import Stores, get_typestore

from contact_curation.contact.body import CONTACTNETS_CUBE, Body
from contact_curation.errors import InvalidValueError, UnreadableInputError
from contact_curation.geometry.scalars import IDENTITY, ScalarPose, compose, multiply
from contact_curation.motion.lead_in import surrounded
from contact_curation.motion.restored_toss import RestoredToss
from contact_curation.motion.segmenter_config import CONTACTNETS_RULES, SegmenterConfig
from contact_curation.motion.toss import NANOSECONDS, Toss
from contact_curation.storage.bags.file import file_sha256
from contact_curation.storage.bags.writer import BagWriter
from contact_curation.storage.datasets.contactnets import contactnets_files, of_center_of_mass, read_contactnets, restored_of
from contact_curation.storage.inputs.pose_messages import ODOMETRY, TF
from contact_curation.storage.inputs.recording_notes import (
    NUMBERS_NOTE,
    RULES_NOTE,
    RecordedNumbers,
    note_of_rules,
    number_of_file,
)

EXACT = 1e-5
"""Largest difference of velocities that count as equal [m/s, rad/s]."""

YAW, TILT = 40.0 * pi / 180.0, 3.0 * pi / 180.0
TURNED = multiply((cos(YAW / 2.0), 0.0, 0.0, sin(YAW / 2.0)), (cos(TILT / 2.0), sin(TILT / 2.0), 0.0, 0.0))
SLANTED = ScalarPose((0.42, -0.31, 0.27), TURNED)
"""Pose of the board in the map: an arbitrary place, and tilted."""


EARLIEST_NS, MADE_UP_NS = 1_600_000_000 * NANOSECONDS, 65_536 * 3600 * NANOSECONDS
"""Earliest made-up time [ns since 1970], and from there to the latest one, in the year 2028."""


@dataclass(frozen=True)
class TagslamRig:
    """A rig with the frames of TagSLAM's recordings.

    Attributes:
        map_frame: frame of all measurements.
        board_frame: frame of the board.
        board: pose of the board in the map [m].
        epoch_ns: stamp of the board and, 1 s later, of the first frame; by default 13 September 2020, 12:26:40 UTC.
        pause: time without poses between tosses [s].
        lead_in: number of made-up frames before each toss.
        lead_out: number of made-up frames after each toss.
        position_deviation: standard deviation of positions in the covariance [m].
        turn_deviation: standard deviation of orientations in the covariance [rad].
        rules: rules by which the tosses may have been cut; the made-up frames follow them, and the bag contains its rest height
            and frame period, each if all tosses keep to it.
    """

    map_frame: str = "map"
    board_frame: str = "body_surface"
    board: ScalarPose = SLANTED
    epoch_ns: int = EARLIEST_NS
    pause: float = 1.0
    lead_in: int = 16
    lead_out: int = 4
    position_deviation: float = 0.3e-3
    turn_deviation: float = 5e-3
    rules: SegmenterConfig = CONTACTNETS_RULES


@dataclass(frozen=True)
class ImportReport:
    """The content of a bag that was written.

    Attributes:
        tosses: number of tosses.
        frames: number of frames of the tosses, without the made-up ones.
        steps: number of steps between these frames.
        timed_steps: steps whose period was recovered exactly; the others' periods are within bounds from the velocities.
        inexact: files for which no stamps reproduce the velocities, one line each.
        skipped: files that were left out, with the reasons, one line each.
    """

    tosses: int
    frames: int
    steps: int
    timed_steps: int
    inexact: tuple[str, ...]
    skipped: tuple[str, ...]


def import_contactnets(
    source: Path,
    out: Path,
    body: Body = CONTACTNETS_CUBE,
    rig: TagslamRig | None = None,
    chosen: Callable[[int], bool] | None = None,
    advance: Callable[[float], None] = lambda share: None,
) -> ImportReport:
    """Writes ContactNets' tosses as a bag, one after the other.

    Args:
        source: a folder of `N.pt` files, or one file.
        out: bag to write, `*.mcap` or a new folder.
        body: tossed body.
        rig: rig that would have recorded the tosses; by default the time at which the bag begins follows from the first file,
            so that bags of other tosses have other ids.
        chosen: decides by a file's number whether its toss is written; None for all files, also those without a number.
        advance: called with the share of the files that is done.

    Raises:
        UnreadableInputError: `source` contains no toss; no bag is written then.
        InvalidValueError: `out` cannot be written, or no file is chosen.
    """
    present = contactnets_files(source)
    files = [file for file in present if chosen is None or _is_chosen(file, chosen)]
    if not files:
        expected = f"numbers such as those of {present[0].name} and {present[-1].name}"
        raise InvalidValueError("numbers to import", f"none among the files of {source}", expected)
    skipped: list[str] = []
    inexact: list[str] = []
    steps = timed = 0

    def sound() -> Iterator[Toss]:
        nonlocal steps, timed
        for done, item in enumerate(_read(files, body), start=1):
            if isinstance(item, Toss):
                original = restored_of(item, body)
                steps, timed = steps + item.frames - 1, timed + original.timed_steps
                inexact.extend(_misfit(original))
                yield of_center_of_mass(original.toss, body)
            else:
                skipped.append(str(item))
            advance(done / len(files))

    with BagWriter(out) as bag:
        tosses, frames = record(bag, body, sound(), rig or TagslamRig(epoch_ns=_time_of(files[0])))
        if not tosses:
            raise UnreadableInputError(source, f"found {len(skipped)} files and no toss, e.g. {skipped[0]}")
    return ImportReport(tosses, frames, steps, timed, tuple(inexact), tuple(skipped))


def made_up_time(digest: bytes) -> int:
    """A time at which a bag begins [ns] that follows from a digest of what is in it, so that other tosses get other ids."""
    return EARLIEST_NS + int.from_bytes(digest) % MADE_UP_NS


def _time_of(first: Path) -> int:
    try:
        return made_up_time(bytes.fromhex(file_sha256(first)))
    except OSError:  # whoever reads it says so
        return EARLIEST_NS


def _read(files: Iterable[Path], body: Body) -> Iterator[Toss | UnreadableInputError]:
    """Reads tosses; for a file that is no toss, the error."""
    for file in files:
        yield from read_contactnets(file, body)


def _is_chosen(file: Path, chosen: Callable[[int], bool]) -> bool:
    number = number_of_file(file.name)
    return number is not None and chosen(number)


def _misfit(original: RestoredToss) -> list[str]:
    """A line if no stamps reproduce a toss's velocities."""
    if original.timing is None:
        return [f"{original.toss.source}: found {original.toss.frames} frames, expected more to recover stamps from"]
    linear, angular = original.timing.linear_residuals.max(), original.timing.angular_residuals.max()
    if linear <= EXACT and angular <= EXACT:
        return []
    return [f"{original.toss.source}: found velocities off by {linear:.2g} m/s and {angular:.2g} rad/s at best, expected none"]


def record(bag: BagWriter, body: Body, tosses: Iterable[Toss], rig: TagslamRig) -> tuple[int, int]:
    """Writes tosses of one body to an open bag; returns the numbers of tosses and of frames.

    Raises:
        InvalidValueError: a toss is of another body.
    """
    messages = RigMessages(rig, f"body_{body.name}")
    x, y, z = (-body.center_of_mass).tolist()
    tracked = ScalarPose((x, y, z), IDENTITY.orientation_wxyz)
    bag.write("/tf_static", messages.board(), rig.epoch_ns, latched=True)
    start_ns, count, frames = rig.epoch_ns + NANOSECONDS, 0, 0
    numbered: list[tuple[int, int]] = []
    rules = rig.rules
    for toss in tosses:
        if toss.body != body.name:
            raise InvalidValueError(f"body of toss {toss.toss_id}", toss.body, f"{body.name}, as of the others")
        number = number_of_file(toss.source)
        if number is not None:
            numbered.append((start_ns, number))
        rules = _kept_to(rules, toss, tracked)
        for stamp_ns, pose in _frames(toss, start_ns, rig):
            seen = compose(rig.board, compose(pose, tracked) if any(tracked.position) else pose)
            bag.write(f"/tagslam/odom/body_{body.name}", messages.odometry(stamp_ns, seen), stamp_ns)
        start_ns = stamp_ns + round(rig.pause * NANOSECONDS)
        count, frames = count + 1, frames + toss.frames
    bag.note(RULES_NOTE, note_of_rules(rules))
    if numbered:
        starts_ns, numbers = zip(*numbered, strict=True)
        bag.note(NUMBERS_NOTE, RecordedNumbers(starts_ns, numbers).note())
    return count, frames


def _kept_to(rules: SegmenterConfig, toss: Toss, tracked: ScalarPose) -> SegmenterConfig:
    """The rules, without a rest height or a frame period that a toss does not have: it was cut by others."""
    (x, y, z), (w, qx, qy, qz) = toss.positions[-1].tolist(), toss.orientations_wxyz[-1].tolist()
    height = compose(ScalarPose((x, y, z), (w, qx, qy, qz)), tracked).position[2]
    return replace(
        rules,
        rest_height=rules.rest_height if height < rules.rest_height else inf,
        frame_period=rules.frame_period if toss.frame_period == rules.frame_period else None,
    )


def _frames(toss: Toss, start_ns: int, rig: TagslamRig) -> Iterator[tuple[int, ScalarPose]]:
    """Stamps [ns] and poses on the board of a toss, with the made-up frames before and after it."""
    made = surrounded(toss, rig.lead_in, rig.lead_out, rig.rules)
    rows = zip(made.stamps_ns.tolist(), made.positions.tolist(), made.orientations_wxyz.tolist())
    for stamp_ns, (x, y, z), (w, qx, qy, qz) in rows:
        yield start_ns + stamp_ns, ScalarPose((x, y, z), (w, qx, qy, qz))


class RigMessages:
    """Makes the rig's messages with the types of ROS 2 Jazzy."""

    def __init__(self, rig: TagslamRig, body_frame: str) -> None:
        self._rig = rig
        self._body_frame = body_frame
        self._types = get_typestore(Stores.ROS2_JAZZY).types
        deviations = np.repeat([rig.position_deviation, rig.turn_deviation], 3)
        self._covariance = np.diag(deviations**2).ravel()
        zero = self._make("geometry_msgs/msg/Vector3", x=0.0, y=0.0, z=0.0)
        still = self._make("geometry_msgs/msg/Twist", linear=zero, angular=zero)
        self._no_twist = self._make("geometry_msgs/msg/TwistWithCovariance", twist=still, covariance=np.zeros(36))

    def odometry(self, stamp_ns: int, pose: ScalarPose) -> Any:
        (x, y, z), turn = pose
        place = self._make("geometry_msgs/msg/Point", x=x, y=y, z=z)
        placed = self._make("geometry_msgs/msg/Pose", position=place, orientation=self._quaternion(turn))
        with_covariance = self._make("geometry_msgs/msg/PoseWithCovariance", pose=placed, covariance=self._covariance)
        return self._make(
            ODOMETRY,
            header=self._header(stamp_ns),
            child_frame_id=self._body_frame,
            pose=with_covariance,
            twist=self._no_twist,
        )

    def board(self) -> Any:
        (x, y, z), turn = self._rig.board
        place = self._make("geometry_msgs/msg/Vector3", x=x, y=y, z=z)
        transform = self._make("geometry_msgs/msg/Transform", translation=place, rotation=self._quaternion(turn))
        stamped = self._make(
            "geometry_msgs/msg/TransformStamped",
            header=self._header(self._rig.epoch_ns),
            child_frame_id=self._rig.board_frame,
            transform=transform,
        )
        return self._make(TF, transforms=[stamped])

    def _quaternion(self, wxyz: tuple[float, float, float, float]) -> Any:
        w, x, y, z = wxyz
        return self._make("geometry_msgs/msg/Quaternion", x=x, y=y, z=z, w=w)

    def _header(self, stamp_ns: int) -> Any:
        stamp = self._make("builtin_interfaces/msg/Time", sec=stamp_ns // NANOSECONDS, nanosec=stamp_ns % NANOSECONDS)
        return self._make("std_msgs/msg/Header", stamp=stamp, frame_id=self._rig.map_frame)

    def _make(self, type_name: str, **fields: Any) -> Any:
        return self._types[type_name](**fields)
