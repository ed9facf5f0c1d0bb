"""Bodies are described in YAML; every mistake is one line that names the file and the key."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from contact_curation.contact.body import CONTACTNETS_CUBE, Body
from contact_curation.contact.body_description import LARGEST_FILE, BodyOptions, read_description
from contact_curation.contact.body_values import body_of_mapping, check_values, text
from contact_curation.errors import ContactCurationError, InvalidValueError, UnreadableInputError

CUBE_FILE = Path(__file__).resolve().parents[2] / "contact_curation" / "config" / "cube.yaml"


def test_the_shipped_cube_is_contactnets_cube() -> None:
    body = Body.from_file(CUBE_FILE)
    assert (body.name, body.mass, body.friction, body.length_scale) == ("cube", 0.37, 0.18, 0.0524)
    np.testing.assert_allclose(body.inertia, CONTACTNETS_CUBE.inertia)
    assert {tuple(corner) for corner in body.vertices} == {tuple(corner) for corner in CONTACTNETS_CUBE.vertices}


def test_vertices_may_be_listed(tmp_path: Path) -> None:
    corners = "[[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]"
    text = f"name: wedge\nvertices: {corners}\nmass: 1\ninertia: [1, 1, 1]\nfriction: 0\nlength_scale: 1\n"
    file = tmp_path / "wedge.yaml"
    file.write_text(text)
    assert Body.from_file(file).vertices.shape == (4, 3)


def test_a_friction_that_is_not_given_is_assumed_with_a_warning_and_the_length_scale_follows_from_the_volume(
    tmp_path: Path,
) -> None:
    file = tmp_path / "brick.yaml"
    file.write_text("name: brick\nhalf_extents: [0.02, 0.04, 0.01]\nmass: 0.1\ninertia: [1.0e-4, 1.0e-4, 1.0e-4]\n")
    told = read_description(file, BodyOptions())
    assert told.friction == 0.5
    assert told.length_scale == pytest.approx(0.02)
    assert any("friction: none given, 0.5 assumed" in line for line in told.warnings)
    assert read_description(file, BodyOptions(friction=0.1, length_scale=0.03)).warnings == ()


def test_a_centre_of_mass_that_is_given_leaves_the_shape_where_the_tracker_sees_it(tmp_path: Path) -> None:
    file, place = tmp_path / "brick.yaml", np.array([0.003, 0.0, -0.002])
    file.write_text(CUBE_FILE.read_text() + "center_of_mass: [0.01, 0, 0]\n")
    before = Body.from_file(file)
    after = Body.described(read_description(file, BodyOptions(center_of_mass=place)))
    np.testing.assert_array_equal(after.center_of_mass, place)
    np.testing.assert_allclose(after.tracked_polytope.vertices, before.tracked_polytope.vertices, atol=1e-15)
    np.testing.assert_allclose(before.about(place).vertices, after.vertices, atol=1e-15)


@pytest.mark.parametrize("more", ["[0.5, 0, 0]", "[0, 0, 1]", "[0.2, 0.2, 0.2]"], ids=["on an edge", "twice", "inside"])
def test_a_vertex_that_is_no_corner_is_refused(tmp_path: Path, more: str) -> None:
    corners = f"[[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], {more}]"
    file = tmp_path / "wedge.yaml"
    file.write_text(f"name: wedge\nvertices: {corners}\nmass: 1\ninertia: [1, 1, 1]\nfriction: 0\nlength_scale: 1\n")
    with pytest.raises(UnreadableInputError, match=r"vertices: found vertex \d at .* within the hull of the others"):
        Body.from_file(file)


@pytest.mark.parametrize(
    ("change", "why"),
    [
        (("mass:", "weight:"), r"unknown key 'weight': expected one of .*'mass'"),
        (("half_extents:", "half_extent:"), r"unknown key 'half_extent': did you mean 'half_extents'\?"),
        (("mass: 0.37", ""), r"missing key: mass \(e.g. 0.46\)"),
        (("mass: 0.37", "density: 900"), "density: found 900 beside an inertia, expected a mass, or no inertia"),
        (("mass: 0.37", "mass: 0.37\ndensity: 900"), "density: found 900 beside a mass, expected one of both"),
        (("mass:", "densitiy:"), r"unknown key 'densitiy': did you mean 'density'\?"),
        (("mass: 0.37", "density: -900"), "density: found -900.0, expected a positive number"),
        (("mass: 0.37", "mass: heavy"), "mass: found heavy, expected numbers"),
        (("mass: 0.37", "mass: true"), "mass: found True, expected numbers"),
        (("mass: 0.37", "mass: 1" + 399 * "0"), "mass: found an integer of over 300 digits"),
        (("mass: 0.37", "mass: .inf"), "mass: found inf, expected a positive number"),
        (
            ("[0.0524, 0.0524, 0.0524]", "[.inf, 0.0524, 0.0524]"),
            r"half_extents: found \[inf, 0.0524, 0.0524\], expected 3 positive",
        ),
        (("[0.00081, 0.00081, 0.00081]", "[.inf, 0.00081, 0.00081]"), "inertia: found .* finite numbers"),
        (
            ("[0.00081, 0.00081, 0.00081]", "[[0.00081, 0.0002, 0], [0, 0.00081, 0], [0, 0, 0.00081]]"),
            "inertia: found 0.0002 in row 1, column 2, and 0 opposite of it, expected a symmetric matrix",
        ),
        (("mass: 0.37", "mass: [1, 2]"), r"mass: found \[1, 2\], expected one number"),
        (("mass: 0.37", "mass: -1"), "mass: found -1.0, expected a positive number"),
        (("mass: 0.37", "mass: .nan"), "mass: found nan"),
        (
            ("name: cube", "name: ../cube"),
            r"name of the body: found '../cube', expected letters, digits",
        ),
        (("name: cube", "name: my-cube"), "name of the body: found 'my-cube'"),
        (("name: cube", "name: a__b"), "name of the body: found 'a__b'"),
        (("name: cube", "name: 2024-02-30"), "found no YAML"),
        (("inertia: [0.00081, 0.00081, 0.00081]", "inertia: [0.00081, 0.00081, 0.0081]"), "inertia: .* sum of the other two"),
        (("[0.0524, 0.0524, 0.0524]", "[0.0524, 0.0524]"), "half_extents: found .*, expected 3 positive numbers"),
        (("name: cube", "name: [cube"), "found no YAML"),
        (("name: cube", "1: 2\nname: cube"), "expected the keys of a body"),
        (("name: cube", "name: !!python/object/apply:os.getcwd []"), "found no YAML"),
    ],
)
def test_a_mistake_is_one_line_with_the_file_and_the_key(tmp_path: Path, change: tuple[str, str], why: str) -> None:
    text = CUBE_FILE.read_text()
    assert change[0] in text
    file = tmp_path / "body.yaml"
    file.write_text(text.replace(*change, 1))
    with pytest.raises(UnreadableInputError, match=why) as caught:
        Body.from_file(file)
    assert str(caught.value).startswith(str(file))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("content", "why"),
    [
        (b"", "found a NoneType"),
        (b"- 1\n- 2\n", "found a list"),
        (b"\xff\xfe\xfa", "found no YAML"),
        (b"[" * 5000, "found no YAML"),
        (b" " * (LARGEST_FILE + 1), "expected at most"),
    ],
)
def test_what_is_no_description_is_refused(tmp_path: Path, content: bytes, why: str) -> None:
    file = tmp_path / "body.yaml"
    file.write_bytes(content)
    with pytest.raises(UnreadableInputError, match=why):
        Body.from_file(file)


def test_a_file_that_is_not_there_says_so(tmp_path: Path) -> None:
    with pytest.raises(UnreadableInputError, match="cannot be read: No such file"):
        Body.from_file(tmp_path / "none.yaml")
    with pytest.raises(UnreadableInputError, match="cannot be read: Is a directory"):
        Body.from_file(tmp_path)


BRICK: dict[str, Any] = {
    "name": "brick",
    "mass": 0.3,
    "inertia": [5.2e-4, 4.5e-4, 2.5e-4],
    "friction": 0.2,
    "length_scale": 0.045,
    "half_extents": [0.03, 0.04, 0.06],
}
KEYS = [
    "center_of_mass",
    "friction",
    "gravity",
    "half_extents",
    "inertia",
    "length_scale",
    "mass",
    "mesh",
    "mjcf",
    "name",
    "urdf",
]
FAR = [[2e12, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, 0]]


@pytest.mark.parametrize(
    ("without", "changes", "message"),
    [
        ([], {"vertices": FAR}, "half_extents: found both they and vertices, expected one of both"),
        (["half_extents"], {}, "missing key: found no shape, expected vertices, half_extents, mesh, urdf, mjcf: one of them"),
        (["half_extents"], {"vertices": FAR}, "vertices: found 2e+12, expected metres, at most 1e+12"),
        (["mass"], {}, "missing key: mass (e.g. 0.23)"),
        (["mass", "inertia"], {}, "missing keys: mass (e.g. 0.23), inertia (e.g. [0.000399, 0.000346, 0.000192])"),
        (
            ["inertia"],
            {"half_extents": [60, 40, 30], "mass": 0.4},
            "vertices: found a body 120 m wide of 6.9e-07 kg/m^3, lighter than air, expected metres: are they in mm?",
        ),
        (["inertia"], {"mass": 0.6}, "missing key: inertia (e.g. [0.00104, 0.0009, 0.0005])"),
        (
            ["name", "friction", "length_scale"],
            {},
            "missing keys: name (e.g. brick), friction (e.g. 0.3), length_scale (e.g. 0.0416)",
        ),
        ([], {"weight": 1}, f"unknown key 'weight': expected one of {', '.join(map(repr, [*KEYS, 'vertices']))}"),
        ([], {"mass": True}, "mass: found True, expected numbers"),
        ([], {"mass": [[1, 2], [False]]}, "mass: found [[1, 2], [False]], expected numbers"),
        ([], {"mass": {"a": 1}}, "mass: found {'a': 1}, expected numbers"),
        ([], {"mass": [1, 2]}, "mass: found [1, 2], expected one number"),
        ([], {"mass": 10**400}, "mass: found an integer of over 300 digits, expected numbers"),
        ([], {"mass": "x" * 60}, f"mass: found {'x' * 60}, expected numbers"),
        ([], {"mass": "x" * 61}, f"mass: found {'x' * 57}..., expected numbers"),
        ([], {"half_extents": [1, 2]}, "half_extents: found [1, 2], expected 3 positive numbers [m]"),
        ([], {"half_extents": [1, 2, 0]}, "half_extents: found [1, 2, 0], expected 3 positive numbers [m]"),
        ([], {"half_extents": [1, 2, np.inf]}, "half_extents: found [1, 2, inf], expected 3 positive numbers [m]"),
        ([], {"inertia": [1, 2]}, "inertia: found [1. 2.], expected 3 or 3x3 finite numbers [kg m^2]"),
        ([], {"inertia": [[1, 2], [3]]}, "inertia: found [[1, 2], [3]], expected numbers"),
        (
            [],
            {"inertia": [1, 2, np.nan]},
            "inertia: found [[ 1. 0. 0.] [ 0. 2. 0.] [ 0. 0. nan]], expected 3 or 3x3 finite numbers [kg m^2]",
        ),
        (
            [],
            {"inertia": [[1, 0.5, 0], [0.25, 1, 0], [0, 0, 1]]},
            "inertia: found 0.5 in row 1, column 2, and 0.25 opposite of it, expected a symmetric matrix",
        ),
    ],
)
def test_values_that_make_no_body_are_refused_by_their_keys(without: list[str], changes: dict[str, Any], message: str) -> None:
    with pytest.raises(ContactCurationError) as refused:
        body_of_mapping({key: value for key, value in BRICK.items() if key not in without} | changes)
    assert str(refused.value) == message


def test_a_body_of_named_values_has_standard_gravity_about_its_origin_unless_they_are_given() -> None:
    plain = body_of_mapping(BRICK)
    assert {key: plain[key] for key in ("name", "mass", "friction", "length_scale", "gravity")} == {
        "name": "brick", "mass": 0.3, "friction": 0.2, "length_scale": 0.045, "gravity": 9.81,
    }  # fmt: skip
    np.testing.assert_array_equal(plain["inertia"], np.diag(BRICK["inertia"]))
    np.testing.assert_array_equal(plain["center_of_mass"], np.zeros(3))
    np.testing.assert_allclose(np.abs(plain["vertices"]), np.tile(BRICK["half_extents"], (8, 1)))
    other = body_of_mapping(BRICK | {"gravity": 1.62, "center_of_mass": [0.1, 0.2, 0.3], "inertia": np.eye(3).tolist()})
    assert other["gravity"] == 1.62
    np.testing.assert_array_equal(other["center_of_mass"], [0.1, 0.2, 0.3])
    np.testing.assert_array_equal(other["inertia"], np.eye(3))


VALUES = {
    "name": "brick",
    "mass": 0.3,
    "inertia": np.diag([5.2e-4, 4.5e-4, 2.5e-4]),
    "friction": 0.2,
    "length_scale": 0.045,
    "gravity": 9.81,
    "center_of_mass": np.zeros(3),
}


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"name": "a b"}, "name of the body: found 'a b', expected letters, digits and single underscores, as in topics"),
        ({"mass": 1e-12}, "mass: found 1e-12, expected a positive number"),
        ({"mass": 1e12}, "mass: found 1000000000000.0, expected a positive number"),
        ({"length_scale": np.nan}, "length_scale: found nan, expected a positive number"),
        ({"gravity": -1.0}, "gravity: found -1.0, expected a positive number"),
        ({"friction": -0.1}, "friction: found -0.1, expected a number of at least 0"),
        ({"friction": np.inf}, "friction: found inf, expected a number of at least 0"),
        ({"inertia": np.diag([1.0, 1.0, 0.0])}, "inertia: found moments [0. 1. 1.], expected positive ones [kg m^2]"),
        (
            {"inertia": np.diag([1.0, 1.0, 2.1])},
            "inertia: found moments [1. 1. 2.1], expected none larger than the sum of the other two [kg m^2]",
        ),
        ({"center_of_mass": np.zeros(2)}, "center_of_mass: found [0. 0.], expected 3 finite numbers [m]"),
        ({"center_of_mass": np.array([0.0, 0.0, np.nan])}, "center_of_mass: found [ 0. 0. nan], expected 3 finite numbers [m]"),
    ],
)
def test_numbers_that_no_body_has_are_refused(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(InvalidValueError) as refused:
        check_values(VALUES | changes)
    assert str(refused.value) == message


def test_a_flat_plate_without_friction_is_a_body() -> None:
    check_values(VALUES | {"friction": 0.0, "inertia": np.diag([1.0, 1.0, 2.0])})


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"mass": 0.0}, "mass: found 0.0, expected a positive number"),
        ({"density": -1.0}, "density: found -1.0, expected a positive number"),
        ({"length_scale": np.nan}, "length_scale: found nan, expected a positive number"),
        ({"scale": np.inf}, "scale: found inf, expected a positive number"),
        ({"mass": "0.3"}, "mass: found '0.3', expected a positive number"),
        ({"mass": 1.0, "density": 2.0}, "density: found 2 beside a mass of 1 kg, expected one of both"),
    ],
)
def test_options_that_make_no_body_are_refused(options: dict[str, object], message: str) -> None:
    with pytest.raises(InvalidValueError) as refused:
        BodyOptions(**options)  # type: ignore[arg-type]
    assert str(refused.value) == message


def test_options_take_what_they_lack_from_others_but_no_density_beside_a_mass() -> None:
    below = BodyOptions(name="b", density=3.0, friction=0.5)
    assert vars(BodyOptions(mass=2.0, friction=0.1).over(below)) == vars(BodyOptions(name="b", mass=2.0, friction=0.1))
    assert vars(BodyOptions(friction=0.1).over(below)) == vars(BodyOptions(name="b", density=3.0, friction=0.1))
    assert vars(BodyOptions(density=4.0).over(BodyOptions(mass=1.0))) == vars(BodyOptions(density=4.0))


@pytest.mark.parametrize("value", ["", 3])
def test_a_text_is_neither_empty_nor_a_number(value: object) -> None:
    with pytest.raises(InvalidValueError) as refused:
        text({"mesh": value}, "mesh")
    assert str(refused.value) == f"mesh: found {value}, expected a text"
    assert text({"mesh": "a.stl"}, "mesh") == "a.stl"
