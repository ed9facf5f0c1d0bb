"""The ground's tilt and height taken about the centroid of a pool: nothing depends on where the board's origin lies.

With the plane n(tilt) . (x - pivot) = height, moving the pivot by d changes only which combination of tilt and height is called
tilt: d/dtilt_a becomes d/dtilt_a + (b_a . d) d/dheight, b_a the direction in which tilt a moves the normal (METHOD 1.1, 2.2).
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from contact_curation.geometry.quaternions import Array
from contact_curation.information.record import ParameterBlock, TossInformation


def pool_centroid(infos: Sequence[TossInformation]) -> Array:
    """Mean position (3,) over all transitions of a pool [characteristic lengths]."""
    weights = np.array([info.transitions for info in infos], dtype=float)
    return np.asarray(weights @ np.array([info.centroid for info in infos]) / weights.sum())


def recentred(infos: Sequence[TossInformation]) -> tuple[TossInformation, ...]:
    """The same information about the centroid of these tosses; models without tilt and height come back as they are.

    The sum runs over ids in order, so that the centroid is the same to the last digit however the tosses are ordered.
    """
    if not infos or infos[0].tilt_axes.shape[0] == 0:
        return tuple(infos)
    centroid = pool_centroid(sorted(infos, key=lambda info: info.toss_id))
    return tuple(recentred_on(info, centroid) for info in infos)


def recentred_on(info: TossInformation, pivot: Array) -> TossInformation:
    """The same information about `pivot` (3,), which becomes its centroid, so that recentring twice is recentring once.

    Block traces change by what the factor says. What was cut off the factor is a share of the trace below 1e-3 (METHOD 2.3),
    so a trace about another point is off by less than that, and blocks other than the tilt not at all.
    """
    shift = info.tilt_axes @ (pivot - info.centroid)
    factor, score_sum = (sheared(rows, info.blocks, shift) for rows in (info.factor, info.score_sum))
    gained = np.square(factor).sum(axis=0) - np.square(info.factor).sum(axis=0)
    moved = np.array([gained[block.start : block.stop].sum() for block in info.blocks])
    return replace(
        info, factor=factor, score_sum=score_sum, block_traces=np.maximum(info.block_traces + moved, 0.0), centroid=pivot
    )


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
