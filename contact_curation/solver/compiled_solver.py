"""Solves the inner problem of many transitions with the compiled interior point method.

See method.md 4.1; kernel/cone_solver.cpp.
"""

import ctypes

import numpy as np

from contact_curation.solver.compiled import KernelStructure, load_kernel, processor_count
from contact_curation.solver.cone_problem import DEFAULT_TOLERANCE, Cone, ConeProblems, ConeSolutions, ConeWeights

MAX_ITERATIONS = 60
"""Transitions of real tosses take about 20 iterations."""

KERNEL_WEIGHTS = {
    "match_weight": "match",
    "normal_weight": "complementarity_normal",
    "tangent_weight": "complementarity_tangent",
    "cone_weight": "dissipation",
    "slack_weight": "penetration",
    "regularization": "regularization",
}
"""The weights' names in the kernel, in its order, and in `ConeWeights`."""

_GIVEN = ("jacobians", "inverse_mass", "gaps", "gaps_next", "free_velocities", "velocities_next", "dt")
_FOUND = ("impulses", "residuals", "status", "iterations")


class ConeBatch(KernelStructure):
    """B inner problems and their solutions (kernel/cone_batch.hpp)."""

    KERNEL_NAME = "ConeBatch"

    _fields_ = (
        ("batch", ctypes.c_int64),
        ("contacts", ctypes.c_int32),
        ("circular", ctypes.c_int32),
        ("threads", ctypes.c_int32),
        ("max_iterations", ctypes.c_int32),
        ("residual_tolerance", ctypes.c_double),
        *((name, ctypes.c_double) for name in KERNEL_WEIGHTS),
        *((name, ctypes.c_void_p) for name in (*_GIVEN, *_FOUND)),
    )


def solve_compiled(
    problems: ConeProblems, tolerance: float = DEFAULT_TOLERANCE, max_iterations: int = MAX_ITERATIONS, threads: int = 0
) -> ConeSolutions:
    """Computes the impulses of B problems; a problem with values that are not finite does not affect the others.

    Args:
        problems: problems to solve.
        tolerance: largest residual that counts as solved.
        max_iterations: largest number of iterations of the interior point method.
        threads: number of threads; 0 for one per processor.

    Raises:
        MissingDependencyError: the kernel was not built.
    """
    solutions = ConeSolutions(
        impulses=np.empty((problems.batch, problems.contacts, 3)),
        residuals=np.empty(problems.batch),
        status=np.empty(problems.batch, np.int32),
        iterations=np.empty(problems.batch, np.int32),
    )
    job = ConeBatch(
        batch=problems.batch,
        contacts=problems.contacts,
        circular=int(problems.cone is Cone.CIRCULAR),
        threads=threads or processor_count(),
        max_iterations=max_iterations,
        residual_tolerance=tolerance,
        **kernel_weights(problems.weights),
        **{name: getattr(problems, name).ctypes.data for name in _GIVEN},
        **{name: getattr(solutions, name).ctypes.data for name in _FOUND},
    )
    solve = load_kernel().function("contact_curation_solve_cones", ctypes.c_int, ctypes.POINTER(ConeBatch))
    solve(ctypes.byref(job))
    return solutions


def kernel_weights(weights: ConeWeights) -> dict[str, float]:
    """The weights by the kernel's names."""
    return {theirs: getattr(weights, ours) for theirs, ours in KERNEL_WEIGHTS.items()}
