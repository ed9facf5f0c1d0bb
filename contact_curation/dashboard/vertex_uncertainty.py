"""How sure a polytope's vertices and friction are by the selected tosses, from their information alone (method.md 2.8).

    Cramer-Rao   C = (A0 + H / sigma^2)^-1,    H = sum of the selected tosses' Gauss-Newton information
    sigma^2      tr(H_o^+ sum s s^T) / rank H_o   over tosses theta was not fitted to, s being a toss's sum of scores

It is a lower bound, which holds if the model is right. A0 is the spread of the published initialisation, as in
`learning.uncertainty`. That module is the one to quote: it has the tosses themselves, so that its sigma^2 is over transitions
and it knows the sandwich, too. Here sigma^2 is over tosses, for a picture that follows every change of the selected set within
milliseconds.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from contact_curation.contact.evaluation import Estimator
from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array
from contact_curation.information.pool import Indices, Pool
from contact_curation.information.subspace import identifiable_subspace

VERTICES, FRICTION = "vertices_normal", "friction"
PRIOR_DEVIATION = 0.4
"""Standard deviation of every parameter before the first toss, that of the published initialisation (method.md 1.1)
[characteristic lengths, shares, rad]."""

FEWEST_OTHERS = 8
"""Fewest unselected tosses from which sigma^2 is estimated; with fewer, all tosses are used."""


@dataclass(frozen=True, eq=False)
class VertexUncertainty:
    """Ellipsoids of one standard deviation, in the body's frame.

    Attributes:
        half_axes: (V, 3) [characteristic lengths], shortest first.
        directions: (V, 3, 3) right-handed; columns are unit vectors along the axes.
        friction: standard deviation of the friction coefficient's logarithm; NaN in a form that has no such parameter.
    """

    half_axes: Array
    directions: Array
    friction: float

    @property
    def largest(self) -> Array:
        """(V,) the longest half axis of each."""
        return np.asarray(self.half_axes[:, -1])


def vertex_uncertainty(pool: Pool, selected: Sequence[str]) -> VertexUncertainty:
    """Computes how accurately the selected tosses determine vertices and friction.

    Args:
        pool: pool of a polytope, scored with the Gauss-Newton estimator.
        selected: ids of the tosses that theta is fitted to; none gives the prior.

    Raises:
        InvalidValueError: a pool of another model or estimator, in which there is no such thing, or a toss that is not in it.
    """
    block = next((one for one in pool.infos[0].blocks if one.name == VERTICES), None)
    if block is None or pool.sketched or pool.infos[0].estimator != Estimator.GAUSS_NEWTON:
        found = f"model {pool.infos[0].model} with estimator {pool.infos[0].estimator}"
        raise InvalidValueError("information", found, f"a polytope's, with estimator {Estimator.GAUSS_NEWTON.value}")
    information: Array = np.eye(pool.parameters) / PRIOR_DEVIATION**2
    indices = pool.indices_of(selected)
    if indices.size:
        information = information + _information(pool, indices) / noise_variance(pool, selected)
    whole = np.linalg.inv(information)
    covariance = whole[block.start : block.stop, block.start : block.stop]
    count = (block.stop - block.start) // 3
    blocks = np.einsum("kikj->kij", covariance.reshape(count, 3, count, 3))  # (V, 3, 3)
    variances, directions = np.linalg.eigh(blocks)
    directions[..., 0] *= np.sign(np.linalg.det(directions))[:, None]
    friction = next((float(whole[one.start, one.start]) for one in pool.infos[0].blocks if one.name == FRICTION), np.nan)
    return VertexUncertainty(np.sqrt(np.maximum(variances, 0.0)), directions, float(np.sqrt(friction)))


def uncertainty_if_known(pool: Pool, selected: Sequence[str]) -> VertexUncertainty | None:
    """Uncertainty of the vertices as `vertex_uncertainty`; None for empirical information and for networks."""
    try:
        return vertex_uncertainty(pool, selected)
    except InvalidValueError:
        return None


def noise_variance(pool: Pool, selected: Sequence[str]) -> float:
    """Sigma^2 of the residuals, by the tosses that are not selected if there are enough of them, else by all."""
    inside = frozenset(selected)
    others = [toss_id for toss_id in pool.ids if toss_id not in inside]
    indices = pool.indices_of(others if len(others) >= FEWEST_OTHERS else pool.ids)
    whitening = identifiable_subspace(_information(pool, indices)).whitening
    rows = pool.toss_scores[indices] @ whitening
    return float((rows * rows).sum() / whitening.shape[1])


def _information(pool: Pool, indices: Indices) -> Array:
    """(P, P) summed over some tosses."""
    rows = pool.stacked(indices).reshape(-1, pool.parameters)
    return np.asarray(rows.T @ rows)
