"""The two worlds of a simulated arm, and how the body passes from one to the other (`arm.model` gives the reason).

In one the body is part of the arm, in the other it is free. Opening the gripper copies the state from the first to the second.
Taking the body puts it into the gripper; picking it up is not simulated.
"""

from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from contact_curation.contact.body import Body
from contact_curation.geometry.poses import Pose
from contact_curation.geometry.quaternions import IDENTITY, Array
from contact_curation.simulation.arm.grasps import grasps_of
from contact_curation.simulation.arm.kinematics import FLANGE
from contact_curation.simulation.arm.model import (
    ARM_BIT,
    BOARD_BIT,
    GRIPPER_LENGTH,
    HELD,
    JOINT_NAMES,
    ArmConfig,
    free_model,
    holding_model,
    put_into_gripper,
)


class World(NamedTuple):
    """A simulated world.

    Attributes:
        model: MuJoCo model.
        data: its state.
        joints: (7,) indices of the arm's joints in the state's positions (qpos).
        dofs: (7,) indices of the arm's joints in the state's speeds (qvel).
    """

    model: mujoco.MjModel
    data: mujoco.MjData
    joints: NDArray[np.int64]
    dofs: NDArray[np.int64]


class ArmWorlds:
    """Arm, body and board. At first the arm is at home and holds the body by the first face on which the pad fits.

    Args:
        body: body that is thrown.
        config: configuration of the arm.
        step: step of the simulation [s].
    """

    def __init__(self, body: Body, config: ArmConfig, step: float) -> None:
        self._body = body
        self._holding = _world(holding_model(body, config, step))
        self._free = _world(free_model(body, config, step))
        joint = self._free.model.joint(body.name).id
        self._place, self._motion = int(self._free.model.jnt_qposadr[joint]), int(self._free.model.jnt_dofadr[joint])
        self.held = True
        self._home = config.home_posture
        self.begin(_first_grip(body))

    @property
    def now(self) -> World:
        """The world that is simulated at present."""
        return self._holding if self.held else self._free

    def take_body(self) -> None:
        """Puts the body into the gripper by the first face on which the pad fits."""
        self._take(_first_grip(self._body))

    def begin(self, grip: Pose) -> None:
        """Resets the arm to rest at home with the body in the gripper, so that the motion depends on nothing before."""
        self.held = True
        mujoco.mj_resetData(self._holding.model, self._holding.data)
        self._holding.data.qpos[:] = self._home
        self._take(grip)

    def _take(self, grip: Pose) -> None:
        """Puts the body into the gripper at a pose in the last link's frame."""
        put_into_gripper(self._holding.model, grip.position, grip.orientation_wxyz)
        holding = self._holding.data
        if not self.held:
            holding.qpos[:], holding.qvel[:] = self._free.data.qpos[self._free.joints], self._free.data.qvel[self._free.dofs]
            self.held = True
        mujoco.mj_forward(self._holding.model, holding)

    def open(self) -> Array:
        """Passes to the world in which the body is free; returns the body's state (13,) at that moment."""
        mujoco.mj_forward(self._holding.model, self._holding.data)
        release = self.body_state()
        free = self._free.data
        mujoco.mj_resetData(self._free.model, free)
        free.qpos[self._free.joints], free.qvel[self._free.dofs] = self._holding.data.qpos, self._holding.data.qvel
        free.qpos[self._place : self._place + 7] = release[:7]
        free.qvel[self._motion : self._motion + 6] = release[7:]
        self.held = False
        self._let_meet(BOARD_BIT | ARM_BIT)
        return release

    def take_away(self) -> None:
        """Lets the arm move through the free body, as if the body had been removed."""
        self._let_meet(BOARD_BIT)

    def body_touches_arm(self) -> bool:
        """Whether the free body touches anything but the board."""
        pairs, model = self._free.data.contact.geom, self._free.model
        ours = (pairs == model.geom(self._body.name).id).any(axis=1) & (pairs != model.geom("board").id).all(axis=1)
        return bool(ours.any())

    def body_state(self) -> Array:
        """The body's state (13,) in SI units, in the board's frame."""
        model, data = self.now.model, self.now.data
        if not self.held:
            return np.concatenate([data.qpos[self._place : self._place + 7], data.qvel[self._motion : self._motion + 6]])
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_comVel(model, data)
        held, twist = data.body(HELD), np.zeros(6)
        mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_XBODY, held.id, twist, 0)
        spin = held.xmat.reshape(3, 3).T @ twist[:3]
        return np.concatenate([held.xpos, held.xquat, twist[3:], spin])

    def _let_meet(self, others: int) -> None:
        """Sets the collision groups that the free body collides with."""
        self._free.model.geom(self._body.name).conaffinity[:] = others


def _world(model: mujoco.MjModel) -> World:
    joints = [model.joint(name).id for name in JOINT_NAMES]
    places, motions = model.jnt_qposadr[joints], model.jnt_dofadr[joints]
    return World(model, mujoco.MjData(model), np.array(places, dtype=np.int64), np.array(motions, dtype=np.int64))


def _first_grip(body: Body) -> Pose:
    """Pose of the body in the last link's frame when it is held by the first face on which the pad fits."""
    grasps = grasps_of(body)
    down = np.array([0.0, 0.0, 1.0])
    normal = -grasps.normals[0]  # the face's inward normal, which the pad's axis is parallel to
    half = np.concatenate([[1.0 + normal @ down], np.cross(normal, down)])
    turn = half / np.linalg.norm(half) if np.linalg.norm(half) > 1e-9 else np.array([0.0, 1.0, 0.0, 0.0])
    pad = Pose(np.array([0.0, 0.0, FLANGE + GRIPPER_LENGTH]), IDENTITY)
    on_face = Pose(np.zeros(3), turn)
    return pad.compose(on_face).compose(Pose(-grasps.places[0], IDENTITY))
