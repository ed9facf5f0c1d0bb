"""One pose of a stream, as any tracker gives it: a child frame in a parent frame at a time, or the reason why there is none."""

from collections.abc import Iterable
from dataclasses import dataclass
from math import isfinite, sqrt

from contact_curation.geometry.poses import QUATERNION_TOLERANCE
from contact_curation.geometry.scalars import ScalarPose

FARTHEST = 1e6
"""No tracker measures a body further away [m]; such numbers would overflow in velocities."""


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
        kind: "pose" where it is none, "stamp" where its time cannot be, "frame" where nothing leads from its frame to the
            board's, "jump" where the body cannot have come so far; of tags also "camera" and the kinds of `motion.tags.pose`.
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
        return BadPose(stamp_ns, child, f"quaternion norm: found {norm:.6g}, expected 1 within {QUATERNION_TOLERANCE}")
    if max(abs(x), abs(y), abs(z)) > FARTHEST:
        return BadPose(stamp_ns, child, f"position: found {(x, y, z)}, expected one within {FARTHEST:g} m")
    return FramePose(stamp_ns, parent, child, ScalarPose((x, y, z), (w, qx, qy, qz)), static)
