"""The kernel's gradient steps of a polytope, a transition each: its structure field by field, and its call."""

import ctypes
import functools
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from contact_curation.contact.body import Body
from contact_curation.contact.compiled_evaluation import ROW, CompiledModel, CompiledRows
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.loss_config import LossConfig
from contact_curation.geometry.quaternions import Array
from contact_curation.solver.compiled import load_kernel

PIECES = ("vertices_normal", "normal", "vertices_tangent", "tangents")
"""The published form's parameters, in the kernel's order."""


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


class CompiledDescent:
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
        self._model = CompiledModel(geometry, body, config)
        for name in PIECES:
            setattr(self._model, name, moments[name].theta.ctypes.data)
        columns = dict(zip(ROW, (values.ctypes.data for values in rows), strict=True))
        self._rows = CompiledRows(**columns, max_iterations=config.max_iterations, residual_tolerance=config.tolerance)
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
def _compiled_descent() -> Callable[..., int]:
    function = load_kernel().contact_curation_descend
    function.argtypes = (ctypes.POINTER(CompiledModel), ctypes.POINTER(CompiledRows), ctypes.POINTER(_Descent))
    function.restype = ctypes.c_int64
    return function
