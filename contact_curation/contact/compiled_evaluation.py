"""The kernel's evaluation of transitions and its steps along them: its structures field by field, and its calls.

ctypes holds bare addresses. Whoever calls keeps the arrays alive and sees to it that they have the right shapes.
"""

import ctypes
import functools
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from contact_curation.contact.body import Body
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.loss_config import LossConfig
from contact_curation.geometry.quaternions import Array
from contact_curation.solver.compiled import load_kernel, processor_count
from contact_curation.solver.cone_problem import Cone

ROW = ("before", "after", "dt")
"""What the kernel reads of a transition."""

PIECES = ("vertices_normal", "normal", "vertices_tangent", "tangents")
"""The published form's parameters, in the kernel's order."""


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


def run(
    geometry: ContactGeometry,
    body: Body,
    config: LossConfig,
    before: Array,
    after: Array,
    periods: Array,
    starts: NDArray[np.int64],
    estimator: int = 0,
    influence_bound: float = np.inf,
    **outputs: np.ndarray[tuple[int, ...], np.dtype[np.float64]] | NDArray[np.int32],
) -> None:
    """Fills the outputs that are given.

    Args:
        geometry, body, config: as in `evaluation.evaluate`.
        before, after, periods: (N, 13), (N, 13) and (N,), checked.
        starts: (K + 1,) edges of the tosses, or of the pieces that threads take.
        estimator: of Fisher matrices, 1 empirical, 2 Gauss-Newton; 0 for no such matrices.
        influence_bound: as in `evaluation.fisher_sums`.
        outputs: contiguous arrays by the job's names.
    """
    model = _Model(geometry, body, config)
    job = _Job(
        before=before.ctypes.data,
        after=after.ctypes.data,
        dt=periods.ctypes.data,
        starts=starts.ctypes.data,
        tosses=starts.size - 1,
        threads=config.threads or processor_count(),
        estimator=estimator,
        max_iterations=config.max_iterations,
        residual_tolerance=config.tolerance,
        influence_bound=influence_bound,
        **{name: value.ctypes.data for name, value in outputs.items()},
    )
    _compiled_evaluation()(ctypes.byref(model), ctypes.byref(job))


class _Descent(ctypes.Structure):
    """The kernel's `Descent`, field by field (contact/kernel/polytope_descent.cpp)."""

    _fields_ = (
        ("rows", ctypes.c_void_p),
        ("rates", ctypes.c_void_p),
        ("steps", ctypes.c_int64),
        ("regularizer", ctypes.c_double),
        ("decay", ctypes.c_double),
        ("first_beta", ctypes.c_double),
        ("second_beta", ctypes.c_double),
        ("epsilon", ctypes.c_double),
        ("theta", ctypes.c_void_p * len(PIECES)),
        ("first", ctypes.c_void_p * len(PIECES)),
        ("second", ctypes.c_void_p * len(PIECES)),
        ("seen", ctypes.c_double),
        ("loss_sum", ctypes.c_double),
    )


@dataclass(frozen=True)
class Moments:
    """AdamW's arrays of one parameter, changed in place: its numbers, and both moments of its slopes, in the same shape."""

    theta: Array
    first: Array
    second: Array


class RowByRow:
    """Gradient steps of a polytope in the published form, a transition each: loss, regulariser and AdamW in the kernel.

    Args:
        geometry: what stays of theta: pivot and height, and the shapes.
        moments: of `PIECES`.
        body: mass, inertia and gravity.
        config: weights and solver.
        before, after, periods: (N, 13), (N, 13) and (N,), checked.
        regularizer: weight of each contact's.
        decay, betas, epsilon: of AdamW.
    """

    def __init__(
        self,
        geometry: ContactGeometry,
        moments: Mapping[str, Moments],
        body: Body,
        config: LossConfig,
        before: Array,
        after: Array,
        periods: Array,
        *,
        regularizer: float,
        decay: float,
        betas: tuple[float, float],
        epsilon: float,
    ) -> None:
        rows = [np.ascontiguousarray(values, dtype=float) for values in (before, after, periods)]
        self._owners = moments, rows  # ctypes holds bare addresses: keep the arrays alive
        self._model = _Model(geometry, body, config)
        for name in PIECES:
            setattr(self._model, name, moments[name].theta.ctypes.data)
        columns = dict(zip(ROW, (values.ctypes.data for values in rows), strict=True))
        self._rows = _Job(**columns, max_iterations=config.max_iterations, residual_tolerance=config.tolerance)
        self._job = _Descent(regularizer=regularizer, decay=decay, first_beta=betas[0], second_beta=betas[1], epsilon=epsilon)
        for part in ("theta", "first", "second"):
            addresses = (getattr(moments[name], part).ctypes.data for name in PIECES)
            setattr(self._job, part, (ctypes.c_void_p * len(PIECES))(*addresses))

    def descend(self, rows: NDArray[np.int64], rates: Array, seen: float, loss_sum: float) -> tuple[int, float]:
        """Steps down the rows in turn, to the first that is not solved, or whose loss or slope is not finite.

        Args:
            rows: (S,) places of transitions.
            rates: (S,) learning rates.
            seen: steps that the moments have seen.
            loss_sum: of the rows before.

        Returns:
            How many steps were taken, and the sum with theirs.
        """
        rows, rates = np.ascontiguousarray(rows, np.int64), np.ascontiguousarray(rates, float)
        job = self._job
        job.rows, job.rates, job.steps = rows.ctypes.data, rates.ctypes.data, len(rows)
        job.seen, job.loss_sum = seen, loss_sum
        taken = _compiled_descent()(ctypes.byref(self._model), ctypes.byref(self._rows), ctypes.byref(job))
        return taken, job.loss_sum


@functools.cache
def _compiled_evaluation() -> Callable[..., int]:
    function = load_kernel().contact_curation_evaluate
    function.argtypes = (ctypes.POINTER(_Model), ctypes.POINTER(_Job))
    function.restype = ctypes.c_int
    return function


@functools.cache
def _compiled_descent() -> Callable[..., int]:
    function = load_kernel().contact_curation_descend
    function.argtypes = (ctypes.POINTER(_Model), ctypes.POINTER(_Job), ctypes.POINTER(_Descent))
    function.restype = ctypes.c_int64
    return function
