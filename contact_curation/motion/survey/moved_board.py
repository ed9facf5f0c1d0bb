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
    """What some rests lie on, and by how much in all they depart from it."""

    up: Array  # (3,)
    height: float  # at the middle of all rests [m]
    uneven: float  # departures of heights, sum of absolute values [m]
    askew: float  # departures of normals, likewise [rad]


class _Split(NamedTuple):
    """A plane for the rests before the one of this number, and another one from it on."""

    at: int
    before: _Plane
    after: _Plane

    @property
    def higher(self) -> float:
        return self.after.height - self.before.height

    @property
    def turned(self) -> Array:
        return self.after.up - self.before.up

    @property
    def tilt(self) -> float:
        return float(np.linalg.norm(self.turned))

    @property
    def uneven(self) -> float:
        return self.before.uneven + self.after.uneven

    @property
    def askew(self) -> float:
        return self.before.askew + self.after.askew


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
    splits = [_Split(at, plane(slice(at)), plane(slice(at, None))) for at in range(FEWEST, len(rests) - FEWEST + 1)]
    candidates: list[tuple[_Split, Array]] = []  # with what changes by 1 from rests before to rests after, if it is so
    raised, tilted = min(splits, key=lambda one: one.uneven), min(splits, key=lambda one: one.askew)
    if abs(raised.higher) >= SMALLEST_STEP and raised.uneven <= LARGEST_SHARE * whole.uneven:
        candidates.append((raised, (places @ whole.up - rests.depths) / raised.higher))
    if tilted.tilt >= SMALLEST_TILT and tilted.askew <= LARGEST_SHARE * whole.askew:
        candidates.append((tilted, normals @ tilted.turned / tilted.tilt**2))
    for split, values in candidates:
        if _on_each_face(rests, split.at, values):
            return BoardMove(int(rests.throws[split.at]), split.higher, split.tilt)
    return None


def _on_each_face(rests: Rests, at: int, values: Array) -> bool:
    """Whether values (K,) change by nearly 1 on the faces that bodies lay on before and after, and there is one."""
    _, faces = np.unique(np.round(rests.normals, 6), axis=0, return_inverse=True)
    shared = np.intersect1d(faces[:at], faces[at:])
    steps = [np.median(values[at:][faces[at:] == face]) - np.median(values[:at][faces[:at] == face]) for face in shared]
    return bool(steps) and min(steps) > ALIKE
