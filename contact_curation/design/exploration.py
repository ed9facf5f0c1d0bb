"""Exploration throws, before theta passes the readiness check: different first impacts, by flight and shape (method.md 2.4).

The information of a toss depends on how the body first meets the board. Up to the first touch its motion is taken for a
ballistic flight with a constant spin, whatever theta is; how it then stands and moves, seen from the body, is the feature: the
direction of down, and the velocity of the body's centre. Throws are spread over
these features as k-means++ spreads its seeds (Arthur and Vassilvitskii 2007), but always to the farthest: the next is the
one farthest from all before it.
"""

from collections.abc import Sequence
from math import sqrt

import numpy as np
from numpy.typing import NDArray

from contact_curation.contact.body import CONTACTNETS_CUBE, Body
from contact_curation.design.candidates import too_few
from contact_curation.design.planner import Plan, Planner
from contact_curation.geometry import quaternions
from contact_curation.geometry.quaternions import Array
from contact_curation.information.accumulated import Accumulated

FLIGHT_STEP = 1.0 / 148.0
"""[s] For a body of the size of ContactNets' cube under its gravity; others by the time in which they fall their own size."""

VELOCITY_WEIGHT = 0.25
"""A metre per second weighs as much as this part of the unit sphere of directions; likewise by the speed of such a fall."""


def impact_features(body: Body, states: Array) -> Array:
    """(K, 6) how bodies first meet the board: down in the body's frame, and weighted velocity in the body's frame.

    Args:
        body: shape and gravity, as described.
        states: (K, 13) releases in SI units.
    """
    lengths, gravities = body.length_scale / CONTACTNETS_CUBE.length_scale, body.gravity / CONTACTNETS_CUBE.gravity
    step, weight = FLIGHT_STEP * sqrt(lengths / gravities), VELOCITY_WEIGHT / sqrt(lengths * gravities)
    landed = (
        states[:, 9] + np.sqrt(states[:, 9] ** 2 + 2.0 * body.gravity * states[:, 2])
    ) / body.gravity  # (K,) the centre, too
    times = step * np.arange(int(np.ceil(landed.max() / step)) + 1)
    turned = quaternions.multiply(states[:, None, 3:7], quaternions.exp(times[None, :, None] * states[:, None, 10:]))
    heights = states[:, None, 2] + times * states[:, None, 9] - 0.5 * body.gravity * times**2
    rotations = quaternions.to_matrix(turned)  # (K, T, 3, 3)
    lowest = heights + (rotations[:, :, 2] @ body.vertices.T).min(axis=-1)
    first = (lowest <= 0.0).argmax(axis=1)
    at = np.arange(len(states))
    velocities = states[:, 7:10] - np.array([0.0, 0.0, body.gravity]) * times[first][:, None]
    into_body = rotations[at, first].transpose(0, 2, 1)
    down = -into_body[:, :, 2]
    return np.concatenate([down, weight * np.einsum("kij,kj->ki", into_body, velocities)], axis=1)


def spread(features: Array, count: int, seen: Array, seed: int) -> NDArray[np.int64]:
    """Indices (B,) of features far from each other and from those seen.

    Args:
        features: (K, D) to pick from.
        count: how many, at most K.
        seen: (M, D) of what was thrown before; the first pick is seeded where there is none.
        seed: of that first pick.
    """
    if len(seen):
        nearest = _squared(features, seen).min(axis=1)
        picks: list[int] = []
    else:
        picks = [int(np.random.default_rng(seed).integers(len(features)))]
        nearest = _squared(features, features[picks])[:, 0]
    while len(picks) < min(count, len(features)):
        nearest[picks] = -1.0
        picks.append(int(nearest.argmax()))
        nearest = np.minimum(nearest, _squared(features, features[picks[-1:]])[:, 0])
    return np.array(picks[:count], dtype=np.int64)


def _squared(one: Array, other: Array) -> Array:
    return np.asarray(((one[:, None] - other[None]) ** 2).sum(axis=-1))


def coverage(features: Array, seen: Array, radius: float) -> float:
    """The share of features with one that was seen within `radius` of it."""
    return float((_squared(features, seen).min(axis=1) <= radius**2).mean()) if len(seen) else 0.0


def features_of(body: Body, releases: Sequence[Array]) -> Array:
    """(M, 6) features of single releases (13,)."""
    return impact_features(body, np.array(releases)) if releases else np.zeros((0, 6))


def exploration_plan(
    planner: Planner, names: Sequence[str], known: Sequence[Accumulated], seed: int, thrown: Sequence[Array] = ()
) -> Plan:
    """Throws that first touch the board differently from each other and from those before.

    Neither choice nor limits ask theta; only the gains that the plan names do.

    Args:
        planner: draws and judges releases.
        names: of the throws.
        known: what is known, for the gains.
        seed: of the pool.
        thrown: releases (13,) in SI units of throws before.

    Raises:
        InvalidValueError: fewer releases may be thrown than throws are wanted.
    """
    body = planner.particles[0].body
    releases = planner.evaluator.draw_safe(planner.prior, planner.config.pool, np.random.default_rng(seed))
    states = releases.states(planner.config.candidates.placement)
    refusals = planner.evaluator.described_refusals(states)
    fine = np.array([index for index, refusal in enumerate(refusals) if refusal is None], dtype=np.int64)
    features, seen = impact_features(body, states), features_of(body, thrown)
    refused_too: list[str] = []
    while True:
        if len(fine) < len(names):
            raise too_few(len(fine), len(states), len(names), (*refusals, *refused_too))
        picked = fine[spread(features[fine], len(names), seen, seed)]
        answers = planner.evaluator.thrower_refusals(states[picked])
        refused = [index for index, answer in zip(picked, answers) if answer]
        if not refused:
            break
        fine = fine[~np.isin(fine, refused)]
        refused_too += [one for one in answers if one]
    return planner.planned(names, planner.forecast(releases.taken(picked)), known, refusals)
