"""A body that is written and read again is the same body, in MuJoCo, too; what a format has no place for is said."""

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
import trimesh
from scipy.spatial import ConvexHull

import contact_curation as cc
from contact_curation.contact.body import CONTACTNETS_CUBE, Body
from contact_curation.contact.body_description import BodyOptions, read_description
from contact_curation.errors import ContactCurationError, InvalidValueError
from contact_curation.geometry import quaternions
from contact_curation.geometry.quaternions import Array
from contact_curation.simulation.world import free_motion

FRAME_PERIOD, FRAMES = 0.005, 200
STEP, CONTACT_TIME = 0.001, 0.006


def irregular_body() -> Body:
    """Of a hull without symmetry, with a full inertia and its centre of mass beside the tracked frame's origin."""
    rng = np.random.default_rng(7)
    half = rng.standard_normal((6, 3))
    half /= np.linalg.norm(half, axis=1, keepdims=True)
    vertices = np.vstack([half, -0.8 * half]) * [0.05, 0.04, 0.03] + [0.004, -0.002, 0.003]
    turn = quaternions.to_matrix(quaternions.normalized(np.array([0.8, 0.3, -0.4, 0.2])))
    inertia = turn @ np.diag([1.1e-4, 1.6e-4, 2.1e-4]) @ turn.T
    center = np.array([0.011, -0.007, 0.023])
    return Body("rock_2", vertices, 0.21, 0.5 * (inertia + inertia.T), 0.31, 0.0333, center_of_mass=center)


BODIES = [CONTACTNETS_CUBE, irregular_body()]
each_body = pytest.mark.parametrize("body", BODIES, ids=lambda body: str(body.name))


def in_order(vertices: Array) -> Array:
    return vertices[np.lexsort(np.round(vertices, 9).T)]


@each_body
@pytest.mark.parametrize("ending", [".xml", ".urdf", ".yaml"])
def test_a_written_body_is_read_as_the_same(body: Body, ending: str, tmp_path: Path) -> None:
    path = tmp_path / f"my object{ending}"
    cc.write_body(path, body)
    read = Body.from_file(path, length_scale=None if ending == ".yaml" else body.length_scale)
    np.testing.assert_allclose(in_order(read.vertices), in_order(body.vertices), rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(read.inertia, body.inertia, rtol=1e-12, atol=0.0)
    np.testing.assert_array_equal(read.center_of_mass, body.center_of_mass)
    for name in ("name", "mass", "friction", "length_scale", "gravity"):
        assert getattr(read, name) == getattr(body, name)


def world_with(path: Path, body_name: str) -> mujoco.MjModel:
    """The world of `free_motion`, in which a file's body is."""
    spec = mujoco.MjSpec.from_file(str(path))
    spec.option.timestep, spec.option.cone = STEP, mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0.0, 0.0, 1.0])
    spec.geom(body_name).solref = [CONTACT_TIME, 1.0]
    return spec.compile()


def moved(model: mujoco.MjModel, release: Array) -> Array:
    """Places of the centre of mass and orientations (FRAMES, 7) after a release at the centre of mass."""
    data, center = mujoco.MjData(model), model.body_ipos[1]
    rotation = quaternions.to_matrix(release[3:7])
    data.qpos[:] = [*(release[:3] - rotation @ center), *release[3:7]]
    data.qvel[:] = [*(release[7:10] - rotation @ np.cross(release[10:], center)), *release[10:]]
    states = [release[:7]]
    for _ in range(FRAMES - 1):
        mujoco.mj_step(model, data, round(FRAME_PERIOD / STEP))
        mujoco.mj_kinematics(model, data)
        states.append(np.array([*data.xipos[1], *data.qpos[3:7]]))
    return np.array(states)


@each_body
def test_mujoco_moves_a_written_body_as_the_simulated_world_does(body: Body, tmp_path: Path) -> None:
    cc.write_body(tmp_path / "body.xml", body)
    model = world_with(tmp_path / "body.xml", body.name)
    assert model.body_mass[1] == body.mass
    np.testing.assert_allclose(np.sort(model.body_inertia[1]), np.linalg.eigvalsh(body.inertia), rtol=1e-9)
    np.testing.assert_array_equal(model.body_ipos[1], body.center_of_mass)
    release = np.array([0.0, 0.0, 0.12, 0.9, 0.3, 0.3, 0.1, 0.5, -0.2, 0.0, 3.0, -2.0, 1.0])
    release[3:7] /= np.linalg.norm(release[3:7])
    states, expected = moved(model, release), free_motion(body, release, FRAMES, FRAME_PERIOD)
    np.testing.assert_allclose(states[:30], expected[:30, :7], atol=2e-4)  # fall and first impact
    heights = [float(body.polytope.corner_heights(one[:3], one[3:7]).min()) for one in (states[-1], expected[-1, :7])]
    assert heights[0] == pytest.approx(heights[1], abs=1e-6)
    assert states[-1, 2] == pytest.approx(expected[-1, 2], abs=1e-6)


def test_the_friction_of_the_file_counts_against_any_ground(tmp_path: Path) -> None:
    cc.write_body(tmp_path / "cube.xml", CONTACTNETS_CUBE)
    spec = mujoco.MjSpec.from_file(str(tmp_path / "cube.xml"))
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0.0, 0.0, 1.0], friction=[1.0, 0.0, 0.0], condim=6)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert data.ncon == 4  # where the file puts it, it stands on the ground
    assert all(contact.dim == 3 and contact.friction[0] == CONTACTNETS_CUBE.friction for contact in data.contact)


@each_body
def test_mujocos_own_reader_of_urdf_finds_the_same_body(body: Body, tmp_path: Path) -> None:
    cc.write_body(tmp_path / "body.urdf", body)
    spec = mujoco.MjSpec.from_file(str(tmp_path / "body.urdf"))
    spec.compiler.fusestatic = False
    model = spec.compile()
    assert model.body_mass[1] == pytest.approx(body.mass)
    np.testing.assert_allclose(np.sort(model.body_inertia[1]), np.linalg.eigvalsh(body.inertia), rtol=1e-6)
    np.testing.assert_allclose(model.body_ipos[1], body.center_of_mass, atol=1e-9)
    vertices = model.mesh_vert @ quaternions.to_matrix(model.geom_quat[0]).T + model.geom_pos[0]
    expected = body.tracked_polytope.vertices
    assert np.linalg.norm(vertices[:, np.newaxis] - expected, axis=2).min(axis=0).max() < 1e-7


def test_a_mesh_beside_a_urdf_is_closed_and_faces_outwards(tmp_path: Path) -> None:
    body = irregular_body()
    cc.write_body(tmp_path / "rock.urdf", body)
    read = read_description(tmp_path / "rock.obj", BodyOptions(density=1000.0))
    assert not any("not closed" in note for note in read.notes)
    mesh = trimesh.load_mesh(tmp_path / "rock.obj")
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(ConvexHull(body.vertices).volume)  # negative where its faces look inwards


def test_what_a_format_has_no_place_for_is_a_note_and_a_comment(tmp_path: Path) -> None:
    body = replace(CONTACTNETS_CUBE, gravity=9.79)
    notes = {ending: cc.write_body(tmp_path / f"a{ending}", body, restitution=0.25) for ending in (".xml", ".urdf", ".yaml")}
    restitution = "restitution 0.25 is not in the file: the format has none"
    of_the_project = (
        "length scale 0.0524 m is not in the file: the format has none",
        "gravity 9.79 m/s^2 is not in the file: it is the world's",
        restitution,
    )
    assert notes[".xml"] == of_the_project
    assert notes[".urdf"][0].startswith("friction 0.18 is in the extensions")
    assert (notes[".urdf"][1:], notes[".yaml"]) == (of_the_project, (restitution,))
    for ending, lines in notes.items():
        assert all(line in (tmp_path / f"a{ending}").read_text() for line in lines)


def test_vertices_within_the_hull_are_left_out_and_counted(tmp_path: Path) -> None:
    vertices = np.vstack([CONTACTNETS_CUBE.vertices, [[0.01, 0.0, 0.0]], CONTACTNETS_CUBE.vertices[:1]])
    (note,) = cc.write_body(tmp_path / "a.yaml", replace(CONTACTNETS_CUBE, vertices=vertices))
    assert note == "2 of 10 vertices are left out: they are within the hull and touch nothing"
    assert len(Body.from_file(tmp_path / "a.yaml").vertices) == 8


@pytest.mark.parametrize(("written", "changed"), [("a.xml",) * 2, ("a.urdf",) * 2, ("a.urdf", "a.obj"), ("a.yaml",) * 2])
def test_only_a_file_that_was_not_edited_is_replaced(written: str, changed: str, tmp_path: Path) -> None:
    path, edited = tmp_path / written, tmp_path / changed
    cc.write_body(path, CONTACTNETS_CUBE)
    cc.write_body(path, irregular_body())
    edited.write_bytes(edited.read_bytes().replace(b"0.0", b"0.1", 1))
    before = {one: one.read_bytes() for one in tmp_path.iterdir()}
    with pytest.raises(InvalidValueError, match=f"found a file at {edited}, expected a new name, or overwrite=True"):
        cc.write_body(path, CONTACTNETS_CUBE)
    assert {one: one.read_bytes() for one in tmp_path.iterdir()} == before
    cc.write_body(path, CONTACTNETS_CUBE, overwrite=True)


def test_another_ending_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InvalidValueError, match=r"a\.sdf, expected a file ending in \.xml, \.urdf, \.yaml"):
        cc.write_body(tmp_path / "a.sdf", CONTACTNETS_CUBE)


@pytest.mark.parametrize(
    ("mesh", "line"),
    [
        ('vertex="0 0 0 1 0 0 0 1 0"', "vertex of <mesh>: found '0 0 0 1 0 0 0 1 0', expected 12 numbers"),
        ('vertex="0 0 0 1 0 0 0 1 0 1 1 0"', "found all points in one plane"),
        ('vertex="0 0 0 1 0 0 0 1 0 0 0 1e9"', "found coordinates that are no lengths"),
        ('vertex="0 0 0 1 0 0 0 1 0 0 0 1" face="0 1 2"', "found mesh m with faces or without a file"),
    ],
)
def test_vertices_of_an_mjcf_that_are_no_body_are_one_line(mesh: str, line: str, tmp_path: Path) -> None:
    path = tmp_path / "a.xml"
    body = '<body name="b"><geom type="mesh" mesh="m"/></body>'
    path.write_text(f'<mujoco><asset><mesh name="m" {mesh}/></asset><worldbody>{body}</worldbody></mujoco>')
    with pytest.raises(ContactCurationError, match=line):
        Body.from_file(path)
