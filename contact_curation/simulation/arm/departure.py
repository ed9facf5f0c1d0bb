"""Checks that a released body does not hit the arm while it flies, lands and bounces, and the arm slows down behind it.

The planned release is simulated without the arm, in the world in which throws land, until the body rests. Along this motion the
arm takes the planned postures: slowing down, then waiting. The gap between body and arm must grow and then stay large.
"""

from dataclasses import dataclass
from typing import NamedTuple

import mujoco
import numpy as np

from contact_curation.contact.body import Body
from contact_curation.geometry.quaternions import Array
from contact_curation.simulation.arm.path import JointPath
from contact_curation.simulation.arm.throwing_arm import ThrowingArm
from contact_curation.simulation.world import world_of


@dataclass(frozen=True)
class DepartureConfig:
    """Required distance between arm and body after the release.

    Attributes:
        at_first: required gap at the release [m].
        opening: rate at which the required gap grows [m/s].
        apart: largest required gap [m]; about the accuracy to which bounces are predicted.
        longest: largest simulated time [s].
        rest_speed: largest speed of a body at rest [m/s].
        rest_spin: largest angular speed of a body at rest [rad/s].
        rest_frames: number of successive frames at rest.
    """

    at_first: float = 0.001
    opening: float = 0.15
    apart: float = 0.02
    longest: float = 3.0
    rest_speed: float = 5e-3
    rest_spin: float = 5e-2
    rest_frames: int = 10


DEFAULT_DEPARTURE = DepartureConfig()


class Gap(NamedTuple):
    """A violation of the required distance: the gap that was found and the one that is required [m]."""

    found: float
    wanted: float


class Departure:
    """Checks whether the arm would hit the body that it released.

    Args:
        body: body that is thrown.
        arm: configuration of the arm.
        step: time between samples of a motion, and time step of the simulation [s].
        every: number of samples between two checks.
        config: required distances.
    """

    def __init__(
        self, body: Body, arm: ThrowingArm, step: float, every: int, config: DepartureConfig = DEFAULT_DEPARTURE
    ) -> None:
        self._config, self._step, self._every = config, step, every
        self._model = arm.free_world(body, step)
        self._data = mujoco.MjData(self._model)
        self._flight = world_of(body, step).compile()
        self._flight_data = mujoco.MjData(self._flight)
        geom = self._model.geom(body.name)
        geom.margin[:] = config.apart
        self._board = self._model.geom("board").id
        self._place = int(self._model.joint(body.name).qposadr[0])
        self._joints = np.array([self._model.joint(name).qposadr[0] for name in arm.joint_names])

    def flight(self, release: Array) -> Array:
        """Simulates the body's states (T, 13), one for each check, from its release (13,) to rest."""
        model, data, config = self._flight, self._flight_data, self._config
        mujoco.mj_resetData(model, data)
        data.qpos[:], data.qvel[:] = release[:7], release[7:]
        states, still, slow = [release], 0, np.repeat([config.rest_speed, config.rest_spin], 3)
        for _ in range(int(config.longest / (self._every * self._step))):
            mujoco.mj_step(model, data, self._every)
            states.append(np.concatenate([data.qpos, data.qvel]))
            still = still + 1 if (np.abs(data.qvel) < slow).all() else 0
            if still == config.rest_frames:
                break
        return np.array(states)

    def too_near(self, flight: Array, stopping: JointPath) -> Gap | None:
        """Finds the largest violation of the required distance after the release.

        Args:
            flight: (N, 13) states of the body from the release on, in SI units.
            stopping: path of the arm from the release to rest, where it waits.

        Returns:
            The largest violation; None if there is none.
        """
        worst: Gap | None = None
        for frame, state in enumerate(flight):
            wanted = min(self._config.at_first + self._config.opening * frame * self._every * self._step, self._config.apart)
            found = self._gap(state, stopping.positions[min(frame * self._every, len(stopping) - 1)])
            if found < wanted and (worst is None or found - wanted < worst.found - worst.wanted):
                worst = Gap(found, wanted)
        return worst

    def _gap(self, state: Array, posture: Array) -> float:
        """Distance between body and arm [m], at most `apart`."""
        model, data = self._model, self._data
        data.qpos[self._place : self._place + 7], data.qpos[self._joints] = state[:7], posture
        mujoco.mj_kinematics(model, data)
        mujoco.mj_collision(model, data)
        gaps = data.contact.dist[(data.contact.geom != self._board).all(axis=1)]
        return float(gaps.min(initial=self._config.apart))
