"""A value in another unit is refused by physics, with the unit that it is likely in; what is only odd is said."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from contact_curation.contact.body_description import BodyOptions, read_description
from contact_curation.contact.plausibility import BodyNumbers, check_lengths, derived_scale, implausible
from contact_curation.errors import InvalidValueError, UnreadableInputError
from contact_curation.geometry.polytopes import box

RIGHT = {
    "half_extents": "[0.03, 0.04, 0.06]",
    "mass": "0.3",
    "inertia": "[5.2e-4, 4.5e-4, 2.5e-4]",
    "friction": "0.2",
    "length_scale": "0.045",
    "gravity": "9.81",
}


def written(folder: Path, **changes: str) -> Path:
    file = folder / "brick.yaml"
    file.write_text("name: brick\n" + "".join(f"{key}: {value}\n" for key, value in {**RIGHT, **changes}.items()))
    return file


def test_a_sound_body_has_no_warnings(tmp_path: Path) -> None:
    assert read_description(written(tmp_path)).warnings == ()


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        (
            {"mass": "300"},
            r"mass: found 300 kg in 0.576 litres, .* denser than any metal, expected kilograms: is it in grams \(0.3 kg\)\?",
        ),
        (
            {"half_extents": "[30, 40, 60]", "length_scale": "45"},
            r"vertices: found a body 120 m wide of 5.2e-07 kg/m\^3, .*, expected metres: are they in mm\?",
        ),
        ({"half_extents": "[3, 4, 6]", "length_scale": "4.5"}, r"vertices: .* expected metres: are they in cm\?"),
        (
            {"half_extents": "[1.2, 1.6, 2.4]", "length_scale": "1.8"},
            r"vertices: .* expected metres: are they in (cm|inches)\?",
        ),
        (
            {"inertia": "[520, 450, 250]"},
            r"inertia: found moments of 2.5e\+02 to 5.2e\+02, but 0.3 kg within 78 mm .* at most 0.0018, .* in kg mm\^2\?",
        ),
        ({"inertia": "[5.2e+5, 4.5e+5, 2.5e+5]"}, r"inertia: .*: is it in g mm\^2\?"),
        ({"inertia": "[5.2, 4.5, 2.5]"}, r"inertia: .*: is it in kg cm\^2\?"),
        (
            {"inertia": "[5.2e-10, 4.5e-10, 2.5e-10]"},
            r"inertia: .* spread evenly, has 0.00025 to 0.00052, .*: in which unit is it\?$",
        ),
        ({"friction": "30"}, r"friction: found 30, .* is it in degrees \(tan 30 = 0.58\) or percent \(0.3\)\?"),
        ({"friction": "-0.1"}, "friction: found -0.1, expected a number of at least 0"),
        (
            {"length_scale": "45"},
            r"length_scale: found 45 m for a body 0.12 m wide, expected metres, about 0.0416: is it in mm \(0.045 m\)\?",
        ),
        ({"gravity": "9810"}, r"gravity: found 9810, expected m/s\^2: is it in mm/s\^2\?"),
        ({"gravity": "-9.81"}, "gravity: found -9.81, expected a positive number"),
    ],
)
def test_a_value_in_another_unit_is_refused(tmp_path: Path, changes: dict[str, str], why: str) -> None:
    with pytest.raises(UnreadableInputError, match=why) as caught:
        read_description(written(tmp_path, **changes))
    assert str(caught.value).startswith(str(tmp_path / "brick.yaml"))


@pytest.mark.parametrize(
    ("changes", "warning"),
    [
        (
            {"mass": "0.002", "inertia": "[3.5e-6, 3.0e-6, 1.7e-6]"},
            "mass: 0.002 kg in 0.576 litres is 3.5 kg/m^3, lighter than foam",
        ),
        ({"friction": "2"}, "friction: 2 is large; a coefficient is mostly 0.05 to 1.5"),
        ({"length_scale": "0.005"}, "length_scale: 0.005 m is far from 0.0416 m, half the edge of a cube of the body's volume"),
        ({"gravity": "1.62"}, "gravity: 1.62 m/s^2 is not that of the Earth"),
        (
            {"inertia": "[6.0e-6, 6.0e-6, 6.0e-6]"},
            "inertia: moments of 6e-06 kg m^2 are small; evenly spread mass has 0.00025 to 0.00052",
        ),
    ],
)
def test_what_is_odd_but_possible_is_said(tmp_path: Path, changes: dict[str, str], warning: str) -> None:
    assert read_description(written(tmp_path, **changes)).warnings == (warning,)


def test_all_mass_at_the_farthest_corners_has_the_largest_moments_that_there_are(tmp_path: Path) -> None:
    largest = 0.3 * (0.03**2 + 0.04**2 + 0.06**2)
    assert read_description(written(tmp_path, inertia=f"[{largest!r}, {largest!r}, 1.0e-3]")).warnings == ()
    with pytest.raises(UnreadableInputError, match="inertia: found moments"):
        read_description(written(tmp_path, inertia=f"[{1.001 * largest!r}, {largest!r}, 1.0e-3]"))


def test_a_mesh_in_millimetres_is_named_so(tmp_path: Path) -> None:
    corners = "".join(f"v {x} {y} {z}\n" for x in (0, 60) for y in (0, 80) for z in (0, 120))
    faces = "f 1 2 4\nf 1 4 3\nf 5 7 8\nf 5 8 6\nf 1 5 6\nf 1 6 2\nf 3 4 8\nf 3 8 7\nf 1 3 7\nf 1 7 5\nf 2 6 8\nf 2 8 4\n"
    (tmp_path / "brick.obj").write_text(corners + faces)
    with pytest.raises(UnreadableInputError, match=r"a body 120 m wide .* are they in mm\?"):
        read_description(tmp_path / "brick.obj", BodyOptions(mass=0.3))
    assert read_description(tmp_path / "brick.obj", BodyOptions(mass=0.3, friction=0.3, scale=0.001)).warnings == ()


def test_vertices_about_another_point_than_the_centre_of_mass_are_noticed(tmp_path: Path) -> None:
    vertices = "[[1, 0, 0], [1.1, 0, 0], [1, 0.1, 0], [1, 0, 0.1]]"
    file = written(tmp_path, inertia="[1.0e-4, 1.0e-4, 1.0e-4]", length_scale="0.03")
    file.write_text(file.read_text().replace("half_extents: [0.03, 0.04, 0.06]", f"vertices: {vertices}"))
    with pytest.raises(UnreadableInputError, match="the centre of mass, their origin, lies outside of their hull"):
        read_description(file)


HALF = np.array([0.03, 0.04, 0.06])


def brick(size: float = 1.0, **changes: Any) -> BodyNumbers:
    """The brick, so many times as large, with some of its numbers changed."""
    half = size * HALF
    mass = changes.get("mass", 0.3)
    given = {
        "vertices": box(half).vertices,
        "mass": mass,
        "inertia": np.diag([5.2e-4, 4.5e-4, 2.5e-4]),
        "friction": 0.2,
        "length_scale": 0.045,
        "gravity": 9.81,
    }
    return BodyNumbers(
        **(given | changes), volume=8.0 * half.prod(), hull_inertia=np.diag(mass / 3.0 * (half @ half - half**2))
    )


HEAVY = "denser than any metal, expected kilograms"
LIGHT = "lighter than air, expected metres"
METRES = "expected metres"
MOST = "but 0.3 kg within 78 mm of the centre of mass has at most 0.0018, expected kg m^2"
LEAST = "but 0.3 kg within 78 mm of the centre of mass, spread evenly, has 0.00025 to 0.00052, expected kg m^2"
OUTSIDE = (
    "found the centre of mass, their origin, lies outside of their hull, "
    "expected vertices about it, or about another point with center_of_mass"
)
CUBE_EDGE = "m is far from 0.0416 m, half the edge of a cube of the body's volume"
COEFFICIENT = "expected a coefficient, mostly 0.05 to 1.5"
SCALE = "m for a body 0.12 m wide, expected metres, about 0.0416"


@pytest.mark.parametrize(
    ("body", "message"),
    [
        (brick(mass=300.0), f"mass: found 300 kg in 0.576 litres, 5.21e+05 kg/m^3, {HEAVY}: is it in grams (0.3 kg)?"),
        (
            brick(mass=3e6),
            f"mass: found 3e+06 kg in 0.576 litres, 5.21e+09 kg/m^3, {HEAVY}: in which unit is it, or are the vertices?",
        ),
        (brick(1e3), f"vertices: found a body 120 m wide of 5.2e-07 kg/m^3, {LIGHT}: are they in mm?"),
        (brick(1e2), f"vertices: found a body 12 m wide of 0.00052 kg/m^3, {LIGHT}: are they in cm?"),
        (brick(26.0), f"vertices: found a body 3.12 m wide of 0.03 kg/m^3, {LIGHT}: are they in inches?"),
        (brick(26.0, mass=3000.0), f"vertices: found a body 3.12 m wide, {METRES}: in which unit are they, or the mass?"),
        (brick(mass=5e-4), f"vertices: found a body 0.12 m wide of 0.87 kg/m^3, {LIGHT}: in which unit are they, or the mass?"),
        (
            brick(vertices=box(HALF).vertices + np.array([0.1, 0.0, 0.0])),
            f"vertices: {OUTSIDE}",
        ),
        (
            brick(inertia=np.diag([520.0, 450.0, 250.0])),
            f"inertia: found moments of 2.5e+02 to 5.2e+02, {MOST}: is it in kg mm^2?",
        ),
        (brick(inertia=np.diag([5.2, 4.5, 2.5])), f"inertia: found moments of 2.5 to 5.2, {MOST}: is it in kg cm^2?"),
        (
            brick(inertia=np.diag([5.2e5, 4.5e5, 2.5e5])),
            f"inertia: found moments of 2.5e+05 to 5.2e+05, {MOST}: is it in g mm^2?",
        ),
        (
            brick(inertia=np.diag([5.2e3, 4.5e3, 2.5e3])),
            f"inertia: found moments of 2.5e+03 to 5.2e+03, {MOST}: is it in g cm^2?",
        ),
        (brick(inertia=5.2e-10 * np.eye(3)), f"inertia: found moments of 5.2e-10, {LEAST}: in which unit is it?"),
        (
            brick(inertia=np.diag([5.2e-4, 4.5e-4, 2.5e-8])),
            f"inertia: found moments of 2.5e-08 to 0.00052, {LEAST}: in which unit is it?",
        ),
        (brick(friction=5.1), f"friction: found 5.1, {COEFFICIENT}: is it in degrees (tan 5.1 = 0.089) or percent (0.051)?"),
        (brick(friction=60.0), f"friction: found 60, {COEFFICIENT}: is it in percent (0.6)?"),
        (brick(length_scale=45.0), f"length_scale: found 45 {SCALE}: is it in mm (0.045 m)?"),
        (brick(length_scale=2.2), f"length_scale: found 2.2 {SCALE}: is it in cm (0.022 m)?"),
        (brick(length_scale=0.0005), f"length_scale: found 0.0005 {SCALE}"),
        (brick(gravity=9000.5), "gravity: found 9000.5, expected m/s^2: is it in mm/s^2?"),
        (brick(gravity=9000.0), "gravity: found 9000, expected m/s^2: it is 9.81 on Earth"),
        (brick(gravity=11000.0), "gravity: found 11000, expected m/s^2: it is 9.81 on Earth"),
        (brick(gravity=0.1), "gravity: found 0.1, expected m/s^2: it is 9.81 on Earth"),
        (brick(gravity=100.0), "gravity: found 100, expected m/s^2: it is 9.81 on Earth"),
    ],
)
def test_a_number_that_no_body_has_is_refused_with_its_likely_unit(body: BodyNumbers, message: str) -> None:
    with pytest.raises(InvalidValueError) as refused:
        implausible(body)
    assert str(refused.value) == message


@pytest.mark.parametrize(
    ("body", "lines"),
    [
        (brick(friction=1.5), ()),
        (brick(friction=1.6), ("friction: 1.6 is large; a coefficient is mostly 0.05 to 1.5",)),
        (brick(friction=5.0), ("friction: 5 is large; a coefficient is mostly 0.05 to 1.5",)),
        (brick(length_scale=0.2), ()),
        (brick(length_scale=0.21), (f"length_scale: 0.21 {CUBE_EDGE}",)),
        (brick(length_scale=0.008), (f"length_scale: 0.008 {CUBE_EDGE}",)),
        (brick(length_scale=2.0), (f"length_scale: 2 {CUBE_EDGE}",)),
        (brick(gravity=9.71), ()),
        (brick(gravity=9.7), ("gravity: 9.7 m/s^2 is not that of the Earth",)),
        (brick(gravity=9.9), ("gravity: 9.9 m/s^2 is not that of the Earth",)),
        (brick(gravity=99.0), ("gravity: 99 m/s^2 is not that of the Earth",)),
        (brick(gravity=0.11), ("gravity: 0.11 m/s^2 is not that of the Earth",)),
        (
            brick(inertia=6e-6 * np.eye(3), friction=2.0, gravity=1.62, length_scale=0.3),
            (
                "inertia: moments of 6e-06 kg m^2 are small; evenly spread mass has 0.00025 to 0.00052",
                "friction: 2 is large; a coefficient is mostly 0.05 to 1.5",
                "length_scale: 0.3 m is far from 0.0416 m, half the edge of a cube of the body's volume",
                "gravity: 1.62 m/s^2 is not that of the Earth",
            ),
        ),
    ],
)
def test_what_is_possible_but_odd_is_one_line_each(body: BodyNumbers, lines: tuple[str, ...]) -> None:
    assert implausible(body) == lines


def test_a_body_is_as_wide_as_along_its_longest_axis() -> None:
    check_lengths(np.array([[0.0, -2.9, 0.0], [2.9, 0.0, 0.0], [0.0, 0.0, 1.0]]), 500.0)


def test_the_derived_scale_is_half_the_edge_of_a_cube_of_the_volume() -> None:
    assert derived_scale(8.0) == pytest.approx(1.0, rel=1e-15)
