"""The ground's tilt and height taken about the centroid of a pool, so that nothing depends on where the board's origin lies.

With the plane n(tilt) . (x - pivot) = height, moving the pivot by d along the board changes only which combination of tilt and height is
called tilt: d/dtilt_a becomes d/dtilt_a + (b_a . d) d/dheight, b_a the directions in which the tilt moves the normal (METHOD 1.1, 2.2).
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from contact_curation.geometry.quaternions import Array
from contact_curation.information.record import TossInformation


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
    """The same information about `pivot` (3,) instead of the board's origin.

    Block traces change by what the factor says: the directions it was cut down to hold the tilt and the height to rounding.
    """
    spans = {block.name: block for block in info.blocks}
    change = np.eye(info.parameters)
    change[spans["height"].start, spans["tilt"].start : spans["tilt"].stop] = info.tilt_axes @ pivot
    factor = info.factor @ change
    gained = np.square(factor).sum(axis=0) - np.square(info.factor).sum(axis=0)
    moved = np.array([gained[block.start : block.stop].sum() for block in info.blocks])
    return replace(info, factor=factor, score_sum=info.score_sum @ change, block_traces=np.maximum(info.block_traces + moved, 0.0))
