"""Corners of a tag to a few hundredths of a pixel: where straight lines through all pixels of its edges meet.

The AprilTag library moves each edge by few samples in steps of a quarter pixel, which leaves more noise than the image has.
Here each edge of the black square is crossed once per pixel of its length. The step from black to white in a crossing is where
the grey value rises on average, sum_k x_k g_k / sum_k g_k with the rises g_k at x_k; a line is fitted to the steps. Falls
count as they are: were they left out, noise would rise on average, and more so on the white side, where there is more of it.
"""

from typing import NamedTuple

import numpy as np
from scipy.ndimage import map_coordinates

from contact_curation.geometry.quaternions import Array
from contact_curation.geometry.tags import BLACK_CELLS
from contact_curation.simulation.camera.tag_textures import Image

INNER = 0.1
"""Share of an edge that is left out at both of its ends, where the next edge is near."""

REACH = 0.45
"""How far a crossing goes to both sides, in cells of the tag: there is one cell without another step on either side."""

REACHES = (3.0, 1.5)
"""[px] At most, in one round after the other: the further a crossing goes, the more noise is in it."""

SPACING = 0.5
"""[px] of the samples of a crossing."""

SMALLEST_RISE = 10.0
"""Grey values that an edge rises by at least."""

FEWEST_CROSSINGS = 4
MIDDLE_OF_FIRST_PIXEL = 0.5


class Line(NamedTuple):
    """Points x with `normal . x = offset` [px].

    Attributes:
        normal: (2,) unit vector.
        offset: [px].
    """

    normal: Array
    offset: float


def refined_corners(image: Image, corners: Array) -> Array:
    """Corners (4, 2) [px] nearer to where they are; as given where the image does not show them.

    Args:
        image: grey.
        corners: in order round the tag, as the AprilTag library gives them.
    """
    given = corners
    for reach in REACHES:
        middle = corners.mean(axis=0)
        lines = [edge_line(image, corners[place], corners[(place + 1) % 4], middle, reach) for place in range(4)]
        kept = [line for line in lines if line is not None]
        if len(kept) < 4:
            return given
        corners = np.array([_meeting(kept[place - 1], kept[place]) for place in range(4)])
        if not np.abs(corners - given).max() < REACHES[0]:  # also where lines are parallel
            return given
    return corners


def edge_line(image: Image, start: Array, end: Array, middle: Array, longest: float) -> Line | None:
    """The line along an edge of a tag; None where the tag is too small or there is no step from black to white.

    Args:
        image: grey.
        start: (2,) one end of the edge [px].
        end: (2,) the other.
        middle: (2,) of the tag: its inside is black.
        longest: how far a crossing goes to both sides at most [px].
    """
    length = float(np.linalg.norm(end - start))
    along = (end - start) / max(length, SPACING)
    across = np.array([along[1], -along[0]])
    width = float(across @ (start - middle))
    outward = across if width > 0.0 else -across
    reach = int(min(REACH * 2.0 * abs(width) / BLACK_CELLS, longest) / SPACING)
    crossings = int(length * (1.0 - 2.0 * INNER))
    if reach < 2 or crossings < FEWEST_CROSSINGS:
        return None
    at = length * (INNER + (1.0 - 2.0 * INNER) * (np.arange(crossings) + 0.5) / crossings)  # (N,)
    offsets = SPACING * np.arange(-reach, reach + 1)  # (M,)
    places = start + at[:, None, None] * along + offsets[:, None] * outward  # (N, M, 2)
    x, y = np.moveaxis(places - MIDDLE_OF_FIRST_PIXEL, -1, 0)
    rises = np.diff(map_coordinates(image, [y, x], output=float, order=1, mode="nearest"), axis=1)
    heights = rises.sum(axis=1)
    clear = heights > max(0.5 * float(np.median(heights)), SMALLEST_RISE)
    if np.count_nonzero(clear) < FEWEST_CROSSINGS:
        return None
    steps = rises[clear] @ (offsets[1:] - 0.5 * SPACING) / heights[clear]
    slope, first = _fitted(at[clear], steps)
    direction = along + slope * outward
    normal = np.array([direction[1], -direction[0]]) / np.linalg.norm(direction)
    return Line(normal, float(normal @ (start + first * outward)))


def _fitted(at: Array, steps: Array) -> tuple[float, float]:
    """Slope and first value of a line through (at, steps) that outliers pull at only as much as a typical residual."""
    weights = np.ones_like(steps)
    for _ in range(3):
        slope, first = np.polynomial.polynomial.polyfit(at, steps, 1, w=weights)[::-1]
        off = np.abs(steps - first - slope * at)
        typical = 2.0 * float(np.median(off)) + 1e-3
        weights = np.sqrt(np.minimum(1.0, typical / np.maximum(off, 1e-9)))
    return float(slope), float(first)


def _meeting(one: Line, other: Line) -> Array:
    """Where two lines meet (2,); not finite where they do not."""
    (a, b), (c, d) = one.normal, other.normal
    area = a * d - b * c
    if abs(area) < 1e-6:
        return np.full(2, np.inf)
    return np.array([(d * one.offset - b * other.offset) / area, (a * other.offset - c * one.offset) / area])
