"""Whether the tracked frame is the described body's, by the heights of bodies that tumble and come to rest.

The described axes may be exchanged (half extents in another order, a mesh with y up), and the origin that is tracked may be
away from the described one. With M a turn by right angles, o the place of the body seen from the poses, v its vertices about
its centre of mass, and h(t) the height of its lowest corner M v + o, every throw gives

    |h(rest)|                   the height at rest, 0 on the described board
    h(rest) - min over t h(t)   how deep corners go below it
    r                           the size by the heights on edges and corners, as in `size`

All three deviate little for the frame that is tracked, on whatever face the body comes to rest. A board at another height, or a
body of another size or with another centre of mass, is brought near by no turn and no place. The one place that is tried is
what bodies turn about in the air: rests on one face tell nothing of a marker along that face.
"""

from dataclasses import dataclass
from itertools import product

import numpy as np

from contact_curation.geometry import quaternions
from contact_curation.geometry.quaternions import Array
from contact_curation.geometry.scalars import vector
from contact_curation.motion.calibration import RigCalibration
from contact_curation.motion.scales import size_of
from contact_curation.motion.survey.falls import Survey
from contact_curation.motion.survey.size import FEWEST_THROWS, USUAL, densest, standing_ratio

MISFIT = 0.1
"""Of the body's size: up to which a frame fits. Simulated rigid bodies have 0.02 to 0.1 under the described one."""

BETTER_FIT, ALIKE = 2.5, 1.5
"""Times: so much less must another frame leave; the body may be turned into itself, and then frames fit alike."""


def _turns() -> Array:
    """(24, 4) the turns by right angles, smaller ones first: of those that fit alike the first counts."""
    signed = np.array([one for one in product((0.0, 1.0, -1.0), repeat=4) if next(filter(None, one), 0.0) > 0.0])
    turns = quaternions.normalized(signed[np.isin(np.abs(signed).sum(axis=1), (1.0, 2.0, 4.0))])
    return np.asarray(turns[np.argsort(-turns[:, 0], kind="stable")])


TURNS = _turns()


@dataclass(frozen=True, eq=False)
class TrackedFrame:
    """A frame that fits much better than the described one.

    Attributes:
        turn_wxyz: (4,) M.
        place: (3,) o, in the axes of the poses [m].
        described, found: misfits of the described frame, and of this one, relative to the body's size.
    """

    turn_wxyz: Array
    place: Array
    described: float
    found: float

    @property
    def is_turned(self) -> bool:
        return bool(self.turn_wxyz[0] < 1.0)

    @property
    def axes(self) -> str:
        """Along which axes of the poses the described x, y and z are, e.g. "x, z, -y"."""
        turn = quaternions.to_matrix(self.turn_wxyz)
        places = np.abs(turn).argmax(axis=0)
        signs = turn[places, range(3)] < 0.0
        return ", ".join(("-" if minus else "") + "xyz"[place] for place, minus in zip(places, signs, strict=True))

    @property
    def rig(self) -> RigCalibration:
        """What corrects the poses."""
        turn, back = -quaternions.log(self.turn_wxyz), quaternions.conjugate(self.turn_wxyz)
        return RigCalibration(marker_turn=vector(turn), marker_offset=vector(quaternions.rotate(back, self.place)))


def tracked_frame(survey: Survey, vertices: Array, center_of_mass: Array, seen: Array | None) -> TrackedFrame | None:
    """The frame that throws fit; None where they fit the described one, or no other fits much better.

    Args:
        survey: of poses of the described centre of mass [m], z up.
        vertices: (V, 3) about it [m].
        center_of_mass: (3,) seen from the tracked origin, as described [m].
        seen: (3,) what bodies turn about in the air, seen from the poses, if it is elsewhere [m].
    """
    motions = [
        (one.positions[frames], quaternions.to_matrix(one.orientations_wxyz[frames])[:, 2])
        for throw in survey.throws
        if throw.rest is not None
        for one in [survey.series[throw.flights[0].series]]
        for frames in [slice(throw.flights[0].first, throw.rest.first + 1)]
    ]
    if len(motions) < FEWEST_THROWS:
        return None
    described = _misfit(motions, vertices)[0]
    if described <= MISFIT:
        return None
    frames = []
    for turn in TURNS:
        corners = quaternions.rotate(turn, vertices)
        for place in [quaternions.rotate(turn, center_of_mass) - center_of_mass, *([] if seen is None else [seen])]:
            misfit, whole = _misfit(motions, corners, place)
            if whole and misfit <= MISFIT and BETTER_FIT * misfit < described:
                frames.append(TrackedFrame(turn, place, described, misfit))
    best = min((one.found for one in frames), default=0.0)
    return next((one for one in frames if one.found <= ALIKE * best), None)  # smaller turns come first


def _misfit(motions: list[tuple[Array, Array]], corners: Array, place: Array | float = 0.0) -> tuple[float, bool]:
    """Relative to the size, and whether enough throws stand on edges or corners.

    Args:
        motions: positions (n, 3), and the vertical in the tracked frame (n, 3), of each throw until it rests.
        corners: (V, 3) M v.
        place: (3,) o.
    """
    heights, depths, ratios = [], [], []
    for positions, vertical in motions:
        height = positions[:, 2] + (vertical * place).sum(axis=1)
        lever = -np.min(vertical @ corners.T, axis=1)
        lowest = height - lever
        heights.append(abs(lowest[-1]))
        depths.append(lowest[-1] - lowest.min())
        ratios.append(standing_ratio(height, lever))
    seen = np.sort([one for one in ratios if one is not None])
    whole = len(seen) >= FEWEST_THROWS
    off = abs(densest(seen) - USUAL) if whole else 0.0
    return float((np.median(heights) + np.median(depths)) / size_of(corners)) + off, whole
