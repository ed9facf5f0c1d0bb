"""Loss, impulses, scores and Fisher matrices of many transitions by the compiled kernel (method.md 1.2 to 1.5).

The impulses are fixed in the derivative: the slack is eliminated and the inner problem strictly convex, so the envelope theorem
holds (method.md E5). A transition whose impulses carry no certificate keeps its status and enters no sum: it is "not scored",
never zero.
"""

from dataclasses import dataclass, replace
from enum import StrEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from contact_curation.contact.body import Body
from contact_curation.contact.compiled import evaluation as compiled_evaluation
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.loss_config import DEFAULT_LOSS, LossConfig
from contact_curation.contact.time_step import checked_states, checked_time_steps, step
from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array
from contact_curation.solver.cone_problem import MAX_CONTACTS
from contact_curation.solver.cone_problem import Cone as Cone
from contact_curation.solver.cone_problem import SolveStatus as SolveStatus

PIECE = 256
"""Transitions that a thread takes at a time, so that one long toss, too, is spread over threads."""

LOSS_TERMS = ("match", "complementarity_n", "complementarity_t", "cone", "penetration")


class Estimator(StrEnum):
    """Which Fisher matrix: outer products of scores, or the Gauss-Newton profile matrix (method.md 1.5)."""

    EMPIRICAL = "empirical"
    GAUSS_NEWTON = "gauss-newton"


KERNEL_CODES = {Estimator.EMPIRICAL: 1, Estimator.GAUSS_NEWTON: 2}
"""What the kernel calls them."""


@dataclass(frozen=True, eq=False)
class Evaluation:
    """N transitions at one theta, characteristic units. What was not scored has status other than SOLVED.

    Attributes:
        terms: (N, 5) weighted loss terms in the order of LOSS_TERMS.
        impulses: (N, V, 3) as [normal, tangent 1, tangent 2].
        scores: (N, 6V + 10) gradient of the log-likelihood, -dL/2 for sigma = 1, by vertices_normal, normal, vertices_tangent,
            tangents, height; and restitution, where theta has it.
        residuals: (N,) natural residual of the impulses.
        status: (N,) SolveStatus.
        iterations: (N,).
    """

    terms: Array
    impulses: Array
    scores: Array
    residuals: Array
    status: NDArray[np.int32]
    iterations: NDArray[np.int32]

    @property
    def losses(self) -> Array:
        """(N,) the loss."""
        return np.asarray(self.terms.sum(axis=1))

    @property
    def solved(self) -> NDArray[np.bool_]:
        """(N,) whether the impulses are certified."""
        return np.asarray(self.status == SolveStatus.SOLVED)


@dataclass(frozen=True, eq=False)
class FisherSums:
    """Sums over the transitions of each of K tosses, not-scored ones left out; Q = 6V + 10 as in `Evaluation.scores`.

    Attributes:
        fishers: (K, Q, Q).
        score_sums: (K, Q).
        losses: (N,) losses of all transitions.
        residuals: (N,) natural residuals.
        status: (N,) SolveStatus.
    """

    fishers: Array
    score_sums: Array
    losses: Array
    residuals: Array
    status: NDArray[np.int32]


def evaluate(
    geometry: ContactGeometry, body: Body, before: ArrayLike, after: ArrayLike, dt: ArrayLike, config: LossConfig = DEFAULT_LOSS
) -> Evaluation:
    """Loss terms, impulses and scores of N transitions.

    Args:
        geometry: theta.
        body: mass, inertia and gravity.
        before: (N, 13) states, rows as in `motion.transitions`.
        after: (N, 13) states one frame later.
        dt: one frame period or N of them [s].
        config: weights and solver.

    Raises:
        InvalidValueError: wrong shapes, quaternions not of unit norm, or more than `MAX_CONTACTS` vertices.
    """
    first, second, periods = checked_transitions(geometry, before, after, dt)
    count, contacts = len(first), geometry.vertex_count
    result = Evaluation(
        terms=np.empty((count, len(LOSS_TERMS))),
        impulses=np.empty((count, contacts, 3)),
        scores=np.empty((count, geometry.kernel_size)),
        residuals=np.empty(count),
        status=np.empty(count, np.int32),
        iterations=np.empty(count, np.int32),
    )
    pieces = np.unique(np.append(np.arange(0, count, PIECE), count)).astype(np.int64)
    compiled_evaluation.run(
        geometry, body, config, first, second, periods, pieces,
        terms=result.terms, impulse=result.impulses, score=result.scores,
        residual=result.residuals, status=result.status, iterations=result.iterations,
    )  # fmt: skip
    return result


def fisher_sums(
    geometry: ContactGeometry,
    body: Body,
    before: ArrayLike,
    after: ArrayLike,
    dt: ArrayLike,
    starts: ArrayLike,
    estimator: Estimator,
    influence_bound: float = np.inf,
    config: LossConfig = DEFAULT_LOSS,
    weights: ArrayLike | None = None,
) -> FisherSums:
    """Fisher matrices of K tosses, summed over their transitions.

    Args:
        geometry, body, before, after, dt, config: as in `evaluate`.
        starts: (K + 1,) toss k owns rows starts[k]:starts[k + 1].
        estimator: empirical or Gauss-Newton.
        influence_bound: a score whose loss L is above this is scaled by bound / L (method.md 2.1).
        weights: (N,) of the losses, one over their variances; those of `transition_weights` by default. The losses that are
            returned are without them.

    Raises:
        InvalidValueError: as `evaluate`, weights that do not fit, starts that do not cover the rows, or a bound that is not
            positive.
    """
    first, second, periods = checked_transitions(geometry, before, after, dt)
    edges = np.ascontiguousarray(starts, dtype=np.int64)
    if edges.ndim != 1 or edges.size < 2 or edges[0] != 0 or edges[-1] != len(first) or np.any(np.diff(edges) < 0):
        raise InvalidValueError("starts", f"{edges.size} edges", f"rising edges from 0 to {len(first)}")
    if not influence_bound > 0.0:
        raise InvalidValueError("influence_bound", influence_bound, "a positive number, or inf for none")
    if weights is None:
        weights = transition_weights(geometry, body, first, periods)
    rows = _Rows(first, second, periods, edges)
    each = None if weights is None else checked_weights(weights, len(first))
    if each is None or (each == 1.0).all():
        return _sums(geometry, body, rows, estimator, influence_bound, config)
    return _weighted_sums(geometry, body, rows, each, estimator, influence_bound, config)


def added_sums(
    geometry: ContactGeometry,
    body: Body,
    before: Array,
    after: Array,
    dt: Array,
    fishers: Array,
    score_sums: Array,
    estimator: Estimator,
    influence_bound: float,
    config: LossConfig,
) -> FisherSums:
    """Sums (1, Q, Q) and (1, Q) over earlier transitions of a toss, continued over N checked ones without weights."""
    rows = _Rows(before, after, dt, np.array([0, len(dt)], dtype=np.int64))
    return _sums(geometry, body, rows, estimator, influence_bound, config, (fishers, score_sums))


def estimator_weight(estimator: Estimator, weight: float) -> float:
    """A weight of losses in a Fisher matrix: the Gauss-Newton rows are residuals, the other's are scores."""
    return weight if estimator is Estimator.GAUSS_NEWTON else weight**2


def transition_weights(geometry: ContactGeometry, body: Body, before: ArrayLike, dt: ArrayLike) -> Array | None:
    """(N,) one over the variances of N transitions' residuals, by the impulses that theta predicts; None for one variance.

    Scores take them as given: their own slope by theta is no part of a score, as in iteratively re-weighted least squares.
    """
    if geometry.noise is None or geometry.noise.growth == 0.0:
        return None
    return np.asarray(1.0 / geometry.noise.variances(predicted_impulses(geometry, body, before, dt)))


def predicted_impulses(geometry: ContactGeometry, body: Body, before: ArrayLike, dt: ArrayLike) -> Array:
    """(N,) normal impulses of one time step from states (N, 13), relative to the one that carries the body at rest."""
    steps = step(geometry, body, before, dt)
    resting = body.mass * body.scaled_gravity * checked_time_steps(dt, len(steps.impulses))
    return np.asarray(steps.impulses[:, :, 0].sum(axis=1) / resting)


def checked_weights(weights: ArrayLike, count: int) -> Array:
    """Weights (N,) of N transitions.

    Raises:
        InvalidValueError: another shape, or not all finite and positive.
    """
    each = np.asarray(weights, dtype=float)
    if each.shape != (count,) or not (np.isfinite(each).all() and (each > 0.0).all()):
        raise InvalidValueError("weights of transitions", f"shape {each.shape}", f"({count},) finite positive numbers")
    return each


class _Rows(NamedTuple):
    """N checked transitions of K tosses: (N, 13), (N, 13), (N,), and (K + 1,) edges."""

    before: Array
    after: Array
    dt: Array
    starts: NDArray[np.int64]


def _weighted_sums(
    geometry: ContactGeometry,
    body: Body,
    rows: _Rows,
    weights: Array,
    estimator: Estimator,
    influence_bound: float,
    config: LossConfig,
) -> FisherSums:
    """The same sums with the rows of each toss in the order of their weights: the kernel weighs equal ones together."""
    toss = np.repeat(np.arange(rows.starts.size - 1), np.diff(rows.starts))
    order = np.lexsort((weights, toss))
    ordered = _Rows(rows.before[order], rows.after[order], rows.dt[order], rows.starts)
    sums = _sums(geometry, body, ordered, estimator, influence_bound, config, weights=weights[order])
    back = np.argsort(order)
    return replace(sums, losses=sums.losses[back], residuals=sums.residuals[back], status=sums.status[back])


def _sums(
    geometry: ContactGeometry,
    body: Body,
    rows: _Rows,
    estimator: Estimator,
    influence_bound: float,
    config: LossConfig,
    earlier: tuple[Array, Array] | None = None,
    weights: Array | None = None,
) -> FisherSums:
    """The sums of each toss, added to those of its `earlier` transitions where there are any."""
    count, tosses, size = len(rows.dt), rows.starts.size - 1, geometry.kernel_size
    terms = np.empty((count, len(LOSS_TERMS)))
    fishers, score_sums = earlier or (np.zeros((tosses, size, size)), np.zeros((tosses, size)))
    result = FisherSums(
        fishers=fishers.copy(),
        score_sums=score_sums.copy(),
        losses=np.empty(count),
        residuals=np.empty(count),
        status=np.empty(count, np.int32),
    )
    compiled_evaluation.run(
        geometry, body, config, *rows, KERNEL_CODES[estimator], influence_bound, weights,
        terms=terms, residual=result.residuals, status=result.status, fisher=result.fishers, score_sum=result.score_sums,
    )  # fmt: skip
    terms.sum(axis=1, out=result.losses)
    return result


def checked_transitions(
    geometry: ContactGeometry, before: ArrayLike, after: ArrayLike, dt: ArrayLike
) -> tuple[Array, Array, Array]:
    """States (N, 13) before and after and time steps (N,), checked as `evaluate` says."""
    first, second = checked_states(before), checked_states(after)
    if first.shape != second.shape:
        raise InvalidValueError("states after", f"shape {second.shape}", f"{first.shape}, as before")
    if geometry.vertex_count > MAX_CONTACTS:
        raise InvalidValueError("vertices", geometry.vertex_count, f"at most {MAX_CONTACTS}")
    return first, second, checked_time_steps(dt, len(first))
