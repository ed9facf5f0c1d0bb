"""Executes throws with the simulated arm from home to home, without ROS: for the command line, benchmarks and tests."""

from dataclasses import dataclass

import numpy as np

from contact_curation.contact.body import Body
from contact_curation.design.throw import Throw
from contact_curation.errors import InvalidValueError
from contact_curation.geometry import quaternions
from contact_curation.geometry.quaternions import Array
from contact_curation.simulation.arm.frame import Phase
from contact_curation.simulation.arm.limits import Peaks
from contact_curation.simulation.arm.simulation import DEFAULT_CONTROL, ArmSimulation, ControlConfig
from contact_curation.simulation.arm.throw_motion import FRAME_PERIOD, Refused, ThrowMotion, ThrowPlanner


@dataclass(frozen=True, eq=False)
class ExecutedThrow:
    """A throw as it was executed.

    Attributes:
        throw: throw as commanded.
        release: (13,) state of the body at the release, in SI units.
        states: (T, 13) states of the body from the release until it rests, one per `frame_period`.
        frame_period: time between states [s].
        rested: whether the body came to rest.
        touched: whether the body touched the arm after the release.
        gave_way: whether the arm detected this as a collision and gave way.
        peaks: largest used shares of the joints' limits.
        duration: simulated time from the start of the arm's motion until the body rests [s].
    """

    throw: Throw
    release: Array
    states: Array
    frame_period: float
    rested: bool
    touched: bool
    gave_way: bool
    peaks: Peaks
    duration: float

    @property
    def errors(self) -> "ReleaseErrors":
        """The errors of the release relative to the commanded throw."""
        return release_errors(self.throw, self.release)


@dataclass(frozen=True)
class ReleaseErrors:
    """Errors of an executed release relative to the commanded one.

    Attributes:
        position: error of the position [m].
        turn: error of the orientation [rad].
        speed: relative error of the speed.
        direction: error of the direction of the velocity [rad].
        spin: norm of the error of the angular velocity in the board's frame [rad/s].
    """

    position: float
    turn: float
    speed: float
    direction: float
    spin: float


def release_errors(throw: Throw, release: Array) -> ReleaseErrors:
    """Compares the state at a release (13,) with the command."""
    wanted, given = throw.linear_velocity, release[7:10]
    sizes = float(np.linalg.norm(wanted)), float(np.linalg.norm(given))
    cosine = float(wanted @ given) / max(sizes[0] * sizes[1], 1e-12)
    spins = [quaternions.rotate(state[3:7], state[10:]) for state in (throw.release, release)]
    return ReleaseErrors(
        float(np.linalg.norm(release[:3] - throw.position)),
        float(quaternions.angle_between(throw.orientation_wxyz, release[3:7])),
        abs(sizes[1] - sizes[0]) / max(sizes[0], 1e-12),
        float(np.arccos(np.clip(cosine, -1.0, 1.0))),
        float(np.linalg.norm(spins[1] - spins[0])),
    )


class ArmThrower:
    """Executes throws of one body, one after the other. Make it once per body.

    Args:
        planner: planner of the arm's motions.
        control: configuration of the controller.
        seed: random seed of the gripper's delays.
    """

    def __init__(self, planner: ThrowPlanner, control: ControlConfig = DEFAULT_CONTROL, seed: int = 0) -> None:
        self.planner = planner
        self._simulation = ArmSimulation(planner.body, planner.config, control, seed)

    @property
    def time(self) -> float:
        """Simulated time since this object was made [s]."""
        return self._simulation.time

    def execute(self, throw: Throw) -> ExecutedThrow:
        """Plans and executes a throw until the body rests and the arm is home again.

        Raises:
            InvalidValueError: the arm cannot make the throw; the message names the violated limit.
        """
        motion = self.planner.plan(throw)
        if isinstance(motion, Refused):
            raise InvalidValueError(f"throw {throw.throw_id}", str(motion), "a throw within the arm's limits")
        return self.carry_out(motion)

    def carry_out(self, motion: ThrowMotion) -> ExecutedThrow:
        """Executes a planned motion until the body rests and the arm is home again."""
        simulation, states = self._simulation, []
        began, rested, rested_at = simulation.time, False, 0.0
        simulation.begin(motion)
        while simulation.phase is not Phase.RESTING:
            frame = simulation.advance()
            if frame.free and not rested:
                states.append(frame.body)
                rested, rested_at = simulation.rested, frame.time
        assert simulation.release is not None
        return ExecutedThrow(
            motion.throw, simulation.release, np.array(states), FRAME_PERIOD, rested, simulation.touched, simulation.gave_way,
            simulation.peaks, rested_at - began,
        )  # fmt: skip


def execute(throw: Throw, body: Body, control: ControlConfig = DEFAULT_CONTROL, seed: int = 0) -> ExecutedThrow:
    """Executes one throw with a new arm; for several throws use `ArmThrower`, which raises the same errors."""
    return ArmThrower(ThrowPlanner(body), control, seed).execute(throw)
