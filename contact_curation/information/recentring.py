"""The ground's tilt and height taken about the centroid of a pool: nothing depends on where the board's origin lies.

With the plane n(tilt) . (x - pivot) = height, moving the pivot by d changes only which combination of tilt and height is called
tilt: d/dtilt_a becomes d/dtilt_a + (b_a . d) d/dheight, b_a the direction in which tilt a moves the normal (METHOD 1.1, 2.2).
"""

from collections.abc import Sequence

import numpy as np

from contact_curation.geometry.quaternions import Array
from contact_curation.information.record import ParameterBlock, TossInformation


def pool_centroid(infos: Sequence[TossInformation]) -> Array:
    """Mean position (3,) over all transitions of a pool [characteristic lengths]."""
    weights = np.array([info.transitions for info in infos], dtype=float)
    return np.asarray(weights @ np.array([info.centroid for info in infos]) / weights.sum())


def about_centroids(fishers: Array, score_sums: Array, blocks: Sequence[ParameterBlock], shifts: Array) -> tuple[Array, Array]:
    """Fisher matrices (K, P, P) and score sums (K, P) with their pivots moved by `shifts` (K, 2) along the tilt's axes."""
    half = sheared(fishers, blocks, shifts[:, None])
    whole = sheared(half.transpose(0, 2, 1), blocks, shifts[:, None])
    return whole, sheared(score_sums, blocks, shifts)


def sheared(rows: Array, blocks: Sequence[ParameterBlock], shift: Array) -> Array:
    """Rows (..., P) with shift (..., 2) times their height column added to their tilt columns."""
    spans = {block.name: block for block in blocks}
    tilt, height = spans["tilt"], spans["height"]
    moved = rows.copy()
    moved[..., tilt.start : tilt.stop] += rows[..., height.start : height.stop] * shift
    return moved
