"""Loss, impulses, scores and Fisher matrices of many transitions by the compiled kernel (METHOD 1.2 to 1.5).

Where no kernel can be loaded, torch does the same work, slower (contact/torch_evaluation.py).

The impulses are fixed in the derivative: the slack is eliminated and the inner problem strictly convex, so the envelope theorem
holds (METHOD E5). A transition whose impulses carry no certificate keeps its status and enters no sum: it is "not scored",
never zero.
"""

import ctypes
import functools
from collections.abc import Callable
from dataclasses import dataclass, fields
from enum import StrEnum
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from contact_curation.contact.body import Body
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.time_step import checked_states, checked_time_steps
from contact_curation.errors import InvalidValueError, MissingDependencyError
from contact_curation.geometry.quaternions import Array
from contact_curation.solver.compiled import load_kernel, processor_count
from contact_curation.solver.cone_problem import MAX_CONTACTS, ConeWeights
from contact_curation.solver.cone_problem import Cone as Cone
from contact_curation.solver.cone_problem import SolveStatus as SolveStatus

PIECE = 256
"""Transitions that a thread takes at a time, so that one long toss, too, is spread over threads."""

LOSS_TERMS = ("match", "complementarity_n", "complementarity_t", "cone", "penetration")


class Estimator(StrEnum):
    """Which Fisher matrix: outer products of scores, or the Gauss-Newton profile matrix (METHOD 1.5)."""

    EMPIRICAL = "empirical"
    GAUSS_NEWTON = "gauss-newton"


@dataclass(frozen=True)
class LossConfig:
    """Weights of the loss and how well its inner problem is solved; the defaults are ContactNets' (METHOD 1.2, 1.3).

    Attributes:
        match, complementarity_normal, complementarity_tangent, dissipation, penetration: weights of the terms.
        regularization: eps, which picks the smallest of equally good impulses.
        cone: shape of the friction cone.
        tolerance: largest natural residual of impulses that count as solved.
        max_iterations: of the interior point method.
        threads: tosses are spread over so many; 0 for one per processor.
    """

    match: float = ConeWeights.match
    complementarity_normal: float = ConeWeights.complementarity_normal
    complementarity_tangent: float = ConeWeights.complementarity_tangent
    dissipation: float = ConeWeights.dissipation
    penetration: float = ConeWeights.penetration
    regularization: float = ConeWeights.regularization
    cone: Cone = Cone.CIRCULAR
    tolerance: float = 1e-7
    max_iterations: int = 60
    threads: int = 0

    def __post_init__(self) -> None:
        _ = self.weights  # checks them
        if not (np.isfinite(self.tolerance) and self.tolerance > 0.0):
            raise InvalidValueError("loss.tolerance", self.tolerance, "a positive number")
        for name, least in (("max_iterations", 1), ("threads", 0)):
            if getattr(self, name) < least:
                raise InvalidValueError(f"loss.{name}", getattr(self, name), f"at least {least}")

    @cached_property
    def weights(self) -> ConeWeights:
        """What the inner problem needs of them."""
        return ConeWeights(**{field.name: getattr(self, field.name) for field in fields(ConeWeights)})


DEFAULT_LOSS = LossConfig()


@dataclass(frozen=True, eq=False)
class Evaluation:
    """N transitions at one theta, characteristic units. What was not scored has status other than SOLVED.

    Attributes:
        terms: (N, 5) weighted loss terms in the order of LOSS_TERMS.
        impulses: (N, V, 3) as [normal, tangent 1, tangent 2].
        scores: (N, 6V + 10) gradient of the log-likelihood, -dL/2 for sigma = 1, by vertices_normal, normal, vertices_tangent,
            tangents, height.
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


class _Model(ctypes.Structure):
    """The kernel's `PolytopeModel`, field by field (contact/kernel/polytope_transition.hpp)."""

    _fields_ = (
        ("contacts", ctypes.c_int),
        ("vertices_normal", ctypes.c_void_p),
        ("normal", ctypes.c_void_p),
        ("vertices_tangent", ctypes.c_void_p),
        ("tangents", ctypes.c_void_p),
        ("pivot", ctypes.c_double * 3),
        ("height", ctypes.c_double),
        ("mass", ctypes.c_double),
        ("inverse_inertia", ctypes.c_double * 9),
        ("gravity", ctypes.c_double),
        ("match", ctypes.c_double),
        ("complementarity_normal", ctypes.c_double),
        ("complementarity_tangent", ctypes.c_double),
        ("dissipation", ctypes.c_double),
        ("penetration", ctypes.c_double),
        ("regularization", ctypes.c_double),
        ("circular", ctypes.c_int),
    )

    def __init__(self, geometry: ContactGeometry, body: Body, config: LossConfig) -> None:
        super().__init__(
            contacts=geometry.vertex_count,
            vertices_normal=geometry.vertices_normal.ctypes.data,
            normal=geometry.normal.ctypes.data,
            vertices_tangent=geometry.vertices_tangent.ctypes.data,
            tangents=geometry.tangents.ctypes.data,
            pivot=(ctypes.c_double * 3)(*geometry.pivot),
            height=geometry.height,
            mass=body.mass,
            inverse_inertia=(ctypes.c_double * 9)(*body.scaled_inverse_inertia.flat),
            gravity=body.scaled_gravity,
            circular=int(config.cone is Cone.CIRCULAR),
            **vars(config.weights),
        )
        self.owner = geometry  # ctypes holds bare addresses: keep the arrays alive


class _Job(ctypes.Structure):
    """The kernel's `Evaluation`, field by field (contact/kernel/polytope_loss.cpp)."""

    _fields_ = (
        ("before", ctypes.c_void_p),
        ("after", ctypes.c_void_p),
        ("dt", ctypes.c_void_p),
        ("starts", ctypes.c_void_p),
        ("tosses", ctypes.c_int64),
        ("threads", ctypes.c_int32),
        ("estimator", ctypes.c_int32),
        ("max_iterations", ctypes.c_int32),
        ("residual_tolerance", ctypes.c_double),
        ("influence_bound", ctypes.c_double),
        ("terms", ctypes.c_void_p),
        ("impulse", ctypes.c_void_p),
        ("score", ctypes.c_void_p),
        ("residual", ctypes.c_void_p),
        ("status", ctypes.c_void_p),
        ("iterations", ctypes.c_void_p),
        ("fisher", ctypes.c_void_p),
        ("score_sum", ctypes.c_void_p),
    )


def evaluate(
    geometry: ContactGeometry, body: Body, before: ArrayLike, after: ArrayLike, dt: ArrayLike, config: LossConfig = DEFAULT_LOSS
) -> Evaluation:
    """Everything the loss says of N transitions.

    Args:
        geometry: theta.
        body: mass, inertia and gravity.
        before: (N, 13) states, rows as in `motion.transitions`.
        after: (N, 13) states one frame later.
        dt: one frame period or N of them [s].
        config: weights and solver.

    Raises:
        InvalidValueError: wrong shapes, quaternions not of unit norm, or more than 32 vertices.
    """
    first, second, periods = checked_transitions(geometry, before, after, dt)
    if not _kernel_is_there():
        from contact_curation.contact.torch_evaluation import evaluate_in_torch  # torch takes seconds to import

        return evaluate_in_torch(geometry, body, first, second, periods, config)
    count, contacts = len(first), geometry.vertex_count
    result = Evaluation(
        terms=np.empty((count, len(LOSS_TERMS))),
        impulses=np.empty((count, contacts, 3)),
        scores=np.empty((count, 6 * contacts + 10)),
        residuals=np.empty(count),
        status=np.empty(count, np.int32),
        iterations=np.empty(count, np.int32),
    )
    pieces = np.unique(np.append(np.arange(0, count, PIECE), count)).astype(np.int64)
    _run(
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
) -> FisherSums:
    """Fisher matrices of K tosses, summed over their transitions.

    Args:
        geometry, body, before, after, dt, config: as in `evaluate`.
        starts: (K + 1,) toss k owns rows starts[k]:starts[k + 1].
        estimator: empirical or Gauss-Newton.
        influence_bound: a score whose loss L is above this is scaled by bound / L (METHOD 2.1).

    Raises:
        InvalidValueError: as `evaluate`, or starts that do not cover the rows, or a bound that is not positive.
    """
    first, second, periods = checked_transitions(geometry, before, after, dt)
    edges = np.ascontiguousarray(starts, dtype=np.int64)
    if edges.ndim != 1 or edges.size < 2 or edges[0] != 0 or edges[-1] != len(first) or np.any(np.diff(edges) < 0):
        raise InvalidValueError("starts", f"{edges.size} edges", f"rising edges from 0 to {len(first)}")
    if not influence_bound > 0.0:
        raise InvalidValueError("influence_bound", influence_bound, "a positive number, or inf for none")
    if not _kernel_is_there():
        from contact_curation.contact.torch_fisher import fisher_sums_in_torch  # torch takes seconds to import

        return fisher_sums_in_torch(geometry, body, first, second, periods, edges, estimator, influence_bound, config)
    count, tosses, size = len(first), edges.size - 1, 6 * geometry.vertex_count + 10
    terms = np.empty((count, len(LOSS_TERMS)))
    result = FisherSums(
        fishers=np.zeros((tosses, size, size)),
        score_sums=np.zeros((tosses, size)),
        losses=np.empty(count),
        residuals=np.empty(count),
        status=np.empty(count, np.int32),
    )
    _run(
        geometry, body, config, first, second, periods, edges, estimator, influence_bound,
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


def _run(
    geometry: ContactGeometry,
    body: Body,
    config: LossConfig,
    before: Array,
    after: Array,
    periods: Array,
    starts: NDArray[np.int64],
    estimator: Estimator | None = None,
    influence_bound: float = np.inf,
    **outputs: np.ndarray[tuple[int, ...], np.dtype[np.float64]] | NDArray[np.int32],
) -> None:
    model = _Model(geometry, body, config)
    job = _Job(
        before=before.ctypes.data,
        after=after.ctypes.data,
        dt=periods.ctypes.data,
        starts=starts.ctypes.data,
        tosses=starts.size - 1,
        threads=config.threads or processor_count(),
        estimator=0 if estimator is None else 1 + list(Estimator).index(estimator),
        max_iterations=config.max_iterations,
        residual_tolerance=config.tolerance,
        influence_bound=influence_bound,
        **{name: value.ctypes.data for name, value in outputs.items()},
    )
    _compiled_evaluation()(ctypes.byref(model), ctypes.byref(job))


def _kernel_is_there() -> bool:
    try:
        load_kernel()
    except MissingDependencyError:
        return False
    return True


@functools.cache
def _compiled_evaluation() -> Callable[..., int]:
    function = load_kernel().contact_curation_evaluate
    function.argtypes = (ctypes.POINTER(_Model), ctypes.POINTER(_Job))
    function.restype = ctypes.c_int
    return function
