"""A board, or a camera over it, that was moved between two throws: what bodies rest on is another plane from there on.

One plane for all rests, or one for those before a throw and one for those from it on: where the second leaves far less over, on
faces that bodies lay on before and after, the plane has moved. A body that is described wrong lies wrong on a face at any time.
"""

from typing import NamedTuple

import numpy as np

from contact_curation.geometry.quaternions import Array
from contact_curation.motion.survey.rests import Rests

FEWEST = 4
"""Rests before, and after."""

LARGEST_SHARE = 0.33
"""Of what one plane leaves over, in the mean of absolute values, that two leave where it has moved."""

SMALLEST_STEP, SMALLEST_TILT = 1.5e-3, np.radians(0.4)
"""[m, rad] Of what is worth a line."""

ALIKE = 0.5
"""Share of the whole step by which what lies on each face changes, at least."""


class BoardMove(NamedTuple):
    """How the plane has moved.

    Attributes:
        throw: index of the first throw after it, among all throws.
        higher: the plane about the middle of the rests, against before [m].
        tilt: between the two [rad].
    """

    throw: int
    higher: float
    tilt: float


class _Plane(NamedTuple):
    up: Array  # (3,)
    height: float  # at the middle of all rests [m]
    uneven: float  # heights beside it, sum of absolute values [m]
    askew: float  # normals beside its own, likewise [rad]


def board_move(rests: Rests) -> BoardMove | None:
    """The move that explains the heights or tilts of K rests in order of time; None where one plane does."""
    if len(rests) < 2 * FEWEST:
        return None
    normals = -np.einsum("kij,kj->ki", rests.turns, rests.normals)  # (K, 3)
    places = rests.places - rests.places.mean(axis=0)

    def plane(part: slice) -> _Plane:
        up = np.median(normals[part], axis=0)
        up /= np.linalg.norm(up)
        heights = places[part] @ up - rests.depths[part]
        height = float(np.median(heights))
        askew = np.linalg.norm(normals[part] - up, axis=1).sum()
        return _Plane(up, height, float(np.abs(heights - height).sum()), float(askew))

    whole = plane(slice(None))
    pairs = {at: (plane(slice(at)), plane(slice(at, None))) for at in range(FEWEST, len(rests) - FEWEST + 1)}
    for name in ("uneven", "askew"):
        at = min(pairs, key=lambda one: sum(getattr(side, name) for side in pairs[one]))
        before, after = pairs[at]
        higher, turned = after.height - before.height, after.up - before.up
        tilt = float(np.linalg.norm(turned))
        large = abs(higher) >= SMALLEST_STEP if name == "uneven" else tilt >= SMALLEST_TILT
        told = getattr(before, name) + getattr(after, name) <= LARGEST_SHARE * getattr(whole, name)
        if large and told:
            step = (places @ whole.up - rests.depths) / higher if name == "uneven" else normals @ turned / tilt**2
            if _on_each_face(rests, at, step):
                return BoardMove(int(rests.throws[at]), higher, tilt)
    return None


def _on_each_face(rests: Rests, at: int, values: Array) -> bool:
    """Whether values (K,) change by nearly 1 on the faces that bodies lay on before and after, and there is one."""
    _, faces = np.unique(np.round(rests.normals, 6), axis=0, return_inverse=True)
    shared = np.intersect1d(faces[:at], faces[at:])
    steps = [np.median(values[at:][faces[at:] == face]) - np.median(values[:at][faces[:at] == face]) for face in shared]
    return bool(steps) and min(steps) > ALIKE
