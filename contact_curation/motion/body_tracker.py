"""Computes poses of the body in the board's frame from poses of frames in frames.

    T_board_body = (T_common_board)^-1 T_common_body T_body_mass

where `common` is the nearest frame above both, and the last factor moves the origin to the body's centre of mass. Boards,
cameras and robots may move; the body's own pose is taken as it was measured. A body pose waits for the rig's poses around its
time, so that what comes out does not hang on the order in which topics arrive. What cannot be used comes out with its reason.
"""

from collections import Counter, deque
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from math import dist, inf
from typing import Any, NamedTuple, cast

import numpy as np

from contact_curation.configs import check_positive
from contact_curation.errors import InvalidValueError
from contact_curation.geometry.scalars import IDENTITY, ScalarPose, Vector, angle_between, compose, inverse
from contact_curation.motion.frame_tree import HISTORY, FrameTree, Link, composed
from contact_curation.motion.pose_stream import (
    BadPose,
    FramePose,
    FrameRun,
    PoseRun,
    counted,
    reading_state,
    stamped_pose,
    whole,
    whole_or_none,
)
from contact_curation.motion.toss import NANOSECONDS

AROUND = "around its time"
"""Said where what leads to the board is known, and not at the time of a pose."""

MOST_LISTED = 8
"""Names of frames in one line."""

MOST_PARENTS = 16
"""Frames that the body is measured in, one after the other or in turn, as by several cameras; the last ones count."""
MOST_UNPLACED = 200_000
"""Poses of a recording that wait for transforms, and of frames that may lead there: 20 minutes at 148 Hz, and some 100 MB."""

SHORT_HISTORY = 256
"""Poses that a frame remembers that is not needed so far: it may turn out to stand between the body and the board."""


@dataclass(frozen=True)
class TrackerConfig:
    """Names of the frames, and how long to wait for them.

    Attributes:
        body_frame: tracked frame of the body.
        board_frame: the board's, z up, its surface at z = 0; empty where poses are given in it already.
        clock_jump: stamps that go back by more than this are a clock that jumped, e.g. a bag that loops [s].
        largest_wait: a body pose waits so long for the rig's poses, by the stamps [s].
        largest_rig_gap: poses of a moving board, camera or robot are interpolated over at most this [s].
        largest_speed: a pose further from the last one than this is a jump, no motion, and is left out [m/s].
        largest_spin: likewise for turns [rad/s].
        center_of_mass: the body's, in that frame [m]; poses come out with their origin there.
        transforms_ahead: moving boards, cameras and robots are given where they are so much later than their stamps say, by
            those of the body's poses; negative: earlier [s].
        recorded: poses of a recording wait for transforms however late these were logged, as /tf_static may be.
    """

    body_frame: str
    board_frame: str = "body_surface"
    clock_jump: float = 1.0
    largest_wait: float = 2.0
    largest_rig_gap: float = 0.5
    largest_speed: float = inf
    largest_spin: float = inf
    center_of_mass: Vector = (0.0, 0.0, 0.0)
    transforms_ahead: float = 0.0
    recorded: bool = False

    def __post_init__(self) -> None:
        if not self.body_frame or self.body_frame == self.board_frame:
            raise InvalidValueError("body_frame", repr(self.body_frame), "the name of a frame that is not the board's")
        check_positive(self, ("clock_jump", "largest_wait", "largest_rig_gap"), unit="of seconds", infinite=True)
        check_positive(self, ("largest_speed", "largest_spin"), infinite=True)


class Carrier(NamedTuple):
    """A frame that the body was measured in and that moves over the board, such as a camera that an arm carries.

    Attributes:
        frame: its name.
        pose: in the board's frame, at the time of the measurement.
    """

    frame: str
    pose: ScalarPose


@dataclass(frozen=True, slots=True)
class BodyPose:
    """The body in the board's frame.

    Attributes:
        stamp_ns: header stamp, as it came; `even_stamps` corrects uneven ones.
        pose: body to board [m].
        carrier: what it was measured in, where transforms move this.
    """

    stamp_ns: int
    pose: ScalarPose
    carrier: Carrier | None = None


def body_poses(run: PoseRun) -> list[BodyPose]:
    """The poses of a run in the board's frame one by one."""
    return [BodyPose(stamp_ns, ScalarPose(position, orientation)) for stamp_ns, position, orientation in run.one_by_one()]


@dataclass(frozen=True, slots=True)
class ClockJump:
    """The stamps went back: what comes now belongs to another run.

    Attributes:
        stamp_ns: of the first pose after the jump.
        back: by how much [s].
    """

    stamp_ns: int
    back: float


TrackerEvent = BodyPose | BadPose | ClockJump


class _Way(NamedTuple):
    """How a measurement leads to the board; `static` holds where none of the links moves.

    Attributes:
        on_body: links from the body up to the measured frame.
        above: links from the measurement's parent up to the nearest frame above it and the board.
        board: links from the board up to that frame.
        static: poses of the three; the last one is that of the frame in the board.
    """

    on_body: list[Link]
    above: list[Link]
    board: list[Link]
    static: tuple[ScalarPose, ScalarPose, ScalarPose] | None

    def at(self, stamp_ns: int, gap_ns: float, *, ended: bool = False) -> tuple[ScalarPose, ScalarPose, ScalarPose] | None:
        """Its poses at a time; None where a link does not know that time, or may know it better unless all has `ended`."""
        if self.static is not None:
            return self.static
        body, above, board = (composed(links, stamp_ns, gap_ns, ended=ended) for links in self[:3])
        return None if body is None or above is None or board is None else (body, above, inverse(board))


class BodyTracker:
    """Follows one body; remembers the rig's frames and the body poses that wait for them.

    Args:
        config: of frames and times.
        marker: the described body's frame in the tracked one, about the centre of mass.

    Attributes:
        config: frames and times.
        center: the described body's frame about its centre of mass, in the tracked one.
        counts: how often something came out: "poses", and the kinds of bad poses.
    """

    def __init__(self, config: TrackerConfig, marker: ScalarPose = IDENTITY) -> None:
        self.config = config
        self.counts: Counter[str] = Counter()
        self._tree = FrameTree()
        self._moving = config.body_frame
        self._ahead_ns = round(config.transforms_ahead * NANOSECONDS)
        center = ScalarPose(config.center_of_mass, IDENTITY.orientation_wxyz)
        self.center = center if marker == IDENTITY else compose(center, marker)
        self._waiting: deque[FramePose] = deque()
        self._parents: tuple[str, ...] = ()
        self._needed: tuple[tuple[int, tuple[str, ...]], frozenset[str]] = ((-1, ()), frozenset())
        self._last_ns: int | None = None
        self._last_pose: BodyPose | None = None
        self._limited = min(config.largest_speed, config.largest_spin) < inf
        self._ways: tuple[int, dict[tuple[str, str], _Way | None]] = (-1, {})

    @property
    def needed_frames(self) -> frozenset[str]:
        """The body, the board and the frames above them and above the frames that the body is measured in.

        What other frames do, of a robot's arm for instance, changes no pose of the body.
        """
        made_of = (self._tree.shape, self._parents)
        if self._needed[0] != made_of:
            starts = (self.config.body_frame, self.config.board_frame, *self._parents)
            self._needed = made_of, frozenset(name for start in starts for name, _ in self._tree.ancestors(start))
        return self._needed[1]

    def push(self, measured: FramePose | BadPose) -> tuple[TrackerEvent, ...]:
        """Takes in a measurement of the body or the rig; gives the body poses that are known now, in order of their stamps."""
        if isinstance(measured, BadPose):
            events: list[TrackerEvent] = [measured]
        elif measured.child == self._moving and not measured.static:
            events = self._body_measured(measured)
        else:
            self._rig_measured(measured)
            events = self._known() if measured.child in self.needed_frames else []
        return self._counted(events)

    def push_run(self, measured: FrameRun) -> PoseRun | None:
        """Takes in successive poses of the body where each is known on the board at once, and gives these.

        Returns:
            None where the rig moves or is not known, poses wait, the clock jumps back or speeds are limited: then nothing has
            changed, and the poses are to be pushed one by one.
        """
        way = self._way(measured.parent, measured.child) if measured.child == self._moving else None
        if way is None or way.static is None or self._waiting or self._limited:
            return None
        stamps = measured.poses.stamps_ns
        newest = np.maximum.accumulate(np.append(stamps[0] if self._last_ns is None else self._last_ns, stamps))
        if (newest[:-1] - stamps).max() > self.config.clock_jump * NANOSECONDS:
            return None
        if measured.parent not in self._parents:
            self._parents = (*self._parents, measured.parent)[-MOST_PARENTS:]
        poses = self._run_in_board(way.static, measured.poses)
        self._last_ns, (self._last_pose,) = int(newest[-1]), body_poses(poses.part(len(poses) - 1, len(poses)))
        self.counts["poses"] += len(poses)
        return poses

    def flush(self) -> tuple[TrackerEvent, ...]:
        """Ends the stream: body poses that still wait are given up."""
        return self._counted(self._last_look("the stream ended"))

    @property
    def size(self) -> int:
        """Poses in a `snapshot`."""
        links, needed = self._tree.links, self.needed_frames
        return len(self._waiting) + sum(len(link.poses) for child, link in links.items() if link.static or child in needed)

    def snapshot(self) -> dict[str, Any]:
        """The state as plain numbers, lists and names, which JSON keeps exactly, without moving frames that are not needed."""
        needed, last = self.needed_frames, self._last_pose
        return {
            "links": {child: asdict(link) for child, link in self._tree.links.items() if link.static or child in needed},
            "waiting": [asdict(measured) for measured in self._waiting],
            "last_ns": self._last_ns,
            "parents": list(self._parents),
            "last_pose": None if last is None else {"stamp_ns": last.stamp_ns, "pose": tuple(last.pose)},
            "counts": dict(self.counts),
        }

    def restore(self, snapshot: Mapping[str, Any]) -> None:
        """Takes up the state of `snapshot`, which a tracker of the same configuration gave.

        Raises:
            InvalidValueError: it is no such state.
        """
        with reading_state("tracker", snapshot, "BodyTracker.snapshot"):
            links = {child: _link_of(entry) for child, entry in snapshot["links"].items()}
            waiting = [_frame_pose_of(entry) for entry in snapshot["waiting"]]
            last_ns, counts = whole_or_none(snapshot["last_ns"]), counted(snapshot["counts"])
            last = snapshot.get("last_pose")  # states of before there was one go on without
            parents = tuple(str(name) for name in snapshot.get("parents", ()))
            last_pose = None if last is None else BodyPose(whole(last["stamp_ns"]), _pose_of(last["pose"]))
        self._tree.links, self._waiting, self._last_ns, self.counts = links, deque(waiting), last_ns, counts
        self._last_pose, self._parents = last_pose, parents
        self._tree.shape += 1
        self._moving = self._tree.moving_ancestor(self.config.body_frame)

    def _body_measured(self, measured: FramePose) -> list[TrackerEvent]:
        jump: list[TrackerEvent] = []
        back_ns = 0 if self._last_ns is None else self._last_ns - measured.stamp_ns
        if back_ns > self.config.clock_jump * NANOSECONDS:
            jump = [
                *self._last_look("the clock jumped back"),
                ClockJump(measured.stamp_ns, back_ns / NANOSECONDS),
            ]
            self._tree.forget_after(measured.stamp_ns + int(self.config.clock_jump * NANOSECONDS))
            self._last_pose = None
        self._last_ns = max(measured.stamp_ns, self._last_ns) if self._last_ns is not None and not jump else measured.stamp_ns
        if measured.parent not in self._parents:
            self._parents = (*self._parents, measured.parent)[-MOST_PARENTS:]
        self._waiting.append(measured)
        return jump + self._known()

    def _rig_measured(self, measured: FramePose) -> None:
        if self._ahead_ns and not measured.static:
            measured = replace(measured, stamp_ns=measured.stamp_ns + self._ahead_ns)
        link = self._tree.links.get(measured.child)
        if link is not None and not link.static and link.newest_ns - measured.stamp_ns > self.config.clock_jump * NANOSECONDS:
            self._tree.forget_after(measured.stamp_ns)
        history = HISTORY if measured.child in self.needed_frames else SHORT_HISTORY
        if self._waiting and (self._board_may_come or self._transforms_are_late):  # then poses of long ago are placed
            history = max(history, MOST_UNPLACED // max(len(self._tree.links), 1))
        self._tree.take(measured, history)
        self._moving = self._tree.moving_ancestor(self.config.body_frame)

    def _known(self) -> list[TrackerEvent]:
        """The body poses, oldest first, that need not wait any longer."""
        events: list[TrackerEvent] = []
        while self._waiting:
            measured = self._waiting[0]
            late = self._waits_long and not self._transforms_are_late
            found = self._in_board(measured, ended=late)
            if found is not None:
                events.append(self._without_jump(found))
                self._waiting.popleft()
            elif self._board_may_come:
                break
            elif late:
                events.append(self._lost(self._waiting.popleft(), f"none within {self.config.largest_wait:g} s"))
            else:
                break
        return events

    @property
    def _board_may_come(self) -> bool:
        """Whether nothing leads to the board so far, and a later part of the recording may."""
        if not self.config.recorded or len(self._waiting) > MOST_UNPLACED:
            return False
        return all(self._way(parent, self._moving) is None for parent in self._parents)

    @property
    def _waits_long(self) -> bool:
        return self._waiting[-1].stamp_ns - self._waiting[0].stamp_ns > self.config.largest_wait * NANOSECONDS

    @property
    def _transforms_are_late(self) -> bool:
        """Whether a recording's poses wait longer than live ones would, for transforms that were logged late."""
        if not self.config.recorded or not self._waits_long or len(self._waiting) > MOST_UNPLACED:
            return False
        _, last_ns = self._known_ns(self._waiting[0])
        return last_ns <= self._waiting[0].stamp_ns + self.config.largest_rig_gap * NANOSECONDS

    def _known_ns(self, measured: FramePose) -> tuple[float, float]:
        """From when to when all transforms between a measurement and the board are known."""
        way = self._way(measured.parent, measured.child)
        links = () if way is None or way.static is not None else (*way.on_body, *way.above, *way.board)
        ends = [(link.stamps_ns[0], link.newest_ns) for link in links if not link.static]
        return max((first for first, _ in ends), default=-inf), min((last for _, last in ends), default=inf)

    def _without_jump(self, found: BodyPose) -> TrackerEvent:
        """The pose, if the body can have come there from where it was last."""
        last = self._last_pose
        if last is not None and self._limited:
            seconds = max(abs(found.stamp_ns - last.stamp_ns), 1) / NANOSECONDS
            speed = dist(found.pose.position, last.pose.position) / seconds
            spin = angle_between(found.pose.orientation_wxyz, last.pose.orientation_wxyz) / seconds
            if speed > self.config.largest_speed or spin > self.config.largest_spin:
                limits = f"{self.config.largest_speed:g} m/s and {self.config.largest_spin:g} rad/s at most"
                why = f"jump: found {speed:.3g} m/s and {spin:.3g} rad/s from the last pose, expected {limits}"
                return BadPose(found.stamp_ns, self.config.body_frame, why, "jump")
        self._last_pose = found
        return found

    def _in_board(self, measured: FramePose, *, ended: bool) -> BodyPose | None:
        """The body in the board's frame by a measurement; None as long as the rig's poses do not determine it.

        Args:
            measured: of the body.
            ended: whether no more of the rig's poses are awaited.
        """
        way = self._way(measured.parent, measured.child)
        poses = None if way is None else way.at(measured.stamp_ns, self.config.largest_rig_gap * NANOSECONDS, ended=ended)
        if poses is None:
            return None
        body, above, to_board = poses
        pose = measured.pose
        if body is not IDENTITY or above is not IDENTITY or 0.0 in pose.position or 0.0 in pose.orientation_wxyz:
            pose = compose(above, compose(pose, body))  # with two identities it changes nothing but signs of zeros
        placed = self._centered(compose(to_board, pose))
        moves = way is not None and way.static is None
        return BodyPose(measured.stamp_ns, placed, Carrier(measured.parent, compose(to_board, above)) if moves else None)

    def _run_in_board(self, way: tuple[ScalarPose, ScalarPose, ScalarPose], measured: PoseRun) -> PoseRun:
        """The same for a run over a way that does not move: the scalars' arithmetic over columns of numbers."""
        body, above, to_board = way
        columns = ScalarPose(cast(Any, tuple(measured.positions.T)), cast(Any, tuple(measured.orientations_wxyz.T)))
        placed = self._centered(compose(to_board, compose(above, compose(columns, body))))
        return PoseRun(measured.stamps_ns, *(np.stack(part, axis=1) for part in placed))

    def _centered(self, tracked: ScalarPose) -> ScalarPose:
        """The pose of the described body's frame, its origin in the centre of mass."""
        return tracked if self.center == IDENTITY else compose(tracked, self.center)

    def _way(self, parent: str, child: str) -> _Way | None:
        """How a measurement of these frames leads to the board, looked up once while the tree keeps its shape."""
        shape, ways = self._ways
        if shape != self._tree.shape or len(ways) > MOST_PARENTS:
            self._ways = self._tree.shape, (ways := {})
        if (parent, child) not in ways:
            ways[parent, child] = self._looked_up(parent, child)
        return ways[parent, child]

    def _looked_up(self, parent: str, child: str) -> _Way | None:
        on_body, paths = self._tree.path(self.config.body_frame, child), self._paths_to_common(parent)
        if on_body is None or paths is None:
            return None
        way = _Way(on_body, *paths, None)
        moves = any(not link.static for links in way[:3] for link in links)
        return way if moves else way._replace(static=way.at(0, 0.0))

    def _paths_to_common(self, parent: str) -> tuple[list[Link], list[Link]] | None:
        """The links from the measurement's parent, and from the board, up to the nearest frame above both."""
        board_frame = self.config.board_frame or parent
        for common, _ in self._tree.ancestors(parent):
            from_board = self._tree.path(board_frame, common)
            if from_board is not None:
                return self._tree.path(parent, common) or [], from_board
        return None

    def _last_look(self, why: str) -> list[TrackerEvent]:
        """The body poses that wait, those placed for which the board is known: an earlier one may have waited in vain."""
        events: list[TrackerEvent] = []
        while self._waiting:
            measured = self._waiting.popleft()
            found = self._in_board(measured, ended=True)
            placed = None if found is None else self._without_jump(found)
            events.append(placed or self._lost(measured, why))
        return events

    def _lost(self, measured: FramePose, why: str) -> BadPose:
        return BadPose(measured.stamp_ns, measured.child, f"board: found {why}, {self._wanted(measured)}", "frame")

    def _wanted(self, measured: FramePose) -> str:
        """What a pose waited for, which frames there are, and what to do."""
        parent, board = measured.parent, self.config.board_frame
        if self._way(parent, measured.child) is not None:
            wanted = f"expected transforms between '{board}' and '{parent}'"
            first_ns, last_ns = self._known_ns(measured)
            if last_ns < measured.stamp_ns:
                return f"{wanted} {AROUND}, found them only before it: they come late, have other stamps, or ended"
            if first_ns > measured.stamp_ns:
                return f"{wanted} {AROUND}, found them only after it: the poses come late, have other stamps, or began sooner"
            gap = f"at most {self.config.largest_rig_gap:g} s apart {AROUND}"
            return f"{wanted} {gap}: send them faster, or once on /tf_static"
        wanted = f"expected poses that lead from frame '{board}' to frame '{parent}' at its time"
        here = ", ".join(self._tree.frames[:MOST_LISTED]) or "none"
        named = "" if parent else "; header.frame_id of the poses is empty: set it"
        on_board = "where poses are given on the board, use --board-frame '' (of a node: board_frame:=none)"
        return f"{wanted}{named}; frames here: {here}; {on_board}"

    def _counted(self, events: list[TrackerEvent]) -> tuple[TrackerEvent, ...]:
        for event in events:
            self.counts[
                "poses" if isinstance(event, BodyPose) else "clock" if isinstance(event, ClockJump) else event.kind
            ] += 1
        return tuple(events)


def _pose_of(entry: Any) -> ScalarPose:
    position, orientation_wxyz = entry
    return ScalarPose(*stamped_pose((0, *position, *orientation_wxyz))[1:])


def _link_of(entry: Mapping[str, Any]) -> Link:
    static, stamps_ns = bool(entry["static"]), [whole(stamp_ns) for stamp_ns in entry["stamps_ns"]]
    poses = [_pose_of(pose) for pose in entry["poses"]]
    if not poses or len(stamps_ns) != (0 if static else len(poses)):
        raise ValueError(f"{len(poses)} poses with {len(stamps_ns)} stamps")
    return Link(str(entry["parent"]), static, stamps_ns, poses)


def _frame_pose_of(entry: Mapping[str, Any]) -> FramePose:
    parent, child = str(entry["parent"]), str(entry["child"])
    return FramePose(whole(entry["stamp_ns"]), parent, child, _pose_of(entry["pose"]), bool(entry["static"]))
