"""Throws in the simulated world without an arm: the body starts in the commanded state, with or without execution noise."""

from dataclasses import dataclass

import numpy as np

from contact_curation.contact.body import Body
from contact_curation.design.execution_noise import ERRORS, ExecutionNoise
from contact_curation.design.throw import Throw, throw_of_state
from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array
from contact_curation.motion.toss import NANOSECONDS, Toss, toss_identity
from contact_curation.simulation.world import DEFAULT_WORLD, WorldConfig, free_motion


@dataclass(frozen=True)
class ThrownTossConfig:
    """Configuration of a simulated throw.

    Attributes:
        frame_period: frame period of the tracker [s].
        longest: longest time until the body must rest [s].
        rest_displacement: largest displacement of a body at rest from frame to frame [m].
        rest_turn: largest rotation of a body at rest from frame to frame [rad].
        rest_frames: number of frames at rest that are recorded.
        world: time step and contact softness of the simulated world.
    """

    frame_period: float = 1.0 / 148.0
    longest: float = 4.0
    rest_displacement: float = 1e-5
    rest_turn: float = 1e-3
    rest_frames: int = 12
    world: WorldConfig = DEFAULT_WORLD


DEFAULT_THROWN = ThrownTossConfig()


def executed_throw(throw: Throw, noise: ExecutionNoise, rng: np.random.Generator) -> Throw:
    """Draws the release that a commanded throw leads to under execution noise."""
    state = noise.executions(throw.release[None], rng.standard_normal((1, ERRORS)))[0, 0]
    return throw_of_state(throw.throw_id, throw.body, state, throw.expected_information, throw.parameters_version)


def thrown_toss(body: Body, throw: Throw, config: ThrownTossConfig = DEFAULT_THROWN, first_stamp_ns: int = 0) -> Toss:
    """Simulates the motion of a throw from the release to rest.

    Args:
        body: body that is thrown.
        throw: actual release.
        config: configuration of the simulation.
        first_stamp_ns: stamp of the release [ns].

    Raises:
        InvalidValueError: the throw is of another body, or the body does not come to rest.
    """
    if throw.body != body.name:
        raise InvalidValueError(f"body of throw {throw.throw_id}", throw.body, body.name)
    frames = max(2, round(config.longest / config.frame_period))
    states = free_motion(body, throw.release, frames, config.frame_period, config.world)
    return _toss(throw, _until_rest(throw, states, config), first_stamp_ns, config)


def _until_rest(throw: Throw, states: Array, config: ThrownTossConfig) -> Array:
    moved = np.linalg.norm(np.diff(states[:, :3], axis=0), axis=1) > config.rest_displacement
    turned = np.linalg.norm(states[1:, 10:], axis=1) * config.frame_period > config.rest_turn
    moving = np.flatnonzero(moved | turned | ~np.isfinite(states[1:]).all(axis=1))
    end = (int(moving[-1]) + 2 if moving.size else 1) + config.rest_frames
    if end > len(states):
        expected = "rest: throw more gently, or set a larger simulation.longest"
        raise InvalidValueError(f"motion of throw {throw.throw_id}", f"no rest within {config.longest:g} s", expected)
    return states[:end]


def _toss(throw: Throw, states: Array, first_stamp_ns: int, config: ThrownTossConfig) -> Toss:
    stamps = first_stamp_ns + np.rint(np.arange(len(states)) * config.frame_period * NANOSECONDS).astype(np.int64)
    return Toss(
        toss_id=toss_identity(throw.body, throw.throw_id, first_stamp_ns),
        body=throw.body,
        source=throw.throw_id,
        frame_period=config.frame_period,
        stamps_ns=stamps,
        positions=states[:, :3],
        orientations_wxyz=states[:, 3:7],
        linear_velocities=states[:, 7:10],
        angular_velocities=states[:, 10:],
    )
