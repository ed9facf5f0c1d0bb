"""The kernel's evaluation of transitions: its structures field by field, and its call.

ctypes holds bare addresses. Whoever calls keeps the arrays alive and sees to it that they have the right shapes.
"""

import ctypes
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contact_curation.contact.body import Body
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.loss_config import LossConfig
from contact_curation.geometry.quaternions import Array
from contact_curation.solver.compiled import KernelStructure, load_kernel, processor_count
from contact_curation.solver.compiled_solver import KERNEL_WEIGHTS, kernel_weights
from contact_curation.solver.cone_problem import Cone

ROW = ("before", "after", "dt")
"""What the kernel reads of a transition."""


class CompiledModel(KernelStructure):
    """A polytope and its loss (contact/kernel/polytope_transition.hpp)."""

    KERNEL_NAME = "PolytopeModel"

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
        ("inertia", ctypes.c_double * 9),
        ("gravity", ctypes.c_double),
        *((name, ctypes.c_double) for name in KERNEL_WEIGHTS),
        ("circular", ctypes.c_int),
    )

    def __init__(self, geometry: ContactGeometry, body: Body, config: LossConfig) -> None:
        rigid = geometry.is_rigid
        inertia = body.gyroscopic_inertia if rigid else None
        weights = config.for_theta(body, rigid).weights
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
            inertia=(ctypes.c_double * 9)(*([] if inertia is None else inertia.flat)),
            gravity=body.scaled_gravity,
            circular=int(config.cone is Cone.CIRCULAR),
            **kernel_weights(weights),
        )
        self.owner = geometry  # ctypes holds bare addresses: keep the arrays alive


class CompiledRows(KernelStructure):
    """Transitions and the requested outputs (contact/kernel/polytope_rows.hpp)."""

    KERNEL_NAME = "Evaluation"

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


def bounce_of(geometry: ContactGeometry) -> tuple[list[Any], str, list[Any]]:
    """For the kernel: the arguments that give it the restitution of a body, the end of its function's name, their types."""
    if geometry.restitution is None:
        return [], "", []
    return [ctypes.byref(ctypes.c_double(geometry.restitution))], "_bouncing", [ctypes.POINTER(ctypes.c_double)]


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
    weights: Array | None = None,
    **outputs: np.ndarray[tuple[int, ...], np.dtype[np.float64]] | NDArray[np.int32],
) -> None:
    """Fills the outputs that are given.

    Args:
        geometry, body, config: as in `evaluation.evaluate`.
        before, after, periods: (N, 13), (N, 13) and (N,), checked.
        starts: (K + 1,) edges of the tosses, or of the pieces that threads take.
        estimator: of Fisher matrices, 1 empirical, 2 Gauss-Newton; 0 for no such matrices.
        influence_bound: as in `evaluation.fisher_sums`.
        weights: (N,) likewise; successive transitions of a toss with the same weight are summed before they are weighted.
        outputs: contiguous arrays by the job's names.
    """
    model = CompiledModel(geometry, body, config)
    job = CompiledRows(
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
    addresses = ctypes.POINTER(CompiledModel), ctypes.POINTER(CompiledRows)
    bounce, name, number = bounce_of(geometry)
    if weights is not None:
        weighted = (*addresses, ctypes.c_void_p, ctypes.POINTER(ctypes.c_double))
        evaluate = load_kernel().function("contact_curation_evaluate_weighted", ctypes.c_int, *weighted)
        evaluate(ctypes.byref(model), ctypes.byref(job), weights.ctypes.data, *(bounce or [None]))
        return
    evaluate = load_kernel().function(f"contact_curation_evaluate{name}", ctypes.c_int, *addresses, *number)
    evaluate(ctypes.byref(model), ctypes.byref(job), *bounce)
