"""The kernel's gradient steps, a transition each: its structures field by field, its call, and the steps of a polytope."""

import ctypes
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from contact_curation.contact.body import Body
from contact_curation.contact.compiled.evaluation import ROW, CompiledModel, CompiledRows
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.loss_config import LossConfig
from contact_curation.geometry.quaternions import Array
from contact_curation.solver.compiled import KernelStructure, load_kernel

PIECES = ("vertices_normal", "normal", "vertices_tangent", "tangents")
"""The published form's parameters, in the kernel's order."""


MAX_LAYERS, MAX_WIDTH = 8, 256
"""The kernel's."""


@dataclass(frozen=True)
class Moments:
    """AdamW's arrays of one parameter, changed in place: its numbers, and both moments of its slopes, in the same shape."""

    theta: Array
    first: Array
    second: Array


@dataclass(frozen=True)
class DescentRules:
    """The objective and rules of gradient steps.

    Attributes:
        loss: weights and solver.
        regularizer: weight of each contact's.
        betas, epsilon: of AdamW.
    """

    loss: LossConfig
    regularizer: float
    betas: tuple[float, float]
    epsilon: float


class DescentRows(NamedTuple):
    """The transitions that steps are taken down: (N, 13), (N, 13) and (N,), checked."""

    before: Array
    after: Array
    periods: Array


class CompiledMoments(KernelStructure):
    """Addresses of a `Moments`' arrays (contact/kernel/descent.hpp, as all here)."""

    KERNEL_NAME = "Moments"

    _fields_ = (("theta", ctypes.c_void_p), ("first", ctypes.c_void_p), ("second", ctypes.c_void_p))

    @staticmethod
    def of(moments: Moments) -> "CompiledMoments":
        return CompiledMoments(*(array.ctypes.data for array in (moments.theta, moments.first, moments.second)))


class CompiledLayer(KernelStructure):
    """A linear layer."""

    KERNEL_NAME = "Layer"

    _fields_ = (
        ("inputs", ctypes.c_int64),
        ("outputs", ctypes.c_int64),
        ("weight", CompiledMoments),
        ("bias", CompiledMoments),
    )


class CompiledNetwork(KernelStructure):
    """Layers with an activation between each two."""

    KERNEL_NAME = "Network"
    _fields_ = (("layers", ctypes.c_int64), ("rectified", ctypes.c_int64), ("layer", CompiledLayer * MAX_LAYERS))


class CompiledAdamW(KernelStructure):
    """AdamW's learning rate and weight decay for some of the parameters."""

    KERNEL_NAME = "AdamWConfig"
    _fields_ = (("rate", ctypes.c_double), ("decay", ctypes.c_double))


class DescentTask(NamedTuple):
    """Gradient steps of one transition each.

    Attributes:
        moments: of all parameters, by name; they are changed.
        rows: to step down.
        rules: how.
        polytope, network: learning rates of the parameters outside networks and of those in them.
    """

    moments: Mapping[str, Moments]
    rows: DescentRows
    rules: DescentRules
    polytope: CompiledAdamW
    network: CompiledAdamW


class CompiledDescent(KernelStructure):
    """Gradient steps and the arrays that they change."""

    KERNEL_NAME = "Descent"

    _fields_ = (
        ("rows", ctypes.c_void_p),
        ("shares", ctypes.c_void_p),
        ("steps", ctypes.c_int64),
        ("regularizer", ctypes.c_double),
        ("polytope", CompiledAdamW),
        ("network", CompiledAdamW),
        ("first_beta", ctypes.c_double),
        ("second_beta", ctypes.c_double),
        ("epsilon", ctypes.c_double),
        ("theta", CompiledMoments * len(PIECES)),
        ("networks", CompiledNetwork * 2),
        ("mean", ctypes.c_void_p),
        ("scale", ctypes.c_void_p),
        ("share", ctypes.c_double),
        ("squared", ctypes.c_int64),
        ("seen", ctypes.c_double),
        ("loss_sum", ctypes.c_double),
    )

    def take_polytope(self, model: CompiledModel, pieces: Mapping[str, Moments]) -> None:
        """Has the kernel read and change theta where training has it: `pieces` of `PIECES`."""
        for place, name in enumerate(PIECES):
            setattr(model, name, pieces[name].theta.ctypes.data)
            self.theta[place] = CompiledMoments.of(pieces[name])


class KernelDescent:
    """Gradient steps of one model in the kernel: loss, regulariser and AdamW.

    ctypes holds bare addresses: parameters and moments must stay where they are.

    Args:
        name: of the kernel's function.
        model: physics, and what the kernel reads of theta.
        rows: to step down.
        rules: how.
        job: with what is peculiar to the model.
        owners: of what `model` and `job` point to.
    """

    def __init__(
        self, name: str, model: CompiledModel, rows: DescentRows, rules: DescentRules, job: CompiledDescent, owners: object
    ) -> None:
        arrays = DescentRows(*(np.ascontiguousarray(values, dtype=float) for values in rows))
        self._owners = owners, arrays
        addresses = ctypes.POINTER(CompiledModel), ctypes.POINTER(CompiledRows), ctypes.POINTER(CompiledDescent)
        self._function = load_kernel().function(name, ctypes.c_int64, *addresses)
        columns = dict(zip(ROW, (values.ctypes.data for values in arrays), strict=True))
        limits = {"max_iterations": rules.loss.max_iterations, "residual_tolerance": rules.loss.tolerance}
        self._model, self._rows, self._job = model, CompiledRows(**columns, **limits), job
        job.regularizer, job.epsilon = rules.regularizer, rules.epsilon
        job.first_beta, job.second_beta = rules.betas

    def descend(self, rows: NDArray[np.int64], shares: Array, seen: float, loss_sum: float) -> tuple[int, float]:
        """Steps down the rows in turn, to the first that is not solved, or whose loss or slope is not finite.

        Args:
            rows: (S,) places of transitions.
            shares: (S,) of the learning rates.
            seen: steps that the moments have seen.
            loss_sum: of the rows before.

        Returns:
            How many steps were taken, and the sum with theirs.
        """
        rows, shares = np.ascontiguousarray(rows, np.int64), np.ascontiguousarray(shares, float)
        job = self._job
        job.rows, job.shares, job.steps = rows.ctypes.data, shares.ctypes.data, len(rows)
        job.seen, job.loss_sum = seen, loss_sum
        taken = self._function(ctypes.byref(self._model), ctypes.byref(self._rows), ctypes.byref(job))
        return taken, job.loss_sum


def polytope_descent(geometry: ContactGeometry, body: Body, task: DescentTask) -> KernelDescent:
    """Makes gradient steps of a polytope in the published form.

    Args:
        geometry: what stays of theta, pivot and height, and the shapes.
        body: mass, inertia and gravity.
        task: with moments of `PIECES`.
    """
    model, job = CompiledModel(geometry, body, task.rules.loss), CompiledDescent(polytope=task.polytope)
    job.take_polytope(model, task.moments)
    return KernelDescent("contact_curation_descend", model, task.rows, task.rules, job, task.moments)
