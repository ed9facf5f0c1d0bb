"""How large a body is in units of its description: by how high it stands on edges and corners.

    r = min over t of (z(t) - z_rest) / (d(t) - d_rest)

z is the height of the origin, d how high the described body's origin is over its lowest corner. A body of r times the
described size that stands on a corner is r (d - d_rest) higher than at rest, and higher still in the air. The board's
height cancels, with which a body that is too large is easily confused. Rounded corners, and boards that give way, make r
some percent too small.
"""

import numpy as np

from contact_curation.geometry import quaternions
from contact_curation.geometry.polytopes import Polytope
from contact_curation.geometry.quaternions import Array
from contact_curation.motion.calibration import calibrated_poses
from contact_curation.motion.survey.falls import Survey
from contact_curation.motion.survey.rig import RigEstimate

FEWEST_THROWS = 6

HIGHER = 0.2
"""Of the height at rest: a body that is so much higher over its lowest corner stands on an edge or a corner."""

USUAL = 0.96
"""What `size_ratio` is for a body as described: rounded corners make it small."""


def size_ratio(survey: Survey, polytope: Polytope, found: RigEstimate) -> float | None:
    """The body's size over its description's; None where too few throws tumble over edges.

    Args:
        survey: of the poses.
        polytope: as described.
        found: the rig of the same survey, whose tilt and scale hold here.
    """
    ratios = []
    for throw in survey.throws:
        flight, rest = throw.flights[0], throw.rest
        if rest is None:
            continue
        series = survey.series[flight.series]
        frames = slice(flight.first, rest.first + 1)
        positions, orientations = calibrated_poses(series.positions[frames], series.orientations_wxyz[frames], found.rig)
        lever = -np.min(quaternions.to_matrix(orientations)[:, 2] @ polytope.vertices.T, axis=1)  # (n,)
        if (ratio := standing_ratio(positions[:, 2], lever)) is not None:
            ratios.append(ratio)
    return densest(np.sort(ratios)) if len(ratios) >= FEWEST_THROWS else None


def standing_ratio(height: Array, lever: Array) -> float | None:
    """Of one throw; None where it never stands on an edge or a corner.

    Args:
        height: (n,) of the origin, at rest in the last frame [m].
        lever: (n,) how high the described body's origin is over its lowest corner [m].
    """
    tumbling = lever - lever[-1] > HIGHER * lever[-1]
    tumbling[-1] = False
    if not tumbling.any():
        return None
    return float(((height[tumbling] - height[-1]) / (lever[tumbling] - lever[-1])).min())


def densest(ratios: Array) -> float:
    """Amid the shortest interval that holds half of the sorted ratios (K,): some throws never stand on an edge."""
    half = (len(ratios) + 1) // 2
    widths = ratios[half - 1 :] - ratios[: len(ratios) - half + 1]
    at = int(np.argmin(widths))
    return float(np.median(ratios[at : at + half]))
