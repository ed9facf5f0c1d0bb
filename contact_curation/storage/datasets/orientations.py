"""Orientations in a table: unit quaternions, rotation matrices, or three angles of which the user says how they turn.

SciPy's `Rotation` makes quaternions of them, and its terms are those of `--angles`: of `xyz` the axes are fixed (extrinsic), of
`XYZ` they turn with the body (intrinsic), the first letter first; `rotvec` is a rotation vector.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import permutations
from math import hypot, isfinite

import numpy as np
from scipy.spatial.transform import Rotation

from contact_curation.errors import InvalidValueError
from contact_curation.geometry.scalars import Quaternion, unit

ROTVEC = "rotvec"
ORDERS = (*("".join(order) for axes in ("xyz", "XYZ") for order in permutations(axes)), ROTVEC)
UNITS = ("deg", "rad")

LEAST_EXACT = 5e-3
"""Largest entry of R R^T - 1: numbers of a rotation matrix have three decimals or more."""

QUATERNION = ("qw", "qx", "qy", "qz")
ANGLES = ("ax", "ay", "az")
ROWS = ("012", "123")
INDEXED = tuple(tuple(f"m{row}{column}" for row in rows for column in rows) for rows in ROWS)
NUMBERED = tuple(tuple(f"m{place + first}" for place in range(9)) for first in (0, 1))
FORMS = (QUATERNION, *INDEXED, *NUMBERED, ANGLES)
"""What columns of an orientation are called in `pose_columns`; entries of matrices row by row."""

type ToQuaternion = Callable[[Sequence[float]], Quaternion]
"""Makes a quaternion (w, x, y, z) of a row's numbers, in the order of the form; raises ValueError for what is no rotation."""


@dataclass(frozen=True)
class AngleConvention:
    """How three angles make a rotation.

    Attributes:
        order: one of `ORDERS`; empty where it is not known.
        unit: deg or rad; empty where only names of columns may say it.
    """

    order: str = ""
    unit: str = ""

    def __post_init__(self) -> None:
        if self.order and self.order not in ORDERS:
            raise InvalidValueError("angles", repr(self.order), f"one of {', '.join(ORDERS)}")
        if self.unit and self.unit not in UNITS:
            raise InvalidValueError("angle_unit", repr(self.unit), f"one of {', '.join(UNITS)}")

    def to_quaternion(self, angles: Sequence[float]) -> Quaternion:
        """Of the angles about x, y and z; order and unit are known.

        Raises:
            ValueError: they are too large.
        """
        degrees = self.unit == "deg"
        if self.order == ROTVEC:
            return _quaternion(Rotation.from_rotvec(np.array(angles), degrees=degrees))
        in_order = ["xyz".index(axis) for axis in self.order.lower()]
        return _quaternion(Rotation.from_euler(self.order, np.array(angles)[in_order], degrees=degrees))


EXACT, ROUNDED = 1e-6, 3e-3
"""Norms of quaternions that differ from 1 by less are as they were written; by up to the second with three decimals."""

UNTOLD = AngleConvention()
"""Of tables without angles."""


def of_quaternion(wxyz: Sequence[float]) -> Quaternion:
    """Of the numbers of a quaternion: as they are, but of unit norm where rounding to some decimals took it from them."""
    w, x, y, z = wxyz
    return unit((w, x, y, z)) if EXACT < abs(hypot(w, x, y, z) - 1.0) < ROUNDED else (w, x, y, z)


def of_matrix(entries: Sequence[float]) -> Quaternion:
    """Of the nine entries of a rotation matrix, row by row.

    Raises:
        ValueError: they are no rotation.
    """
    matrix = np.array(entries).reshape(3, 3)
    with np.errstate(over="ignore", invalid="ignore"):
        error, determinant = np.abs(matrix @ matrix.T - np.eye(3)).max(), np.linalg.det(matrix)
    if not (error <= LEAST_EXACT and determinant > 0.0):
        found = f"a matrix with determinant {determinant:.3g}, of which R R^T is {error:.3g} off the identity"
        raise ValueError(f"found {found}, expected a rotation")
    return _quaternion(Rotation.from_matrix(matrix))


def _quaternion(rotation: Rotation) -> Quaternion:
    w, x, y, z = rotation.as_quat(scalar_first=True).tolist()
    if not isfinite(w):
        raise ValueError("found numbers too large for angles, expected a rotation")
    return w, x, y, z
