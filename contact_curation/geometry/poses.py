"""Rigid poses: where a child frame stands in a parent frame."""

from dataclasses import dataclass

import numpy as np

from contact_curation.errors import InvalidValueError
from contact_curation.geometry import quaternions
from contact_curation.geometry.quaternions import Array

QUATERNION_TOLERANCE = 1e-3
"""A tracker's quaternion further than this from unit norm is refused, never normalised away (FIELD 3)."""


@dataclass(frozen=True, eq=False)
class Pose:
    """Pose of a child frame in its parent: `p_parent = R(orientation) p_child + position`.

    Attributes:
        position: (3,) [m].
        orientation_wxyz: (4,) unit quaternion.
    """

    position: Array
    orientation_wxyz: Array

    def __post_init__(self) -> None:
        position = np.asarray(self.position, dtype=float)
        orientation = np.asarray(self.orientation_wxyz, dtype=float)
        if position.shape != (3,) or orientation.shape != (4,):
            raise InvalidValueError("pose", f"shapes {position.shape} and {orientation.shape}", "(3,) and (4,)")
        if not (np.isfinite(position).all() and np.isfinite(orientation).all()):
            raise InvalidValueError("pose", "a value that is not finite", "finite numbers")
        norm = float(np.linalg.norm(orientation))
        if abs(norm - 1.0) > QUATERNION_TOLERANCE:
            raise InvalidValueError("quaternion norm", f"{norm:.6g}", f"1 within {QUATERNION_TOLERANCE}")
        object.__setattr__(self, "position", position)
        object.__setattr__(self, "orientation_wxyz", orientation / norm)

    @staticmethod
    def identity() -> "Pose":
        return Pose(np.zeros(3), quaternions.IDENTITY)

    def compose(self, child: "Pose") -> "Pose":
        """The pose of `child`, given in this frame, in this frame's parent."""
        return Pose(
            self.position + quaternions.rotate(self.orientation_wxyz, child.position),
            quaternions.multiply(self.orientation_wxyz, child.orientation_wxyz),
        )

    def inverse(self) -> "Pose":
        back = quaternions.conjugate(self.orientation_wxyz)
        return Pose(-quaternions.rotate(back, self.position), back)
