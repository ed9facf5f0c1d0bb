"""Writes poses over time as the bag that a tracker would have recorded of them.

    /tagslam/odom/body_<name>   nav_msgs/Odometry in `map`, a message for each pose, without covariance and twist
    /tf_static                  the board `body_surface` in `map`, latched, at the origin of the poses, z up

Poses are turned so that z points up, and not corrected otherwise: `check` says what else is wrong with axes, board, unit or
times, and which settings correct it.
"""

from array import array
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from math import cos, pi, sin
from pathlib import Path
from statistics import median

from contact_curation.contact.body import CONTACTNETS_CUBE, Body
from contact_curation.errors import InvalidValueError, UnreadableInputError
from contact_curation.geometry.scalars import IDENTITY, ScalarPose, compose
from contact_curation.motion.survey.series import WIDEST_STEP
from contact_curation.motion.toss import NANOSECONDS
from contact_curation.storage.bags.writer import BagWriter
from contact_curation.storage.datasets.orientations import UNTOLD, AngleConvention
from contact_curation.storage.datasets.pose_table import PoseTable
from contact_curation.storage.datasets.tagslam_bag import RigMessages, TagslamRig

UPRIGHT = {
    "x": ScalarPose((0.0, 0.0, 0.0), (cos(pi / 4.0), 0.0, -sin(pi / 4.0), 0.0)),
    "y": ScalarPose((0.0, 0.0, 0.0), (cos(pi / 4.0), sin(pi / 4.0), 0.0, 0.0)),
    "z": IDENTITY,
}
"""Rotations that take an axis of the poses' frame to z."""

BETWEEN_NS = NANOSECONDS
"""Time without poses before a recording that is moved behind the one before it."""
BACK_NS, SHORTEST = NANOSECONDS // 3, 10
"""Times that go back by more begin another recording, of so many rows in the mean; what goes back by less was logged late."""
LATEST_NS = (1 << 31) * NANOSECONDS
"""Of a stamp of ROS, whose seconds have 32 bits."""


@dataclass(frozen=True)
class PosesReport:
    """What was written to a bag.

    Attributes:
        recordings: number of recordings, one behind the other: files, and parts of one in which times begin again.
        poses: number of poses.
        seconds: that they take, without the times between recordings.
        rate: at which poses follow each other where none is missing [Hz]; 0 where there are too few.
        moved: number of recordings whose times were moved: they begin at 0, or before the recording before them ends.
        moved_by: by how much those were moved, each [s].
        left_out: for each recording with rows that are no poses, a line that says how many, and why the first of them.
        unnamed: recordings whose columns have no names.
        assumed: for each recording whose columns' names do not say all, a line that says how they were taken.
    """

    recordings: int
    poses: int
    seconds: float
    rate: float
    moved: int
    moved_by: tuple[float, ...]
    left_out: tuple[str, ...]
    unnamed: tuple[str, ...]
    assumed: tuple[str, ...]


def import_poses(
    sources: Sequence[Path],
    out: Path,
    body: Body = CONTACTNETS_CUBE,
    rate: float | None = None,
    up: str = "z",
    advance: Callable[[float], None] = lambda share: None,
    angles: AngleConvention = UNTOLD,
) -> PosesReport:
    """Writes tables of poses as one bag, each recording behind the one before it.

    Args:
        sources: files of text (`pose_table`).
        out: bag to write, `*.mcap` or a new folder.
        body: that is tracked; only its name counts, also to choose among the bodies of a table.
        rate: poses in a second, of files without times.
        up: axis of the poses' frame that points up, one of `UPRIGHT`; the bag's frame has z up.
        advance: called with the share of the files that is done.
        angles: how angles turn, of files that have them.

    Raises:
        UnreadableInputError: a file is no table of poses; no bag is written then.
        InvalidValueError: `out` cannot be written, times are negative, or a rate is missing or one too much.
    """
    tables = [PoseTable(path, rate, body.name, angles) for path in sources]
    left_out = []
    with BagWriter(out) as bag:
        writer = PoseWriter(bag, body, up)
        for done, table in enumerate(tables, start=1):
            before, seconds = writer.recordings, writer.seconds
            count, (rows, first) = writer.write(table), table.left_out
            back = writer.recordings - before - 1
            if back > 0 and count < SHORTEST * back:
                what = f"found times that go back in {back} of {count} rows"
                raise UnreadableInputError(table.path, f"{what}, expected rows in order of time, of one body")
            if not count:
                raise UnreadableInputError(table.path, f"found no pose ({first}), expected one in each row")
            if count > 1 and writer.seconds == seconds:
                what = f"found no row of {count} that is later than the one before it"
                raise UnreadableInputError(table.path, f"{what}, expected a time of each, in order")
            left_out += [f"{table.path}: left out {rows} rows without a pose ({first})"] if rows else []
            others = table.of_others
            left_out += [f"{table.path}: left out {others} rows of other bodies than {body.name}"] if others else []
            advance(done / len(tables))
    unnamed = tuple(str(table.path) for table in tables if not table.named)
    assumed = tuple(f"{table.path}: {table.assumed}" for table in tables if table.assumed)
    moved = len(writer.moved_by), tuple(writer.moved_by)
    return PosesReport(writer.recordings, writer.poses, writer.seconds, writer.rate, *moved, tuple(left_out), unnamed, assumed)


class PoseWriter:
    """Writes recordings to an open bag; for arguments see `import_poses`."""

    def __init__(self, bag: BagWriter, body: Body, up: str = "z") -> None:
        rig = TagslamRig(board=IDENTITY, epoch_ns=0, position_deviation=0.0, turn_deviation=0.0)
        self._bag, self._topic = bag, f"/tagslam/odom/body_{body.name}"
        self._messages, self._last_ns = RigMessages(rig, f"body_{body.name}"), 0
        self._upright = UPRIGHT[up]
        self.poses, self.recordings, self._lasted_ns = 0, 0, 0
        self.moved_by, self._steps_ns = list[float](), array("q")

    @property
    def seconds(self) -> float:
        """That the recordings take."""
        return self._lasted_ns / NANOSECONDS

    @property
    def rate(self) -> float:
        """At which poses follow each other where none is missing [Hz]; 0 where there are too few."""
        usual = median(self._steps_ns or [0])
        steps = [step_ns for step_ns in self._steps_ns if step_ns < WIDEST_STEP * usual]
        return len(steps) * NANOSECONDS / max(sum(steps), 1)

    def write(self, poses: Iterable[tuple[int, ScalarPose]]) -> int:
        """Adds stamps [ns] and poses, as several recordings where times begin again; returns the number of poses."""
        count, newest_ns, offset_ns = 0, None, 0
        for stamp_ns, pose in poses:
            begins = newest_ns is None or stamp_ns < newest_ns - BACK_NS
            if begins:
                offset_ns = 0 if stamp_ns > self._last_ns else self._last_ns + BETWEEN_NS - stamp_ns
                self.recordings += 1
                self.moved_by += [offset_ns / NANOSECONDS] if offset_ns else []
            newest_ns = stamp_ns if newest_ns is None or begins else max(newest_ns, stamp_ns)
            count, moved_ns = count + 1, stamp_ns + offset_ns
            if moved_ns >= LATEST_NS:
                latest = LATEST_NS / NANOSECONDS
                raise InvalidValueError("times", f"{moved_ns / NANOSECONDS:g} s", f"less than {latest:g} s, as in ROS")
            if not self._last_ns:  # logged with the first pose: tools take what is logged first for the recording's start
                self._bag.write("/tf_static", self._messages.board(), moved_ns, latched=True)
            self._bag.write(self._topic, self._messages.odometry(moved_ns, compose(self._upright, pose)), moved_ns)
            if not begins:
                self._steps_ns.append(max(moved_ns - self._last_ns, 0))
                self._lasted_ns += self._steps_ns[-1]
            self._last_ns = max(self._last_ns, moved_ns)
        self.poses += count
        return count
