"""What plans of throws need to know of an arm, whichever it is."""

from typing import Protocol

import mujoco

from contact_curation.contact.body import Body
from contact_curation.geometry.quaternions import Array
from contact_curation.simulation.arm.kinematics import Postures
from contact_curation.simulation.arm.limits import JointLimits


class ThrowingArm(Protocol):
    """An arm of J joints that stands upright beside the board: its first joint turns about the vertical."""

    @property
    def base(self) -> tuple[float, float, float]:
        """Position of the arm's base in the board's frame [m]."""

    @property
    def yaw(self) -> float:
        """Direction that the arm faces, from the board's x axis [rad]."""

    @property
    def margin(self) -> float:
        """Share of each joint limit that plans use."""

    @property
    def clearance(self) -> float:
        """Planned distance between moving parts and the table or the arm [m]."""

    @property
    def home_posture(self) -> Array:
        """Where it rests between throws, (J,) [rad]."""

    @property
    def limits(self) -> JointLimits:
        """Limits of its joints."""

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of its joints, from the base on."""

    @property
    def last_link(self) -> str:
        """Name of the link that carries the gripper."""

    def postures(self, joints: Array) -> Postures:
        """What postures (N, J) give, in the frame of the base."""

    def planning_model(self, body: Body | None) -> mujoco.MjModel:
        """The arm over a table of its true size, with the body or nothing in its gripper; contacts come with the clearance."""

    def free_world(self, body: Body, step: float) -> mujoco.MjModel:
        """The arm and a free body over the board."""
