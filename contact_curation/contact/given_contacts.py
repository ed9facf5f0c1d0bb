"""One time step at contacts that somebody else evaluated: the time step of `contact.time_step` for any model of contact.

The compiled kernel takes gaps phi and Jacobians J as they are at the states, instead of a polytope, and does the rest alike.
"""

import ctypes

import numpy as np
from numpy.typing import ArrayLike

from contact_curation.contact.body import Body
from contact_curation.contact.time_step import (
    DEFAULT_LIMITS,
    CompiledDynamics,
    Steps,
    StepStatus,
    SweepLimits,
    checked_guesses,
    checked_states,
    checked_time_steps,
)
from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array
from contact_curation.solver.compiled import load_kernel


def step_at_contacts(
    body: Body,
    states: ArrayLike,
    dt: ArrayLike,
    gaps: ArrayLike,
    jacobians: ArrayLike,
    guesses: ArrayLike | None = None,
    limits: SweepLimits = DEFAULT_LIMITS,
) -> Steps:
    """Advances each of N states by one time step.

    Args:
        body: mass, inertia and gravity.
        states: (N, 13).
        dt: one or (N,) time steps [s].
        gaps: (N, K) at the states; a state with one that is not finite ends as NOT_FINITE.
        jacobians: (N, K, 3, 6) as [normal, tangent 1, tangent 2], the friction coefficient in the tangents; the same holds.
        guesses: (N, K, 3) impulses to start from; zero when absent.
        limits: when to stop.

    Raises:
        InvalidValueError: a wrong shape, time step or quaternion norm.
    """
    after = checked_states(states)
    count = len(after)
    steps = checked_time_steps(dt, count)
    phi = np.ascontiguousarray(gaps, dtype=float)
    if phi.ndim != 2 or len(phi) != count:
        raise InvalidValueError("gaps", f"shape {phi.shape}", f"({count}, K)")
    contacts = phi.shape[1]
    rows: Array = np.ascontiguousarray(jacobians, dtype=float)
    if rows.shape != (count, contacts, 3, 6):
        raise InvalidValueError("jacobians", f"shape {rows.shape}", f"{(count, contacts, 3, 6)}")
    impulses = checked_guesses(guesses, count, contacts)
    status, residual = np.empty(count, np.int32), np.empty(count)
    dynamics = CompiledDynamics(body, limits)
    data = (array.ctypes.data for array in (steps, phi, rows, after, impulses, status, residual))
    counts, arrays = 2 * [ctypes.c_int64], 7 * [ctypes.c_void_p]
    advance = load_kernel().function("contact_given_step", None, ctypes.POINTER(CompiledDynamics), *counts, *arrays)
    advance(ctypes.byref(dynamics), count, contacts, *data)
    after[status == StepStatus.NOT_FINITE] = np.nan
    return Steps(after, impulses, status, residual)
