"""What is known of a polytope after it was fitted to tosses: per parameter in mm, friction and degrees (method.md 2.8).

The one to quote is `deviation`: how far tosses, and transitions with other impulses, disagree about theta (two_way.py), or
Cramer-Rao's where that is more, and what was known before where that is less. It alone contains that the model is not quite
right. Beside it stand three that are known from books, with H the Gauss-Newton information and s the scores at theta, k
counting tosses and t transitions:

    Cramer-Rao  (A0 + H / sigma^2)^-1                        if all residuals were independent and of one variance sigma^2
    sandwich    B (sum_k s_k s_k^T + sigma^4 A0) B           if only tosses are independent, and there are many (Huber 1967)
                with B = (H + sigma^2 A0)^-1
    naive       (sum_t s_t s_t^T)^-1                         the inverse of the empirical Fisher matrix, as often taken

sigma^2 comes from tosses that theta was not fitted to: the mean, over the directions that they measure, of their scores'
variance relative to what H says it is for sigma = 1,

    sigma^2 = tr(H_o^+ sum_t s_t s_t^T) / rank H_o .

One sigma^2, not one per kind of residual: the loss weighs the kinds once and for all, so that theta is fitted as if the
weighted residuals were alike, and what breaks this most is not their kind but impacts, a few frames with most of the loss and
of the information. This figure weighs every residual by what it tells of theta, and does not depend on theta's coordinates.

The s_k are taken about their mean, which is zero where theta is the optimum of the tosses, so that the sandwich means something
next to it, too. With fewer tosses than parameters it cannot see all directions and says too little; Cramer-Rao does not. None
of the three knows of a bias: a friction that is 10 % too low because contacts are soft is known to 2 % by each of them
(docs/explanation/learning.md).

A0 is what was known before the first toss: the spread of the published initialisation. In the sandwich it enters as if it were
one more toss, with score variance sigma^4 A0, so that a vertex that nothing touched is known as well as before, and no better.
"""

from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from contact_curation.configs import check_positive
from contact_curation.contact.evaluation import Estimator
from contact_curation.contact.geometry_parameters import INITIAL_NOISE, RESTITUTION_SPREAD
from contact_curation.contact.loss_config import DEFAULT_LOSS, LossConfig
from contact_curation.contact.models.model import Model
from contact_curation.contact.models.polytope import PolytopeModel
from contact_curation.contact.parameter_form import Form, ParameterForm, parameter_form
from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array
from contact_curation.information.impacts import as_described
from contact_curation.information.subspace import identifiable_subspace, model_covariance, sandwich_covariance
from contact_curation.learning.evaluation.rebounds import Rebound, rebound_of
from contact_curation.learning.fits.polytope_sums import PolytopeSums, fitted_form, polytope_sums
from contact_curation.learning.uncertainty.two_way import impact_scores, interval_factor, two_way_covariance
from contact_curation.motion.survey.sliding import Sliding
from contact_curation.motion.transitions import Transitions


@dataclass(frozen=True)
class KnownConfig:
    """How it is found out what is known.

    Attributes:
        loss: weights and solver.
        vertices, height: what was known before [characteristic lengths].
        friction: the same, as a share.
        tilt: the same [rad].
    """

    loss: LossConfig = field(default_factory=lambda: DEFAULT_LOSS)
    vertices: float = INITIAL_NOISE
    friction: float = INITIAL_NOISE
    tilt: float = INITIAL_NOISE
    height: float = INITIAL_NOISE

    def __post_init__(self) -> None:
        check_positive(self, ("vertices", "friction", "tilt", "height"), "known.")

    def with_shape(self, shape: float | None) -> "KnownConfig":
        """The same, where a training knew the vertices better than that [characteristic lengths]; None where it did not."""
        return self if shape is None else replace(self, vertices=min(shape, self.vertices))


class KnownParameter(NamedTuple):
    """One parameter and its standard deviations.

    Attributes:
        name: as in `ParameterForm.names`.
        unit: "mm", "deg" or "" for friction.
        value: of the model; a tilt is measured from its own normal and is zero, the height is the ground's amid the tosses.
        cramer_rao, sandwich, naive: see above; inf where the empirical Fisher matrix is singular.
        deviation: the standard deviation to quote.
        interval: half the width of the 95 % interval that follows from it, and from `misfit`.
        misfit: how far from a learned friction that of sliding bodies may be, with 95 % confidence, or how far from a learned
            restitution the share of their speed is with which corners leave first impacts. All impacts alike may ask for
            another value, which no spread of tosses or impacts tells of.
    """

    name: str
    unit: str
    value: float
    cramer_rao: float
    sandwich: float
    naive: float
    deviation: float
    interval: float
    misfit: float = 0.0

    @property
    def interval_of_fit(self) -> float:
        """The interval without the misfit."""
        return float(np.sqrt(max(self.interval**2 - self.misfit**2, 0.0)))


class KnownVertex(NamedTuple):
    """Where a vertex is, and the ellipsoid of one standard deviation about it, by the covariance to quote.

    Attributes:
        position_mm: (3,) in the body's frame.
        axes_mm: (3,) half axes, longest first.
        directions: (3, 3) rows: unit vectors along them.
    """

    position_mm: Array
    axes_mm: Array
    directions: Array


@dataclass(frozen=True, eq=False)
class Known:
    """What is known of a polytope.

    Attributes:
        parameters: in the order of theta, physical form.
        vertices: V of them, those of the gaps.
        noise_variance: sigma^2 [characteristic units of the loss].
        directions: how many directions of theta the tosses themselves measure, of as many as there are parameters.
        to_optimum: largest distance of a parameter from where a Newton step on these tosses takes it, in its Cramer-Rao
            standard deviations; where it is above one, theta was not fitted to these tosses, or not to the end.
        tosses: that theta was fitted to.
        not_solved: transitions of these that were left out.
    """

    parameters: tuple[KnownParameter, ...]
    vertices: tuple[KnownVertex, ...]
    noise_variance: float
    directions: int
    to_optimum: float
    tosses: int
    not_solved: int


def known(model: Model, fitted: Transitions, others: Transitions, config: KnownConfig, sliding: Sliding | None = None) -> Known:
    """What is known.

    Args:
        model: fitted; its geometry is physical.
        fitted: the tosses that it was fitted to.
        others: tosses that it was not fitted to, for sigma^2.
        config: loss and prior.
        sliding: frictions of the tosses that slide; None of too few.

    Raises:
        InvalidValueError: no polytope, or one without a physical form; or no toss has information about theta.
    """
    model, rebound = _about_the_middle(model, fitted), rebound_of(fitted, model.body)
    fitted, others = (as_described(data, model.geometry(), model.body) for data in (fitted, others))
    sums = polytope_sums(model, fitted, Estimator.GAUSS_NEWTON, config.loss)
    information = sums.fishers.sum(axis=0)
    variance = noise_variance(model, others, config.loss)
    prior = prior_of(model, config)
    cramer_rao = model_covariance(identifiable_subspace(prior + information / variance), 1.0)
    sandwich = _sandwich(sums, variance, prior)
    naive = _inverse(polytope_sums(model, fitted, Estimator.EMPIRICAL, config.loss).fishers.sum(axis=0))
    groups = impact_scores(model, fitted, config.loss)
    both = _at_most(_at_least(two_way_covariance(sums, groups, variance, prior), cramer_rao), 1.0 / np.diagonal(prior))
    deviations = tuple(np.sqrt(np.diagonal(each)) for each in (cramer_rao, sandwich, naive, both))
    newton = np.linalg.solve(variance * prior + information, sums.scores.sum(axis=0))
    rows = _parameters(model, *deviations, interval_factor(len(fitted.toss_ids), len(groups)) * deviations[-1])
    return Known(
        parameters=tuple(_beside_observed(row, sliding, rebound) for row in rows),
        vertices=_vertices(model, both),
        noise_variance=variance,
        directions=identifiable_subspace(information).dimension,
        to_optimum=float(np.abs(newton / deviations[0])[_weighted(model)].max()),
        tosses=len(fitted.toss_ids),
        not_solved=int(sums.not_solved.sum()),
    )


def _beside_observed(row: KnownParameter, sliding: Sliding | None, rebound: Rebound | None) -> KnownParameter:
    """A friction or restitution with its distance from what motions show without a model; its interval contains this, too."""
    if row.name == "friction" and sliding is not None:
        misfit = sliding.farthest_from(row.value)
    elif row.name == "restitution" and rebound is not None:
        misfit = abs(row.value - rebound.restitution)
    else:
        return row
    return row._replace(interval=float(np.hypot(row.interval, misfit)), misfit=misfit)


def _weighted(model: PolytopeModel) -> NDArray[np.bool_]:
    """(P,) the parameters whose optimum is that of the weighted losses: all but a restitution (learning/fits/held_fit.py)."""
    return np.array([name != "restitution" for name in _form(model).names()])


def noise_variance(model: PolytopeModel, others: Transitions, loss: LossConfig) -> float:
    """Sigma^2 of the residuals, by tosses that the model was not fitted to."""
    information = polytope_sums(model, others, Estimator.GAUSS_NEWTON, loss).fishers.sum(axis=0)
    empirical = polytope_sums(model, others, Estimator.EMPIRICAL, loss).fishers.sum(axis=0)
    whitening = identifiable_subspace(information).whitening
    return float(np.einsum("pa,pq,qa->", whitening, empirical, whitening) / whitening.shape[1])


def _sandwich(sums: PolytopeSums, variance: float, prior: Array) -> Array:
    bread = identifiable_subspace(sums.fishers.sum(axis=0) + variance * prior)
    centred = sums.scores if len(sums.scores) < 2 else sums.scores - sums.scores.mean(axis=0)
    return sandwich_covariance(bread, np.concatenate([centred, variance * np.sqrt(prior)]))


def _at_least(covariance: Array, least: Array) -> Array:
    """The covariance with variances that are at least those of another, and its correlations."""
    factors = np.sqrt(np.maximum(np.diagonal(least) / np.diagonal(covariance), 1.0))
    return np.asarray(factors[:, None] * covariance * factors)


def _at_most(covariance: Array, variances: Array) -> Array:
    """The covariance with variances of at most these (P,), and its correlations: what was known before is not forgotten."""
    factors = np.sqrt(np.minimum(variances / np.diagonal(covariance), 1.0))
    return np.asarray(factors[:, None] * covariance * factors)


def _inverse(matrix: Array) -> Array:
    """Its inverse; infinite where it has none."""
    subspace = identifiable_subspace(matrix)
    if subspace.dimension < len(matrix):
        return np.full(matrix.shape, np.inf)
    return model_covariance(subspace, 1.0)


def _about_the_middle(model: Model, data: Transitions) -> PolytopeModel:
    """The same ground, its height told where the tosses were; tilt and height then keep apart as well as they can."""
    geometry = model.geometry()
    if geometry is None:
        raise InvalidValueError("model whose parameters are estimated", model.kind, "a polytope")
    pivot = np.array([*data.before[:, :2].mean(axis=0), 0.0])
    height = geometry.height + float(geometry.normal @ (geometry.pivot - pivot))
    form = Form.PHYSICAL if geometry.noise is None else Form.RIGID
    return PolytopeModel(replace(geometry, pivot=pivot, height=height), model.body, form)


def _by_block(model: PolytopeModel, values: dict[str, float]) -> Array:
    """(P,) one value per block, for each of its parameters."""
    return np.concatenate([np.full(b.size, values[b.name]) for b in _form(model).blocks])


def _form(model: PolytopeModel) -> ParameterForm:
    return parameter_form(model.geometry(), fitted_form(model))


def prior_of(model: PolytopeModel, config: KnownConfig) -> Array:
    """(P, P) A0: inverse variances of what was known before the first toss."""
    deviations = {"friction": config.friction, "tilt": config.tilt, "height": config.height, "restitution": RESTITUTION_SPREAD}
    vertices = {"vertices_normal": config.vertices, "vertices_tangent": config.vertices}
    return np.diag(_by_block(model, {**vertices, **deviations}) ** -2)


def unit_sizes(model: PolytopeModel) -> Array:
    """(P,) what a small change of theta is multiplied with to be in mm, friction (theta has its logarithm) and degrees."""
    millimetres = 1e3 * model.body.length_scale
    others = {"friction": _friction(model), "tilt": float(np.degrees(1.0)), "height": millimetres, "restitution": 1.0}
    return _by_block(model, {"vertices_normal": millimetres, "vertices_tangent": millimetres, **others})


def _friction(model: PolytopeModel) -> float:
    return float(np.linalg.norm(model.geometry().tangents[0]))


def _parameters(model: PolytopeModel, *deviations: Array) -> tuple[KnownParameter, ...]:
    geometry, scales = model.geometry(), unit_sizes(model)
    form = _form(model)
    vertices = (getattr(geometry, block.name).ravel() for block in form.blocks if block.name.startswith("vertices"))
    bounce = [] if geometry.restitution is None else [geometry.restitution]
    values = scales * np.concatenate([*vertices, bounce, [1.0, 0.0, 0.0, geometry.height]])
    names = form.names()
    units = [{"friction": "", "restitution": "", "tilt": "deg"}.get(name.partition("[")[0], "mm") for name in names]
    columns = (values, *(scales * each for each in deviations))
    return tuple(KnownParameter(*row) for row in zip(names, units, *(column.tolist() for column in columns), strict=True))


def _vertices(model: PolytopeModel, covariance: Array) -> tuple[KnownVertex, ...]:
    millimetres = 1e3 * model.body.length_scale
    return tuple(
        _vertex(millimetres * place, millimetres**2 * covariance[3 * k : 3 * k + 3, 3 * k : 3 * k + 3])
        for k, place in enumerate(model.geometry().vertices_normal)
    )


def _vertex(position_mm: Array, covariance: Array) -> KnownVertex:
    variances, directions = np.linalg.eigh(covariance)
    return KnownVertex(position_mm, np.sqrt(np.maximum(variances[::-1], 0.0)), directions.T[::-1])
