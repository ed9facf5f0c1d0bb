"""What a new user brings along: two objects of one's own, and recordings of their tosses with names of one's own.

MuJoCo throws the objects (`benchmarks.data.thrown_bodies`); a tracker with the noise of ContactNets' sees them at 150 Hz. A
motion capture system would record them so: PoseStamped on a topic of its own, or transforms on /tf, in a frame called
`mocap`, with the board's place in it on /tf_static.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.typesys import Stores, get_typestore

from benchmarks.data.thrown_bodies import ThrownBody, prism, release, thrown, uniform
from contact_curation.geometry import quaternions
from contact_curation.geometry.polytopes import box
from contact_curation.geometry.quaternions import Array
from contact_curation.motion.toss import NANOSECONDS
from contact_curation.storage.bags.writer import BagWriter

STORE = get_typestore(Stores.ROS2_JAZZY)
FRAME_NS, TAKEN = 6_666_667, 20
"""Between frames, and of so many simulated poses one is a frame."""

FIRST_S = 1_700_000_000
"""Stamp of the first frame [s]."""

BOARD = np.array([0.3, -0.2, 0.75, np.cos(0.3), 0.0, 0.0, np.sin(0.3)])
"""(7,) of the board in the frame of the motion capture system."""

NOISE = 2.2e-5, 4.2e-4
"""Of positions [m] and turns [rad]."""

WEDGE = uniform("wedge", [prism([(0.0, 0.0), (0.10, 0.0), (0.0, 0.06)], 0.08)], 900.0, 0.3)
SLED = uniform("sled", [box([0.05, 0.035, 0.02]).vertices], 800.0, 0.25)

SLED_URDF = """<?xml version="1.0"?>
<robot name="sled">
  <link name="sled">
    <inertial>
      <mass value="{mass:.9g}"/>
      <inertia ixx="{moments[0]:.9g}" iyy="{moments[1]:.9g}" izz="{moments[2]:.9g}" ixy="0" ixz="0" iyz="0"/>
    </inertial>
    <collision><geometry><box size="0.1 0.07 0.04"/></geometry></collision>
  </link>
</robot>
"""


@dataclass(frozen=True)
class Own:
    """A user's object and recording.

    Attributes:
        words: options that say what was thrown.
        bag: its recording.
        poses: options that say where its poses are.
    """

    words: tuple[str, ...]
    bag: Path
    poses: tuple[str, ...]


def wedge_yaml(**changes: object) -> str:
    """A description of the wedge by hand."""
    body = WEDGE.body
    keys = {
        "name": "wedge",
        "mass": body.mass,
        "inertia": body.inertia.tolist(),
        "friction": body.friction,
        "length_scale": body.length_scale,
        "vertices": body.vertices.tolist(),
    }
    return "".join(f"{name}: {value}\n" for name, value in {**keys, **changes}.items() if value is not None)


def own_wedge(folder: Path, tosses: int) -> Own:
    """The wedge as YAML, its poses as PoseStamped."""
    (folder / "wedge.yaml").write_text(wedge_yaml())
    write_stamped(folder / "wedge.mcap", session(WEDGE, tosses), "wedge")
    poses = ("--topic", "/mocap/wedge/pose", "--board-frame", "table")
    return Own(("--body", str(folder / "wedge.yaml")), folder / "wedge.mcap", poses)


def own_sled(folder: Path, tosses: int) -> Own:
    """The sled as URDF, its poses on /tf."""
    body = SLED.body
    (folder / "sled.urdf").write_text(SLED_URDF.format(mass=body.mass, moments=np.diag(body.inertia)))
    write_transforms(folder / "sled.mcap", session(SLED, tosses, seed=1), "sled")
    poses = ("--topic", "/tf", "--body-frame", "sled", "--board-frame", "table")
    return Own(("--body", str(folder / "sled.urdf"), "--friction", "0.25"), folder / "sled.mcap", poses)


def session(piece: ThrownBody, tosses: int, seed: int = 0) -> Array:
    """(T, 7) poses on the board as a tracker sees them, of tosses one after the other."""
    rng = np.random.default_rng(seed)
    motions: list[Array] = []
    while len(motions) < tosses:
        motion = thrown(piece, release(piece.body, rng))
        if motion is not None:  # it came to rest
            motions.append(motion[::TAKEN])
    poses = np.concatenate(motions)
    poses[:, :3] += NOISE[0] * rng.standard_normal((len(poses), 3))
    poses[:, 3:] = quaternions.multiply(poses[:, 3:], quaternions.exp(NOISE[1] * rng.standard_normal((len(poses), 3))))
    return poses


def write_stamped(
    path: Path,
    poses: Array,
    name: str,
    *,
    board: Array | None = BOARD,
    frame: str = "mocap",
    first_s: int = FIRST_S,
) -> Path:
    """A bag with PoseStamped on /mocap/NAME/pose."""
    kind = STORE.types["geometry_msgs/msg/PoseStamped"]

    def message(stamp_ns: int, row: list[float]) -> Any:
        return kind(_header(stamp_ns, frame), _pose(row))

    return _written(path, f"/mocap/{name}/pose", poses, board, message, first_s)


def write_transforms(path: Path, poses: Array, name: str, *, board: Array | None = BOARD) -> Path:
    """A bag with the body's frame on /tf."""
    message = STORE.types["tf2_msgs/msg/TFMessage"]
    return _written(path, "/tf", poses, board, lambda stamp, row: message([_transform(stamp, name, row)]))


def _written(
    path: Path,
    topic: str,
    poses: Array,
    board: Array | None,
    message: Callable[[int, list[float]], Any],
    first_s: int = FIRST_S,
) -> Path:
    first = first_s * NANOSECONDS
    if board is not None:
        turned = quaternions.multiply(np.tile(board[3:], (len(poses), 1)), poses[:, 3:])
        poses = np.concatenate([board[:3] + quaternions.rotate(board[3:], poses[:, :3]), turned], axis=1)
    with BagWriter(path, STORE) as bag:
        if board is not None:
            static = STORE.types["tf2_msgs/msg/TFMessage"]([_transform(0, "table", board.tolist())])
            bag.write("/tf_static", static, first, latched=True)
        for number, row in enumerate(poses.tolist()):
            stamp = first + number * FRAME_NS
            bag.write(topic, message(stamp, row), stamp + 3_000_000)
    return path


def _header(stamp_ns: int, frame: str) -> Any:
    time = STORE.types["builtin_interfaces/msg/Time"](*divmod(stamp_ns, NANOSECONDS))
    return STORE.types["std_msgs/msg/Header"](time, frame)


def _quaternion(row: list[float]) -> Any:
    w, x, y, z = row[3:]
    return STORE.types["geometry_msgs/msg/Quaternion"](x, y, z, w)


def _pose(row: list[float]) -> Any:
    return STORE.types["geometry_msgs/msg/Pose"](STORE.types["geometry_msgs/msg/Point"](*row[:3]), _quaternion(row))


def _transform(stamp_ns: int, child: str, row: list[float]) -> Any:
    vector = STORE.types["geometry_msgs/msg/Vector3"](*row[:3])
    transform = STORE.types["geometry_msgs/msg/Transform"](vector, _quaternion(row))
    return STORE.types["geometry_msgs/msg/TransformStamped"](_header(stamp_ns, "mocap"), child, transform)
