"""The subspace in which a pool's tosses are compared: all that they can tell, or of a network what they tell best.

A network has more weights than any pool has transitions, so that the smallest eigenvalue of its information is zero by counting
and each transition is the only one to know some direction. There log-det, leverage, the smallest eigenvalue and the diagnostics
are about the directions that the pool as a whole knows best (METHOD 2.7).
"""

from contact_curation.information.pool import Pool
from contact_curation.information.subspace import EIGENVALUE_CUT, IdentifiableSubspace, identifiable_subspace, leading_subspace

LEADING_DIRECTIONS = 64


def pool_subspace(pool: Pool, cut: float = EIGENVALUE_CUT) -> IdentifiableSubspace:
    """The subspace for a pool; `cut` and errors as in `subspace`."""
    if pool.sketched:
        return leading_subspace(pool.fisher, LEADING_DIRECTIONS, cut)
    return identifiable_subspace(pool.fisher, cut)
