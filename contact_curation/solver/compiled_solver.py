"""Solves the inner problem of many transitions with the compiled interior point method (METHOD 4.1; kernel/cone_solver.cpp)."""

import ctypes
from collections.abc import Callable

import numpy as np

from contact_curation.solver.compiled import load_kernel, processor_count
from contact_curation.solver.cone_problem import DEFAULT_TOLERANCE, Cone, ConeProblems, ConeSolutions

MAX_ITERATIONS = 60
"""The real tosses need about 20."""

_WEIGHTS = ("match", "complementarity_normal", "complementarity_tangent", "dissipation", "penetration", "regularization")
_GIVEN = ("jacobians", "inverse_mass", "gaps", "gaps_next", "free_velocities", "velocities_next", "dt")
_FOUND = ("impulses", "residuals", "status", "iterations")


class _Batch(ctypes.Structure):
    """The kernel's `ConeBatch`, field by field."""

    _fields_ = (
        ("batch", ctypes.c_int64),
        ("contacts", ctypes.c_int32),
        ("circular", ctypes.c_int32),
        ("threads", ctypes.c_int32),
        ("max_iterations", ctypes.c_int32),
        ("residual_tolerance", ctypes.c_double),
        *((name, ctypes.c_double) for name in _WEIGHTS),
        *((name, ctypes.c_void_p) for name in (*_GIVEN, *_FOUND)),
    )


def solve_compiled(
    problems: ConeProblems, tolerance: float = DEFAULT_TOLERANCE, max_iterations: int = MAX_ITERATIONS, threads: int = 0
) -> ConeSolutions:
    """The impulses of B problems; one that is not finite does not disturb its neighbours.

    Args:
        problems: what to solve.
        tolerance: largest residual that counts as solved.
        max_iterations: of the interior point method.
        threads: how many work at once; 0 for one per processor.

    Raises:
        MissingDependencyError: the kernel was not built.
    """
    solutions = ConeSolutions(
        impulses=np.empty((problems.batch, problems.contacts, 3)),
        residuals=np.empty(problems.batch),
        status=np.empty(problems.batch, np.int32),
        iterations=np.empty(problems.batch, np.int32),
    )
    job = _Batch(
        batch=problems.batch,
        contacts=problems.contacts,
        circular=int(problems.cone is Cone.CIRCULAR),
        threads=threads or processor_count(),
        max_iterations=max_iterations,
        residual_tolerance=tolerance,
        **{name: getattr(problems.weights, name) for name in _WEIGHTS},
        **{name: getattr(problems, name).ctypes.data for name in _GIVEN},
        **{name: getattr(solutions, name).ctypes.data for name in _FOUND},
    )
    _compiled_solver()(ctypes.byref(job))
    return solutions


def _compiled_solver() -> Callable[..., int]:
    signature = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.POINTER(_Batch))
    return signature(("contact_curation_solve_cones", load_kernel()))
