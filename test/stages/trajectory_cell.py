"""An arm whose one moving joint carries a cube, its controller, its gripper and a tracker, without any code of the stage."""

from collections.abc import Callable

import numpy as np

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.design.throw import Throw
from contact_curation.geometry.poses import Pose
from contact_curation.geometry.quaternions import IDENTITY, Array
from contact_curation.simulation.arm.limits import JointLimits
from contact_curation.simulation.arm.path import JointPath, RampConfig, moving
from contact_curation.simulation.arm.planned_throw import PlannedThrow
from contact_curation.simulation.arm.safety import GateConfig, SafetyGate
from contact_curation.simulation.arm.throw_motion import STEP
from contact_curation.stages.arm import Ending
from contact_curation.stages.records import GripperRecord
from contact_curation.stages.trajectory_throw import Sent, TrajectoryConfig, TrajectoryThrow

JOINTS, TICK = 6, 0.004
RELEASE = 0.45
VELOCITY = np.array([0.9, 0.1, 0.1])
START = np.array([-0.4, 0.0, 0.16])
GRAVITY = np.array([0.0, 0.0, -CONTACTNETS_CUBE.gravity])
ONES = np.ones(JOINTS)
LIMITS = JointLimits(-3 * ONES, 3 * ONES, 3 * ONES, 12 * ONES, 99 * ONES, 1e9 * ONES, 12 * ONES, 0 * ONES, -3 * ONES, 3 * ONES)
THROW = Throw("one", "cube", START + 0.2 * VELOCITY, np.array([1.0, 0.0, 0.0, 0.0]), VELOCITY, np.zeros(3))


def plan_of(throw: Throw) -> PlannedThrow | str:
    """The first joint speeds up for 0.4 s, goes evenly at 1 rad/s for 0.1 s, slows down and comes back."""
    if throw.throw_id == "through the stand":
        return "distance of gripper and obstacle 1: found -0.01 m, expected at least 0.008 m"
    times = np.arange(0.0, 1.7, STEP)
    up, down = np.clip(times / 0.4, 0.0, 1.0), np.clip((times - 0.5) / 0.4, 0.0, 1.0)
    speed = (3.0 * up**2 - 2.0 * up**3) * (1.0 - 3.0 * down**2 + 2.0 * down**3)
    far = np.concatenate([[0.0], np.cumsum(0.5 * STEP * (speed[1:] + speed[:-1]))])
    back = np.clip((times - 0.9) / 0.75, 0.0, 1.0)
    joint = far - far[-1] * (10.0 * back**3 - 15.0 * back**4 + 6.0 * back**5)
    positions = np.zeros((len(times), JOINTS))
    positions[:, 0] = joint
    speeds = np.asarray(np.gradient(positions, STEP, axis=0))
    path = JointPath(positions, speeds, np.asarray(np.gradient(speeds, STEP, axis=0)))
    held = Pose(START, IDENTITY)
    return PlannedThrow(throw, path, RELEASE, times, START + far[:, None] * VELOCITY, held, held)


def way_home(posture: Array) -> JointPath | str:
    """Straight in half a second."""
    return moving(posture, np.zeros(JOINTS), LIMITS.speed, STEP, RampConfig())


class Cell:
    """All of it, with a clock of its own.

    Attributes:
        slider: speed scaling.
        aborts: why the controller gives up; empty if it does not.
        silent: whether joint states have stopped.
        off: how far the second joint is off its path [rad].
        gain: how far joints go, as a share of what they are told.
        misplaced: how far the body is off its place in the gripper [m].
        opened: when the gripper was told to open.
        sent: trajectories that the controller got.
    """

    def __init__(self, seed: int = 0, *, lag: float = 0.02, delay: float = 0.05, jitter: float = 0.0,
                 config: TrajectoryConfig | None = None, record: GripperRecord | None = None,
                 limits: JointLimits = LIMITS) -> None:  # fmt: skip
        self.now, self.slider, self.aborts, self.silent, self.off, self.active = 100.0, 1.0, "", False, 0.0, True
        self.gain, self.lag, self.delay, self.jitter, self._rng = 1.0, lag, delay, jitter, np.random.default_rng(seed)
        self.gate = SafetyGate(GateConfig(keep_out_radius=0.0))
        self.stage = TrajectoryThrow(
            CONTACTNETS_CUBE, limits, np.zeros(JOINTS), plan_of, way_home, self.gate, lambda: self.now,
            config or TrajectoryConfig(), 0.03, record=record,
        )  # fmt: skip
        self.sent: list[Sent] = []
        self.opened: float | None = None
        self.fell: float | None = None
        self._ticks, self.misplaced = 0, np.zeros(3)
        self._rest = np.zeros(JOINTS)
        self.joints = np.zeros(JOINTS)
        self.gate.arm(self.now)
        for _ in range(8):
            self.tick()

    def tick(self) -> Ending | None:
        """Time goes on."""
        self.now += TICK
        self._ticks += 1
        self.gate.heartbeat(self.now)
        self.joints = self._followed(self.now)
        if self.active:
            self.stage.signals.controller_seen()
        self.stage.signals.scaling_seen(self.slider)
        if not self.silent and self._ticks % 2 == 0:
            self.stage.signals.joints_seen(self.now, self.joints)
        place = self._body(self.now) + 1e-4 * self._rng.standard_normal(3)
        self.stage.signals.body_seen(self.now, place, np.array([1.0, 0.0, 0.0, 0.0]))
        if self.sent and self.aborts:
            self.stage.controller_ended(self.aborts)
        elif self.sent and self.now > self.sent[-1].begin + (len(self.sent[-1].path) - 1) * STEP + self.lag:
            self.stage.controller_ended("")
        step = self.stage.advance()
        if step.opens:
            assert self.opened is None
            self.opened = self.now
            self.fell = self.now + self.delay + self.jitter * self._rng.standard_normal()
        if step.stop is not None:
            self.sent.append(step.stop)
        return step.ending

    def throw(self, meanwhile: Callable[[], object] = lambda: None, throw: Throw = THROW) -> Ending:
        """Makes a throw; `meanwhile` is called at every tick."""
        refusal = self.stage.admits(throw)
        if refusal is not None:
            return Ending(False, refusal)
        self.sent, self.opened, self.fell = [], None, None
        while (began := self.stage.begin()) is None:
            meanwhile()
            self.tick()
        return self._made(began, meanwhile)

    def go_home(self) -> Ending:
        """Goes home."""
        refusal = self.stage.admits_homeward()
        return Ending(False, refusal) if refusal else self._made(self.stage.begin_homeward(), lambda: None)

    def _made(self, began: Sent | Ending, meanwhile: Callable[[], object]) -> Ending:
        if isinstance(began, Ending):
            return began
        self.sent = [began]
        until = self.now + 20.0
        while self.now < until:
            meanwhile()
            ending = self.tick()
            if ending is not None:
                self._rest = self.joints - self.off * np.eye(JOINTS)[1]
                self.sent = []
                return ending
        raise AssertionError("no ending")

    @property
    def elapsed(self) -> float:
        """Since the trajectory began [s]."""
        return self.now - self.sent[0].begin

    def _followed(self, at: float) -> Array:
        """Joints at a time, by the newest trajectory that has begun."""
        begun = [one for one in self.sent if one.begin <= at - self.lag] or self.sent[:1]
        if not begun:
            return np.asarray(self._rest + np.eye(JOINTS)[1] * self.off)
        positions = begun[-1].path.positions
        row = float(np.clip((at - self.lag - begun[-1].begin) / STEP, 0.0, len(positions) - 1.0))
        first = min(int(row), len(positions) - 2)
        joints: Array = self.gain * (positions[first] + (row - first) * (positions[first + 1] - positions[first]))
        joints[1] += self.off
        return joints

    def _body(self, at: float) -> Array:
        """Where the body is: in the hand, or falling as it left it."""
        fell = self.fell
        if fell is None or at < fell:
            return np.asarray(START + self._followed(at)[0] * VELOCITY + self.misplaced)
        near = [self._followed(fell + step)[0] for step in (-0.003, 0.0, 0.003)]
        velocity = (near[2] - near[0]) / 0.006 * VELOCITY
        return np.asarray(START + near[1] * VELOCITY + velocity * (at - fell) + 0.5 * GRAVITY * (at - fell) ** 2)
