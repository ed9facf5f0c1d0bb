"""Throws by a described arm through the stage that `trajectory_thrower` runs, in simulated time, without ROS."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.design.throw import Throw
from contact_curation.geometry.quaternions import Array
from contact_curation.simulation.arm.described import read_arm
from contact_curation.simulation.arm.planned_throw import planned_throw, way_home
from contact_curation.simulation.arm.safety import GateConfig, SafetyGate
from contact_curation.stages.arm import Ending
from contact_curation.stages.trajectory_throw import Sent, TrajectoryConfig, TrajectoryThrow
from test.foreign_arm.cell import STEP, Cell, Trajectory
from test.foreign_arm.planning import STEADY, planner_of

JOINTS_EVERY, POSES_EVERY = 4, 7
REST, LONGEST = 0.5, 60.0
"""Time between throws, and the longest that one may take [s]."""

CONFIG = TrajectoryConfig(tracking_error=0.1)
"""Joints of the xArm7 turn by 5 rad, and the cell's controller strays by 1 % of that."""


class Lab:
    """A thrower, and the cell of one arm.

    Args:
        file: YAML file of the arm.
        seed: of the cell.

    Attributes:
        meanwhile: called at every step.
        sent: trajectories of the motion under way.
    """

    def __init__(self, file: Path, seed: int = 0) -> None:
        self.cell = Cell(file, seed, now=100.0)
        arm = read_arm(file)
        self.planner = planner_of(arm)
        self.gate = SafetyGate(GateConfig(keep_out_place=(arm.base[0], arm.base[1])))
        self.stage = TrajectoryThrow(
            CONTACTNETS_CUBE, self.planner.arm.limits, self.planner.arm.home_posture,
            lambda throw: planned_throw(self.planner, throw), lambda posture: way_home(self.planner, posture), self.gate,
            lambda: self.cell.time, CONFIG, STEADY.window,
        )  # fmt: skip
        self.meanwhile: Callable[[], object] = lambda: None
        self.sent: list[Sent] = []
        self._samples: list[tuple[Array, Array]] = []
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
        self.sent, self._samples = [], []
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
        self.sent, self._samples = [], []
        refusal = self.stage.admits_homeward()
        return Ending(False, refusal) if refusal else self._made(self.stage.begin_homeward())

    def used(self) -> dict[str, float]:
        """The largest share of each limit that a joint used in any sample since the last goal."""
        limits = self.planner.arm.limits
        joints, speeds = (np.array(part) for part in zip(*self._samples))
        middle, half = 0.5 * (limits.highest + limits.lowest), 0.5 * (limits.highest - limits.lowest)
        return {
            "position": float((np.abs(joints - middle) / half).max()),
            "speed": float(limits.speed_use(joints, speeds).max()),
            "acceleration": float((np.abs(np.diff(speeds, axis=0)) / STEP / limits.acceleration).max()),
        }

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
        self._samples.append((cell.joints, cell.joint_speeds))
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


def fault(name: str) -> Callable[[Lab], None]:
    """Lets something go wrong."""

    def be_faulty(lab: Lab) -> None:
        lab.cell.fault = name

    return be_faulty


def stopped_by_hand(lab: Lab) -> None:
    """Somebody calls the stop service."""
    lab.gate.stop("the stop service was called")


FAULTS: dict[str, tuple[Callable[[Lab], None], str]] = {
    "slider": (fault("slider"), "speed scaling: found 80 %, expected 100 %"),
    "abort": (fault("abort"), "the controller gave up: path tolerance violated"),
    "silent": (fault("silent"), "joint states: found the last one"),
    "inactive": (fault("inactive"), "controller: found no state of it"),
    "offset": (fault("offset"), "joint 2: found it 0."),
    "stop": (stopped_by_hand, "the stop service was called"),
}
"""What goes wrong, and what is said then."""
