"""What tosses say of the rig that tracked them: how its board lies, and how long its metre is.

Nothing but the tosses is needed. A body comes to rest flat on the board, so that the mean of the faces that it lies on is the
board's plane; and it falls by 9.81 m/s^2, so that a tracker that sees it fall by less measures lengths too short (or time too
slow, which free fall alone cannot tell apart). Both are the rig's, the same for all tosses, and are put right together: the
frame is turned until the mean rest is level, and lengths are multiplied.

A board that leans in the tracker's frame looks to a learner like ground that leans and gravity that does not; a short metre
looks like a small body. Of ContactNets' public tosses both are true (docs/rule.md).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from contact_curation.errors import InvalidValueError
from contact_curation.geometry import quaternions
from contact_curation.geometry.polytopes import Polytope
from contact_curation.geometry.quaternions import Array
from contact_curation.motion.gates import footing, rest_normal
from contact_curation.motion.toss import NANOSECONDS, Toss

FEWEST_TOSSES = 8
"""Of which a rig can be told."""

FEWEST_FRAMES = 12
"""In the air, for an acceleration."""

CLEARANCE = 0.012
"""A body whose corners are higher than this is in the air [m]."""


@dataclass(frozen=True, eq=False)
class Rig:
    """How poses of a rig are put right.

    Attributes:
        normal: (3,) of the board's plane, up, in the frame of the poses.
        centre: (3,) amid where bodies came to rest; it stays where it is but for its height, which is scaled [m].
        scale: what lengths are multiplied with.
        rests: tosses that tell the normal.
        falls: tosses that tell the scale.
    """

    normal: Array
    centre: Array
    scale: float
    rests: int
    falls: int

    @property
    def lean(self) -> float:
        """Angle of the board against the frame of the poses [rad]."""
        return float(np.arccos(min(self.normal[2], 1.0)))


def rig_of(tosses: Sequence[Toss], polytope: Polytope, gravity: float = 9.81) -> Rig:
    """The rig that tosses were tracked with.

    Args:
        tosses: of one body, all tracked by the same rig.
        polytope: of the body.
        gravity: true one [m/s^2].

    Raises:
        InvalidValueError: fewer than `FEWEST_TOSSES` of them come to rest, or are long enough in the air.
    """
    rests = [rest_normal(corners) for toss in tosses if (corners := footing(toss, polytope)) is not None]
    falls = [fall for toss in tosses if (fall := _fall(toss, polytope)) is not None]
    for what, found in (("come to rest", rests), (f"are {FEWEST_FRAMES} frames in the air", falls)):
        if len(found) < FEWEST_TOSSES:
            raise InvalidValueError(f"tosses that {what}", len(found), f"at least {FEWEST_TOSSES}, to tell the rig by them")
    normal = np.median(rests, axis=0)
    accelerations, weights = (np.array(each) for each in zip(*falls))
    seen = np.linalg.norm(weights @ accelerations) / weights.sum()
    last = np.array([toss.positions[-1] for toss in tosses])
    centre = np.array([*last[:, :2].mean(axis=0), 0.0])
    return Rig(normal / np.linalg.norm(normal), centre, gravity / float(seen), len(rests), len(falls))


def put_right(toss: Toss, rig: Rig) -> Toss:
    """The toss as a level rig with a true metre would have tracked it."""
    axis = np.cross(rig.normal, [0.0, 0.0, 1.0])
    length = float(np.linalg.norm(axis))
    turn = quaternions.exp(axis * (rig.lean / length if length else 0.0))
    centre = rig.centre * [1.0, 1.0, rig.scale]
    return replace(
        toss,
        positions=centre + rig.scale * quaternions.rotate(turn, toss.positions - rig.centre),
        orientations_wxyz=quaternions.multiply(turn, toss.orientations_wxyz),
        linear_velocities=rig.scale * quaternions.rotate(turn, toss.linear_velocities),
        angular_velocities=quaternions.rotate(turn, toss.angular_velocities),
    )


def _fall(toss: Toss, polytope: Polytope) -> tuple[Array, float] | None:
    """(3,) acceleration before the first contact [m/s^2], and its weight: the inverse of its variance goes as n^5."""
    low = polytope.corner_heights(toss.positions, toss.orientations_wxyz).min(axis=1) < CLEARANCE
    frames = int(np.argmax(low)) if low.any() else toss.frames
    if frames < FEWEST_FRAMES:
        return None
    times = (toss.stamps_ns[:frames] - toss.stamps_ns[0]) / NANOSECONDS
    terms = np.stack([np.ones(frames), times, 0.5 * times**2], axis=1)
    return np.linalg.lstsq(terms, toss.positions[:frames], rcond=None)[0][2], float(frames) ** 5
