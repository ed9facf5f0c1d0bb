"""Rollouts: whole motions from their first state by repeated time steps, many trajectories at once (method.md 4.2)."""

import ctypes
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from contact_curation.contact.body import Body
from contact_curation.contact.compiled.evaluation import bounce_of
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.time_step import (
    DEFAULT_LIMITS,
    STATE_SIZE,
    CompiledWorld,
    StepStatus,
    SweepLimits,
    checked_states,
    checked_time_steps,
)
from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array
from contact_curation.solver.compiled import load_kernel


@dataclass(frozen=True, eq=False)
class Rollout:
    """B trajectories, one after the other: trajectory b owns rows starts[b]:starts[b + 1]; N rows in all.

    Attributes:
        starts: (B + 1,).
        states: (N, 13); the first row of a trajectory is its initial state, rows from a step that is not finite on are NaN.
        status: (N,) StepStatus of the step that led to a row.
        residual: (N,) see `SweepLimits.tolerance`.
        impulses: (N, V, 3) of the step that led to a row, or None when they were not asked for.
    """

    starts: NDArray[np.int64]
    states: Array
    status: NDArray[np.int32]
    residual: Array
    impulses: Array | None

    def trajectory(self, index: int) -> Array:
        """States (T, 13) of one trajectory."""
        return self.states[self.starts[index] : self.starts[index + 1]]

    @property
    def finite(self) -> NDArray[np.bool_]:
        """(B,) whether a trajectory is finite to its end."""
        return np.not_equal(self.status[self.starts[1:] - 1], StepStatus.NOT_FINITE)


def rollout(
    geometry: ContactGeometry,
    body: Body,
    initial: ArrayLike,
    lengths: ArrayLike,
    dt: ArrayLike,
    limits: SweepLimits = DEFAULT_LIMITS,
    threads: int = 1,
    keep_impulses: bool = False,
) -> Rollout:
    """Rolls out B initial states; each step starts from the impulses of the step before.

    The result does not depend on the number of threads, bit for bit.

    Args:
        geometry: shape, plane and friction; the body's own vertices and friction are not used.
        body: mass, inertia and gravity.
        initial: (B, 13).
        lengths: one or (B,) frames, the initial one included.
        dt: one or (B,) time steps [s].
        limits: when a step's sweeps stop.
        threads: how many work at once.
        keep_impulses: whether to return the impulses.

    Raises:
        InvalidValueError: a wrong shape, length, time step or quaternion norm.
    """
    start = checked_states(initial)
    starts = row_starts(lengths, len(start))
    steps = checked_time_steps(dt, len(start))
    checked_threads(threads)
    rows = int(starts[-1])
    states = np.empty((rows, STATE_SIZE))
    impulses = np.empty((rows, geometry.vertex_count, 3)) if keep_impulses else None
    status = np.empty(rows, np.int32)
    residual = np.empty(rows)
    world = CompiledWorld(geometry, body, limits)
    given = (array.ctypes.data for array in (start, starts, steps))
    results = (None if array is None else array.ctypes.data for array in (states, impulses, status, residual))
    address, count, arrays = ctypes.POINTER(CompiledWorld), ctypes.c_int64, [ctypes.c_void_p]
    bounce, name, number = bounce_of(geometry)
    run = load_kernel().function(f"contact_rollout{name}", None, address, *number, count, *3 * arrays, count, *4 * arrays)
    run(ctypes.byref(world), *bounce, len(start), *given, threads, *results)
    return Rollout(starts, states, status, residual, impulses)


def row_starts(lengths: ArrayLike, count: int) -> NDArray[np.int64]:
    """First rows (count + 1,) of trajectories from one length or `count` lengths.

    Raises:
        InvalidValueError: not integers, less than 1, or as many as neither 1 nor `count`.
    """
    given = np.asarray(lengths)
    if given.shape not in ((), (count,)) or not np.issubdtype(given.dtype, np.integer):
        raise InvalidValueError("lengths", f"{given.dtype} of shape {given.shape}", f"one integer or ({count},) integers")
    if np.any(given < 1):
        raise InvalidValueError("lengths", int(given.min()), "at least 1 frame")
    return np.concatenate([[0], np.cumsum(np.broadcast_to(given, (count,)), dtype=np.int64)])


def checked_threads(threads: int) -> int:
    """The number of threads.

    Raises:
        InvalidValueError: less than 1.
    """
    if threads < 1:
        raise InvalidValueError("threads", threads, "at least 1")
    return threads
