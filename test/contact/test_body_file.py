"""Bodies are described in YAML; every mistake is one line that names the file and the key."""

from pathlib import Path

import numpy as np
import pytest

from contact_curation.contact.body import CONTACTNETS_CUBE, Body
from contact_curation.contact.body_description import LARGEST_FILE
from contact_curation.errors import UnreadableInputError

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
        (("length_scale: 0.0524", ""), r"missing key: length_scale \(e.g. 0.0524\)"),
        (("inertia: [0.00081, 0.00081, 0.00081]", ""), r"missing key: inertia \(e.g. \[0.000677, 0.000677, 0.000677\]\)"),
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
