"""An arm known by its description alone: a URDF or MJCF file, the limits that such files lack, and the gripper on its flange.

Files give kinematics, masses, shapes, and ranges of the joints; a URDF also speeds and torques. Neither has accelerations;
the arm's manual or MoveIt's `joint_limits.yaml` has them. Joints that are not named (fingers) are held still. The gripper is a
capsule along the z axis of the flange, with the pad at its end, or shorter than its radius where the file holds the gripper.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import mujoco
import numpy as np

from contact_curation.contact.body import Body
from contact_curation.contact.body_values import STANDARD_GRAVITY
from contact_curation.errors import InvalidValueError, UnknownNameError, UnreadableInputError
from contact_curation.files import read_yaml
from contact_curation.geometry.numbers import number, numbers
from contact_curation.geometry.quaternions import Array
from contact_curation.geometry.solids.xml_file import referenced
from contact_curation.simulation.arm.kinematics import Postures, about_z
from contact_curation.simulation.arm.limits import JointLimits
from contact_curation.simulation.arm.model import ARM_BIT, BOARD_BIT, BODY_BIT, LOWER_BIT, PAD, PREFIX, add_table, hold
from contact_curation.simulation.world import world_of

NO_LIMIT = 1e9
"""Of torques and their rates, where nothing is known."""

LARGEST_FILE = 1 << 16
"""[bytes]"""

POSITIVE, AT_LEAST_0 = ("table_half_width",), ("gripper_length", "gripper_radius", "gripper_mass", "clearance")
"""Fields with one number."""

SMALLEST = 1e-6
"""Half size of a shape [m]: MuJoCo accepts no smaller ones."""

WRIST = 3
"""So many last joints move the wrist; of the links before it the second half may be hit by the body."""


@dataclass(frozen=True)
class DescribedArmConfig:
    """Which arm it is and where it stands. Lists of numbers have one for each joint.

    Attributes:
        description: path of a URDF or MJCF file.
        joints: names of its joints, from the base on.
        flange: name of the link that carries the gripper.
        base: position of the base in the board's frame [m].
        yaw: direction that the arm faces, from the board's x axis [rad].
        home: posture between throws [rad].
        speed: speed limits [rad/s]; empty: those of the URDF.
        acceleration: acceleration limits [rad/s^2].
        torque: torque limits [N m]; empty: those of the URDF, or none.
        gripper_length: from the flange to the pad, along the flange's z axis [m].
        gripper_radius: radius of the gripper's shape [m].
        gripper_mass: mass of the gripper [kg].
        obstacles: boxes that nothing may touch, such as a stand; six numbers each, centre and half sizes [m].
        table_half_width: half the width of the table under the board, in x and y [m].
        clearance: planned distance between moving parts and the table or the arm [m].
        margin: share of the limits of speed, acceleration and torque that plans use.
    """

    description: str = ""
    joints: tuple[str, ...] = ()
    flange: str = "tool0"
    base: tuple[float, float, float] = (-0.307, -0.5, 0.0)
    yaw: float = float(np.pi / 2.0)
    home: tuple[float, ...] = ()
    speed: tuple[float, ...] = ()
    acceleration: tuple[float, ...] = ()
    torque: tuple[float, ...] = ()
    gripper_length: float = 0.1
    gripper_radius: float = 0.02
    gripper_mass: float = 0.5
    obstacles: tuple[float, ...] = ()
    table_half_width: float = 0.38
    clearance: float = 0.008
    margin: float = 0.95

    def __post_init__(self) -> None:
        for name in ("base", "home", "speed", "acceleration", "torque", "obstacles"):
            object.__setattr__(self, name, tuple(numbers(f"arm.{name}", getattr(self, name)).ravel().tolist()))
        for name in ("yaw", *POSITIVE, *AT_LEAST_0, "margin"):
            object.__setattr__(self, name, number(f"arm.{name}", getattr(self, name)))
        count = len(self.joints)
        if not self.description:
            raise InvalidValueError("arm.description", "nothing", "the path of a URDF or MJCF file")
        if count < 6:
            raise InvalidValueError("arm.joints", f"{count} names", "those of 6 or more joints, from the base on")
        for name, may_be_empty in (("home", False), ("speed", True), ("acceleration", False), ("torque", True)):
            values = getattr(self, name)
            if (values or not may_be_empty) and (len(values) != count or not np.isfinite(values).all()):
                raise InvalidValueError(f"arm.{name}", values or "nothing", f"{count} numbers, one for each joint")
        for name in ("speed", "acceleration", "torque"):
            if any(value <= 0.0 for value in getattr(self, name)):
                raise InvalidValueError(f"arm.{name}", getattr(self, name), "positive numbers")
        for names, least, expected in ((POSITIVE, SMALLEST, "a positive number"), (AT_LEAST_0, 0.0, "0 or more")):
            for name in names:
                if not (np.isfinite(getattr(self, name)) and getattr(self, name) >= least):
                    raise InvalidValueError(f"arm.{name}", getattr(self, name), expected)
        if len(self.obstacles) % 6 or not np.isfinite(self.obstacles).all():
            raise InvalidValueError("arm.obstacles", f"{len(self.obstacles)} numbers", "six finite ones for each box")
        halves = np.reshape(self.obstacles, (-1, 6))[:, 3:]
        if (halves < SMALLEST).any():
            raise InvalidValueError(
                "arm.obstacles", f"a half size of {halves.min():g} m", "three positive half sizes for each box"
            )
        if np.shape(self.base) != (3,) or not np.isfinite([*self.base, self.yaw]).all():
            raise InvalidValueError("arm.base, arm.yaw", (self.base, self.yaw), "a position and an angle, finite")
        if not 0.0 < self.margin <= 1.0:
            raise InvalidValueError("arm.margin", self.margin, "a share in (0, 1]")


def read_arm(path: Path) -> DescribedArmConfig:
    """Reads a YAML file with the fields of `DescribedArmConfig`; a relative `description` is looked for beside it.

    Raises:
        UnreadableInputError: the file cannot be read, or a name is no text.
        UnknownNameError: a key is none of the fields.
        InvalidValueError: a value is missing or not accepted.
    """
    found = read_yaml(path, LARGEST_FILE, "an arm: a YAML mapping with the path of its description, its joints and limits")
    if not isinstance(found, dict):
        raise UnreadableInputError(path, "found no mapping, expected one with the arm's description, joints and limits")
    known = DescribedArmConfig.__dataclass_fields__
    for key in found:
        if key not in known:
            raise UnknownNameError(f"{path.name}: key", str(key), list(known))
    values: dict[str, Any] = {key: tuple(value) if isinstance(value, list) else value for key, value in found.items()}
    joints = values.get("joints", ())
    texts = [values.get("description", ""), values.get("flange", ""), *(joints if isinstance(joints, tuple) else [None])]
    if not all(isinstance(text, str) for text in texts):
        raise UnreadableInputError(path, "a description, flange or joint that is no text, expected names and a path")
    if values.get("description"):
        values["description"] = str(path.parent / values["description"])
    return DescribedArmConfig(**values)


class DescribedArm:
    """An arm made of its description, as plans of throws need it.

    Args:
        config: which arm, and where.

    Raises:
        UnreadableInputError: the file cannot be read.
        InvalidValueError: a name or a limit is missing, or the arm does not stand upright.
    """

    def __init__(self, config: DescribedArmConfig) -> None:
        self.config = config
        self.base, self.yaw, self.margin, self.clearance = config.base, config.yaw, config.margin, config.clearance
        self.joint_names = tuple(PREFIX + name for name in config.joints)
        self.last_link = PREFIX + config.flange
        self.home_posture = np.array(config.home)
        self.limits = _limits(config, self._spec())
        if not ((self.limits.lowest <= self.home_posture) & (self.home_posture <= self.limits.highest)).all():
            raise InvalidValueError("arm.home", config.home, "positions within the joints' ranges [rad]")
        try:
            self._model = self.planning_model(None)
        except ValueError as error:
            raise _unusable(Path(config.description), error) from error
        self._data = mujoco.MjData(self._model)
        mujoco.mj_kinematics(self._model, self._data)
        upright = float(self._data.xaxis[self._model.joint(self.joint_names[0]).id][2])
        if upright < 1.0 - 1e-6:
            found = f"a first joint that is {np.degrees(np.arccos(np.clip(upright, -1.0, 1.0))):.1f} degrees off the vertical"
            raise InvalidValueError("arm", found, "an arm that stands upright and turns about the vertical")

    def postures(self, joints: Array) -> Postures:
        """What postures (N, J) give, in the frame of the base."""
        model, data, count = self._model, self._data, len(joints)
        site, back = model.site(PAD).id, about_z(np.array([-self.yaw]))[0]
        places, frames, jacobians = np.empty((count, 3)), np.empty((count, 3, 3)), np.empty((count, 6, model.nv))
        jacobian = np.zeros((6, model.nv))
        for row, posture in enumerate(joints):
            data.qpos[:] = posture
            mujoco.mj_kinematics(model, data)
            mujoco.mj_comPos(model, data)
            mujoco.mj_jacSite(model, data, jacobian[:3], jacobian[3:], site)
            places[row], frames[row], jacobians[row] = data.site_xpos[site], data.site_xmat[site].reshape(3, 3), jacobian
        jacobians = np.concatenate([back @ jacobians[:, :3], back @ jacobians[:, 3:]], axis=1)
        return Postures(np.asarray(joints), (places - self.base) @ back.T, back @ frames, jacobians)

    def planning_model(self, body: Body | None) -> mujoco.MjModel:
        """The arm over a table of its true size and among the obstacles, with the body in its gripper or with nothing."""
        world = mujoco.MjSpec()
        world.option.gravity = [0.0, 0.0, -(body.gravity if body else STANDARD_GRAVITY)]
        add_table(world, self.config.table_half_width, margin=self.clearance)
        for row, box in enumerate(np.reshape(self.config.obstacles, (-1, 6))):
            world.worldbody.add_geom(
                name=f"obstacle {row + 1}", type=mujoco.mjtGeom.mjGEOM_BOX, pos=box[:3], size=box[3:],
                contype=BOARD_BIT, conaffinity=0, margin=self.clearance,
            )  # fmt: skip
        flange = self._stand(world, meets_itself=True)
        if body is not None:
            hold(world, flange, body, contype=BODY_BIT, conaffinity=BOARD_BIT | LOWER_BIT)
        return world.compile()

    def free_world(self, body: Body, step: float) -> mujoco.MjModel:
        """The arm and a free body over the board."""
        world = world_of(body, step)
        world.geom(body.name).conaffinity = BOARD_BIT | ARM_BIT
        self._stand(world, meets_itself=False)
        return world.compile()

    def _spec(self) -> mujoco.MjSpec:
        """The description, with the named joints alone and without anything that moves them."""
        path = Path(self.config.description)
        try:
            spec = mujoco.MjSpec.from_file(str(path))
        except (ValueError, OSError) as error:
            raise _unusable(path, error) from error
        for mesh in spec.meshes:
            if "://" in mesh.file:
                mesh.file = str(referenced(path, mesh.file).absolute())
        spec.compiler.fusestatic = False
        for part in (*spec.actuators, *spec.sensors, *spec.keys, *spec.equalities, *spec.tendons, *spec.excludes, *spec.pairs):
            spec.delete(part)
        for joint in list(spec.joints):
            if joint.name not in self.config.joints:
                spec.delete(joint)
        found = [joint.name for joint in spec.joints]
        if found != list(self.config.joints):
            missing = sorted(set(self.config.joints) - set(found))
            raise InvalidValueError("arm.joints", f"{', '.join(missing)} not in {path.name}" if missing else "another order",
                                    f"joints of the file in its order: {', '.join(found)}")  # fmt: skip
        if spec.body(self.config.flange) is None:
            names = ", ".join(body.name for body in spec.bodies if body.name not in ("", "world"))
            raise InvalidValueError("arm.flange", self.config.flange, f"a link of {path.name}: {names}")
        return spec

    def _stand(self, world: mujoco.MjSpec, *, meets_itself: bool) -> Any:
        """Puts the arm into a world and gives its flange."""
        spec, config = self._spec(), self.config
        depths = _joints_before(spec)
        for geom in spec.geoms:
            collides = bool(geom.contype or geom.conaffinity)
            geom.contype, geom.conaffinity, geom.margin = 0, 0, 0.0
            if collides:
                geom.contype, geom.conaffinity = _bits(depths[geom.parent.name], len(config.joints), meets_itself=meets_itself)
        flange = spec.body(config.flange)
        bits = _bits(len(config.joints), len(config.joints), meets_itself=meets_itself)
        short = config.gripper_length - 0.005  # the pad is soft
        if short > config.gripper_radius:
            flange.add_geom(
                type=mujoco.mjtGeom.mjGEOM_CAPSULE, fromto=[0.0, 0.0, 0.0, 0.0, 0.0, short - config.gripper_radius],
                size=[config.gripper_radius, 0.0, 0.0], mass=config.gripper_mass, contype=bits[0], conaffinity=bits[1],
            )  # fmt: skip
        half = 0.5 * self.yaw
        frame = world.worldbody.add_frame(pos=config.base, quat=[np.cos(half), 0.0, 0.0, np.sin(half)])
        world.compiler.degree = False
        world.attach(spec, frame=frame, prefix=PREFIX)
        flange = world.body(self.last_link)
        flange.add_site(name=PAD, pos=[0.0, 0.0, config.gripper_length])
        return flange


def _unusable(path: Path, error: Exception) -> UnreadableInputError:
    """That MuJoCo cannot read a description, or a mesh that it names."""
    return UnreadableInputError(path, f"no URDF or MJCF file that MuJoCo reads ({' '.join(str(error).split())[:200]})")


def _joints_before(spec: mujoco.MjSpec) -> dict[str, int]:
    """For each link how many joints lie between it and the base."""
    depths: dict[str, int] = {"world": 0}
    for body in spec.bodies:
        if body.name != "world":
            depths[body.name] = depths[body.parent.name] + len(body.joints)
    return depths


def _bits(depth: int, count: int, *, meets_itself: bool) -> tuple[int, int]:
    """What a link after so many of all joints may hit: contype and conaffinity."""
    if not meets_itself:
        return ARM_BIT, 0
    lower = depth <= count - WRIST - 1
    if depth == 0:
        return LOWER_BIT, 0
    if lower:
        return LOWER_BIT, BOARD_BIT
    return 0, BOARD_BIT | (LOWER_BIT if depth > count - WRIST + 1 else 0) | (BODY_BIT if depth < count - 1 else 0)


def _limits(config: DescribedArmConfig, spec: mujoco.MjSpec) -> JointLimits:
    """Ranges of the file, and the other limits of the configuration or of the URDF."""
    joints = [spec.joint(name) for name in config.joints]
    count, urdf = len(joints), _urdf_limits(Path(config.description))
    factor = np.pi / 180.0 if spec.compiler.degree else 1.0
    ranges = np.array([joint.range for joint in joints]) * factor
    for name, (lowest, highest) in zip(config.joints, ranges):
        if not lowest < highest:
            raise InvalidValueError(f"range of {name}", f"{lowest:g} to {highest:g}", "a range in the description [rad]")
    speed = config.speed or tuple(urdf.get(name, {}).get("velocity", 0.0) for name in config.joints)
    if min(speed) <= 0.0:
        raise InvalidValueError("arm.speed", "nothing", f"{count} numbers: {Path(config.description).name} has no speed limits")
    torque = config.torque or tuple(urdf.get(name, {}).get("effort", 0.0) or NO_LIMIT for name in config.joints)
    acceleration = np.array(config.acceleration)
    return JointLimits(
        ranges[:, 0], ranges[:, 1], np.array(speed), acceleration, np.array(torque), np.full(count, NO_LIMIT),
        acceleration, np.zeros(count), ranges[:, 0], ranges[:, 1],
    )  # fmt: skip


def _urdf_limits(path: Path) -> dict[str, dict[str, float]]:
    """Per joint the attributes of its limit; nothing for a file that is no URDF."""
    root = ElementTree.parse(path).getroot()
    limits = ((joint.get("name", ""), joint.find("limit")) for joint in root.findall("joint"))
    return {name: {key: float(value) for key, value in limit.items()} for name, limit in limits if limit is not None}
