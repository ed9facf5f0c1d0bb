"""A described arm behind a trajectory controller, its gripper, a cube and a tracker; shares no code with the package.

MuJoCo has the arm of a URDF or MJCF file and a free cube over a board. The arm follows the trajectories that it is sent

    q(t) = d(t - lag) + error * s * (d(t - lag) - home)

with cubic Hermite polynomials d through their points, signs s, and an error of 1 %. The lag may differ from joint to joint. The
gripper opens at a normally distributed time after its command. The cube falls freely when it is let go, and lies where it comes
to rest.

Faults: `slider` (the speed falls to 80 %), `abort` (the controller gives up), `silent` (joint states stop), `inactive` (so does
the controller's state), `offset` (the second joint strays), `unseen` (the tracker loses the cube).
"""

from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import yaml
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline

Array = NDArray[np.float64]

STEP = 0.001
PREFIX = "arm/"
HALF_WIDTH, MASS = 0.0524, 0.37
HARD = [0.006, 1.0]
"""Time constant [s] and damping of contacts: with MuJoCo's defaults the cube sinks 9 mm into the board."""

POSITION_NOISE, TURN_NOISE = 3e-5, 4e-4
"""Of the tracker [m], [rad]."""

SLOWED, OFFSET = 0.8, 0.2
"""Speed of a slider that is not at its end, and error of a joint that strays [rad]."""


class Trajectory:
    """A goal's trajectory.

    Args:
        begin: when it begins [s].
        times: (N,) of its points, after that [s].
        positions: (N, J) [rad].
        speeds: (N, J) [rad/s].
        goal: that it came with.
    """

    def __init__(self, begin: float, times: Array, positions: Array, speeds: Array, goal: Any = None) -> None:
        self.begin, self.last, self.goal = begin, float(times[-1]), goal
        self._spline = CubicHermiteSpline(times, positions, speeds)
        self._slope = self._spline.derivative()

    def at(self, places: Array) -> tuple[Array, Array]:
        """Positions and speeds of the joints, each at its time (J,) on the trajectory."""
        inside = np.clip(places, 0.0, self.last)
        return self._spline(inside).diagonal(), self._slope(inside).diagonal() * (inside == places)


class Cell:
    """Arm, gripper and cube, moved on step by step.

    Args:
        file: YAML file of the arm; its description lies beside it.
        seed: of the gripper's delays, the tracker's noise and the arm's errors.
        now: time at its beginning [s].

    Attributes:
        time: now [s].
        fault: what goes wrong now; empty for nothing.
        uneven: (J,) how much later than others each joint is [s].
        delay, jitter: of the gripper [s].
        joints, joint_speeds: (J,) as measured [rad], [rad/s].
        delays: of the gripper in each throw [s].
        released: when the cube left, and its pose (7,) and twist (6,) then.
        grip: position and orientation wxyz of the held cube in the flange's frame; None if it is not held.
    """

    def __init__(self, file: Path, seed: int, now: float) -> None:
        config: dict[str, Any] = yaml.safe_load(file.read_text())
        self.names, self.home = list(config["joints"]), np.array(config["home"])
        self.rng = np.random.default_rng(seed)
        self.model = _world(config, file.parent)
        self.data = mujoco.MjData(self.model)
        joints = [self.model.joint(PREFIX + name) for name in self.names]
        self._places = [joint.qposadr[0] for joint in joints]
        self._rates = [joint.dofadr[0] for joint in joints]
        cube = self.model.joint("cube")
        first, rate = int(cube.qposadr[0]), int(cube.dofadr[0])
        self._cube_place, self._cube_rate = slice(first, first + 7), slice(rate, rate + 6)
        self._flange = self.model.body(PREFIX + config["flange"]).id
        self.data.qpos[self._cube_place] = [0.2, 0.2, HALF_WIDTH, 1.0, 0.0, 0.0, 0.0]
        self._signs = self.rng.choice([-1.0, 1.0], len(self.names))
        self.time, self.lag, self.error, self.delay, self.jitter, self.fault = now, 0.02, 0.01, 0.05, 0.01, ""
        self._strays, self.uneven = 0.0, np.zeros(len(self.names))
        self.trajectories: list[Trajectory] = []
        self.place = 0.0
        self.desired, self.rate = self.home.copy(), np.zeros(len(self.names))
        self.joints, self.joint_speeds = self.home.copy(), np.zeros(len(self.names))
        self.grip: tuple[Array, Array] | None = None
        self.opens_at: float | None = None
        self.delays: list[float] = []
        self.released: list[tuple[float, Array, Array]] = []
        self._settle()

    def step(self) -> None:
        """Time goes on by one step."""
        self.time += STEP
        self._strays = min(self._strays + STEP, OFFSET) if self.fault == "offset" else 0.0
        if len(self.trajectories) > 1 and self.time - self.lag >= self.trajectories[1].begin:
            self.trajectories.pop(0)
            self.place = max(self.time - self.lag - self.trajectories[0].begin, 0.0)
        elif self.trajectories and self.time - self.lag >= self.trajectories[0].begin:
            self.place += self.speed * STEP
        if self.trajectories:
            self.desired, rate = self.trajectories[0].at(self.place - self.uneven)
            self.rate = rate * self.speed
        self._settle()

    @property
    def speed(self) -> float:
        """Of the slider."""
        return SLOWED if self.fault == "slider" else 1.0

    def take(self, newest: Trajectory) -> None:
        """Follows a trajectory from its beginning on, in place of the one before."""
        if not self.trajectories:
            self.place = 0.0
        self.trajectories = [*self.trajectories[:1], newest]

    def ended(self) -> tuple[Any, str] | None:
        """The goal that ends now, and why it was given up; nothing if it was followed to its end."""
        if not self.trajectories:
            return None
        goal, first = self.trajectories[-1].goal, self.trajectories[0]
        followed = len(self.trajectories) == 1 and self.place - self.uneven.max() > first.last
        if not followed and self.fault != "abort":
            return None
        self.trajectories, self.rate = [], np.zeros(len(self.names))  # it stands still
        return goal, "" if followed else "path tolerance violated"

    def open(self, now: float) -> None:
        """Tells the gripper to open."""
        if self.grip is not None and self.opens_at is None:
            self.delays.append(max(self.delay + self.jitter * float(self.rng.standard_normal()), STEP))
            self.opens_at = now + self.delays[-1]

    def cube(self) -> tuple[Array, Array]:
        """Position and orientation wxyz as a tracker sees them."""
        pose, turned, error = self.data.qpos[self._cube_place], np.zeros(4), np.ones(4)
        error[1:] = 0.5 * TURN_NOISE * self.rng.standard_normal(3)
        mujoco.mju_mulQuat(turned, pose[3:], error / np.linalg.norm(error))
        return pose[:3] + POSITION_NOISE * self.rng.standard_normal(3), turned

    def hold(self, position: Any, orientation_wxyz: Any) -> None:
        """Puts the cube into the gripper."""
        self.grip, self.opens_at = (np.array(position), np.array(orientation_wxyz)), None

    def _settle(self) -> None:
        away = self.error * self._signs
        self.joints = self.desired + away * (self.desired - self.home)
        self.joints[1] += self._strays
        self.joint_speeds = (1.0 + away) * self.rate
        self.data.qpos[self._places], self.data.qvel[self._rates] = self.joints, self.joint_speeds
        if self.opens_at is not None and self.time >= self.opens_at:
            self.grip = self.opens_at = None
            self.released.append((self.time, self.data.qpos[self._cube_place].copy(), self.data.qvel[self._cube_rate].copy()))
        if self.grip is None:
            mujoco.mj_step(self.model, self.data)
        else:
            self._carry()

    def _carry(self) -> None:
        """The cube moves with the flange."""
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_comPos(self.model, self.data)
        assert self.grip is not None
        turn, place = self.data.body(self._flange).xquat.copy(), np.zeros(3)
        mujoco.mju_rotVecQuat(place, self.grip[0], turn)
        pose = np.zeros(7)
        pose[:3] = self.data.body(self._flange).xpos + place
        mujoco.mju_mulQuat(pose[3:], turn, self.grip[1])
        linear, angular = np.zeros((3, self.model.nv)), np.zeros((3, self.model.nv))
        mujoco.mj_jac(self.model, self.data, linear, angular, pose[:3], self._flange)
        back, spin = np.zeros(4), np.zeros(3)
        mujoco.mju_negQuat(back, pose[3:])
        mujoco.mju_rotVecQuat(spin, angular @ self.data.qvel, back)  # a free joint turns in its own frame
        self.data.qpos[self._cube_place] = pose
        self.data.qvel[self._cube_rate] = np.concatenate([linear @ self.data.qvel, spin])


def _world(config: dict[str, Any], folder: Path) -> mujoco.MjModel:
    """The arm without shapes, a cube and a board."""
    arm = mujoco.MjSpec.from_file(str(folder / config["description"]))
    arm.compiler.fusestatic = False
    for part in (*arm.actuators, *arm.sensors, *arm.keys, *arm.equalities, *arm.tendons, *arm.excludes, *arm.pairs):
        arm.delete(part)
    for joint in list(arm.joints):
        if joint.name not in config["joints"]:
            arm.delete(joint)
    for geom in list(arm.geoms):
        geom.contype = geom.conaffinity = 0
    world = mujoco.MjSpec()
    world.option.timestep = STEP
    world.compiler.degree = False
    half = 0.5 * config.get("yaw", 0.5 * np.pi)
    frame = world.worldbody.add_frame(pos=config["base"], quat=[np.cos(half), 0.0, 0.0, np.sin(half)])
    world.attach(arm, frame=frame, prefix=PREFIX)
    contact = {"friction": [0.2, 0.005, 0.0001], "solref": HARD}
    world.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[2.0, 2.0, 0.1], **contact)
    cube = world.worldbody.add_body(name="cube")
    cube.add_freejoint(name="cube")
    cube.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[HALF_WIDTH] * 3, mass=MASS, **contact)
    return world.compile()
