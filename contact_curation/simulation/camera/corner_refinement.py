"""Refines the corners of a tag to a few hundredths of a pixel: intersections of lines that are fitted to all edge pixels.

The AprilTag library places each edge by few samples in steps of a quarter pixel, which adds more noise than the image has. Here
the edges of the black square are sampled along cross-sections, one per pixel of an edge's length. In a cross-section the edge
is at the mean position of the rises in grey value, sum_k x_k g_k / sum_k g_k with the rise g_k at x_k. A line is fitted to
these positions. Negative rises count, too: leaving them out would bias the edge towards the white side, which is noisier.
"""

from typing import NamedTuple

import numpy as np
from scipy.ndimage import map_coordinates

from contact_curation.geometry.quaternions import Array
from contact_curation.geometry.tags import BLACK_CELLS
from contact_curation.simulation.camera.tag_textures import Image

INNER = 0.1
"""Share of an edge that is left out at each end, where the next edge is near."""

REACH = 0.45
"""Half length of a cross-section in cells of the tag: on each side of the edge one cell has no other edge."""

REACHES = (3.0, 1.5)
"""Largest half length of a cross-section in each of the successive rounds [px]; a longer one contains more noise."""

SPACING = 0.5
"""Distance between the samples of a cross-section [px]."""

SMALLEST_RISE = 10.0
"""Smallest rise in grey value of an edge."""

FEWEST_CROSSINGS = 4
MIDDLE_OF_FIRST_PIXEL = 0.5


class Line(NamedTuple):
    """A line in the image: the points x with `normal . x = offset` [px].

    Attributes:
        normal: (2,) unit vector.
        offset: [px].
    """

    normal: Array
    offset: float


def refined_corners(image: Image, corners: Array) -> Array:
    """Refines the corners (4, 2) [px] of a tag; returns them unchanged if an edge is not found in the image.

    Args:
        image: grey values (height, width).
        corners: (4, 2) corners [px] in order around the tag, as the AprilTag library gives them.
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
    """Fits a line to an edge of a tag; None if the tag is too small or there is no rise from black to white.

    Args:
        image: grey values (height, width).
        start: (2,) one end of the edge [px].
        end: (2,) other end of the edge [px].
        middle: (2,) centre of the tag [px], on the black side of the edge.
        longest: largest half length of a cross-section [px].
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
    """Robust fit of a line to (at, steps): slope and intercept; an outlier weighs only as much as a typical residual."""
    weights = np.ones_like(steps)
    for _ in range(3):
        slope, first = np.polynomial.polynomial.polyfit(at, steps, 1, w=weights)[::-1]
        off = np.abs(steps - first - slope * at)
        typical = 2.0 * float(np.median(off)) + 1e-3
        weights = np.sqrt(np.minimum(1.0, typical / np.maximum(off, 1e-9)))
    return float(slope), float(first)


def _meeting(one: Line, other: Line) -> Array:
    """Intersection of two lines (2,) [px]; not finite if they are parallel."""
    (a, b), (c, d) = one.normal, other.normal
    area = a * d - b * c
    if abs(area) < 1e-6:
        return np.full(2, np.inf)
    return np.array([(d * one.offset - b * other.offset) / area, (a * other.offset - c * one.offset) / area])
