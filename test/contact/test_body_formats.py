"""One brick in every format is one body; what a file cannot be is one line that says what to do."""

import os
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from contact_curation.contact.body import Body
from contact_curation.contact.body_description import LARGEST_FILE, BodyOptions, plain_name, read_description
from contact_curation.errors import UnreadableInputError

HALF = np.array([0.03, 0.04, 0.06])
MASS, FRICTION = 0.3, 0.2
INERTIA = MASS / 3.0 * (HALF @ HALF - HALF**2)
CENTER = np.array([0.01, -0.02, 0.05])
"""Of mass, in the frame of the file."""

TRIANGLES = (
    (0, 1, 3),
    (0, 3, 2),
    (4, 6, 7),
    (4, 7, 5),
    (0, 4, 5),
    (0, 5, 1),
    (2, 3, 7),
    (2, 7, 6),
    (0, 2, 6),
    (0, 6, 4),
    (1, 5, 7),
    (1, 7, 3),
)
"""Of a box whose corners are in binary order, outwards."""


def corners_mm(half: np.ndarray = HALF, center: np.ndarray = CENTER) -> np.ndarray:
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    return np.asarray(1000.0 * (center + half * signs))


def stl_text(corners: np.ndarray, triangles: tuple[tuple[int, ...], ...] = TRIANGLES) -> str:
    facets = [
        "facet normal 0 0 0\nouter loop\n"
        + "".join(f"vertex {x:.9g} {y:.9g} {z:.9g}\n" for x, y, z in corners[list(one)])
        + "endloop\nendfacet\n"
        for one in triangles
    ]
    return "solid brick\n" + "".join(facets) + "endsolid brick\n"


def stl_bytes(corners: np.ndarray) -> bytes:
    facets = [struct.pack("<12fH", 0, 0, 0, *corners[list(one)].ravel(), 0) for one in TRIANGLES]
    return bytes(80) + struct.pack("<I", len(facets)) + b"".join(facets)


def obj_text(corners: np.ndarray, triangles: tuple[tuple[int, ...], ...] = TRIANGLES) -> str:
    lines = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in corners]
    return (
        "mtllib ../secret.mtl\n" + "\n".join([*lines, *("f " + " ".join(str(k + 1) for k in one) for one in triangles)]) + "\n"
    )


def off_text(corners: np.ndarray) -> str:
    rows = [" ".join(f"{value:.9g}" for value in corner) for corner in corners]
    return "\n".join(["OFF", f"8 {len(TRIANGLES)} 0", *rows, *("3 " + " ".join(map(str, one)) for one in TRIANGLES)]) + "\n"


def ply_text(corners: np.ndarray) -> str:
    head = ["ply", "format ascii 1.0", "element vertex 8", *(f"property double {axis}" for axis in "xyz")]
    head += [f"element face {len(TRIANGLES)}", "property list uchar int vertex_indices", "end_header"]
    return "\n".join([*head, *off_text(corners).splitlines()[2:]]) + "\n"


URDF = """<robot name="brick"><link name="base_link">
  <inertial><origin xyz="0.01 -0.02 0.05" rpy="1.5707963267948966 0 0"/><mass value="0.3"/>
    <inertia ixx="{0}" iyy="{2}" izz="{1}" ixy="0" ixz="0" iyz="0"/></inertial>
  <collision><origin xyz="0.01 -0.02 0.05" rpy="0 0 1.5707963267948966"/>
    <geometry><box size="0.08 0.06 0.12"/></geometry></collision>
  <contact><lateral_friction value="0.2"/></contact>
</link></robot>"""

MJCF = """<mujoco><compiler angle="radian"/><default><geom friction="0.2"/></default>
  <worldbody><geom type="plane" size="1 1 1"/>
  <body name="brick" pos="0 0 1"><freejoint/>
    <geom type="box" size="0.04 0.03 0.06" pos="0.01 -0.02 0.05" euler="0 0 1.5707963267948966" mass="0.3"/>
  </body></worldbody></mujoco>"""


def urdf_with(geometry: str) -> bytes:
    link = f'<link name="b"><collision><geometry>{geometry}</geometry></collision></link>'
    return f'<robot name="a">{link}</robot>'.encode()


YAML = "name: brick\nmass: 0.3\nfriction: 0.2\n"


def brick_files(folder: Path) -> dict[str, Path]:
    """The brick, a file per format; meshes are in mm and described by a YAML file beside each."""
    written: dict[str, Path] = {}
    meshes: dict[str, str | bytes] = {
        "ascii.stl": stl_text(corners_mm()),
        "binary.stl": stl_bytes(corners_mm()),
        "brick.obj": obj_text(corners_mm()),
        "brick.ply": ply_text(corners_mm()),
        "brick.off": off_text(corners_mm()),
    }
    for name, content in meshes.items():
        (folder / name).write_bytes(content if isinstance(content, bytes) else content.encode())
        written[name] = folder / f"{name}.yaml"
        written[name].write_text(f"{YAML}mesh: {name}\nscale: 0.001\n")
    moments = [float(value) for value in INERTIA]
    listed = f"half_extents: {HALF.tolist()}\ninertia: {moments}\nlength_scale: {0.5 * np.cbrt(8.0 * HALF.prod())}\n"
    texts = {
        "brick.yaml": YAML + listed + f"center_of_mass: {CENTER.tolist()}\n",
        "brick.urdf": URDF.format(*moments),
        "brick.xml": MJCF,
    }
    for name, text in texts.items():
        written[name] = folder / name
        written[name].write_text(text)
    return written


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    return brick_files(tmp_path_factory.mktemp("bricks"))


@pytest.mark.parametrize(
    "name", ["brick.yaml", "brick.urdf", "brick.xml", "ascii.stl", "binary.stl", "brick.obj", "brick.ply", "brick.off"]
)
def test_every_format_gives_the_same_brick(files: dict[str, Path], name: str) -> None:
    body = Body.from_file(files[name])
    assert body.name == "brick"
    np.testing.assert_allclose(
        sorted(body.vertices.tolist()), sorted((corners_mm(center=np.zeros(3)) / 1e3).tolist()), atol=1e-9
    )
    np.testing.assert_allclose(body.inertia, np.diag(INERTIA), atol=1e-12)
    np.testing.assert_allclose(body.center_of_mass, CENTER, atol=1e-9)
    assert (body.mass, body.friction) == pytest.approx((MASS, FRICTION))
    assert body.length_scale == pytest.approx(0.5 * np.cbrt(8.0 * HALF.prod()), abs=1e-9)
    assert read_description(files[name]).warnings == ()


def test_a_mesh_alone_takes_its_mass_from_the_options(files: dict[str, Path]) -> None:
    mesh = files["binary.stl"].with_name("binary.stl")
    with pytest.raises(UnreadableInputError, match=r"mass: found none in the file, expected --mass KG or --density"):
        read_description(mesh, BodyOptions(scale=1e-3))
    by_mass = Body.from_file(mesh, scale=1e-3, mass=MASS, friction=FRICTION, name="brick")
    by_density = Body.from_file(mesh, scale=1e-3, density=MASS / (8.0 * HALF.prod()), friction=FRICTION)
    np.testing.assert_allclose(by_mass.inertia, by_density.inertia, rtol=1e-9)
    assert by_density.name == "binary"
    assert any("0.5 assumed" in line for line in read_description(mesh, BodyOptions(scale=1e-3, mass=MASS)).warnings)


def test_a_listed_shape_without_an_inertia_is_filled_evenly(tmp_path: Path) -> None:
    file, density = tmp_path / "listed.yaml", MASS / (8.0 * HALF.prod())
    file.write_text(f"name: brick\nhalf_extents: {HALF.tolist()}\nmass: {MASS}\nfriction: {FRICTION}\n")
    expected = MASS / 3.0 * (HALF @ HALF - HALF**2)
    np.testing.assert_allclose(Body.from_file(file).inertia, np.diag(expected), atol=1e-15)
    assert read_description(file).notes == (EVENLY.replace("geometry", "shape"),)
    assert Body.from_file(file, density=2.0 * density).mass == pytest.approx(2.0 * MASS, rel=1e-12)
    file.write_text(f"name: brick\nvertices: {(corners_mm(center=np.zeros(3)) / 1e3).tolist()}\ndensity: {density}\n")
    np.testing.assert_allclose(Body.from_file(file).inertia, np.diag(expected), atol=1e-12)
    assert Body.from_file(file, mass=2.0 * MASS).inertia == pytest.approx(2.0 * np.diag(expected), abs=1e-12)
    file.write_text(f"name: brick\nvertices: {(corners_mm() / 1e3).tolist()}\nmass: {MASS}\n")
    with pytest.raises(UnreadableInputError, match=r"vertices: found a shape whose middle is at \(10, -20, 50\) mm, expected"):
        Body.from_file(file)
    body = Body.described(read_description(file, BodyOptions(center_of_mass=np.array([0.01, -0.02, 0.05]))))
    np.testing.assert_allclose(body.vertices.mean(axis=0), 0.0, atol=1e-12)
    np.testing.assert_allclose(body.inertia, np.diag(expected), atol=1e-12)


EVENLY = "inertia: of the geometry filled evenly with 0.3 kg"
CENTRE = "centre of mass: at (10, -20, 50) mm in the file's frame; poses are taken to be of that frame"
FOLLOWED = "centre of mass: at (10, -20, 50) mm in the frame that the tracker follows"
LENGTH = "length scale: 0.0416 m, half the edge of a cube of the same volume"
IN_YAML = "mesh: binary.stl\nscale: 0.001\nfriction: 0.2\n"


@pytest.mark.parametrize(
    ("name", "options", "notes", "warnings"),
    [
        (
            "binary.stl",
            {"scale": 1e-3, "mass": 0.3},
            (EVENLY, CENTRE, LENGTH),
            ("friction: none given, 0.5 assumed: give --friction",),
        ),
        (
            "binary.stl",
            {"scale": 1e-3, "density": 500.0, "friction": 0.0, "length_scale": 0.05},
            ("mass and inertia: of the geometry filled with 500 kg/m^3", CENTRE),
            (),
        ),
        ("brick.urdf", {}, ("mass and inertia: as in the file", CENTRE, LENGTH), ()),
        ("brick.urdf", {"mass": 0.6}, ("inertia: as in the file, times 2", CENTRE, LENGTH), ()),
        ("brick.yaml", {}, (FOLLOWED,), ()),
    ],
)
def test_a_description_says_how_it_was_understood(
    files: dict[str, Path], name: str, options: dict[str, float], notes: tuple[str, ...], warnings: tuple[str, ...]
) -> None:
    found = read_description(files["brick.yaml"].with_name(name), BodyOptions(**options))  # type: ignore[arg-type]
    assert (found.notes, found.warnings) == (notes, warnings)
    assert (found.hull_count, found.error, found.source) == (8, 0.0, str(files["brick.yaml"].with_name(name)))
    assert found.friction == options.get("friction", 0.5 if warnings else 0.2)


@pytest.mark.parametrize(
    ("name", "options", "message"),
    [
        (
            "binary.stl",
            {"scale": 1e-3},
            "mass: found none in the file, expected --mass KG or --density KG/M^3 (in YAML mass: or density:)",
        ),
        (
            "brick.urdf",
            {"scale": 2.0},
            "scale: found 2.0, expected none for URDF and MJCF, whose meshes have a scale of their own",
        ),
        ("brick.yaml", {"scale": 2.0}, "scale: found 2.0, expected none for a body whose vertices or half_extents are listed"),
        (
            "brick.yaml",
            {"density": 2.0},
            "density: found 2 beside an inertia, expected a mass, or no inertia",
        ),
        ("brick.yaml", {"link": "a"}, "link: found a, expected none for a body whose vertices or half_extents are listed"),
    ],
)
def test_options_that_a_format_has_not_are_refused(
    files: dict[str, Path], name: str, options: dict[str, Any], message: str
) -> None:
    file = files["brick.yaml"].with_name(name)
    with pytest.raises(UnreadableInputError) as refused:
        read_description(file, BodyOptions(**options))
    assert str(refused.value) == f"{file}: {message}"


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("mesh: binary.stl\nurdf: brick.urdf\n", "urdf: found a file beside that of mesh, expected one of both"),
        ("mesh: a.txt\n", "mesh: found a.txt, expected a file ending in .stl, .obj, .ply, .off, .urdf, .mjcf, .xml, .xacro"),
        ("mesh: 3\n", "mesh: found 3, expected a text"),
        ("- 1\n", "found a list, expected the keys of a body and their values"),
        (
            f"#{'x' * LARGEST_FILE}",
            (
                f"holds more than {LARGEST_FILE} bytes, expected at most that for the description of a body: "
                "YAML, URDF, MJCF, STL, OBJ, PLY or OFF"
            ),
        ),
        ("mesh: binary.stl\nmasse: 3\n", "unknown key 'masse': did you mean 'mass'?"),
    ],
)
def test_a_description_that_refers_to_no_geometry_is_refused(files: dict[str, Path], content: str, message: str) -> None:
    file = files["brick.yaml"].with_name("wrong.yaml")
    file.write_text(content)
    with pytest.raises(UnreadableInputError) as refused:
        read_description(file)
    assert str(refused.value) == f"{file}: {message}"


def test_what_a_description_in_yaml_says_of_its_mesh_is_taken(files: dict[str, Path]) -> None:
    file = files["brick.yaml"].with_name("said.yaml")
    values = "mass: 0.3\ninertia: [5.3e-4, 4.6e-4, 2.6e-4]\ncenter_of_mass: [0.011, -0.02, 0.05]\ngravity: 9.8\n"
    file.write_text(IN_YAML + values + "length_scale: 0.05\nname: said\n")
    said = read_description(file)
    assert (said.name, said.mass, said.friction, said.gravity, said.length_scale) == ("said", 0.3, 0.2, 9.8, 0.05)
    np.testing.assert_array_equal(said.inertia, np.diag([5.3e-4, 4.6e-4, 2.6e-4]))
    np.testing.assert_array_equal(said.center_of_mass, [0.011, -0.02, 0.05])
    np.testing.assert_allclose(said.vertices.max(axis=0), HALF + CENTER - [0.011, -0.02, 0.05], atol=1e-9)
    over = read_description(file, BodyOptions(name="other", density=500.0, friction=0.1, gravity=9.82))
    assert (over.name, over.friction, over.gravity) == ("other", 0.1, 9.82)
    assert over.mass == pytest.approx(0.288)
    file.write_text(IN_YAML + "density: 500\n")
    assert read_description(file).mass == pytest.approx(0.288)


def test_a_listed_body_takes_options_over_its_values(files: dict[str, Path]) -> None:
    found = read_description(files["brick.yaml"], BodyOptions(mass=0.6, friction=0.4, name="x", gravity=9.8))
    assert (found.name, found.mass, found.friction, found.gravity) == ("x", 0.6, 0.4, 9.8)
    np.testing.assert_allclose(found.inertia, 2.0 * np.diag(INERTIA), rtol=1e-12)


def test_names_are_letters_digits_and_single_underscores() -> None:
    assert (plain_name("a--b c.d"), plain_name("--")) == ("a_b_c_d", "body")


def test_a_mass_that_is_given_scales_the_inertia_of_the_file(files: dict[str, Path]) -> None:
    for name in ("brick.urdf", "brick.xml", "brick.yaml"):
        body = Body.from_file(files[name], mass=2.0 * MASS)
        np.testing.assert_allclose(body.inertia, 2.0 * np.diag(INERTIA), atol=1e-12)


def test_a_centre_of_mass_beside_the_tracked_frame_is_said_of_a_listed_shape(tmp_path: Path) -> None:
    file = tmp_path / "box.yaml"
    file.write_text(
        "name: box\nhalf_extents: [0.05, 0.04, 0.03]\nmass: 0.4\nfriction: 0.3\ncenter_of_mass: [0.02, -0.01, 0.0]\n"
    )
    found = "centre of mass: at {} mm in the frame that the tracker follows"
    assert found.format("(20, -10, 0)") in read_description(file).notes
    moved = BodyOptions(center_of_mass=np.array([0.0, 0.0, 0.005]))
    assert found.format("(0, 0, 5)") in read_description(file, moved).notes


def test_a_name_that_yaml_takes_for_a_truth_value_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "box.yaml"
    file.write_text("name: off\nhalf_extents: [0.05, 0.04, 0.03]\nmass: 0.4\nfriction: 0.3\n")
    with pytest.raises(UnreadableInputError, match="name: found False, expected a text"):
        read_description(file)


@pytest.mark.parametrize("weight", [BodyOptions(mass=0.8), BodyOptions(density=0.8 / (0.1 * 0.08 * 0.06))])
def test_a_mass_that_is_given_scales_the_inertia_beside_the_name_of_a_file(tmp_path: Path, weight: BodyOptions) -> None:
    box = '<geom type="box" size="0.05 0.04 0.03"/>'
    (tmp_path / "box.xml").write_text(f'<mujoco><worldbody><body name="box">{box}</body></worldbody></mujoco>')
    file = tmp_path / "box.yaml"
    file.write_text("mjcf: box.xml\nmass: 0.4\ninertia: [4.0e-4, 5.0e-4, 6.0e-4]\nfriction: 0.3\n")
    assert np.diag(Body.from_file(file).inertia) == pytest.approx([4e-4, 5e-4, 6e-4], rel=1e-12)
    found = read_description(file, weight)
    assert (found.mass, *np.diag(found.inertia)) == pytest.approx((0.8, 8e-4, 1e-3, 1.2e-3), rel=1e-9)
    assert [note for note in found.notes if "inertia" in note] == ["inertia: as stated in box.yaml, times 2"]


def test_an_l_of_two_pieces_touches_with_the_corners_of_its_hull_and_has_its_own_inertia(tmp_path: Path) -> None:
    boxes = (((0.02, 0.02, 0.08), (0.0, 0.0, 0.0)), ((0.04, 0.02, 0.02), (0.06, 0.0, -0.06)))  # they overlap nowhere
    collisions = "".join(
        f'<collision><origin xyz="{x} {y} {z}"/><geometry><box size="{2 * a} {2 * b} {2 * c}"/></geometry></collision>'
        for (a, b, c), (x, y, z) in boxes
    )
    file = tmp_path / "l.urdf"
    file.write_text(f'<robot name="ell"><link name="l">{collisions}</link></robot>')
    body = Body.from_file(file, density=500.0, friction=0.3)
    weights = np.array([8.0 * np.prod(half) for half, _ in boxes])
    center = weights @ np.array([place for _, place in boxes]) / weights.sum()
    assert len(body.vertices) == 10  # an L has 12 corners; the two at its inner edge lie in the hull
    assert body.mass == pytest.approx(500.0 * weights.sum())
    np.testing.assert_allclose(body.center_of_mass, center, atol=1e-12)
    spread = sum(
        500.0
        * w
        * ((np.square(half).sum() - np.square(half)) / 3.0 + np.square(place - center).sum() - np.square(place - center))
        for w, (half, place) in zip(weights, ((np.array(half), np.array(place)) for half, place in boxes), strict=True)
    )
    np.testing.assert_allclose(np.diag(body.inertia), spread, rtol=1e-12)


def test_a_concave_mesh_says_that_only_its_hull_touches(tmp_path: Path) -> None:
    outline = np.array([(0, 0), (6, 0), (6, 2), (2, 2), (2, 6), (0, 6)])
    points = np.array([(x, y, z) for z in (0, 4) for x, y in outline], dtype=float)
    sides = [((k, (k + 1) % 6, (k + 1) % 6 + 6), (k, (k + 1) % 6 + 6, k + 6)) for k in range(6)]
    caps = [(0, 1, 2), (0, 2, 3), (0, 3, 4), (0, 4, 5)]
    faces = (
        [face for pair in sides for face in pair]
        + [face[::-1] for face in caps]
        + [tuple(k + 6 for k in face) for face in caps]
    )
    (tmp_path / "l.obj").write_text(obj_text(points, tuple(faces)))
    found = read_description(tmp_path / "l.obj", BodyOptions(scale=0.01, mass=0.2, friction=0.3))
    assert any("not convex" in note and "2 vertices inside" in note for note in found.notes)
    assert len(found.vertices) == 10
    assert found.mass == 0.2


@pytest.mark.parametrize(("shift", "overlap"), [(2.0, False), (1.5, True), (2.5, False)])
def test_pieces_of_a_mesh_may_touch_or_overlap(tmp_path: Path, shift: float, overlap: bool) -> None:
    """Two boxes one above the other share the corners and edges of a face, once corners at one place are one."""
    file = tmp_path / "pair.stl"
    other = CENTER + np.array([0.0, 0.0, shift * HALF[2]])
    triangles = TRIANGLES + tuple((8 + a, 8 + b, 8 + c) for a, b, c in TRIANGLES) + ((0, 1, 1),)  # the last has no area
    file.write_text(stl_text(np.concatenate([corners_mm(), corners_mm(HALF, other)]), triangles))
    read = read_description(file, BodyOptions(scale=0.001, density=1000.0, friction=0.2))
    assert read.mass == pytest.approx(2.0 * 1000.0 * 8.0 * HALF.prod(), rel=1e-6)
    assert any("where they overlap" in note for note in read.notes) == overlap
    assert not any("not closed" in note for note in read.notes)


def test_a_cylinder_becomes_a_prism_and_its_error_is_said(tmp_path: Path) -> None:
    file = tmp_path / "can.urdf"
    inertial = '<inertial><mass value="0.2"/><inertia ixx="2e-4" iyy="2e-4" izz="9e-5" ixy="0" ixz="0" iyz="0"/></inertial>'
    geometry = '<collision><geometry><cylinder radius="0.03" length="0.1"/></geometry></collision>'
    file.write_text(f'<robot name="can"><link name="can">{inertial}{geometry}</link></robot>')
    found = read_description(file, BodyOptions(friction=0.3))
    assert len(found.vertices) == 32
    assert found.error == pytest.approx(0.03 * (1.0 - np.cos(np.pi / 16)))
    assert found.warnings == ("vertices: 32 corners stand for the hull and are at most 0.58 mm inside it",)
    np.testing.assert_allclose(np.linalg.norm(found.vertices[:, :2], axis=1), 0.03)


def test_of_eighty_vertices_in_yaml_the_solvers_64_are_taken_and_the_error_is_said(tmp_path: Path) -> None:
    points = np.random.default_rng(2).standard_normal((80, 3))
    points *= 0.05 / np.linalg.norm(points, axis=1)[:, None]
    file = tmp_path / "ball.yaml"
    file.write_text(f"{YAML}vertices: {points.tolist()}\ninertia: [3.0e-4, 3.0e-4, 3.0e-4]\nlength_scale: 0.04\n")
    found = read_description(file)
    assert (len(found.vertices), found.hull_count) == (64, 80)
    assert found.warnings[0].startswith("vertices: 64 of 80 corners stand for the hull and are at most ")


def test_the_length_scale_of_a_cube_is_its_half_width(tmp_path: Path) -> None:
    (tmp_path / "cube.obj").write_text(obj_text(corners_mm(np.full(3, 0.0524), np.zeros(3))))
    assert Body.from_file(tmp_path / "cube.obj", scale=1e-3, mass=0.37).length_scale == pytest.approx(0.0524)


def test_mjcf_is_understood_as_mujoco_understands_it(tmp_path: Path) -> None:
    import mujoco

    (tmp_path / "meshes").mkdir()
    (tmp_path / "meshes" / "brick.stl").write_bytes(stl_bytes(corners_mm()))
    text = """<mujoco><compiler meshdir="meshes" eulerseq="zyx"/>
      <default><geom density="700"/>
        <default class="d"><geom type="capsule"/><mesh scale="0.001 0.001 0.001"/></default></default>
      <asset><mesh class="d" file="brick.stl"/></asset>
      <worldbody><body name="thing" childclass="d" pos="1 2 3"><freejoint/>
        <geom size="0.02" fromto="0 0 0 0.05 0.04 0.03"/>
        <geom type="cylinder" size="0.02 0.03" pos="0.1 0 0" euler="20 30 40" mass="0.2"/>
        <geom type="ellipsoid" size="0.02 0.03 0.04" axisangle="1 1 0 50" contype="0" conaffinity="0"/>
        <geom type="mesh" mesh="brick" quat="1 2 3 4" friction="0.7"/>
        <geom type="box" size="0.01 0.02 0.03" zaxis="1 1 1"/>
        <geom type="sphere" size="0.02" xyaxes="0 1 0 -1 0 0" pos="0 0 0.1"/>
      </body></worldbody></mujoco>"""
    (tmp_path / "thing.xml").write_text(text)
    found = read_description(tmp_path / "thing.xml")
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "thing.xml"))
    flat = np.zeros(9)
    mujoco.mju_quat2Mat(flat, model.body_iquat[1])
    turn = flat.reshape(3, 3)
    assert found.mass == pytest.approx(model.body_mass[1], rel=1e-9)
    assert found.friction == 0.7
    np.testing.assert_allclose(found.center_of_mass, model.body_ipos[1], atol=1e-9)
    np.testing.assert_allclose(found.inertia, turn @ np.diag(model.body_inertia[1]) @ turn.T, atol=1e-9)


L_CORNERS = np.array([[x, y, z] for z in (0, 5) for x, y in ((0, 0), (12, 0), (12, 4), (4, 4), (4, 12), (0, 12))])
L_CAPS = ((0, 2, 1), (0, 3, 2), (0, 5, 3), (3, 5, 4), (6, 7, 8), (6, 8, 9), (6, 9, 11), (9, 10, 11))
L_SIDES = tuple(face for a in range(6) for face in ((a, (a + 1) % 6, (a + 1) % 6 + 6), (a, (a + 1) % 6 + 6, a + 6)))
BOX_AND_OTHER = '<geom type="box" size="0.02 0.03 0.04"/><geom type="box" size="0.02 0.02 0.02" pos="0.02 0 0.05" group="3"/>'


@pytest.mark.parametrize(
    ("compiler", "mesh", "geoms"),
    [
        ('inertiagrouprange="0 2"', "", BOX_AND_OTHER),
        ('inertiagrouprange="3 5"', "", BOX_AND_OTHER),
        ('boundmass="0.2" boundinertia="1e-5"', "", BOX_AND_OTHER),
        ("", 'inertia="convex"', '<geom type="mesh" mesh="l"/>'),
        ("", 'inertia="exact"', '<geom type="mesh" mesh="l"/>'),
    ],
)
def test_what_weighs_in_mjcf_is_what_weighs_in_mujoco(tmp_path: Path, compiler: str, mesh: str, geoms: str) -> None:
    import mujoco

    (tmp_path / "l.obj").write_text(obj_text(L_CORNERS, L_CAPS + L_SIDES))
    file = tmp_path / "thing.xml"
    asset = f'<asset><mesh file="l.obj" scale="0.01 0.01 0.01" {mesh}/></asset>'
    file.write_text(f"<mujoco><compiler {compiler}/>{asset}<worldbody><body>{geoms}</body></worldbody></mujoco>")
    found, model = read_description(file), mujoco.MjModel.from_xml_path(str(file))
    assert found.mass == pytest.approx(model.body_mass[1], rel=1e-6)
    np.testing.assert_allclose(found.center_of_mass, model.body_ipos[1], atol=1e-8)
    np.testing.assert_allclose(np.linalg.eigvalsh(found.inertia), np.sort(model.body_inertia[1]), rtol=1e-5)


@pytest.mark.parametrize(
    ("compiler", "mesh", "geom", "why"),
    [
        ("", "", 'type="box" size="0.02 0.03 0.04" shellinertia="true"', "geom with the mass of a shell, expected filled"),
        ("", 'inertia="shell"', 'type="mesh" mesh="l"', "with the mass of a shell, expected filled ones, or an <inertial>"),
        ('boundmass="2"', "", 'type="box" size="0.02 0.03 0.04"', "boundmass of <compiler>: found 2, expected at most 0.192"),
        ('boundinertia="1"', "", 'type="box" size="0.02 0.03 0.04"', "boundinertia of <compiler>: found 1, expected at most"),
    ],
)
def test_a_mass_that_mujoco_alone_understands_is_refused(tmp_path: Path, compiler: str, mesh: str, geom: str, why: str) -> None:
    (tmp_path / "l.obj").write_text(obj_text(L_CORNERS, L_CAPS + L_SIDES))
    asset = f'<asset><mesh file="l.obj" scale="0.01 0.01 0.01" {mesh}/></asset>'
    text = f"<mujoco><compiler {compiler}/>{asset}<worldbody><body>{{}}<geom {geom}/></body></worldbody></mujoco>"
    file = tmp_path / "thing.xml"
    file.write_text(text.format(""))
    with pytest.raises(UnreadableInputError, match=why):
        read_description(file)
    file.write_text(text.format('<inertial pos="0 0 0.01" mass="3" diaginertia="0.003 0.003 0.003"/>'))
    if not compiler:
        assert read_description(file).mass == 3.0


BOX = '<geometry><box size="0.1 0.1 0.1"/></geometry>'
WEIGHT = '<inertial><mass value="1"/><inertia ixx="1e-3" iyy="1e-3" izz="1e-3" ixy="0" ixz="0" iyz="0"/></inertial>'
LINKS = f"""<robot name="r"><link name="root"/><link name="a">{WEIGHT}<collision>{BOX}</collision></link>
  <link name="b">{WEIGHT}</link><link name="c">{WEIGHT}</link>
  <joint type="fixed"><parent link="root"/><child link="a"/></joint>
  <joint type="fixed"><parent link="root"/><child link="b"/></joint>
  <joint type="hinge"><parent link="a"/><child link="c"/></joint></robot>"""
BODIES = """<mujoco><worldbody><body name="a"><freejoint/><geom type="box" size=".1 .1 .1"/>
  <frame><body name="b"><geom size=".1" contype="0" conaffinity="0"/><body name="d"><site/></body></body></frame>
  <body name="c"><joint/><geom size=".1" contype="0" conaffinity="0"/></body></body></worldbody></mujoco>"""
AROUND = """<mujoco><worldbody><body name="b"><freejoint/><geom size=".1" contype="0" conaffinity="0"/>
  <body name="a"><geom type="box" size=".1 .1 .1"/>
  <body name="c"><frame><joint/></frame><geom size=".1" contype="0" conaffinity="0"/></body></body></body>
  <body name="e"><geom size=".1" contype="0" conaffinity="0"/></body></worldbody></mujoco>"""


@pytest.mark.parametrize(("name", "text"), [("links.urdf", LINKS), ("bodies.xml", BODIES), ("around.xml", AROUND)])
def test_a_mass_fixed_to_the_body_is_not_counted_and_a_note_says_so(tmp_path: Path, name: str, text: str) -> None:
    (tmp_path / name).write_text(text)
    said = "b: fixed to a, but not counted: shape, mass and inertia are those of a alone"
    assert said in read_description(tmp_path / name, BodyOptions(mass=1.0, friction=0.2)).notes
    text = text.replace('"fixed"', '"floating"').replace('<body name="b"><geom', '<body name="b"><joint/><geom')
    (tmp_path / name).write_text(text.replace('<body name="a"><geom', '<body name="a"><joint/><geom'))
    assert not any("fixed" in note for note in read_description(tmp_path / name, BodyOptions(mass=1.0, friction=0.2)).notes)


PARTS = {
    "main.xml": """<mujoco model="thing"><compiler meshdir="meshes" eulerseq="zyx"/><include file="parts/assets.xml"/>
      <worldbody><frame pos="9 9 9"><body name="thing" childclass="heavy"><include file="parts/geoms.xml"/>
        <replicate count="3" offset="0 0.05 0" euler="20 0 10">
          <geom type="cylinder" size="0.01 0.02" pos="0.01 0 0"/>
          <replicate count="2" sep="-" offset="0.03 0 0"><geom name="ball" size="0.012"/></replicate>
        </replicate></body></frame></worldbody></mujoco>""",
    "parts/assets.xml": """<mujocoinclude><default><default class="heavy"><geom density="2000"/></default>
      <default class="light"><geom density="100"/></default></default>
      <asset><mesh name="brick" file="brick.stl" scale="0.001 0.001 0.001"/></asset></mujocoinclude>""",
    "parts/geoms.xml": """<mujocoinclude><geom type="mesh" mesh="brick" quat="1 2 3 4"/>
      <frame pos="0 0 0.05" euler="0 30 0" childclass="light"><geom type="capsule" size="0.01 0.02"/>
        <frame pos="0.01 0 0" axisangle="1 0 0 40"><geom type="box" size="0.01 0.02 0.03" friction="0.7"/></frame></frame>
      </mujocoinclude>""",
}


def test_included_files_frames_and_replicas_are_understood_as_mujoco_understands_them(tmp_path: Path) -> None:
    import mujoco

    for folder in ("meshes", "parts"):
        (tmp_path / folder).mkdir()
    (tmp_path / "meshes" / "brick.stl").write_bytes(stl_bytes(corners_mm()))
    for name, content in PARTS.items():
        (tmp_path / name).write_text(content)
    found = read_description(tmp_path / "main.xml")
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "main.xml"))
    assert model.ngeom == 3 + 3 * (1 + 2)
    flat = np.zeros(9)
    mujoco.mju_quat2Mat(flat, model.body_iquat[1])
    turn = flat.reshape(3, 3)
    assert found.mass == pytest.approx(model.body_mass[1], rel=1e-6)  # MuJoCo holds meshes in single precision
    assert found.friction == 0.7
    np.testing.assert_allclose(found.center_of_mass, model.body_ipos[1], atol=1e-8)
    np.testing.assert_allclose(found.inertia, turn @ np.diag(model.body_inertia[1]) @ turn.T, atol=1e-9)


BROKEN = {
    "cut.stl": (stl_bytes(corners_mm())[:-20], "found 664 bytes, expected 684 of an STL file: it was cut off"),
    "cut_text.stl": (stl_text(corners_mm())[:-40].encode(), "found no endsolid at its end"),
    "empty.stl": (b"", "expected 84 of an STL file"),
    "empty.obj": (b"", "found no triangles|is no mesh"),
    "words.obj": (b"v 1 2 x\nf 1 1 1\n", "is no mesh|found no triangles"),
    "polygon.off": (
        b"OFF\n5 2 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n0 0 1\n5 0 1 2 3 4\n3 0 1 4\n",
        "found a face of more than four corners, expected triangles, or the same mesh as OBJ or PLY",
    ),
    "flat.obj": (obj_text(corners_mm() * [1, 1, 0]).encode(), "in one plane"),
    "huge.obj": (obj_text(corners_mm() * 1e9).encode(), "coordinates that are no lengths"),
    "thing.dae": (b"<COLLADA/>", r"is COLLADA, expected one of \.stl, \.obj, \.ply, \.off: convert it to STL or OBJ"),
    "of_dae.yaml": (b"{mesh: thing.dae, mass: 1.0}", "thing.dae.* is COLLADA, expected one of"),
    "mesh_dae.urdf": (urdf_with('<mesh filename="thing.dae"/>'), "thing.dae: is COLLADA, expected one of"),
    "no_collision.urdf": (b'<robot name="a"><link name="b"><visual/></link></robot>', "found no link with a <collision>"),
    "two.urdf": (
        b'<robot name="a"><link name="b"><collision/></link><link name="c"><collision/></link></robot>',
        r"found 2 links with collision geometry \(b, c\), expected one: choose with --link NAME",
    ),
    "no_mesh.urdf": (
        urdf_with('<mesh filename="gone.stl"/>'),
        "gone.stl: cannot be read: No such file",
    ),
    "package.urdf": (
        urdf_with('<mesh filename="package://arm/x.stl"/>'),
        "package://arm/x.stl: found no folder arm with that file above it; name the mesh by a relative path",
    ),
    "web.urdf": (
        urdf_with('<mesh filename="http://x/y.stl"/>'),
        "found http://x/y.stl, expected a path",
    ),
    "torus.urdf": (
        urdf_with("<torus/>"),
        "geometry of <collision>: found <torus>, expected one of box, cylinder",
    ),
    "size.urdf": (
        urdf_with('<box size="1 2"/>'),
        "size of <box>: found '1 2', expected 3 numbers",
    ),
    "a.urdf.xacro": (b"<robot/>", "is a xacro: expand it first with `xacro "),
    "macro.urdf": (b'<robot xmlns:xacro="http://www.ros.org/wiki/xacro"/>', "is a xacro"),
    "bomb.urdf": (b'<!DOCTYPE a [<!ENTITY b "c">]><robot>&b;</robot>', "found a document type"),
    "cut.urdf": (b"<robot><link", "is no XML"),
    "other.urdf": (b"<sdf/>", "found a <sdf>, expected a <robot>"),
    "include.xml": (
        b"<mujoco><include file='/etc/passwd'/></mujoco>",
        "passwd: is no XML",
    ),
    "itself.xml": (b"<mujoco><include file='itself.xml'/></mujoco>", "<include>: found 'itself.xml' once more, expected each"),
    "gone.xml": (b"<mujoco><include file='part.xml'/></mujoco>", "part.xml: cannot be read: No such file"),
    "many.xml": (
        b"<mujoco><worldbody><replicate count='99'><replicate count='999'><geom/></replicate></replicate></worldbody></mujoco>",
        "count of <replicate>: found 99, expected a whole number from 1, and at most 20000 elements",
    ),
    "half.xml": (
        b"<mujoco><worldbody><replicate count='1.5'><geom size='1'/></replicate></worldbody></mujoco>",
        "count of <replicate>: found 1.5",
    ),
    "composite.xml": (
        b"<mujoco><worldbody><composite/></worldbody></mujoco>",
        "found <composite>, which is not understood: describe the body as one rigid <body> of geoms",
    ),
    "no_geom.xml": (b"<mujoco><worldbody><body/></worldbody></mujoco>", "found no body with a geom that collides"),
}


@pytest.mark.parametrize("name", BROKEN)
def test_a_broken_file_is_one_line(tmp_path: Path, name: str) -> None:
    content, why = BROKEN[name]
    (tmp_path / name).write_bytes(content)
    with pytest.raises(UnreadableInputError, match=why) as caught:
        read_description(tmp_path / name, BodyOptions(mass=0.3))
    assert "\n" not in str(caught.value)


def test_a_link_is_chosen_by_its_name(tmp_path: Path) -> None:
    boxes = "".join(
        f'<link name="{name}"><collision><geometry><box size="{size} 0.1 0.1"/></geometry></collision></link>'
        for name, size in (("small", 0.1), ("large", 0.2))
    )
    file = tmp_path / "two.urdf"
    file.write_text(f'<robot name="two">{boxes}</robot>')
    body = Body.from_file(file, link="large", mass=0.3, friction=0.3)
    assert body.name == "large"
    assert np.ptp(body.vertices[:, 0]) == pytest.approx(0.2)
    with pytest.raises(UnreadableInputError, match=r"--link: found no link huge .* expected one of small, large"):
        read_description(file, BodyOptions(link="huge", mass=0.3))


def test_meshes_of_a_package_are_found_above_the_urdf(tmp_path: Path) -> None:
    for folder in ("urdf", "meshes"):
        (tmp_path / "bricks" / folder).mkdir(parents=True)
    (tmp_path / "bricks" / "meshes" / "brick.stl").write_bytes(stl_bytes(corners_mm()))
    mesh = '<mesh filename="package://bricks/meshes/brick.stl" scale="0.001 0.001 0.001"/>'
    file = tmp_path / "bricks" / "urdf" / "brick.urdf"
    file.write_bytes(urdf_with(mesh))
    assert len(Body.from_file(file, mass=0.3).vertices) == 8


def test_only_files_that_are_named_as_geometry_are_opened(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "bricks"
    folder.mkdir()
    file = brick_files(folder)["brick.obj"]
    (tmp_path / "secret.mtl").write_text("newmtl a\nmap_Kd secret.png\n")
    read_description(file)  # what python imports late is imported now
    opened: list[str] = []
    whole = Path.open

    def watched(path: Path, *arguments: object, **named: object) -> object:
        opened.append(path.name)
        return whole(path, *arguments, **named)  # type: ignore[call-overload]

    monkeypatch.setattr(Path, "open", watched)
    monkeypatch.setattr("builtins.open", lambda *arguments, **_: pytest.fail(f"opened {arguments}"))
    monkeypatch.setattr(os, "open", lambda *arguments, **_: pytest.fail(f"opened {arguments}"))
    read_description(file)
    assert opened == ["brick.obj.yaml", "brick.obj"]


MESH = '<mesh filename="/dev/zero"/>'


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("a.urdf", f'<robot><link name="a"><collision><geometry>{MESH}</geometry></collision></link></robot>'),
        ("a.xml", '<mujoco><include file="/dev/zero"/></mujoco>'),
    ],
)
def test_a_description_makes_nobody_read_a_device(tmp_path: Path, name: str, text: str) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises(UnreadableInputError, match="/dev/zero: is no regular file"):
        read_description(tmp_path / name, BodyOptions(mass=0.3))


def test_a_mesh_that_is_too_large_is_refused_before_it_is_read_whole(tmp_path: Path) -> None:
    from contact_curation.geometry.solids.mesh_file import LARGEST_MESH

    with (tmp_path / "large.stl").open("wb") as file:
        file.truncate(LARGEST_MESH + 1)
    with pytest.raises(UnreadableInputError, match="holds more than"):
        read_description(tmp_path / "large.stl", BodyOptions(mass=0.3))
