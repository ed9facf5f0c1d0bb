"""Tosses of our own making, for tests that a clone alone can run: seeded releases like the real ones, rolled out to rest.

The releases follow method.md 3 and 5: normal in the heading frame, whose x axis is the horizontal direction of flight; headings
and orientations are uniform. `test_simulated.py` holds them and the tracker's noise against the real tosses.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from contact_curation.contact.body import CONTACTNETS_CUBE, Body
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.rollout import rollout
from contact_curation.geometry import quaternions
from contact_curation.geometry.quaternions import Array
from contact_curation.motion.smoothing import kinematics
from contact_curation.motion.toss import NANOSECONDS, Toss, toss_identity

FRAME_PERIOD = 1.0 / 148.0
RELEASE_MEAN = np.array([-0.307, -0.013, 0.141, 1.14, -0.03, -0.85, 3.41, -0.15])
RELEASE_DEVIATION = np.array([0.041, 0.033, 0.016, 0.085, 0.16, 1.16, 1.60, 0.88])
"""In the heading frame: place along, across, up [m]; speed along, up [m/s]; angular velocity [rad/s]."""

RELEASE_CLEARANCE = 0.015
"""A release has every corner higher than this [m]."""

FRAMES_AT_REST = 12
LONGEST = 600
"""Frames within which every toss comes to rest."""

STANDING_SPEED = np.array([1e-3] * 3 + [1e-2] * 3)
"""Under these speeds the body rests [m/s, rad/s]."""

FIRST_STAMP_NS = 1_600_000_000 * NANOSECONDS
PAUSE_NS = 10 * NANOSECONDS
"""From release to release."""


@dataclass(frozen=True)
class TrackerNoise:
    """White noise of a tracker's poses, standard deviations per axis.

    Attributes:
        position: [m].
        orientation: [rad].
    """

    position: float
    orientation: float


RIG_NOISE = TrackerNoise(position=2.2e-5, orientation=np.radians(0.024))
"""White noise with the size of the real tosses' second differences in the air: 0.022 mm and 0.024 degrees."""


def release_states(count: int, rng: np.random.Generator, body: Body = CONTACTNETS_CUBE) -> Array:
    """States (count, 13) of released bodies in SI units."""
    kept: list[Array] = []
    while len(kept) < count:
        state = _release(rng)
        if body.polytope.corner_heights(state[:3], state[3:7]).min() > RELEASE_CLEARANCE:
            kept.append(state)
    return np.array(kept)


def motion_to_rest(release: Array, body: Body = CONTACTNETS_CUBE, geometry: ContactGeometry | None = None) -> Array:
    """States (T, 13) in SI units, from the frame of release to `FRAMES_AT_REST` frames after the last that moves."""
    scale = length_scales(body)
    rolled = rollout(geometry or ContactGeometry.of_body(body).rigid(), body, release[None] / scale, LONGEST, FRAME_PERIOD)
    states = rolled.states * scale
    moving = np.flatnonzero((np.abs(states[:, 7:]) > STANDING_SPEED).any(axis=1))
    frames = int(moving[-1]) + 1 + FRAMES_AT_REST
    assert frames <= LONGEST, f"still moving after {LONGEST} frames"
    return states[:frames]


def simulated_tosses(
    count: int,
    seed: int,
    noise: TrackerNoise | None = None,
    body: Body = CONTACTNETS_CUBE,
    geometry: ContactGeometry | None = None,
) -> tuple[Toss, ...]:
    """Tosses in SI units, the same for the same arguments.

    Args:
        count: how many.
        seed: of releases and noise.
        noise: of the tracker; its velocities are then differences of the noisy poses, as `motion.smoothing` makes them. Without
            noise poses and velocities are the simulation's own.
        body: what is thrown.
        geometry: its true shape, plane and friction, in its characteristic lengths, where they are not the body's.
    """
    rng = np.random.default_rng(seed)
    releases = release_states(count, rng, body)
    motions = [motion_to_rest(release, body, geometry) for release in releases]
    if noise is not None:
        motions = [tracked(states, noise, rng) for states in motions]
    return tuple(toss_of(states, FIRST_STAMP_NS + k * PAUSE_NS, body.name) for k, states in enumerate(motions))


def with_noise(states: Array, noise: TrackerNoise, rng: np.random.Generator) -> Array:
    """The states with noisy poses and unchanged velocities."""
    noisy = states.copy()
    noisy[:, :3] += noise.position * rng.standard_normal((len(states), 3))
    turns = noise.orientation * rng.standard_normal((len(states), 3))
    noisy[:, 3:7] = quaternions.multiply(states[:, 3:7], quaternions.exp(turns))
    return noisy


def tracked(states: Array, noise: TrackerNoise, rng: np.random.Generator) -> Array:
    """What a tracker makes of a motion: noisy poses, and velocities from their differences."""
    before = states[:1].copy()  # the frame before release, so that the first velocity is a difference too
    before[:, :3] -= FRAME_PERIOD * states[0, 7:10]
    before[:, 3:7] = quaternions.multiply(states[0, 3:7], quaternions.exp(-FRAME_PERIOD * states[0, 10:]))
    noisy = with_noise(np.concatenate([before, states]), noise, rng)
    rates = kinematics(stamps_ns(len(noisy)), noisy[:, :3], noisy[:, 3:7])
    return np.concatenate([noisy[:, :7], rates.linear_velocities, rates.angular_velocities], axis=1)[1:]


def stamps_ns(frames: int, first_ns: int = 0) -> NDArray[np.int64]:
    """Even stamps (frames,)."""
    return first_ns + np.rint(np.arange(frames) * FRAME_PERIOD * NANOSECONDS).astype(np.int64)


def toss_of(states: Array, first_ns: int, body: str) -> Toss:
    """A record of states (T, 13) in SI units."""
    return Toss(
        toss_id=toss_identity(body, "simulated", first_ns),
        body=body,
        source="simulated",
        frame_period=FRAME_PERIOD,
        stamps_ns=stamps_ns(len(states), first_ns),
        positions=states[:, :3],
        orientations_wxyz=states[:, 3:7],
        linear_velocities=states[:, 7:10],
        angular_velocities=states[:, 10:],
    )


def length_scales(body: Body) -> Array:
    """(13,) what a state in characteristic lengths is multiplied with to be in SI units."""
    length = body.length_scale
    return np.array([length] * 3 + [1.0] * 4 + [length] * 3 + [1.0] * 3)


def _release(rng: np.random.Generator) -> Array:
    along, across, height, horizontal, vertical, *spin = rng.normal(RELEASE_MEAN, RELEASE_DEVIATION)
    to_world = quaternions.exp([0.0, 0.0, rng.uniform(-np.pi, np.pi)])
    orientation = quaternions.normalized(rng.standard_normal(4))
    position = quaternions.rotate(to_world, [along, across, height])
    velocity = quaternions.rotate(to_world, [horizontal, 0.0, vertical])
    spin_in_world = quaternions.rotate(to_world, spin)
    return np.concatenate(
        [position, orientation, velocity, quaternions.rotate(quaternions.conjugate(orientation), spin_in_world)]
    )
