"""Rollouts with any model's own time steps, many trajectories in lockstep (method.md 4.2).

The polytope has a kernel of its own (`contact.rollout`). With a network each frame is one evaluation for a block of
trajectories, and then the compiled time step at the contacts it gave, or the model's own.

Blocks always have the same size. Libraries choose how they sum by the shape of a product: alone, a network's last digits are
others than among many, and a motion with impacts makes much of last digits. With one shape for all, what a trajectory becomes
depends neither on those beside it nor on the number of threads. Trajectories of like length share a block.
"""

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import ArrayLike, NDArray

from contact_curation.contact.rollout import Rollout, checked_threads, row_starts
from contact_curation.contact.time_step import STATE_SIZE, Steps, StepStatus, checked_states, checked_time_steps
from contact_curation.geometry.quaternions import Array

BLOCK = 16
"""Trajectories that a network evaluates at once: enough that a row costs what it does in large batches, few enough for one."""


class _Releases(NamedTuple):
    """B trajectories to be: states (B, 13), first rows (B + 1,) and time steps (B,) [s]."""

    states: Array
    starts: NDArray[np.int64]
    dt: Array


type Stepping = Callable[[Array, Array], Iterator[Steps]]
"""Step after step from states (B, 13) with time steps (B,) [s], without end."""


def roll_out_steps(stepping: Stepping, initial: ArrayLike, lengths: ArrayLike, dt: ArrayLike, threads: int) -> Rollout:
    """As `Model.roll_out`, by a model's own steps."""
    states = checked_states(initial)
    releases = _Releases(states, row_starts(lengths, len(states)), checked_time_steps(dt, len(states)))
    result = _before_the_first_step(releases)
    work = partial(_roll_out_block, stepping, releases, result)
    with ThreadPoolExecutor(checked_threads(threads), initializer=_take, initargs=(torch.get_num_threads(),)) as pool:
        list(pool.map(work, _blocks(releases.starts)))
    return result


def _take(cores: int) -> None:
    """Lets torch take so many cores in a new thread: products of matrices would take all.

    Torch is asked first, since it takes the process's number at the first question.
    """
    torch.get_num_threads()
    torch.set_num_threads(cores)


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


def _roll_out_block(stepping: Stepping, releases: _Releases, result: Rollout, chosen: NDArray[np.int64]) -> None:
    """Fills in the rows of some trajectories; those that have ended, and copies that make the block full, run along unseen."""
    slots = np.resize(chosen, BLOCK)
    first, lengths = releases.starts[chosen], np.diff(releases.starts)[chosen]
    for frame, steps in zip(range(1, int(lengths.max())), stepping(releases.states[slots], releases.dt[slots])):
        running = np.flatnonzero(lengths > frame)
        rows = first[running] + frame
        result.states[rows] = steps.states[running]
        result.status[rows] = steps.status[running]
        result.residual[rows] = steps.residual[running]
