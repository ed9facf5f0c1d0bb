"""One step of a body that falls on the board, solved by the compiled kernel (method.md 4.2).

    v' = v - g dt e3 + M^-1 J^T lambda,    0 <= lambda_n _|_ J_n v' + phi / dt >= 0,    ||lambda_t|| <= lambda_n (Coulomb)
    x' = x + dt v',    q' = q * exp(dt omega')

Lengths are characteristic lengths, states are rows of 13: x (3), q wxyz (4), v in the board's frame (3), omega in the body's
(3). Impulses are rows [normal, tangent 1, tangent 2]; the friction coefficient is in the tangents T, so that ||lambda_t|| <=
lambda_n. The spin of a rigid theta precesses, too (`ContactGeometry.is_rigid`): omega' has - dt I^-1 (omega x I omega).

Impacts bounce where theta has a restitution e: a contact that comes with J_n v < 0 and would close within the step parts with
J_n v' >= max(-phi / dt, -e J_n v), Newton's law.
"""

import ctypes
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import ArrayLike, NDArray

from contact_curation.configs import check_positive, set_whole_numbers
from contact_curation.contact.body import Body
from contact_curation.contact.compiled.evaluation import bounce_of
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.errors import InvalidValueError
from contact_curation.geometry.poses import QUATERNION_TOLERANCE
from contact_curation.geometry.quaternions import Array
from contact_curation.solver.compiled import KernelStructure, load_kernel

STATE_SIZE = 13

SMALLEST_SQUARE, LARGEST_SQUARE = (1.0 - QUATERNION_TOLERANCE) ** 2, (1.0 + QUATERNION_TOLERANCE) ** 2
"""Of the norm of a quaternion that counts as a unit one."""


class StepStatus(IntEnum):
    """How a step ended."""

    CONVERGED = 0
    SWEEPS_EXHAUSTED = 1
    NOT_FINITE = 2


@dataclass(frozen=True)
class SweepLimits:
    """When the sweeps over the contacts stop.

    Attributes:
        tolerance: on the largest change of a contact's own velocity within a sweep [characteristic lengths per s].
        max_sweeps: a step that needs more ends as SWEEPS_EXHAUSTED, with its residual.
    """

    tolerance: float = 1e-6
    max_sweeps: int = 400

    def __post_init__(self) -> None:
        check_positive(self, ("tolerance",))
        set_whole_numbers(self, ("max_sweeps",), 1)


DEFAULT_LIMITS = SweepLimits()


@dataclass(frozen=True, eq=False)
class Steps:
    """N steps.

    Attributes:
        states: (N, 13) after the step; NaN where the status is NOT_FINITE.
        impulses: (N, V, 3).
        status: (N,) StepStatus.
        residual: (N,) change of the last sweep, see `SweepLimits.tolerance`.
    """

    states: Array
    impulses: Array
    status: NDArray[np.int32]
    residual: Array


class CompiledDynamics(KernelStructure):
    """The moving body and the limits of the sweeps (contact/kernel/contact_sweeps.hpp)."""

    KERNEL_NAME = "Dynamics"

    _fields_ = (
        ("inverse_inertia", ctypes.c_void_p),
        ("inertia", ctypes.c_void_p),
        ("inverse_mass", ctypes.c_double),
        ("gravity", ctypes.c_double),
        ("tolerance", ctypes.c_double),
        ("max_sweeps", ctypes.c_int64),
    )

    def __init__(self, body: Body, limits: SweepLimits, *, is_rigid: bool = False) -> None:
        inverse_inertia = np.ascontiguousarray(body.scaled_inverse_inertia)
        inertia = body.gyroscopic_inertia if is_rigid else None
        super().__init__(
            inverse_inertia=inverse_inertia.ctypes.data,
            inertia=None if inertia is None else inertia.ctypes.data,
            inverse_mass=1.0 / body.mass,
            gravity=body.scaled_gravity,
            tolerance=limits.tolerance,
            max_sweeps=limits.max_sweeps,
        )
        self.owner = (inverse_inertia, inertia)  # ctypes holds bare addresses: keep the array alive


class CompiledWorld(KernelStructure):
    """A polytope over a plane and the moving body (contact/kernel/time_step.hpp)."""

    KERNEL_NAME = "ContactWorld"

    _fields_ = (
        ("vertices", ctypes.c_int64),
        ("vertices_normal", ctypes.c_void_p),
        ("normal", ctypes.c_void_p),
        ("vertices_tangent", ctypes.c_void_p),
        ("tangents", ctypes.c_void_p),
        ("pivot", ctypes.c_void_p),
        ("height", ctypes.c_double),
        ("dynamics", CompiledDynamics),
    )

    def __init__(self, geometry: ContactGeometry, body: Body, limits: SweepLimits) -> None:
        dynamics = CompiledDynamics(body, limits, is_rigid=geometry.is_rigid)
        super().__init__(
            vertices=geometry.vertex_count,
            vertices_normal=geometry.vertices_normal.ctypes.data,
            normal=geometry.normal.ctypes.data,
            vertices_tangent=geometry.vertices_tangent.ctypes.data,
            tangents=geometry.tangents.ctypes.data,
            pivot=geometry.pivot.ctypes.data,
            height=geometry.height,
            dynamics=dynamics,
        )
        self.owners = (geometry, dynamics)  # ctypes holds bare addresses: keep the arrays alive


def checked_states(states: ArrayLike) -> Array:
    """A copy (N, 13) of `states`; values that are not finite pass, they become a status.

    Raises:
        InvalidValueError: wrong shape, or a finite quaternion that is not of unit norm.
    """
    rows = np.array(states, dtype=float, order="C")
    if rows.ndim != 2 or rows.shape[1] != STATE_SIZE:
        raise InvalidValueError("states", f"shape {rows.shape}", f"(N, {STATE_SIZE})")
    squares = np.einsum("ni,ni->n", rows[:, 3:7], rows[:, 3:7])
    if ((squares < SMALLEST_SQUARE) | (squares > LARGEST_SQUARE)).any():
        norms = np.sqrt(squares)
        found = f"{np.nanmin(norms):.6g} to {np.nanmax(norms):.6g}"
        raise InvalidValueError("quaternion norms", found, f"1 within {QUATERNION_TOLERANCE}")
    return rows


def checked_time_steps(dt: ArrayLike, count: int) -> Array:
    """Time steps (count,) from one number or `count` numbers [s].

    Raises:
        InvalidValueError: not positive, or as many as neither 1 nor `count`.
    """
    given = np.asarray(dt, dtype=float)
    if given.shape not in ((), (count,)):
        raise InvalidValueError("dt", f"shape {given.shape}", f"one number or ({count},)")
    if not np.all(np.isfinite(given) & (given > 0.0)):
        raise InvalidValueError("dt", np.array2string(given), "positive numbers of seconds")
    return np.ascontiguousarray(np.broadcast_to(given, (count,)))


def checked_guesses(guesses: ArrayLike | None, count: int, contacts: int) -> Array:
    """A copy of the impulses (count, contacts, 3) to start from; zero when there are none.

    Raises:
        InvalidValueError: another shape.
    """
    shape = (count, contacts, 3)
    impulses = np.zeros(shape) if guesses is None else np.array(guesses, dtype=float, order="C")
    if impulses.shape != shape:
        raise InvalidValueError("guesses", f"shape {impulses.shape}", f"{shape}")
    return impulses


def step(
    geometry: ContactGeometry,
    body: Body,
    states: ArrayLike,
    dt: ArrayLike,
    guesses: ArrayLike | None = None,
    limits: SweepLimits = DEFAULT_LIMITS,
) -> Steps:
    """Advances each of N states by one time step.

    Args:
        geometry: shape, plane and friction; the body's own vertices and friction are not used.
        body: mass, inertia and gravity.
        states: (N, 13).
        dt: one or (N,) time steps [s].
        guesses: (N, V, 3) impulses to start from; zero when absent.
        limits: when to stop.

    Raises:
        InvalidValueError: a wrong shape, time step or quaternion norm.
    """
    after = checked_states(states)
    count = len(after)
    steps = checked_time_steps(dt, count)
    impulses = checked_guesses(guesses, count, geometry.vertex_count)
    status, residual = np.empty(count, np.int32), np.empty(count)
    world = CompiledWorld(geometry, body, limits)
    data = (array.ctypes.data for array in (steps, after, impulses, status, residual))
    address, arrays = ctypes.POINTER(CompiledWorld), 5 * [ctypes.c_void_p]
    bounce, name, number = bounce_of(geometry)
    advance = load_kernel().function(f"contact_time_step{name}", None, address, *number, ctypes.c_int64, *arrays)
    advance(ctypes.byref(world), *bounce, count, *data)
    after[status == StepStatus.NOT_FINITE] = np.nan
    return Steps(after, impulses, status, residual)


def step_at_contacts(
    body: Body,
    states: ArrayLike,
    dt: ArrayLike,
    gaps: ArrayLike,
    jacobians: ArrayLike,
    guesses: ArrayLike | None = None,
    limits: SweepLimits = DEFAULT_LIMITS,
) -> Steps:
    """The same for any model of contact, at gaps phi and Jacobians J as they are at the states.

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
