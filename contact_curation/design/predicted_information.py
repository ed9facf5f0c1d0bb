"""Predicts the information of throws: the model's motions and their Gauss-Newton information (method.md 1.10).

    F(x, e) = sum_t F_GN(t),      the toss rolled out at theta from execution e of release x
A toss ends once the body has rested for a few frames, as the segmenter ends one. Frames in the air carry no information
(method.md 6.7) and are left out; where the body lies on three corners or more and goes on lying on them, frames differ little
from one to the next, and one of every few stands for all. Each motion's tilt is taken about its own centroid, so that the place
of a throw does not count; its heading does a little, since the tilt's axes are the board's.
"""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from contact_curation.configs import check_positive, set_whole_numbers
from contact_curation.contact.body import Body
from contact_curation.contact.evaluation import Estimator, SolveStatus, fisher_sums
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.loss_config import DEFAULT_LOSS, LossConfig
from contact_curation.contact.parameter_form import form_of_geometry
from contact_curation.contact.rollout import rollout
from contact_curation.contact.time_step import STATE_SIZE, StepStatus, SweepLimits
from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array
from contact_curation.information.scoring import Scorer, ScoringConfig


@dataclass(frozen=True, eq=False)
class Particle:
    """A theta; several of them represent the uncertainty about it (method.md 2.4).

    Attributes:
        geometry: theta.
        body: mass, inertia, gravity.
        loss: weights and solver of the information.
    """

    geometry: ContactGeometry
    body: Body
    loss: LossConfig = DEFAULT_LOSS

    @cached_property
    def scorer(self) -> Scorer:
        """The scorer of measured tosses at this theta, with the same parameters and estimator as in designs.

        Always Gauss-Newton: of a motion that the model itself predicted the empirical matrix is almost zero, and what is left
        of it is unrelated to the information of a real toss (method.md 0.4).
        """
        form = form_of_geometry(self.geometry)
        return Scorer(self.geometry, self.body, ScoringConfig(estimator=Estimator.GAUSS_NEWTON, form=form, loss=self.loss))

    @property
    def version(self) -> str:
        """Digest of theta."""
        return self.scorer.version


PIECE = 512
"""Motions worked on at a time: 30 MB of Fisher matrices and of states."""

LYING = 3
"""Corners on which a body lies."""

SWEEPS = SweepLimits(tolerance=1e-3)
"""At half the time bodies come to rest within 1e-5 characteristic lengths of where they do with the usual tolerance."""


@dataclass(frozen=True)
class PredictionConfig:
    """How motions are predicted.

    Attributes:
        executions: simulated executions of each throw over which its information is averaged; an even number.
        frame_period: time between frames of the tracker that will observe the throw [s].
        longest: time at which a predicted motion is cut off [s].
        still_speed: largest speed of the centre of a body at rest [m/s].
        still_spin: largest angular speed of a body at rest [rad/s].
        still_frames: a toss ends after this many frames at rest.
        thinning: one in this many of the frames in which the body lies on the same vertices is evaluated, weighted for all.
        touching: gap under which a vertex is in contact [characteristic lengths].
        airborne: gap over which contact forces are neglected [characteristic lengths].
    """

    executions: int = 8
    frame_period: float = 1.0 / 148.0
    longest: float = 0.9
    still_speed: float = 0.044
    still_spin: float = 0.5
    still_frames: int = 10
    thinning: int = 16
    touching: float = 0.02
    airborne: float = 0.3

    def __post_init__(self) -> None:
        if self.executions < 2 or self.executions % 2:
            raise InvalidValueError("forecast.executions", self.executions, "an even number of at least 2")
        set_whole_numbers(self, ("still_frames", "thinning"), 1, prefix="forecast.")
        check_positive(self, ("frame_period", "longest", "still_speed", "still_spin", "touching", "airborne"), "forecast.")
        if self.frames < 2:
            raise InvalidValueError("forecast.longest", self.longest, f"at least two frames of {self.frame_period} s")

    @property
    def frames(self) -> int:
        """Of the longest motion."""
        return round(self.longest / self.frame_period)


DEFAULT_PREDICTION = PredictionConfig()


@dataclass(frozen=True, eq=False)
class Motions:
    """N predicted motions, each of T frames, in characteristic units.

    Attributes:
        states: (N, T, 13); NaN from the frame on at which the model gave up.
        frames: (N,) of the toss, until the body has rested; T where it never does.
        rested: (N,) whether it does.
        finite: (N,) whether the toss is finite.
    """

    states: Array
    frames: NDArray[np.int64]
    rested: NDArray[np.bool_]
    finite: NDArray[np.bool_]

    def within(self) -> NDArray[np.bool_]:
        """(N, T) which frames belong to the tosses."""
        return np.asarray(np.arange(self.states.shape[1]) < self.frames[:, None])


class PredictedInformation(NamedTuple):
    """Information of N motions.

    Attributes:
        fishers: (N, P, P) Gauss-Newton sums, the tilt about each motion's centroid; zero where not known.
        known: (N,) whether the motion and every transition of it that was asked for could be worked out.
    """

    fishers: Array
    known: NDArray[np.bool_]


def predicted_motions(
    particle: Particle,
    states: Array,
    config: PredictionConfig = DEFAULT_PREDICTION,
    geometries: Sequence[ContactGeometry] = (),
) -> Motions:
    """The model's motions from releases.

    Args:
        particle: theta.
        states: (N, 13) releases in SI units.
        config: how.
        geometries: G thetas to move by, release n by the (n modulo G)-th; by default the particle's own.
    """
    scale, threads = particle.body.length_scale, particle.loss.threads or os.cpu_count() or 1
    initial, moving = scaled(states, scale), geometries or (particle.geometry,)
    motion = np.empty((len(states), config.frames, STATE_SIZE))
    status = np.empty(motion.shape[:2], np.int32)
    for first, geometry in enumerate(moving[: len(states)]):
        own = slice(first, None, len(moving))
        rolled = rollout(geometry, particle.body, initial[own], config.frames, config.frame_period, SWEEPS, threads)
        motion[own] = rolled.states.reshape(-1, config.frames, STATE_SIZE)
        status[own] = rolled.status.reshape(-1, config.frames)
    return _until_rest(motion, status, scale, config)


def predicted_information(
    particle: Particle, motions: Motions, config: PredictionConfig = DEFAULT_PREDICTION
) -> PredictedInformation:
    """The information of predicted motions at the same theta."""
    sums = _kernel_sums(particle, motions, config)
    return PredictedInformation(_in_form(particle, sums.fishers), sums.known)


def information_of_executions(
    particle: Particle, motions: Motions, executions: int, config: PredictionConfig = DEFAULT_PREDICTION
) -> PredictedInformation:
    """Information of K throws in E executions of each.

    Args:
        particle: theta.
        motions: (K E) of them, the executions of a throw one after the other.
        executions: E.
        config: how.

    Returns:
        (K, E, P, P), where an execution that could not be worked out has the mean of the others, and whether at least half of
        them could be (K,).
    """
    found = predicted_information(particle, motions, config)
    known = found.known.reshape(-1, executions)
    good = known.sum(axis=1)
    fishers = found.fishers.reshape(-1, executions, *found.fishers.shape[1:])
    means = fishers.sum(axis=1, keepdims=True) / np.maximum(good, 1)[:, None, None, None]
    return PredictedInformation(np.where(known[..., None, None], fishers, means), 2 * good >= executions)


def scaled(states: Array, length: float) -> Array:
    """States (..., 13) with lengths divided by `length`."""
    result = np.array(states, dtype=float)
    result[..., :3] /= length
    result[..., 7:10] /= length
    return result


def _until_rest(motion: Array, status: NDArray[np.int32], scale: float, config: PredictionConfig) -> Motions:
    with np.errstate(invalid="ignore", over="ignore"):  # of motions that the model could not follow
        slow = np.linalg.norm(motion[:, :, 7:10], axis=2) * scale < config.still_speed
        still = slow & (np.linalg.norm(motion[:, :, 10:], axis=2) < config.still_spin)
    run = np.cumsum(still, axis=1)
    run[:, config.still_frames :] -= run[:, : -config.still_frames].copy()
    over = run >= config.still_frames
    rested = over.any(axis=1)
    frames = np.where(rested, over.argmax(axis=1) + 1, motion.shape[1])
    finite = np.isfinite(motion[np.arange(len(motion)), frames - 1]).all(axis=1)
    bad = (status == StepStatus.NOT_FINITE).any(axis=1) & ~rested
    return Motions(motion, frames.astype(np.int64), rested, finite & ~bad)


def _kernel_sums(particle: Particle, motions: Motions, config: PredictionConfig) -> PredictedInformation:
    """Information of motions (N, Q, Q) from the kernel, in pieces of limited size."""
    size = particle.geometry.kernel_size
    sums, known = np.zeros((len(motions.frames), size, size)), motions.finite.copy()
    for first in range(0, len(known), PIECE):
        chosen = first + np.flatnonzero(motions.finite[first : first + PIECE])
        if chosen.size:
            sums[chosen], known[chosen] = _piece_sums(particle, motions, chosen, config)
    sums[~known] = 0.0
    return PredictedInformation(sums, known)


def _piece_sums(
    particle: Particle, motions: Motions, chosen: NDArray[np.int64], config: PredictionConfig
) -> tuple[Array, NDArray[np.bool_]]:
    states = _about_the_pivot(particle, motions.states[chosen], motions.frames[chosen])
    rows = _teaching(particle, states, motions.frames[chosen], config)
    sums = fisher_sums(
        particle.geometry,
        particle.body,
        states[rows.toss, rows.frame],
        states[rows.toss, rows.frame + 1],
        config.frame_period,
        rows.starts,
        Estimator.GAUSS_NEWTON,
        config=particle.loss,
    )
    unsolved = np.bincount(rows.toss, sums.status != SolveStatus.SOLVED, minlength=len(chosen))
    return sums.fishers[0::2] + rows.weights[:, None, None] * sums.fishers[1::2], unsolved == 0


def _about_the_pivot(particle: Particle, states: Array, frames: NDArray[np.int64]) -> Array:
    """Motions (M, T, 13) moved within the ground so that their centroids lie over or under theta's pivot.

    That changes no gap and no velocity, and the tilt is then about the centroid. Theta of the published form has no pivot to
    speak of: there a motion stays where it is.
    """
    axes = particle.scorer.form.tilt_axes
    if not axes.size:
        return states
    inside = np.arange(states.shape[1]) < frames[:, None]
    centroids = np.where(inside[..., None], states[:, :, :3], 0.0).sum(axis=1) / frames[:, None]
    moved = states.copy()
    moved[:, :, :3] -= ((centroids - particle.geometry.pivot) @ axes.T @ axes)[:, None]
    return moved


def _in_form(particle: Particle, fishers: Array) -> Array:
    """(N, P, P) by the parameters of theta's form."""
    chart = particle.scorer.form.chart
    turned = chart.T @ fishers @ chart
    return np.asarray(0.5 * (turned + turned.transpose(0, 2, 1)))


class _Rows(NamedTuple):
    """Which transitions of M motions are worked out: R rows, of each motion first those that count once.

    Attributes:
        toss: (R,) their motion.
        frame: (R,) their first frame.
        starts: (2M + 1,) edges between those that count once and those that stand for several.
        weights: (M,) how many each of the latter stands for.
    """

    toss: NDArray[np.int64]
    frame: NDArray[np.int64]
    starts: NDArray[np.int64]
    weights: Array


def _teaching(particle: Particle, states: Array, frames: NDArray[np.int64], config: PredictionConfig) -> _Rows:
    """The transitions of motions (M, T, 13) that carry information, with weights for those they represent."""
    gaps = particle.geometry.gaps(states)  # (M, T, V)
    felt = gaps.min(axis=2) < config.airborne
    wanted = (np.arange(1, states.shape[1]) < frames[:, None]) & (felt[:, 1:] | felt[:, :-1])
    touching = gaps < config.touching
    lying = wanted & (touching[:, 1:] == touching[:, :-1]).all(axis=2) & (touching[:, 1:].sum(axis=2) >= LYING)
    place = np.cumsum(lying, axis=1) - 1
    resting = lying & (place % config.thinning == config.thinning // 2)
    alone = wanted & ~lying
    few = ~resting.any(axis=1)  # too few for one to stand for them
    alone[few] |= lying[few]
    toss, frame = (np.concatenate(pair) for pair in zip(np.nonzero(alone), np.nonzero(resting)))
    group = 2 * toss + np.repeat([0, 1], [alone.sum(), resting.sum()])
    order = np.argsort(group, kind="stable")
    starts = np.concatenate([[0], np.cumsum(np.bincount(group, minlength=2 * len(states)))])
    weights = lying.sum(axis=1) / np.maximum(resting.sum(axis=1), 1)
    return _Rows(toss[order], frame[order], starts, weights)
