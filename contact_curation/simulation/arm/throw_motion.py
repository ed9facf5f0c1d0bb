"""Plans the motion of the arm for a throw: from home to the wind-up, through the release, to rest, and home again.

For each promising grasp and posture (`postures`) the joints accelerate so that all of them reach the release posture with the
release speeds at the same instant, and then decelerate. A motion is accepted if every sample keeps positions, speeds,
accelerations and torques (by inverse dynamics) within the limits, no moving part comes near the table or the arm itself, and
the released body does not hit the arm (`departure`). Otherwise the throw is refused; the refusal names the limit that the best
attempt violates.
"""

from dataclasses import dataclass, field, replace
from typing import NamedTuple, Protocol

import mujoco
import numpy as np

from contact_curation.contact.body import Body
from contact_curation.design.throw import Throw
from contact_curation.geometry.poses import Pose
from contact_curation.geometry.quaternions import Array
from contact_curation.simulation.arm.departure import DEFAULT_DEPARTURE, Departure, DepartureConfig
from contact_curation.simulation.arm.grasps import Grasps, grasps_of
from contact_curation.simulation.arm.model import DEFAULT_ARM, HELD, PREFIX, TABLE, ArmConfig, put_into_gripper
from contact_curation.simulation.arm.path import (
    DEFAULT_RAMP,
    JointPath,
    RampConfig,
    moving,
    ramp_way,
    slowing_down,
    speeding_up,
)
from contact_curation.simulation.arm.postures import DEFAULT_SEARCH, Candidate, PostureSearch, SearchConfig, Target, pad_targets
from contact_curation.simulation.arm.throwing_arm import ThrowingArm
from contact_curation.simulation.world import DEFAULT_WORLD

FRAME_PERIOD = 1.0 / 148.0
"""Frame period of trackers like ContactNets' [s]."""

STEPS_PER_FRAME = DEFAULT_WORLD.steps_in(FRAME_PERIOD)
STEP = FRAME_PERIOD / STEPS_PER_FRAME
"""Step of control and simulation [s]: 1036 Hz; the real arm is commanded at 1 kHz."""

CHECKED_EVERY = 8
"""Every so many samples one is checked for collisions and torques."""

HOMEWARD = 0.3
"""Share of the usual speed and acceleration between postures on the way home after a stop."""

FROM_BELOW = 0.3
"""Largest vertical part of the pad's axis. A pad that points further up would carry the body along; its face is not tried."""


class Refused(NamedTuple):
    """Why the arm cannot make a throw.

    Attributes:
        limit: name of the violated limit.
        found: value that the best attempt needs.
        allowed: allowed value.
        unit: unit of both values.
    """

    limit: str
    found: float
    allowed: float
    unit: str

    def __str__(self) -> str:
        side = "at most" if self.found > self.allowed else "at least"
        return f"{self.limit}: found {self.found:.4g} {self.unit}, expected {side} {self.allowed:.4g} {self.unit}"


@dataclass(frozen=True, eq=False)
class ThrowMotion:
    """The arm's motion for a throw. The last sample of each path is the first of the next.

    Attributes:
        throw: throw as commanded.
        candidate: posture, speeds and face at release.
        grip: the body in the last link's frame.
        approach: path from home to the wind-up, at rest at both ends.
        swing: path from the wind-up to the release.
        stopping: path from the release to rest.
        returning: path from there home.
    """

    throw: Throw
    candidate: Candidate
    grip: Pose
    approach: JointPath
    swing: JointPath
    stopping: JointPath
    returning: JointPath


class Swing(Protocol):
    """How an arm moves through the release."""

    def way(self, speeds: Array) -> Array:
        """How far each joint moves from rest to release speeds (N, J), (N, J) [rad]."""

    def paths(self, model: mujoco.MjModel, data: mujoco.MjData, candidate: Candidate) -> tuple[JointPath, JointPath]:
        """The path from rest to the release, and the one from there to rest, of the arm with the body in its gripper."""


@dataclass(frozen=True)
class SuddenSwing:
    """Each joint takes the shortest way to its release speed; it has that speed in the instant of the release only.

    Attributes:
        ramp: how the joints accelerate.
    """

    ramp: RampConfig

    def way(self, speeds: Array) -> Array:
        return ramp_way(speeds, self.ramp)

    def paths(self, _model: mujoco.MjModel, _data: mujoco.MjData, candidate: Candidate) -> tuple[JointPath, JointPath]:
        before = speeding_up(candidate.joints, candidate.speeds, STEP, self.ramp)
        return before, slowing_down(candidate.joints, candidate.speeds, STEP, self.ramp)


def within_margin(ramp: RampConfig, arm: ThrowingArm) -> RampConfig:
    """The ramp, with accelerations that the arm's margin leaves."""
    most = arm.margin * float(arm.limits.acceleration.min())
    fast, slow = min(ramp.acceleration, most), min(ramp.moving_acceleration, most)
    return replace(ramp, acceleration=fast, moving_acceleration=slow)


class ArmPlanner:
    """Plans throws of one body by any arm; made once, for its table of postures takes a while.

    Args:
        body: body that is thrown.
        arm: arm that throws it.
        swing: how it moves through the release.
        ramp: how the joints move between postures.
        search: size of the search for postures.
        departure: required distance between arm and released body.
        sinking: largest downward acceleration of the held body on its way to the wind-up [m/s^2]: a tracker's toss begins where
            the body falls freely.
    """

    def __init__(self, body: Body, arm: ThrowingArm, swing: Swing, ramp: RampConfig, search: SearchConfig,
                 departure: DepartureConfig, sinking: float = np.inf) -> None:  # fmt: skip
        self.body, self.arm, self.grasps = body, arm, grasps_of(body)
        self._swing, self._ramp, self._sinking = swing, ramp, sinking
        self._holding, self._empty = arm.planning_model(body), arm.planning_model(None)
        self._holding_data, self._empty_data = mujoco.MjData(self._holding), mujoco.MjData(self._empty)
        self._postures = PostureSearch(arm.planning_model(body), arm, swing.way, search)
        self._departure = Departure(body, arm, STEP, STEPS_PER_FRAME, departure)

    def plan(self, throw: Throw) -> ThrowMotion | Refused:
        """The motion for a throw, or the reason why there is none."""
        target = self._reachable(pad_targets(throw.release, self.grasps, self.arm))
        if not len(target.places):
            return Refused("tilt of the gripper", 1.0, FROM_BELOW, "upwards")
        worst: Refused | None = None
        flight: Array | None = None
        for candidate in self._postures.candidates(target):
            refused = self._use(candidate)
            if refused is not None:
                return worst or refused  # candidates are sorted: no later one is better
            flight = self._departure.flight(throw.release) if flight is None else flight
            motion = self._motion(throw, candidate, flight)
            if isinstance(motion, ThrowMotion):
                return motion
            worst = worst or motion
        assert worst is not None
        return worst

    def homeward(self, posture: Array) -> JointPath | Refused:
        """The slow way home from rest at a posture (J,) [rad], straight in joint space, or why there is none.

        It is clear with the body of the last plan in the gripper, and so without it.
        """
        ramp = replace(
            self._ramp, moving=HOMEWARD * self._ramp.moving, moving_acceleration=HOMEWARD * self._ramp.moving_acceleration
        )
        path = moving(posture, self.arm.home_posture, self.arm.limits.speed, STEP, ramp)
        refused = (
            self._within(path)
            or self._clear(self._holding, self._holding_data, path)
            or self._strong(self._holding, self._holding_data, path)
            or self._strong(self._empty, self._empty_data, path)
        )
        return refused or path

    def _reachable(self, target: Target) -> Target:
        kept = target.axes[:, 2] <= FROM_BELOW
        return Target(target.places[kept], target.axes[kept], target.twists[kept])

    def _use(self, candidate: Candidate) -> Refused | None:
        """The limit that the release posture or its speeds violate; None if they violate none."""
        limits, margin = self.arm.limits, self.arm.margin
        if candidate.miss > 1e-3:
            return Refused("reach", candidate.miss, 1e-3, "m from the release pose")
        joint = int(candidate.speed_use.argmax())
        if candidate.speed_use[joint] > 1.0:
            found = abs(float(candidate.speeds[joint]))
            allowed = min(found / float(candidate.speed_use[joint]), margin * float(limits.speed[joint]))
            return Refused(f"speed of joint {joint + 1}", found, allowed, "rad/s")
        joint = int(candidate.range_use.argmax())
        if candidate.range_use[joint] > 1.0:
            half = 0.5 * float(limits.highest[joint] - limits.lowest[joint])
            found = half * float(candidate.range_use[joint])
            return Refused(f"range of joint {joint + 1}", found, half, "rad from its middle")
        return None

    def _motion(self, throw: Throw, candidate: Candidate, flight: Array) -> ThrowMotion | Refused:
        grip = self._grip(throw, candidate)
        put_into_gripper(self._holding, grip.position, grip.orientation_wxyz)
        swing, stopping = self._swing.paths(self._holding, self._holding_data, candidate)
        approach = self._carrying(self.arm.home_posture, swing.positions[0])
        returning = self._moving(stopping.positions[-1], self.arm.home_posture)
        refused = (
            self._within(JointPath.joined(approach, swing, stopping, returning))
            or self._clear(self._holding, self._holding_data, swing)
            or self._clear(self._empty, self._empty_data, stopping)
            or self._departing(flight, stopping)
            or self._strong(self._holding, self._holding_data, swing)
            or self._strong(self._empty, self._empty_data, stopping)
            or self._clear(self._holding, self._holding_data, approach)
            or self._clear(self._empty, self._empty_data, returning)
            or self._strong(self._holding, self._holding_data, approach)
            or self._strong(self._empty, self._empty_data, returning)
        )
        return refused or ThrowMotion(throw, candidate, grip, approach, swing, stopping, returning)

    def _carrying(self, start: Array, end: Array) -> JointPath:
        """Path between two postures with the body in the gripper, so slow that it does not sink like one that falls."""
        path = self._moving(start, end)
        slower = float(np.sqrt(self._sinks(path) / self._sinking))
        return path if slower <= 1.0 else self._moving(start, end, slower)

    def _sinks(self, path: JointPath) -> float:
        """Largest downward acceleration of the held body [m/s^2]."""
        heights = np.empty(len(path.positions[::CHECKED_EVERY]))
        for row, posture in enumerate(path.positions[::CHECKED_EVERY]):
            self._holding_data.qpos[:] = posture
            mujoco.mj_kinematics(self._holding, self._holding_data)
            heights[row] = self._holding_data.body(HELD).xpos[2]
        return float(-np.diff(heights, 2).min(initial=0.0)) / (CHECKED_EVERY * STEP) ** 2

    def _moving(self, start: Array, end: Array, slower: float = 1.0) -> JointPath:
        """Path between two postures; slower near the ends of a joint's range, where speed limits are lower."""
        least = self._ramp.moving_acceleration / slower**2
        for share in (1.0, 0.5, 0.25):
            ramp = replace(self._ramp, moving=share * self._ramp.moving / slower, moving_acceleration=least)
            path = moving(start, end, self.arm.limits.speed, STEP, ramp)
            if self._within(path) is None:
                break
        return path

    def _grip(self, throw: Throw, candidate: Candidate) -> Pose:
        self._empty_data.qpos[:] = candidate.joints
        mujoco.mj_kinematics(self._empty, self._empty_data)
        link = self._empty_data.body(self.arm.last_link)
        return Pose(link.xpos.copy(), link.xquat.copy()).inverse().compose(Pose(throw.position, throw.orientation_wxyz))

    def _departing(self, flight: Array, stopping: JointPath) -> Refused | None:
        """Checks that the released body does not hit the arm, which slows down and waits."""
        gap = self._departure.too_near(flight, stopping)
        return None if gap is None else Refused("distance of the thrown body to the arm", gap.found, gap.wanted, "m")

    def _within(self, path: JointPath) -> Refused | None:
        """Checks that a path keeps positions, speeds and accelerations within the limits."""
        limits, margin = self.arm.limits, self.arm.margin
        half = 0.5 * (limits.highest - limits.lowest)
        for name, values, most, unit in (
            ("speed of joint {} on the way", path.speeds, margin * limits.speed, "rad/s"),
            ("range of joint {} on the way", path.positions - limits.lowest - half, half, "rad from its middle"),
            ("acceleration of joint {}", path.accelerations, margin * limits.acceleration, "rad/s^2"),
        ):
            largest = np.abs(values).max(axis=0)
            worst = int((largest / most).argmax())
            if largest[worst] > most[worst] + 1e-9:
                return Refused(name.format(worst + 1), float(largest[worst]), float(most[worst]), unit)
        use = limits.speed_use(path.positions, path.speeds) / margin  # near an end of a range less is allowed
        row, joint = np.unravel_index(int(use.argmax()), use.shape)
        if use[row, joint] > 1.0:
            found = abs(float(path.speeds[row, joint]))
            return Refused(f"speed of joint {joint + 1} on the way", found, found / float(use[row, joint]), "rad/s")
        return None

    def _clear(self, model: mujoco.MjModel, data: mujoco.MjData, path: JointPath) -> Refused | None:
        """Checks that no moving part comes near the table or the arm itself on a path."""
        for posture in path.thinned(CHECKED_EVERY).positions:
            data.qpos[:] = posture
            mujoco.mj_kinematics(model, data)
            mujoco.mj_collision(model, data)
            if data.ncon:
                contact = data.contact[int(data.contact.dist.argmin())]
                names = " and ".join(_name(model, geom) for geom in (contact.geom1, contact.geom2))
                return Refused(f"distance of {names}", float(contact.dist), self.arm.clearance, "m")
        return None

    def _strong(self, model: mujoco.MjModel, data: mujoco.MjData, path: JointPath) -> Refused | None:
        """Checks by inverse dynamics that the torques of a path, and their rates, are within the limits."""
        part, limits = path.thinned(CHECKED_EVERY), self.arm.limits
        torques = np.empty_like(part.positions)
        for row, (posture, speed, acceleration) in enumerate(zip(part.positions, part.speeds, part.accelerations)):
            data.qpos[:], data.qvel[:], data.qacc[:] = posture, speed, acceleration
            mujoco.mj_inverse(model, data)
            torques[row] = data.qfrc_inverse
        times = STEP * np.minimum(np.arange(len(part)) * CHECKED_EVERY, len(path) - 1)
        rates = np.diff(torques, axis=0) / np.diff(times)[:, None]
        for name, needed, motors, unit in (
            ("torque", torques, limits.torque, "N m"),
            ("torque's rate", rates, limits.torque_rate, "N m/s"),
        ):
            most = np.abs(needed).max(axis=0)
            joint = int((most / motors).argmax())
            allowed = self.arm.margin * float(motors[joint])
            if most[joint] > allowed:
                return Refused(f"{name} of joint {joint + 1}", float(most[joint]), allowed, unit)
        return None


def _name(model: mujoco.MjModel, geom: int) -> str:
    """What a shape belongs to, for a message."""
    owner = str(model.body(model.geom_bodyid[geom]).name)
    name = str(model.geom(geom).name) if owner == "world" else owner.removeprefix(PREFIX)
    return {TABLE: "the table", HELD: "the body"}.get(name, name)


@dataclass
class ThrowPlanner:
    """Plans throws of one body by the simulated arm; made once, for its table of postures takes a while.

    Attributes:
        body: body that is thrown.
        config: configuration of the arm.
        ramp: how its joints speed up.
        search: how hard postures are looked for.
        departure: how far arm and thrown body stay apart.
    """

    body: Body
    config: ArmConfig = DEFAULT_ARM
    ramp: RampConfig = DEFAULT_RAMP
    search: SearchConfig = DEFAULT_SEARCH
    departure: DepartureConfig = DEFAULT_DEPARTURE
    _planner: ArmPlanner = field(init=False, repr=False)

    def __post_init__(self) -> None:
        ramp = within_margin(self.ramp, self.config)
        self._planner = ArmPlanner(self.body, self.config, SuddenSwing(ramp), ramp, self.search, self.departure)

    @property
    def grasps(self) -> Grasps:
        """The faces that the gripper can hold."""
        return self._planner.grasps

    def plan(self, throw: Throw) -> ThrowMotion | Refused:
        """The motion of a throw, or why there is none."""
        return self._planner.plan(throw)
