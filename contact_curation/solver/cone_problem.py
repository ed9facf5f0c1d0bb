"""The inner problem as data: which impulses explain a measured change of velocity best? See method.md 1.2 and 1.3.

    minimise  w_m |A l - b|^2 + sum_i l_i^T D_i l_i + eps |l|^2 + w_s sum_i min(0, c_i + B_i A l)^2
    over      l_i = (normal, tangent 1, tangent 2) in the friction cone |tangent| <= normal

    A = M^-1 J^T,  b = v' - v_f,  B_i = dt J_n,i,  c_i = phi_i + dt J_n,i v_f,
    D_i = phi_i'^2 diag(w_n, w_t, w_t) + w_c C_i^T C_i,  C_i = [s_i, |s_i| I],  s_i = J_t,i v'

Every contact model with gaps and their Jacobians leads to this problem, a polytope as well as a network. J_t contains the
friction coefficient. The penetration slack is eliminated, so that the constraints do not depend on theta, and eps > 0 makes the
minimum unique (method.md E5).
"""

from dataclasses import dataclass, replace
from enum import IntEnum, StrEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from contact_curation.configs import check_not_negative, check_positive
from contact_curation.errors import InvalidValueError

Array = NDArray[np.float64]

MAX_CONTACTS = 64
"""Largest number of contacts in the compiled kernel (solver/kernel/cone_problem.hpp)."""

DEFAULT_TOLERANCE = 1e-7
"""Largest natural residual of certified impulses."""


class Cone(StrEnum):
    """The friction cone: circular (Coulomb), or ContactNets' pyramid of eight facets around it."""

    CIRCULAR = "circular"
    POLYHEDRAL = "polyhedral"


class SolveStatus(IntEnum):
    """How an inner problem ended."""

    SOLVED = 0
    NOT_SOLVED = 1
    NOT_FINITE = 2


@dataclass(frozen=True)
class ConeWeights:
    """Weights of the objective; the defaults are ContactNets' (method.md 1.2), `regularization` is eps."""

    match: float = 0.1
    complementarity_normal: float = 1.0
    complementarity_tangent: float = 1.0
    dissipation: float = 1.0
    penetration: float = 1.0
    regularization: float = 1e-6

    def __post_init__(self) -> None:
        check_positive(self, ("match", "penetration", "regularization"), "loss.")
        check_not_negative(self, ("complementarity_normal", "complementarity_tangent", "dissipation"), "loss.")


@dataclass(frozen=True, eq=False)
class ConeProblems:
    """B problems of K contacts each. Values that are not finite are accepted: they lead to a status, not to an error.

    Attributes:
        jacobians: (B, K, 3, 6) rows J_n, J_t,1, J_t,2 in twist coordinates at the first pose.
        inverse_mass: (6, 6) M^-1.
        gaps: (B, K) gaps phi at the first pose.
        gaps_next: (B, K) gaps phi' at the measured next pose.
        free_velocities: (B, 6) v_f, the next velocity without contact.
        velocities_next: (B, 6) v', the measured next velocity.
        dt: (B,) durations of the transitions [s].
        weights: weights of the objective.
        cone: shape of the friction cone.
    """

    jacobians: Array
    inverse_mass: Array
    gaps: Array
    gaps_next: Array
    free_velocities: Array
    velocities_next: Array
    dt: Array
    weights: ConeWeights = ConeWeights()
    cone: Cone = Cone.CIRCULAR

    def __post_init__(self) -> None:
        batch, contacts = np.shape(self.jacobians)[:2] if np.ndim(self.jacobians) == 4 else (0, 0)
        if not 1 <= contacts <= MAX_CONTACTS:
            raise InvalidValueError(
                "jacobians", f"shape {np.shape(self.jacobians)}", f"(B, K, 3, 6) with K from 1 to {MAX_CONTACTS}"
            )
        shapes = {
            "jacobians": (batch, contacts, 3, 6), "inverse_mass": (6, 6), "gaps": (batch, contacts),
            "gaps_next": (batch, contacts), "free_velocities": (batch, 6), "velocities_next": (batch, 6), "dt": (batch,),
        }  # fmt: skip
        for name, shape in shapes.items():
            value = np.ascontiguousarray(getattr(self, name), dtype=float)
            if value.shape != shape:
                raise InvalidValueError(name, f"shape {value.shape}", f"{shape}")
            object.__setattr__(self, name, value)

    @property
    def batch(self) -> int:
        """Number of problems B."""
        return int(self.jacobians.shape[0])

    @property
    def contacts(self) -> int:
        """Number of contacts K."""
        return int(self.jacobians.shape[1])

    def rows(self, chosen: slice) -> "ConeProblems":
        """The problems of a slice of the batch."""
        batched = ("jacobians", "gaps", "gaps_next", "free_velocities", "velocities_next", "dt")
        return replace(self, **{name: getattr(self, name)[chosen] for name in batched})


@dataclass(frozen=True, eq=False)
class ConeSolutions:
    """Solutions of B problems.

    Attributes:
        impulses: (B, K, 3) impulses (normal, tangent 1, tangent 2).
        residuals: (B,) natural residuals, zero at the optimum only; NaN where no solution was found.
        status: (B,) values of `SolveStatus`.
        iterations: (B,) numbers of iterations.
    """

    impulses: Array
    residuals: Array
    status: NDArray[np.int32]
    iterations: NDArray[np.int32]


class QuadraticForm(NamedTuple):
    """The symbols of the objective: A (B, 6, 3K), b (B, 6), D (B, K, 3, 3), B A as S (B, K, 3K) and c (B, K)."""

    motion: Array
    target: Array
    blocks: Array
    slack_rows: Array
    slack_offsets: Array


def quadratic_form(problems: ConeProblems) -> QuadraticForm:
    """Computes the matrices of the objective."""
    j, weights = problems.jacobians, problems.weights
    batch, contacts = problems.gaps.shape
    motion = np.einsum("ab,bn->an", problems.inverse_mass, j.reshape(-1, 6).T)
    motion = motion.reshape(6, batch, 3 * contacts).transpose(1, 0, 2)
    approach = problems.dt[:, None, None] * j[:, :, 0]  # (B, K, 6)
    slip = np.einsum("bkta,ba->bkt", j[:, :, 1:], problems.velocities_next)
    speed = np.linalg.norm(slip, axis=-1)
    rows = np.concatenate([slip[..., None], speed[..., None, None] * np.eye(2)], axis=-1)  # C_i, (B, K, 2, 3)
    closed = np.square(problems.gaps_next)[..., None] * np.array(
        [weights.complementarity_normal, weights.complementarity_tangent, weights.complementarity_tangent]
    )
    blocks = closed[..., None] * np.eye(3) + weights.dissipation * np.swapaxes(rows, -1, -2) @ rows
    return QuadraticForm(
        motion=motion,
        target=problems.velocities_next - problems.free_velocities,
        blocks=blocks,
        slack_rows=approach @ motion,
        slack_offsets=problems.gaps + np.einsum("bka,ba->bk", approach, problems.free_velocities),
    )
