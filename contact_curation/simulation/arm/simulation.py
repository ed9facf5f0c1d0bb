"""Simulates a throw in MuJoCo: a controller follows the planned motion, the gripper opens, the body flies and comes to rest.

The whole motion is one path whose parameter advances by one sample per control step. A stop slows the parameter down, so that
the arm brakes on the path that was checked for collisions. Re-arming runs the path back to the home posture, or forward if the
body has been released. The controller is computed torque, tau = M (a + Kp e + Kd e') + bias, clipped to the motors' torque
limits and torque rates; it does not compensate for the joints' dry friction.

After the release the arm waits until the body rests and has been taken away. If it detects a collision meanwhile, it gives way:
it slows down as planned without stiffness, and then goes home from where it stands.
"""

from dataclasses import dataclass, field

import mujoco
import numpy as np

from contact_curation.contact.body import Body
from contact_curation.design.throw import throw_seed
from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array
from contact_curation.simulation.arm.frame import ArmFrame, Phase
from contact_curation.simulation.arm.limits import JOINTS, CollisionReflex, LimitUse, Peaks, ReflexConfig
from contact_curation.simulation.arm.model import DEFAULT_ARM, ArmConfig
from contact_curation.simulation.arm.path import DEFAULT_RAMP, JointPath, moving
from contact_curation.simulation.arm.throw_motion import STEP, STEPS_PER_FRAME, ThrowMotion
from contact_curation.simulation.arm.worlds import ArmWorlds

PER_FRAME = STEP * STEPS_PER_FRAME

SOFT_DAMPING = 10.0
"""Kd of an arm that gives way, whose Kp is 0 [1/s]."""


@dataclass(frozen=True)
class ControlConfig:
    """Configuration of the arm's controller and of a throw's end.

    Attributes:
        stiffness: proportional gain Kp [1/s^2].
        damping: derivative gain Kd [1/s].
        release_jitter: the gripper opens late by the absolute value of a normal number with this standard deviation [s].
        braking: joint acceleration of a stop [rad/s^2].
        return_rate: speed of the way back after a stop, as a share of the planned motion's speed.
        rest_speed: largest speed of a body at rest [m/s].
        rest_spin: largest angular speed of a body at rest [rad/s].
        rest_time: time at rest before the body is taken away [s].
        longest_flight: time after which the body is taken away in any case [s].
        still: joints slower than this count as still [rad/s].
        reflex: when the arm stops because something pushes it.
    """

    stiffness: float = 2500.0
    damping: float = 100.0
    release_jitter: float = 0.001
    braking: float = 5.0
    return_rate: float = 0.3
    rest_speed: float = 2e-3
    rest_spin: float = 2e-2
    rest_time: float = 0.3
    longest_flight: float = 5.0
    still: float = 0.01
    reflex: ReflexConfig = field(default_factory=ReflexConfig)

    def __post_init__(self) -> None:
        for name in set(self.__dataclass_fields__) - {"reflex"}:
            value = getattr(self, name)
            if not (np.isfinite(value) and value >= 0.0) or (value == 0.0 and name != "release_jitter"):
                raise InvalidValueError(f"control.{name}", value, "a positive number")


DEFAULT_CONTROL = ControlConfig()


class ArmSimulation:
    """Simulates arm, body and board frame by frame.

    Args:
        body: body that is thrown.
        config: configuration of the arm.
        control: configuration of the controller.
        seed: random seed; together with a throw's name it determines the gripper's delay.
    """

    def __init__(
        self, body: Body, config: ArmConfig = DEFAULT_ARM, control: ControlConfig = DEFAULT_CONTROL, seed: int = 0
    ) -> None:
        self.body, self.config, self.control = body, config, control
        self._seed = seed
        self._worlds = ArmWorlds(body, config, STEP)
        self.time = 0.0
        self.phase = Phase.RESTING
        self.release: Array | None = None
        self.released_at = 0.0
        self.touched = self.gave_way = self.settled = False
        self._reflex = CollisionReflex(config.limits.torque, control.reflex)
        self._yields = self._gone = False
        self._path = _still(config.home_posture)
        self._at, self._rate, self._wanted, self._slowing = 0.0, 0.0, 0.0, 1.0
        self._release_row, self._swing_row, self._stopped_row, self._opens_at = -1, -1, -1, -1.0
        self._still_for, self._free_for = 0.0, 0.0
        self._used = LimitUse(config.limits)
        self._torques = self._worlds.now.data.qfrc_bias.copy()  # the torques that hold the arm's weight at home

    @property
    def rested(self) -> bool:
        """Whether the body has left the gripper and lies still."""
        return not self._worlds.held and self._still_for >= self.control.rest_time

    @property
    def peaks(self) -> Peaks:
        """The largest shares of the limits since the motion began."""
        return self._used.peaks

    def begin(self, motion: ThrowMotion) -> None:
        """Begins a throw: puts the body into the gripper in the grip of the throw.

        The simulated motion depends on the throw alone, not on earlier throws.

        Raises:
            InvalidValueError: the arm is not at rest at home.
        """
        if self.phase is not Phase.RESTING:
            raise InvalidValueError("arm", self.phase.value, "an arm that rests at home")
        self._worlds.begin(motion.grip)
        self._torques = self._worlds.now.data.qfrc_bias.copy()
        lead = -(len(motion.approach) + len(motion.swing) - 2) % STEPS_PER_FRAME  # so that the release falls on a frame
        before = JointPath.joined(_still(self.config.home_posture, lead + 1), motion.approach)
        self._path = JointPath.joined(before, motion.swing, motion.stopping, motion.returning)
        self._swing_row, self._release_row = len(before) - 1, len(before) + len(motion.swing) - 2
        self._stopped_row = self._release_row + len(motion.stopping) - 1
        late = np.random.default_rng([self._seed, throw_seed(motion.throw.throw_id)]).standard_normal()
        delay = abs(float(late)) * self.control.release_jitter
        self._opens_at = self._release_row + round(delay / STEP)
        self._slowing = self.control.braking / max(float(np.abs(self._path.speeds).max()), 1e-6)
        self._at, self._rate, self._wanted, self.release = 0.0, 1.0, 1.0, None
        self.touched = self.gave_way = self.settled = False
        self._used.forget()
        self.phase = Phase.MOVING

    def stop(self) -> None:
        """Brakes on the path; nothing moves afterwards until `rearm`, and the gripper stays as it is."""
        if self.phase in (Phase.RESTING, Phase.STOPPED):
            self.phase = Phase.STOPPED
        else:
            self.phase, self._wanted = Phase.STOPPING, 0.0

    def rearm(self) -> None:
        """Goes home after a stop: back along its path, or forward if the body has been released."""
        if self.phase is Phase.STOPPED:
            self.phase, self._wanted = Phase.RETURNING, -self.control.return_rate if self._worlds.held else 1.0

    def advance(self) -> ArmFrame:
        """Simulates one frame and returns it."""
        for _ in range(STEPS_PER_FRAME):
            self._step()
        self._after_frame()
        return self.frame()

    def frame(self) -> ArmFrame:
        """The present state as a frame."""
        world = self._worlds.now
        return ArmFrame(
            self.time,
            self.phase,
            min(self._at / max(len(self._path) - 1, 1), 1.0),
            world.data.qpos[world.joints].copy(),
            world.data.qvel[world.dofs].copy(),
            self._torques.copy(),
            self._worlds.body_state(),
            not self._worlds.held,
        )

    def _step(self) -> None:
        """One control step: path parameter, torques, physics, and the gripper if it is time."""
        before, rate = self._at, self._rate
        self._at, self._rate = self._ahead()
        posture, speed = self._reference(before, rate)
        next_speed = self._reference(self._at, self._rate)[1]
        model, data, joints, dofs = self._worlds.now
        mujoco.mj_step1(model, data)
        speeds = data.qvel.copy()
        wanted, moment = np.zeros(model.nv), np.zeros(model.nv)
        wanted[dofs] = (next_speed - speed) / STEP + self._pull(posture - data.qpos[joints], speed - speeds[dofs])
        mujoco.mj_mulM(model, data, moment, wanted)
        limit, change = self.config.limits.torque, self.config.limits.torque_rate * STEP
        followed = np.clip(moment[dofs] + data.qfrc_bias[dofs], self._torques - change, self._torques + change)
        self._torques = np.clip(followed, -limit, limit)
        data.qfrc_applied[dofs] = self._torques
        mujoco.mj_step2(model, data)
        self.time += STEP
        self._used.note(self._torques, data.qpos[joints], data.qvel[dofs])
        if not self._worlds.held:
            mujoco.mj_mulM(model, data, moment, (data.qvel - speeds) / STEP)
            self._feel(moment[dofs] + data.qfrc_bias[dofs] - self._torques)
        if self._worlds.held and self.phase is Phase.THROWING and self._at >= self._opens_at:
            self._open()

    def _pull(self, off: Array, slow: Array) -> Array:
        """The feedback accelerations (7,) for errors of position (7,) and speed (7,)."""
        if self._yields:
            return SOFT_DAMPING * slow
        return self.control.stiffness * off + self.control.damping * slow

    def _feel(self, outside: Array) -> None:
        """Notes whether the body touches the arm, and gives way if the external torques (7,) are too large."""
        self.touched |= self._worlds.body_touches_arm()
        if self._reflex.feels(outside, STEP) and not self._gone:
            self._yields = self.gave_way = True

    def _ahead(self) -> tuple[float, float]:
        """The path parameter and its rate after the next step."""
        rate, change = self._rate, self._slowing * STEP
        past_release = self._release_row < self._at < self._stopped_row
        if not (past_release and self._wanted == 0.0):  # after the release the path itself slows down at the limit
            rate += float(np.clip(self._wanted - rate, -change, change))
        # The arm waits until the body rests, so that it does not hit it on the way home.
        waits = not self._worlds.held and self._at <= self._stopped_row and (self._yields or not self._gone)
        return float(np.clip(self._at + rate, 0.0, self._stopped_row if waits else len(self._path) - 1)), rate

    def _reference(self, at: float, rate: float) -> tuple[Array, Array]:
        low = min(int(at), len(self._path) - 1)
        high, part = min(low + 1, len(self._path) - 1), at - low
        path = self._path
        posture = (1.0 - part) * path.positions[low] + part * path.positions[high]
        speed = (1.0 - part) * path.speeds[low] + part * path.speeds[high]
        return posture, rate * speed

    def _after_frame(self) -> None:
        """Changes the phase if the state of arm and body calls for it."""
        if self.phase is Phase.MOVING and self._at >= self._swing_row:
            self.phase = Phase.THROWING
        if not self._worlds.held:
            self._watch_body()
        if self._yields and self._gone and self._stands() and self.phase in (Phase.RELEASED, Phase.RETURNING):
            self._go_on()
        at_end = self._at >= len(self._path) - 1
        if self.phase is Phase.STOPPING and self._stands():
            self.phase, self._rate = Phase.STOPPED, 0.0
        elif self.phase is Phase.RETURNING and self._worlds.held and self._at <= 0.0:
            self._home()
        elif self.phase in (Phase.RELEASED, Phase.RETURNING) and at_end and self._gone:
            self._worlds.take_body()
            self._gone = False
            self._home()

    def _stands(self) -> bool:
        """Whether the path parameter stands still, and also the joints of an arm that gives way."""
        world = self._worlds.now
        if self._yields and np.abs(world.data.qvel[world.dofs]).max() > self.control.still:
            return False
        row = min(int(self._at), len(self._path) - 1)
        slowed = bool(self._at > self._release_row >= 0 and np.abs(self._path.speeds[row]).max() < 1e-9)
        return slowed or abs(self._rate) < 1e-9 or self._at >= len(self._path) - 1

    def _go_on(self) -> None:
        """Leads an arm that gave way from where it stands back to the path and home."""
        world, rest = self._worlds.now, self._path.after(self._stopped_row)
        here = world.data.qpos[world.joints]
        back = moving(here, rest.positions[0], self.config.limits.speed, STEP, DEFAULT_RAMP)
        self._path = JointPath.joined(back, rest)
        self._slowing = self.control.braking / max(float(np.abs(self._path.speeds).max()), 1e-6)
        self._at, self._rate, self._wanted, self._yields = 0.0, 0.0, 1.0, False
        self._release_row = self._swing_row = self._stopped_row = 0

    def _home(self) -> None:
        self._path, self._at, self._rate, self._wanted = _still(self.config.home_posture), 0.0, 0.0, 0.0
        self._release_row = self._swing_row = self._stopped_row = -1
        self.phase = Phase.RESTING

    def _watch_body(self) -> None:
        self._free_for += PER_FRAME
        body = self._worlds.body_state()
        slow = np.abs(body[7:10]).max() < self.control.rest_speed and np.abs(body[10:]).max() < self.control.rest_spin
        self._still_for = self._still_for + PER_FRAME if slow else 0.0
        self.settled |= self.rested
        if not self._gone and (self.rested or self._free_for >= self.control.longest_flight):
            self._gone = True
            self._worlds.take_away()

    def _open(self) -> None:
        """Opens the gripper: the body becomes free."""
        self.release, self.released_at = self._worlds.open(), self.time
        self._still_for, self._free_for = 0.0, 0.0
        self._yields = self._gone = False
        self._reflex.forget()
        self.phase = Phase.RELEASED


def _still(posture: Array, count: int = 1) -> JointPath:
    return JointPath(np.tile(posture, (count, 1)), np.zeros((count, JOINTS)), np.zeros((count, JOINTS)))
