"""Transitions as a polytope describes them.

Velocities of fast cameras are medians of three (motion/smoothing.py), from which much friction is learned far too low
(docs/explanation/learning.md, "Much friction"). So those of a body with much friction are plain differences.

Where the tracker's noise hides what gravity does within a frame period, transitions lead over several frames, with the mean
velocities between these: else what is noise counts as slip and impulses, and friction is learned far too high
(docs/explanation/learning.md, "Noisy and fast trackers").

With a restitution, one transition spans all frame periods of an impact. The frame period in which a body meets the board has a
mean velocity that is neither the one before nor the one after the impact. No law of impact relates the two transitions that
share it, but one relates the states before and after it. Without this a restitution cannot be learned (docs/results.md, "Bodies
that bounce").
"""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from contact_curation.contact.body import Body
from contact_curation.contact.geometry_parameters import UPWARD, ContactGeometry
from contact_curation.contact.loss_config import MODERATE_FRICTION
from contact_curation.geometry import quaternions
from contact_curation.geometry.quaternions import Array
from contact_curation.motion.survey.series import THIRD_DIFFERENCE
from contact_curation.motion.transitions import Transitions, by_differences

HARD = 5.0
"""At an impact the velocity changes by more than so many times what gravity changes in a frame period."""

UNUSUAL = 3.0
"""It also changes by more than so many times the toss's median change, so that a tracker's noise is not taken for impacts."""

LONGEST = 3
"""Transitions are merged where at most so many in a row begin with such a change."""

HIDDEN, CLEAR = 0.35, 0.1
"""Noise of a vertex relative to how far a body falls in a transition, g dt^2: with more than the first a transition leads over
so many frames that it has the second at most."""

LONGEST_SPAN = 1.0 / 60.0
"""[s] Over longer transitions impacts are not seen."""

FEWEST = 8
"""Transitions that a toss keeps."""

SHORTEST_PLAIN = 1.0 / 220.0
"""[s] At frames that are closer the noise of plain differences makes friction too high."""


def as_described(data: Transitions, geometry: ContactGeometry | None, body: Body) -> Transitions:
    """The transitions that a model's loss is taken of.

    For a theta in the rigid form, transitions of a toss lead over several frames where its tracker is noisy, and velocities are
    plain differences where the body is described with more friction than `MODERATE_FRICTION`, and frames are not too close.
    Impacts are merged where theta has a restitution.

    Args:
        data: transitions between successive frames.
        geometry: theta; None for a network.
        body: that moves.
    """
    if geometry is None:
        return data
    if geometry.is_rigid:
        data = _over_noise(data, body)
        if body.friction > MODERATE_FRICTION:
            data = _by_differences_where_slow(data)
    return data if geometry.restitution is None else merged_impacts(data, body)


def _over_noise(data: Transitions, body: Body) -> Transitions:
    """The transitions, over several frames in tosses whose tracker's noise hides what gravity does within one.

    Such a toss loses the frames at its end that are too few for another transition, and its velocities are mean ones.
    """
    ends = [*pairwise(data.starts.tolist())]
    spans = [_span(data, slice(*each), body) for each in ends]
    if max(spans, default=1) == 1:
        return data
    firsts = [np.arange(begin, end - span + 1, span) for span, (begin, end) in zip(spans, ends, strict=True)]
    periods = [data.dt[first[:, np.newaxis] + np.arange(span)].sum(axis=1) for span, first in zip(spans, firsts, strict=True)]
    counts = [len(first) for first in firsts]
    first, span = np.concatenate(firsts), np.repeat(spans, counts)
    starts = np.concatenate([[0], np.cumsum(counts)])
    over = Transitions(data.toss_ids, data.before[first], data.after[first + span - 1], np.concatenate(periods), starts)
    return _by_differences_in(over, np.array(spans) > 1)


def _span(data: Transitions, rows: slice, body: Body) -> int:
    """How many frames a transition of a toss leads over, by its own noise; `motion.pose_noise` follows whole recordings."""
    before, after, periods = data.before[rows], data.after[rows], data.dt[rows]
    if len(periods) < 2 * FEWEST:
        return 1
    turns = quaternions.log(quaternions.multiply(quaternions.conjugate(before[:, 3:7]), after[:, 3:7]))
    place, turn = (
        float(np.median(np.abs(np.diff(steps, n=2, axis=0)))) / THIRD_DIFFERENCE
        for steps in (after[:, :3] - before[:, :3], turns)
    )
    noise = math.hypot(place, turn * math.sqrt(float(np.square(body.scaled_vertices).sum(axis=1).mean())))
    period = float(np.median(periods))
    if not noise > HIDDEN * body.scaled_gravity * period**2:
        return 1
    seconds = min(math.sqrt(noise / (CLEAR * body.scaled_gravity)), LONGEST_SPAN)
    return max(1, min(math.ceil(seconds / period), len(periods) // FEWEST))


def _by_differences_where_slow(data: Transitions) -> Transitions:
    """With plain differences in tosses whose median frame period is `SHORTEST_PLAIN` at least."""
    slow = [bool(begin < end and np.median(data.dt[begin:end]) >= SHORTEST_PLAIN) for begin, end in pairwise(data.starts)]
    return _by_differences_in(data, np.array(slow)) if any(slow) else data


def _by_differences_in(data: Transitions, tosses: NDArray[np.bool_]) -> Transitions:
    """With plain differences in some tosses (K,)."""
    rows, plain = tosses[data.toss_index, np.newaxis], by_differences(data)
    return replace(data, before=np.where(rows, plain.before, data.before), after=np.where(rows, plain.after, data.after))


def merged_impacts(data: Transitions, body: Body) -> Transitions:
    """The transitions, with those of an impact as one: a toss keeps its first and last state, and its id.

    Args:
        data: transitions between successive frames.
        body: that moves.
    """
    changes = _velocity_changes(data, body)
    gravity = body.scaled_gravity * data.dt
    bounds = np.concatenate(
        [np.maximum(HARD * gravity[slice(*ends)], UNUSUAL * _median(changes[slice(*ends)])) for ends in pairwise(data.starts)]
    )
    hard = changes > bounds
    edges = np.flatnonzero(np.diff(np.concatenate([[False], hard, [False]])))  # a run of hard rows begins, ends, begins ...
    first = np.ones(len(data.dt), dtype=bool)
    for begin, end in edges.reshape(-1, 2):
        if end - begin <= LONGEST:
            first[begin + 1 : end] = False
    rows = np.flatnonzero(first)
    last = np.append(rows[1:], len(first)) - 1
    starts = np.concatenate([[0], np.cumsum(first)])[data.starts]
    return Transitions(data.toss_ids, data.before[rows], data.after[last], np.add.reduceat(data.dt, rows), starts)


def _velocity_changes(data: Transitions, body: Body) -> Array:
    """(N,) how much the mean velocity changes from the transition before to each one, without gravity's share.

    The change of the spin counts times the body's radius. 0 at the first transition of a toss.
    """
    velocities = (data.after[:, :3] - data.before[:, :3]) / data.dt[:, np.newaxis]
    turns = quaternions.log(quaternions.multiply(quaternions.conjugate(data.before[:, 3:7]), data.after[:, 3:7]))
    spins = turns / data.dt[:, np.newaxis]
    falling = 0.5 * body.scaled_gravity * (data.dt[1:] + data.dt[:-1])
    linear = np.linalg.norm(np.diff(velocities, axis=0) + falling[:, np.newaxis] * UPWARD, axis=1)
    radius = float(np.linalg.norm(body.scaled_vertices, axis=1).max())
    changes = np.concatenate([[0.0], np.hypot(linear, radius * np.linalg.norm(np.diff(spins, axis=0), axis=1))])
    changes[data.starts[:-1]] = 0.0
    return np.asarray(changes)


def _median(changes: Array) -> float:
    """Of a toss's changes; its first transition has none."""
    return float(np.median(changes[1:])) if len(changes) > 1 else 0.0
