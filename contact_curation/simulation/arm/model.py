"""The arm as MuJoCo specifications, built in code: a Franka Research 3 with a vacuum gripper beside the board.

The numbers are published, the shapes are our own (capsules):
    kinematics    Denavit-Hartenberg parameters, see `arm_kinematics`
    masses        franka_description, robots/fr3/inertials.yaml; the gripper's end_effectors/cobot_pump/inertials.yaml
    rotors        inertia seen at the joints: Drake's franka_description README, as given by Franka for the FR3
    friction      Gaz, Cognetti, Oliva, Robuffo Giordano, De Luca, Dynamic identification of the Franka Emika Panda robot with
                  retrieval of feasible parameters using penalty-based optimization, IEEE RA-L 4(4), 4147-4154, 2019

The vacuum gripper holds a convex body rigidly by a flat face. There are therefore two simulated worlds: in one the body is part
of the arm, in the other it is free. When the gripper opens, the state is copied from the first to the second. So the body is
released with exactly the pose and twist of the pad's motion; a soft weld constraint would disturb them.
"""

from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from contact_curation.configs import check_not_negative, check_positive
from contact_curation.contact.body import Body
from contact_curation.contact.body_values import STANDARD_GRAVITY
from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array
from contact_curation.simulation.arm.kinematics import FLANGE, LINK_LENGTHS, LINK_OFFSETS, LINK_TWISTS, Postures, postures_of
from contact_curation.simulation.arm.limits import FR3_LIMITS, JOINTS, JointLimits
from contact_curation.simulation.world import world_of

JOINT_NAMES = tuple(f"fr3_joint{number}" for number in range(1, JOINTS + 1))
PAD, HELD, TABLE = "pad", "held", "table"

PREFIX = "arm_"
"""Of the names in an arm's description, in a world that it is put into."""

ROTOR_INERTIA = (0.605721456, 0.605721456, 0.462474144, 0.462474144, 0.205544064, 0.205544064, 0.205544064)
"""[kg m^2], seen at the joints."""

JOINT_FRICTION = (0.273, 0.436, 0.320, 0.640, 0.420, 0.152, 0.282)
"""Dry friction [N m]: half of phi_1, the height of the sigmoid over the speed that Gaz et al. fitted to the FR3's predecessor,
without its small offset. The controller does not compensate for it."""

GRIPPER_LENGTH = 0.105
"""Distance from the flange to the pad [m]."""


@dataclass(frozen=True)
class Inertial:
    """Mass of a link in its joint's frame.

    Attributes:
        mass: [kg].
        centre: centre of mass [m].
        inertia: xx, yy, zz, xy, xz, yz about the centre of mass [kg m^2].
    """

    mass: float
    centre: tuple[float, float, float]
    inertia: tuple[float, float, float, float, float, float]


LINKS = (
    Inertial(
        2.9274653454,
        (4.128e-7, -0.0181251324, -0.0386035970),
        (0.0239273165, 0.0224821614, 0.0063500983, 1.33179035e-5, -1.14047749e-4, -0.0019950321),
    ),
    Inertial(
        2.9355370338,
        (0.0031828864, -0.0743221644, 0.0088146084),
        (0.0419389463, 0.0251451489, 0.0617021447, 2.02573315e-4, 0.0040777842, -0.0042252158),
    ),
    Inertial(
        2.2449013699,
        (0.0407015686, -0.0048200565, -0.0289730823),
        (0.0241014255, 0.0197405327, 0.0190444945, 0.0024046946, -0.0028562693, -0.0021042127),
    ),
    Inertial(
        2.6155955791,
        (-0.0459100965, 0.0630492960, -0.0085187868),
        (0.0345299832, 0.0288816219, 0.0412547117, 0.0132255227, 0.0101514300, -9.76283387e-4),
    ),
    Inertial(
        2.3271207594,
        (-0.0016039605, 0.0292536262, -0.0972965990),
        (0.0516102785, 0.0478772971, 0.0164236256, -0.0057151734, -0.0035673168, 0.0106739851),
    ),
    Inertial(
        1.8170376524,
        (0.0597131221, -0.0410294666, -0.0101692726),
        (0.0054123336, 0.0140583295, 0.0160808179, 0.0061934564, 0.0014219289, -0.0013140754),
    ),
    Inertial(
        0.6271432862,
        (0.0045225817, 0.0086261921, -0.0161633251),
        (2.10923892e-4, 1.77185680e-4, 5.99319060e-5, -2.43329911e-5, 4.56448039e-5, 8.74407022e-5),
    ),
)
GRIPPER = Inertial(1.01, (0.0, 0.0, 0.063), (0.001, 0.001, 0.001, 0.0, 0.0, 0.0))
"""The gripper in the flange's frame."""

SHAPES: tuple[tuple[int, tuple[float, ...], float], ...] = (
    (0, (0.0, 0.0, 0.06, 0.0, 0.0, 0.16), 0.07),
    (1, (0.0, 0.0, -0.14, 0.0, 0.0, 0.0), 0.06),
    (2, (0.0, 0.0, -0.06, 0.0, 0.0, 0.06), 0.06),
    (3, (0.0, 0.0, -0.22, 0.0, 0.0, -0.05), 0.055),
    (4, (0.0, 0.0, -0.05, 0.0, 0.0, 0.05), 0.055),
    (5, (0.0, 0.0, -0.27, 0.0, 0.0, -0.06), 0.055),
    (6, (0.0, 0.0, -0.03, 0.0, 0.0, 0.03), 0.05),
    (7, (0.0, 0.0, 0.0, 0.0, 0.0, 0.07), 0.045),
    (7, (0.0, 0.0, FLANGE + 0.02, 0.0, 0.0, FLANGE + GRIPPER_LENGTH - 0.025), 0.02),
)
"""Capsules: link, its ends in the link's frame [m], radius [m]. The gripper's ends 5 mm before the pad, which is soft."""

BOARD_BIT, LOWER_BIT, BODY_BIT, ARM_BIT = 1, 2, 4, 8
MEETS = {5: LOWER_BIT | BODY_BIT, 6: LOWER_BIT, 7: LOWER_BIT, 4: BODY_BIT}
"""What links 4 to 7 can collide with besides the board (MuJoCo's collision bits); the lower links are those up to 3."""


@dataclass(frozen=True)
class ArmConfig:
    """Where the arm stands, and the margins that its motions keep.

    The robot stands on the floor beside the table with the board. By default it stands so that throws along the board's x axis
    are made sideways, which the arm does best.

    Attributes:
        base: position of the arm's base in the board's frame [m].
        yaw: direction that the arm faces, from the board's x axis [rad].
        home: joint angles between throws [rad].
        table_half_width: half the width of the table under the board, in x and y [m].
        clearance: planned distance between moving parts and the table or the arm [m].
        margin: share of the joints' limits of speed, acceleration and torque that plans use; the rest is for the controller.
        friction: factor on the joints' dry friction.
    """

    base: tuple[float, float, float] = (-0.307, -0.5, -0.3)
    yaw: float = float(np.pi / 2.0)
    home: tuple[float, ...] = (0.0, -0.6, 0.0, -1.9, 0.0, 1.3, 0.785)
    table_half_width: float = 0.38
    clearance: float = 0.008
    margin: float = 0.95
    friction: float = 1.0

    def __post_init__(self) -> None:
        if np.shape(self.base) != (3,) or not np.isfinite([*self.base, self.yaw]).all():
            raise InvalidValueError("arm.base, arm.yaw", (self.base, self.yaw), "3 and 1 finite numbers")
        home = np.asarray(self.home, dtype=float)
        if home.shape != (JOINTS,) or not ((FR3_LIMITS.lowest <= home) & (home <= FR3_LIMITS.highest)).all():
            raise InvalidValueError("arm.home", self.home, "7 positions within the joints' limits [rad]")
        check_positive(self, ("table_half_width",), "arm.")
        check_not_negative(self, ("clearance", "friction"), "arm.")
        if not 0.0 < self.margin <= 1.0:
            raise InvalidValueError("arm.margin", self.margin, "a share in (0, 1]")

    @property
    def limits(self) -> JointLimits:
        return FR3_LIMITS

    @property
    def home_posture(self) -> Array:
        """Joint angles (7,) of the home posture [rad]."""
        return np.array(self.home)

    @property
    def joint_names(self) -> tuple[str, ...]:
        return JOINT_NAMES

    def postures(self, joints: Array) -> Postures:
        """What postures (N, 7) give."""
        return postures_of(joints, GRIPPER_LENGTH)

    @property
    def last_link(self) -> str:
        return f"fr3_link{JOINTS}"

    def planning_model(self, body: Body | None) -> mujoco.MjModel:
        """The arm over a table of its true size, with the body in its gripper or with nothing."""
        return planning_model(body, self)

    def free_world(self, body: Body, step: float) -> mujoco.MjModel:
        """The arm and a free body over the board."""
        return free_model(body, self, step)


DEFAULT_ARM = ArmConfig()


def planning_model(body: Body | None, config: ArmConfig) -> mujoco.MjModel:
    """The arm with a body in its gripper, or with none, and the table; distances below the clearance count as contacts."""
    spec = mujoco.MjSpec()
    spec.option.gravity = [0.0, 0.0, -(body.gravity if body else STANDARD_GRAVITY)]
    add_table(spec, config.table_half_width, margin=config.clearance)
    last = add_arm(spec, config, meets_itself=True, friction=0.0)
    if body is not None:
        hold(spec, last, body, contype=BODY_BIT, conaffinity=BOARD_BIT | LOWER_BIT)
    return spec.compile()


def holding_model(body: Body, config: ArmConfig, step: float) -> mujoco.MjModel:
    """The simulated world while the gripper holds the body."""
    spec = world_of(body, step)
    spec.delete(spec.body(body.name))
    spec.delete(spec.geom("board"))
    add_table(spec, config.table_half_width, margin=0.0)
    last = add_arm(spec, config, meets_itself=False, friction=config.friction)
    hold(spec, last, body, contype=BOARD_BIT, conaffinity=BOARD_BIT)
    return spec.compile()


def free_model(body: Body, config: ArmConfig, step: float) -> mujoco.MjModel:
    """The simulated world while the body is free; the body can collide with the arm."""
    spec = world_of(body, step)
    spec.geom(body.name).conaffinity = BOARD_BIT | ARM_BIT
    add_arm(spec, config, meets_itself=False, friction=config.friction)
    return spec.compile()


def add_table(spec: mujoco.MjSpec, half_width: float, *, margin: float) -> None:
    """Adds a table of a half width [m] under the board; contacts with it come at the margin [m]."""
    half, thick = half_width, 0.02
    spec.worldbody.add_geom(
        name=TABLE,
        type=mujoco.mjtGeom.mjGEOM_BOX,
        pos=[0.0, 0.0, -thick],
        size=[half, half, thick],
        contype=BOARD_BIT,
        conaffinity=0,
        margin=margin,
    )


def add_arm(spec: mujoco.MjSpec, config: ArmConfig, *, meets_itself: bool, friction: float) -> Any:
    """Adds the arm to a world and returns its last link.

    Args:
        spec: specification of the world.
        config: configuration of the arm.
        meets_itself: whether its links collide with each other and the board; not needed in simulation, where the plan has
            been checked for collisions.
        friction: factor on the joints' dry friction.
    """
    spec.compiler.degree = False
    yaw = 0.5 * config.yaw
    parent = spec.worldbody.add_body(name="fr3_link0", pos=config.base, quat=[np.cos(yaw), 0.0, 0.0, np.sin(yaw)])
    _add_shapes(parent, 0, meets_itself)
    for joint in range(JOINTS):
        parent = _add_link(parent, joint, config, friction)
        _add_shapes(parent, joint + 1, meets_itself)
    flange = parent.add_body(name="gripper", pos=[0.0, 0.0, FLANGE])
    _give(flange, GRIPPER)
    flange.add_site(name=PAD, pos=[0.0, 0.0, GRIPPER_LENGTH])
    if meets_itself:
        spec.add_exclude(bodyname1="fr3_link3", bodyname2="fr3_link5")
    return parent


def _add_link(parent: Any, joint: int, config: ArmConfig, friction: float) -> Any:
    twist, length = LINK_TWISTS[joint], LINK_LENGTHS[joint]
    link = parent.add_body(
        name=f"fr3_link{joint + 1}",
        pos=[LINK_OFFSETS[joint], -length * np.sin(twist), length * np.cos(twist)],
        quat=[np.cos(0.5 * twist), np.sin(0.5 * twist), 0.0, 0.0],
    )
    link.add_joint(
        name=JOINT_NAMES[joint],
        type=mujoco.mjtJoint.mjJNT_HINGE,
        axis=[0.0, 0.0, 1.0],
        limited=mujoco.mjtLimited.mjLIMITED_TRUE,
        range=[config.limits.lowest[joint], config.limits.highest[joint]],
        armature=ROTOR_INERTIA[joint],
        frictionloss=friction * JOINT_FRICTION[joint],
    )
    _give(link, LINKS[joint])
    return link


def _give(link: Any, inertial: Inertial) -> None:
    link.mass, link.ipos, link.fullinertia = inertial.mass, inertial.centre, inertial.inertia
    link.explicitinertial = True


def _add_shapes(link: Any, number: int, meets_itself: bool) -> None:
    for place, (owner, ends, radius) in enumerate(SHAPES):
        if owner == number:
            lower = meets_itself and number <= 3
            link.add_geom(
                name=f"fr3_shape{place}",
                type=mujoco.mjtGeom.mjGEOM_CAPSULE,
                fromto=ends,
                size=[radius, 0.0, 0.0],
                contype=LOWER_BIT if lower else (0 if meets_itself else ARM_BIT),
                conaffinity=(BOARD_BIT | MEETS.get(number, 0)) if meets_itself and number else 0,
                mass=0.0,
            )


def hold(spec: mujoco.MjSpec, link: Any, body: Body, *, contype: int, conaffinity: int) -> None:
    """Adds the body to the last link; `put_into_gripper` sets its pose for each throw."""
    xx, xy, xz, _, yy, yz, _, _, zz = body.inertia.ravel()
    held = link.add_body(
        name=HELD, mass=body.mass, ipos=[0.0, 0.0, 0.0], fullinertia=[xx, yy, zz, xy, xz, yz], explicitinertial=True
    )
    if body.name not in [mesh.name for mesh in spec.meshes]:
        spec.add_mesh(name=body.name, uservert=body.vertices.ravel())
    held.add_geom(
        name=HELD, type=mujoco.mjtGeom.mjGEOM_MESH, meshname=body.name, contype=contype, conaffinity=conaffinity,
        friction=[body.friction, 0.0, 0.0], priority=1,
    )  # fmt: skip


def put_into_gripper(model: mujoco.MjModel, place: Array, orientation_wxyz: Array) -> None:
    """Sets the held body's position (3,) [m] and orientation wxyz (4,) in the last link's frame."""
    held = model.body(HELD)
    held.pos[:], held.quat[:] = place, orientation_wxyz
    mujoco.mj_setConst(model, mujoco.MjData(model))
