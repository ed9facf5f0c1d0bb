"""The poses of a stream, as any tracker gives them: a child frame in a parent frame at a time, or the reason why there is none.

Recordings are read in runs of successive poses, which are arrays; live poses come one by one.

The stages that follow a stream write their state down as plain numbers, lists and names (`snapshot`), which JSON keeps exactly.
Whatever reads such a state does it under `reading_state`, so that another content is refused in one line.
"""

from collections import Counter
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from math import isfinite, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contact_curation.errors import InvalidValueError
from contact_curation.geometry.poses import QUATERNION_TOLERANCE
from contact_curation.geometry.quaternions import Array
from contact_curation.geometry.scalars import Quaternion, ScalarPose, Vector

FARTHEST = 1e6
"""No tracker measures a body further away [m]; such numbers would overflow in velocities."""

LOWEST_RATE = 55.0
"""[Hz] At lower rates short free falls are missed, which need two accelerations."""

LONGEST_NUMBER = 64
"""Bits of a stamp, a count or a place."""


@dataclass(frozen=True, slots=True)
class FramePose:
    """Where `child` stands in `parent`.

    Attributes:
        stamp_ns: header stamp.
        parent: frame the pose is given in.
        child: frame the pose is of.
        pose: child in parent [m].
        static: holds for all times, whatever its stamp (/tf_static).
    """

    stamp_ns: int
    parent: str
    child: str
    pose: ScalarPose
    static: bool = False


@dataclass(frozen=True, slots=True)
class BadPose:
    """A measurement that is not a pose or cannot be used, with the reason.

    Attributes:
        stamp_ns: its header stamp.
        child: frame it was meant for.
        why: one line.
        kind: "pose" where it is none, "far" where it is too far off, "array" where several may be it, "name" where none is
            called so, "twice" where several are, "static" where it is no static transform, "stamp" where its time cannot be,
            "frame" where nothing leads from its frame to the board's, "jump" where the body cannot have come so far; of tags
            also "camera" and the kinds of `motion.tags.pose`.
    """

    stamp_ns: int
    child: str
    why: str
    kind: str = "pose"


def checked_pose(
    stamp_ns: int,
    parent: str,
    child: str,
    position: Iterable[float],
    orientation_wxyz: Iterable[float],
    *,
    static: bool = False,
) -> FramePose | BadPose:
    """A frame pose, or a bad pose where numbers are not finite, far off, or no rotation; nothing is repaired."""
    x, y, z = position
    w, qx, qy, qz = orientation_wxyz
    norm = sqrt(w * w + qx * qx + qy * qy + qz * qz)
    if not (isfinite(norm) and isfinite(x) and isfinite(y) and isfinite(z)):
        return BadPose(stamp_ns, child, f"pose: found {(x, y, z, w, qx, qy, qz)}, expected finite numbers")
    if abs(norm - 1.0) > QUATERNION_TOLERANCE:
        of, kind = (f" of the static transform from '{parent}' to '{child}'", "static") if static else ("", "pose")
        why = f"quaternion norm{of}: found {norm:.6g}, expected 1 within {QUATERNION_TOLERANCE}"
        return BadPose(stamp_ns, child, why, kind)
    if max(abs(x), abs(y), abs(z)) > FARTHEST:
        return BadPose(stamp_ns, child, f"position: found {(x, y, z)}, expected one within {FARTHEST:g} m", "far")
    return FramePose(stamp_ns, parent, child, ScalarPose((x, y, z), (w, qx, qy, qz)), static)


@dataclass(frozen=True, eq=False, slots=True)
class PoseRun:
    """N successive poses, in the order in which they were recorded.

    Attributes:
        stamps_ns: (N,) int64 header stamps.
        positions: (N, 3) [m].
        orientations_wxyz: (N, 4).
    """

    stamps_ns: NDArray[np.int64]
    positions: Array
    orientations_wxyz: Array

    def __len__(self) -> int:
        return len(self.stamps_ns)

    def part(self, start: int, stop: int) -> "PoseRun":
        """The poses from index `start` to before `stop`."""
        return PoseRun(self.stamps_ns[start:stop], self.positions[start:stop], self.orientations_wxyz[start:stop])

    def one_by_one(self) -> Iterator[tuple[int, Vector, Quaternion]]:
        """Stamp [ns], position [m] and orientation of each pose."""
        columns = (*self.positions.T.tolist(), *self.orientations_wxyz.T.tolist())
        x, y, z, a, b, c, d = columns
        return zip(self.stamps_ns.tolist(), zip(x, y, z, strict=True), zip(a, b, c, d, strict=True), strict=True)


@dataclass(frozen=True, eq=False, slots=True)
class FrameRun:
    """Where `child` stands in `parent`, pose by pose; the numbers are those that `checked_pose` accepts."""

    parent: str
    child: str
    poses: PoseRun

    @property
    def frames(self) -> tuple[str, str]:
        """Parent and child."""
        return self.parent, self.child

    def followed_by(self, other: "FrameRun") -> "FrameRun":
        """The poses and then those of another run of the same frames."""
        runs = (self.poses, other.poses)
        arrays = ([getattr(run, name) for run in runs] for name in ("stamps_ns", "positions", "orientations_wxyz"))
        return FrameRun(self.parent, self.child, PoseRun(*map(np.concatenate, arrays)))

    def part(self, start: int, stop: int) -> "FrameRun":
        """The poses from index `start` to before `stop`."""
        return FrameRun(self.parent, self.child, self.poses.part(start, stop))

    def frame_poses(self, *, static: bool = False) -> list[FramePose]:
        """The same poses one by one."""
        return [
            FramePose(stamp_ns, self.parent, self.child, ScalarPose(position, orientation), static)
            for stamp_ns, position, orientation in self.poses.one_by_one()
        ]


@contextmanager
def reading_state(name: str, snapshot: object, writer: str) -> Iterator[None]:
    """Turns what goes wrong while a state is read into one error.

    Args:
        name: of the state, for the message.
        snapshot: what is read.
        writer: the method that gives such states.

    Raises:
        InvalidValueError: the state lacks something or holds something else.
    """
    try:
        yield
    except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as error:
        found = f"{repr(snapshot)[:80]} ({type(error).__name__}: {error})"
        raise InvalidValueError(f"{name} state", found[:200], f"what {writer} gave: begin with an empty store") from error


def whole(value: Any) -> int:
    """A whole number of a state.

    Raises:
        TypeError: it is something else.
        ValueError: it has more than 64 bits.
    """
    if type(value) is not int:
        raise TypeError(f"found {value!r}, expected a whole number")
    if value.bit_length() >= LONGEST_NUMBER:
        raise ValueError(f"found a number of {value.bit_length()} bits, expected at most {LONGEST_NUMBER}")
    return value


def whole_or_none(value: Any) -> int | None:
    """A whole number of a state, or None."""
    return None if value is None else whole(value)


def finite(value: Any) -> float:
    """A finite number of a state.

    Raises:
        TypeError: it is no number.
        ValueError: it is not finite.
    """
    if type(value) not in (int, float):
        raise TypeError(f"found {value!r}, expected a number")
    if not isfinite(value):
        raise ValueError(f"found {value!r}, expected a finite number")
    return float(value)


def counted(numbers: Any) -> Counter[str]:
    """How often what happened, of a state."""
    return Counter({str(kind): whole(number) for kind, number in numbers.items()})


def stamped_pose(row: Any) -> tuple[int, Vector, Quaternion]:
    """A pose of a state: stamp [ns], position [m], orientation (wxyz), from a list of eight numbers."""
    stamp_ns, x, y, z, a, b, c, d = row
    return whole(stamp_ns), (finite(x), finite(y), finite(z)), (finite(a), finite(b), finite(c), finite(d))
