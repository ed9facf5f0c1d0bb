"""Writes poses over time as the bag that a tracker would have recorded of them.

    /tagslam/odom/body_<name>   nav_msgs/Odometry in `map`, a message for each pose, without covariance and twist
    /tf_static                  the board `body_surface` in `map`, latched, at the origin of the poses, z up

Poses are turned so that z points up, and not corrected otherwise: `check` says what else is wrong with axes, board, unit or
times, and which settings correct it.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from math import cos, pi, sin
from pathlib import Path

from contact_curation.contact.body import CONTACTNETS_CUBE, Body
from contact_curation.errors import InvalidValueError, UnreadableInputError
from contact_curation.geometry.scalars import IDENTITY, ScalarPose, compose
from contact_curation.motion.toss import NANOSECONDS
from contact_curation.storage.bags.writer import BagWriter
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
LATEST_NS = (1 << 31) * NANOSECONDS
"""Of a stamp of ROS, whose seconds have 32 bits."""


@dataclass(frozen=True)
class PosesReport:
    """What was written to a bag.

    Attributes:
        recordings: number of recordings, one behind the other.
        poses: number of poses.
        seconds: that they take, without the times between recordings.
        moved: number of recordings whose times were moved: they begin at 0, or before the recording before them ends.
        left_out: for each recording with rows that are no poses, a line that says how many, and why the first of them.
        unnamed: recordings whose columns have no names.
    """

    recordings: int
    poses: int
    seconds: float
    moved: int
    left_out: tuple[str, ...]
    unnamed: tuple[str, ...]


def import_poses(
    sources: Sequence[Path],
    out: Path,
    body: Body = CONTACTNETS_CUBE,
    rate: float | None = None,
    up: str = "z",
    advance: Callable[[float], None] = lambda share: None,
) -> PosesReport:
    """Writes tables of poses as one bag, each recording behind the one before it.

    Args:
        sources: files of text (`pose_table`).
        out: bag to write, `*.mcap` or a new folder.
        body: that is tracked; only its name counts, also to choose among the bodies of a table.
        rate: poses in a second, of files without times.
        up: axis of the poses' frame that points up, one of `UPRIGHT`; the bag's frame has z up.
        advance: called with the share of the files that is done.

    Raises:
        UnreadableInputError: a file is no table of poses; no bag is written then.
        InvalidValueError: `out` cannot be written, times are negative, or a rate is missing or one too much.
    """
    tables = [PoseTable(path, rate, body.name) for path in sources]
    left_out = []
    with BagWriter(out) as bag:
        writer = PoseWriter(bag, body, up)
        for done, table in enumerate(tables, start=1):
            count, (rows, first) = writer.write(table), table.left_out
            if not count:
                raise UnreadableInputError(table.path, f"found no pose ({first}), expected one in each row")
            left_out += [f"{table.path}: left out {rows} rows without a pose ({first})"] if rows else []
            others = table.of_others
            left_out += [f"{table.path}: left out {others} rows of other bodies than {body.name}"] if others else []
            advance(done / len(tables))
    unnamed = tuple(str(table.path) for table in tables if not table.named)
    return PosesReport(len(tables), writer.poses, writer.seconds, writer.moved, tuple(left_out), unnamed)


class PoseWriter:
    """Writes recordings to an open bag; for arguments see `import_poses`."""

    def __init__(self, bag: BagWriter, body: Body, up: str = "z") -> None:
        rig = TagslamRig(board=IDENTITY, epoch_ns=0, position_deviation=0.0, turn_deviation=0.0)
        self._bag, self._topic = bag, f"/tagslam/odom/body_{body.name}"
        self._messages, self._last_ns = RigMessages(rig, f"body_{body.name}"), 0
        self._upright = UPRIGHT[up]
        self.poses, self.moved, self.seconds = 0, 0, 0.0

    def write(self, poses: Iterable[tuple[int, ScalarPose]]) -> int:
        """Adds a recording, stamps [ns] and poses; returns their number."""
        before_ns, count, first_ns, offset_ns = self._last_ns, 0, 0, 0
        for stamp_ns, pose in poses:
            if not count:
                first_ns = stamp_ns
                offset_ns = 0 if stamp_ns > before_ns else before_ns + BETWEEN_NS - stamp_ns
            count, moved_ns = count + 1, stamp_ns + offset_ns
            if moved_ns >= LATEST_NS:
                latest = LATEST_NS / NANOSECONDS
                raise InvalidValueError("times", f"{moved_ns / NANOSECONDS:g} s", f"less than {latest:g} s, as in ROS")
            if not self._last_ns:  # logged with the first pose: tools take what is logged first for the recording's start
                self._bag.write("/tf_static", self._messages.board(), moved_ns, latched=True)
            self._bag.write(self._topic, self._messages.odometry(moved_ns, compose(self._upright, pose)), moved_ns)
            self._last_ns = max(self._last_ns, moved_ns)
        self.poses, self.moved = self.poses + count, self.moved + (offset_ns != 0)
        self.seconds += max(self._last_ns - first_ns - offset_ns, 0) / NANOSECONDS if count else 0.0
        return count
