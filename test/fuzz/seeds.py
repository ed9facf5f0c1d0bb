"""The corpora: a few small sound inputs for each target, out of the package's own writers and the tests'.

python -m test.fuzz.seeds          writes test/fuzz/corpus
"""

import json
import shutil
import struct
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import torch
from rclpy.serialization import serialize_message
from rosbags.rosbag2 import StoragePlugin

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.models.polytope import PolytopeModel
from contact_curation.contact.parameter_form import Form
from contact_curation.design.throw import Throw
from contact_curation.information.record import TossInformation
from contact_curation.learning.checkpoints.stored_model import model_bytes
from contact_curation.learning.checkpoints.theta_bytes import bytes_of_geometry
from contact_curation.nodes.messages.headers import Stamped
from contact_curation.nodes.messages.model_parameters import model_message
from contact_curation.nodes.messages.throw import throw_message
from contact_curation.nodes.messages.toss import toss_message
from contact_curation.nodes.messages.toss_information import information_message
from contact_curation.storage.throws_file import write_throws
from test.conftest import REPOSITORY
from test.storage import stored_records, written_bags

FOLDER = Path(__file__).parent / "corpus"
CONFIG = REPOSITORY / "contact_curation" / "config"
PREVIOUS = REPOSITORY / "test" / "storage" / "previous_release"

TAGSLAM = """
bodies:
  - table: {is_static: true, type: board, board: {tag_rows: 2, tag_columns: 2, tag_size: 0.05, tag_spacing: 0.2,
      tag_start_id: 10, pose: {position: {x: 0, y: 0, z: 0}, rotation: {x: 0, y: 0, z: 0}}}}
  - cube: {is_static: false, type: simple, tags: [{id: 1, size: 0.05, pose: {position: {x: 0, y: 0, z: 0.05},
      rotation: {x: 0.1, y: 0, z: 0}}}]}
"""
URDF = """<robot name="r"><link name="brick"><inertial><origin xyz="0 0 0" rpy="0 0 0.1"/><mass value="0.3"/>
<inertia ixx="1e-4" iyy="1e-4" izz="1e-4" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><origin xyz="0 0 0"/><geometry><{shape}/></geometry></collision></link></robot>"""
MJCF = """<mujoco><compiler angle="radian"/><default><geom density="500"/></default><worldbody><body name="b"><freejoint/>
<inertial pos="0 0 0" mass="0.2" diaginertia="1e-4 1e-4 1e-4"/><geom type="{kind}" size="{size}" euler="0 0.1 0"/></body>
</worldbody></mujoco>"""
BODY = """name: brick
mass: 0.37
inertia: [[8.1e-4, 0, 0], [0, 8.1e-4, 0], [0, 0, 8.1e-4]]
friction: 0.18
length_scale: 0.0524
half_extents: [0.05, 0.04, 0.03]
gravity: 9.81
center_of_mass: [0, 0, 0.001]
"""
POSES = (
    "# timestamp tx ty tz qx qy qz qw\n1.00 0 0 1 0 0 0 1\n1.01 0 0 0.9 0 0 0 1\n",
    "sec,nanosec,pose.position.x,p.y,p.z,q.w,q.x,q.y,q.z,frame\n1,5,0,0,1,1,0,0,0,map\n1,10000005,,,,,,,,map\n",
    ",,Rotation,Rotation,Rotation,Rotation,Position,Position,Position\nFrame,Time [ms],X,Y,Z,W,X [mm],Y,Z\n0,0,0,0,0,1,0,0,1\n",
    "t;x;y;z;qw;qx;qy;qz\n0,5;0,1;0;1;1;0;0;0\n0,51;0,1;0;1;1;0;0;0\n",
    "t,x,y,z,roll,pitch,yaw\n0.5,0,0,1,10,0,-20\n0.51,0,0,1,10,0,-20\n",
    "date,time,x,y,z,r11,r12,r13,r21,r22,r23,r31,r32,r33\n2026-11-28,10:00:00.5,0,0,1,1,0,0,0,1,0,0,0,1\n",
)
CORNERS = ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1))
FACES = ((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3))


def _meshes() -> Iterator[bytes]:
    triangles = [[CORNERS[k] for k in face] for face in FACES]
    binary = b"\0" * 80 + struct.pack("<I", len(FACES))
    for three in triangles:
        binary += struct.pack("<12fH", *(0.0,) * 3, *(float(x) for corner in three for x in corner), 0)
    yield b"\0" + binary
    facets = "".join(
        "facet normal 0 0 0\nouter loop\n" + "".join(f"vertex {x} {y} {z}\n" for x, y, z in three) + "endloop\nendfacet\n"
        for three in triangles
    )
    yield b"\0" + f"solid t\n{facets}endsolid t\n".encode()
    points = "".join(f"v {x} {y} {z}\n" for x, y, z in CORNERS)
    yield b"\1" + (points + "".join(f"f {a + 1} {b + 1} {c + 1}\n" for a, b, c in FACES)).encode()
    rows = "".join(f"{x} {y} {z}\n" for x, y, z in CORNERS) + "".join(f"3 {a} {b} {c}\n" for a, b, c in FACES)
    head = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
    yield b"\2" + (head + "element face 4\nproperty list uchar int vertex_indices\nend_header\n" + rows).encode()
    yield b"\3" + ("OFF\n4 4 6\n" + rows).encode()


def _bags(folder: Path) -> Iterator[tuple[str, bytes]]:
    sent = written_bags.recording(3)
    yield "mcap", written_bags.write_ours(folder / "ours.mcap", sent).read_bytes()
    yield "mcap", written_bags.write_mcap(folder / "theirs.mcap", sent).read_bytes()
    database = written_bags.write_rosbag2(folder / "two", sent, StoragePlugin.SQLITE3)
    yield "sqlite", next(database.glob("*.db3")).read_bytes()
    for compression in ("none", "lz4", "bz2"):
        sent_1 = written_bags.recording(3, written_bags.NOETIC)
        yield "ros1", written_bags.write_ros1(folder / f"{compression}.bag", sent_1, compression).read_bytes()


def _messages() -> Iterator[bytes]:
    stamped, model = (
        Stamped(1, "board"),
        PolytopeModel(ContactGeometry.of_body(CONTACTNETS_CUBE), CONTACTNETS_CUBE, Form.PHYSICAL),
    )
    information: TossInformation = stored_records.information(1)
    throw = Throw.from_mapping(json.loads((PREVIOUS / "throws.json").read_text(encoding="utf-8"))["throws"][0])
    yield b"\0" + bytes(serialize_message(toss_message(stored_records.toss(1), 1, "board")))
    yield b"\1" + bytes(serialize_message(information_message(information, 1, stamped)))
    yield b"\2" + bytes(serialize_message(model_message(model, "a", 1, stamped)))
    yield b"\3" + bytes(serialize_message(throw_message(throw, stamped)))


def seeds(folder: Path) -> Iterator[tuple[str, bytes]]:
    """Targets and inputs; the folder is for files on the way."""
    yield from _bags(folder)
    yield "body", (CONFIG / "cube.yaml").read_bytes()
    yield "body", BODY.encode()
    for shape in ('box size="0.1 0.1 0.1"', 'cylinder radius="0.1" length="0.1"', 'sphere radius="0.1"'):
        yield "urdf", URDF.replace("{shape}", shape).encode()
    for kind, size in (("box", "0.1 0.1 0.1"), ("capsule", "0.1 0.1"), ("ellipsoid", "0.1 0.2 0.1")):
        yield "mjcf", MJCF.replace("{kind}", kind).replace("{size}", size).encode()
    yield from (("mesh", one) for one in _meshes())
    yield "tag_map", (CONFIG / "cube_tags.yaml").read_bytes()
    yield "tag_map", TAGSLAM.encode()
    geometry = ContactGeometry.of_body(CONTACTNETS_CUBE)
    yield "theta", bytes_of_geometry(geometry)
    yield "theta", bytes_of_geometry(replace(geometry, pivot=np.ones(3), height=0.1))
    yield "checkpoint", (PREVIOUS / "model.safetensors").read_bytes()
    yield "checkpoint", model_bytes(PolytopeModel(geometry, CONTACTNETS_CUBE, Form.PHYSICAL))
    head = json.dumps(json.loads((PREVIOUS / "manifest.json").read_text(encoding="utf-8"))).encode()
    yield "manifest", b"\1" + head
    yield "manifest", b"\2" + (PREVIOUS / "manifest.parquet").read_bytes()
    yield "manifest", b"\0" + (PREVIOUS / "manifest.csv").read_bytes()
    throw = Throw.from_mapping(json.loads((PREVIOUS / "throws.json").read_text(encoding="utf-8"))["throws"][0])
    write_throws(folder / "throws.json", [throw], CONTACTNETS_CUBE)
    yield "throws", (folder / "throws.json").read_bytes()
    torch.save(torch.arange(4.0 * 19, dtype=torch.float64).reshape(1, 4, 19) / 40.0, folder / "1.pt")
    yield "pt", (folder / "1.pt").read_bytes()
    yield from (("poses", one.encode()) for one in POSES)
    names = ("vertices_normal", "normal", "vertices_tangent", "tangents")
    yield "parameters", json.dumps({name: getattr(geometry, name).tolist() for name in names}).encode()
    yield "node_parameters", (CONFIG / "nodes.yaml").read_bytes()[:4000]
    yield from (("messages", one) for one in _messages())


def main() -> None:
    """Writes them anew."""
    shutil.rmtree(FOLDER, ignore_errors=True)
    with TemporaryDirectory() as name:
        for target, data in seeds(Path(name)):
            folder = FOLDER / target
            folder.mkdir(parents=True, exist_ok=True)
            (folder / f"{len(list(folder.iterdir()))}").write_bytes(data)


if __name__ == "__main__":
    main()
