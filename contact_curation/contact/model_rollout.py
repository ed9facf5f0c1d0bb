"""Whole motions from their first state with any model, many trajectories in lockstep (METHOD 4.2).

The polytope has a kernel of its own (`contact.rollout`). With a network each frame is one evaluation for a block of
trajectories, and then the compiled time step at the contacts it gave; `EndToEndModel` gives the net impulse f itself,

    v' = v - g dt e3 + M^-1 f,    x' = x + dt v',    q' = q * exp(dt omega').

Blocks always have the same size. Libraries choose how they sum by the shape of a product: alone, a network's last digits are
others than among many, and a motion with impacts makes much of last digits. With one shape for all, what a trajectory becomes
depends neither on those beside it nor on the number of threads. Trajectories of like length share a block.
"""

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import ArrayLike, NDArray

from contact_curation.contact.body import Body
from contact_curation.contact.end_to_end_model import EndToEndModel
from contact_curation.contact.given_contacts import step_at_contacts
from contact_curation.contact.model import ContactModel, Model
from contact_curation.contact.polytope_model import PolytopeModel
from contact_curation.contact.rollout import Rollout, checked_threads, rollout, row_starts
from contact_curation.contact.time_step import (
    DEFAULT_LIMITS,
    STATE_SIZE,
    Steps,
    StepStatus,
    SweepLimits,
    checked_states,
    checked_time_steps,
)
from contact_curation.errors import InvalidValueError
from contact_curation.geometry import quaternions
from contact_curation.geometry.quaternions import Array

BLOCK = 16
"""Trajectories that a network evaluates at once: enough that a row costs what it does in large batches, few enough for one."""


class _Releases(NamedTuple):
    """B trajectories to be: states (B, 13), first rows (B + 1,) and time steps (B,) [s]."""

    states: Array
    starts: NDArray[np.int64]
    dt: Array


def roll_out_model(
    model: Model,
    initial: ArrayLike,
    lengths: ArrayLike,
    dt: ArrayLike,
    limits: SweepLimits = DEFAULT_LIMITS,
    threads: int = 1,
) -> Rollout:
    """Rolls out B initial states; where there are contacts, each step starts from the impulses of the step before.

    Args:
        model: any.
        initial: (B, 13).
        lengths: one or (B,) frames, the initial one included.
        dt: one or (B,) time steps [s].
        limits: when a step's sweeps over the contacts stop.
        threads: how many blocks are rolled out at once; torch's own threads are extra, so give it one where these are many.

    Returns:
        The rollout, without impulses.

    Raises:
        InvalidValueError: a wrong shape, length, time step or quaternion norm.
    """
    if isinstance(model, PolytopeModel):
        return rollout(model.geometry(), model.body, initial, lengths, dt, limits, threads)
    states = checked_states(initial)
    releases = _Releases(states, row_starts(lengths, len(states)), checked_time_steps(dt, len(states)))
    result = _before_the_first_step(releases)
    work = partial(_roll_out_block, model, limits, releases, result)
    # Asked in a new thread, torch tells it how many cores it may use; products of matrices do not ask, and would take them all.
    with ThreadPoolExecutor(checked_threads(threads), initializer=torch.get_num_threads) as pool:
        list(pool.map(work, _blocks(releases.starts)))
    return result


def _before_the_first_step(releases: _Releases) -> Rollout:
    """The first row of each trajectory that is finite there; all others NaN and NOT_FINITE."""
    rows = int(releases.starts[-1])
    states, residual = np.full((rows, STATE_SIZE), np.nan), np.full(rows, np.nan)
    status = np.full(rows, StepStatus.NOT_FINITE, np.int32)
    finite = np.isfinite(releases.states).all(axis=1)
    first = releases.starts[:-1][finite]
    states[first], status[first], residual[first] = releases.states[finite], StepStatus.CONVERGED, 0.0
    return Rollout(releases.starts, states, status, residual, None)


def _blocks(starts: NDArray[np.int64]) -> Iterator[NDArray[np.int64]]:
    """Trajectories by falling length, in groups of at most BLOCK."""
    longest_first = np.argsort(-np.diff(starts), kind="stable")
    return (longest_first[at : at + BLOCK] for at in range(0, len(longest_first), BLOCK))


def _roll_out_block(model: Model, limits: SweepLimits, releases: _Releases, result: Rollout, chosen: NDArray[np.int64]) -> None:
    """Fills in the rows of some trajectories; those that have ended, and copies that make the block full, run along unseen."""
    slots = np.resize(chosen, BLOCK)
    first, lengths = releases.starts[chosen], np.diff(releases.starts)[chosen]
    for frame, steps in zip(range(1, int(lengths.max())), _steps(model, limits, releases.states[slots], releases.dt[slots])):
        running = np.flatnonzero(lengths > frame)
        rows = first[running] + frame
        result.states[rows] = steps.states[running]
        result.status[rows] = steps.status[running]
        result.residual[rows] = steps.residual[running]


def _steps(model: Model, limits: SweepLimits, states: Array, dt: Array) -> Iterator[Steps]:
    """Step after step from B states (B, 13), without end."""
    if isinstance(model, ContactModel):
        return _steps_at_contacts(model, limits, states, dt)
    if isinstance(model, EndToEndModel):
        return _steps_by_impulses(model, states, dt)
    raise InvalidValueError("model", type(model).__name__, "a ContactModel or an EndToEndModel")


def _steps_at_contacts(model: ContactModel, limits: SweepLimits, states: Array, dt: Array) -> Iterator[Steps]:
    impulses = None
    while True:
        rotations, positions = torch.as_tensor(quaternions.to_matrix(states[:, 3:7])), torch.as_tensor(states[:, :3])
        with torch.no_grad():
            gaps, jacobians = model.contacts_at(rotations, positions)
        steps = step_at_contacts(model.body, states, dt, gaps.numpy(), jacobians.numpy(), impulses, limits)
        states, impulses = steps.states, steps.impulses
        yield steps


def _steps_by_impulses(model: EndToEndModel, states: Array, dt: Array) -> Iterator[Steps]:
    """Without contacts there is nothing to solve: a step fails only where it is not finite."""
    none = np.empty((len(states), 0, 3))
    while True:
        with torch.no_grad():
            impulses = model.impulses_at(states).numpy()
        states = _pushed(model.body, states, dt, impulses)
        finite = np.isfinite(states[:, 0])
        status = np.where(finite, StepStatus.CONVERGED, StepStatus.NOT_FINITE).astype(np.int32)
        yield Steps(states, none, status, np.where(finite, 0.0, np.nan))


def _pushed(body: Body, states: Array, dt: Array, impulses: Array) -> Array:
    """States (B, 13) after net impulses (B, 6); all NaN where one number is not finite."""
    period = dt[:, None]
    with np.errstate(over="ignore", invalid="ignore"):  # a motion that runs away becomes NaN below
        linear = states[:, 7:10] + impulses[:, :3] / body.mass
        linear[:, 2] -= body.scaled_gravity * dt
        angular = states[:, 10:] + impulses[:, 3:] @ body.scaled_inverse_inertia.T
        turned = quaternions.multiply(states[:, 3:7], quaternions.exp(period * angular))
        after = np.concatenate([states[:, :3] + period * linear, quaternions.normalized(turned), linear, angular], axis=1)
    after[~np.isfinite(after).all(axis=1)] = np.nan
    return after
