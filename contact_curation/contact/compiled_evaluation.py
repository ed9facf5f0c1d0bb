"""The kernel's evaluation of transitions: its structures field by field, and its call.

ctypes holds bare addresses. Whoever calls keeps the arrays alive and sees to it that they have the right shapes.
"""

import ctypes
import functools
from collections.abc import Callable, Mapping

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


class RowByRow:
    """Single transitions at a polytope whose numbers are changed in place between them.

    All that does not change is prepared once: a call takes the kernel's time and little more.

    Args:
        geometry: what stays of theta: pivot and height, and the shapes.
        theta: vertices_normal (V, 3), normal (3,), vertices_tangent (V, 3) and tangents (2, 3), read anew at each call.
        body: mass, inertia and gravity.
        config: weights and solver.
        before, after, periods: (N, 13), (N, 13) and (N,), checked.

    Attributes:
        score: (6V + 10,) of the last row, as in `evaluation.Evaluation`.
    """

    def __init__(
        self,
        geometry: ContactGeometry,
        theta: Mapping[str, Array],
        body: Body,
        config: LossConfig,
        before: Array,
        after: Array,
        periods: Array,
    ) -> None:
        self.score = np.empty(6 * geometry.vertex_count + 10)
        self._terms, self._status, self._edges = np.empty(5), np.empty(1, np.int32), np.array([0, 1], np.int64)
        rows = [np.ascontiguousarray(values, dtype=float) for values in (before, after, periods)]
        self._columns = [(name, values.ctypes.data, values.strides[0]) for name, values in zip(ROW, rows, strict=True)]
        self._owners = theta, rows  # ctypes holds bare addresses: keep the arrays alive
        self._model = _Model(geometry, body, config)
        for name, values in theta.items():
            setattr(self._model, name, values.ctypes.data)
        self._job = _Job(
            starts=self._edges.ctypes.data,
            tosses=1,
            threads=1,
            max_iterations=config.max_iterations,
            residual_tolerance=config.tolerance,
            influence_bound=np.inf,
            terms=self._terms.ctypes.data,
            score=self.score.ctypes.data,
            status=self._status.ctypes.data,
        )
        self._call = _compiled_evaluation(), ctypes.byref(self._model), ctypes.byref(self._job)

    def loss(self, row: int) -> float | None:
        """Of one transition; None where its impulses carry no certificate."""
        for name, address, stride in self._columns:
            setattr(self._job, name, address + row * stride)
        function, model, job = self._call
        function(model, job)
        return None if self._status[0] else float(self._terms.sum())


@functools.cache
def _compiled_evaluation() -> Callable[..., int]:
    function = load_kernel().contact_curation_evaluate
    function.argtypes = (ctypes.POINTER(_Model), ctypes.POINTER(_Job))
    function.restype = ctypes.c_int
    return function
