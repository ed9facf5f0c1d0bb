"""Throws by a described arm through the stage that `trajectory_thrower` runs, in simulated time, without ROS."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.design.throw import Throw
from contact_curation.simulation.arm.described import read_arm
from contact_curation.simulation.arm.planned_throw import planned_throw, way_home
from contact_curation.simulation.arm.safety import GateConfig, SafetyGate
from contact_curation.stages.arm import Ending
from contact_curation.stages.trajectory_throw import Sent, TrajectoryConfig, TrajectoryThrow
from test.foreign_arm.cell import Cell, Trajectory
from test.foreign_arm.planning import STEADY, planner_of

JOINTS_EVERY, POSES_EVERY = 4, 7
REST, LONGEST = 0.5, 60.0
"""Time between throws, and the longest that one may take [s]."""


class Lab:
    """A thrower, and the cell of one arm.

    Args:
        file: YAML file of the arm.
        seed: of the cell.

    Attributes:
        meanwhile: called at every step.
        speeds: largest speed of each joint so far [rad/s].
        sent: trajectories of the motion under way.
    """

    def __init__(self, file: Path, seed: int = 0) -> None:
        self.cell = Cell(file, seed, now=100.0)
        arm = read_arm(file)
        self.planner = planner_of(arm)
        self.gate = SafetyGate(GateConfig(keep_out_place=arm.base[:2]))
        self.stage = TrajectoryThrow(
            CONTACTNETS_CUBE, self.planner.arm.limits, self.planner.arm.home_posture,
            lambda throw: planned_throw(self.planner, throw), lambda posture: way_home(self.planner, posture), self.gate,
            lambda: self.cell.time, TrajectoryConfig(), STEADY.window,
        )  # fmt: skip
        self.meanwhile: Callable[[], object] = lambda: None
        self.speeds = np.zeros(len(arm.joints))
        self.sent: list[Sent] = []
        self._steps = 0
        self.gate.arm(self.cell.time)
        self.rest()

    def rest(self, seconds: float = REST) -> None:
        """Lets time pass."""
        until = self.cell.time + seconds
        while self.cell.time < until:
            self._step()

    def throw(self, throw: Throw) -> Ending:
        """Makes a throw; the body is put into the gripper as the thrower wants it."""
        self.sent = []
        refusal = self.stage.admits(throw)
        if refusal is not None:
            return Ending(False, refusal)
        began = self.stage.begin()
        if began is None:
            grip = self.stage.grip
            assert grip is not None
            self.cell.hold(grip.position, grip.orientation_wxyz)
        while began is None:
            self._step()
            began = self.stage.begin()
        return self._made(began)

    def go_home(self) -> Ending:
        """Goes home."""
        self.sent = []
        refusal = self.stage.admits_homeward()
        return Ending(False, refusal) if refusal else self._made(self.stage.begin_homeward())

    def _made(self, began: Sent | Ending) -> Ending:
        if isinstance(began, Ending):
            return began
        self._send(began)
        until = self.cell.time + LONGEST
        while self.cell.time < until:
            self.meanwhile()
            ending = self._step()
            if ending is not None:
                return ending
        raise AssertionError("no ending")

    def _send(self, sent: Sent) -> None:
        self.sent.append(sent)
        times, points = sent.points
        self.cell.take(Trajectory(sent.begin, times, points.positions, points.speeds))

    def _step(self) -> Ending | None:
        cell, stage, self._steps = self.cell, self.stage, self._steps + 1
        cell.step()
        self.speeds = np.maximum(self.speeds, np.abs(cell.joint_speeds))
        self.gate.heartbeat(cell.time)
        ended = cell.ended()
        if ended is not None:
            stage.controller_ended(ended[1])
        if self._steps % JOINTS_EVERY == 0:
            stage.signals.scaling_seen(cell.speed)
            if cell.fault != "inactive":
                stage.signals.controller_seen()
            if cell.fault != "silent":
                stage.signals.joints_seen(cell.time, cell.joints)
        if self._steps % POSES_EVERY == 0:
            stage.signals.body_seen(cell.time, *cell.cube())
        step = stage.advance()
        if step.opens:
            cell.open(cell.time)
        if step.stop is not None:
            self._send(step.stop)
        return step.ending
