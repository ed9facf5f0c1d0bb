"""Theta from a JSON file: what is accepted, and one clear line for everything else."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.errors import ContactCurationError
from contact_curation.storage.parameters_file import read_parameters

TRUE = ContactGeometry.of_body(CONTACTNETS_CUBE)
KEYS = ("vertices_normal", "normal", "vertices_tangent", "tangents")


def plain(geometry: ContactGeometry = TRUE) -> dict[str, Any]:
    return {key: getattr(geometry, key).tolist() for key in KEYS}


def written(folder: Path, data: object) -> Path:
    path = folder / "params.json"
    path.write_text(data if isinstance(data, str) else json.dumps(data))
    return path


def test_the_four_keys_give_theta_and_the_bodys_own_constants(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    given = replace(TRUE, vertices_normal=rng.normal(size=(8, 3)), tangents=rng.normal(size=(2, 3)))
    read = read_parameters(written(tmp_path, plain(given)), CONTACTNETS_CUBE)
    for key in KEYS:
        np.testing.assert_array_equal(getattr(read.geometry, key), getattr(given, key))
    assert read.geometry.height == 0.0
    assert (read.body.mass, read.body.length_scale) == (0.37, 0.0524)
    np.testing.assert_array_equal(read.body.inertia, CONTACTNETS_CUBE.inertia)


@pytest.mark.parametrize("inertia", [0.295, [0.295, 0.295, 0.295], np.diag([0.295] * 3).tolist()])
def test_mass_inertia_and_length_scale_replace_the_bodys(tmp_path: Path, inertia: object) -> None:
    path = written(tmp_path, {**plain(), "mass": 0.5, "inertia": inertia, "length_scale": 0.1})
    body = read_parameters(path, CONTACTNETS_CUBE).body
    assert (body.mass, body.length_scale) == (0.5, 0.1)
    np.testing.assert_allclose(body.scaled_inertia, np.diag([0.295] * 3), rtol=1e-12)
    np.testing.assert_allclose(body.inertia, np.diag([0.295 * 0.1**2] * 3), rtol=1e-12)


def without(key: str) -> dict[str, Any]:
    return {name: value for name, value in plain().items() if name != key}


@pytest.mark.parametrize(
    ("content", "says"),
    [
        ("{", "is not JSON"),
        ("\x00\xff", "is not JSON"),
        ("[" * 100_000, "is not JSON"),
        ([1, 2], "an object with the keys vertices_normal"),
        (without("normal"), "no normal"),
        ({**plain(), "friction": 0.2}, "unknown friction"),
        ({**plain(), "normal": [0.0, 0.0]}, "normal: found shape (2,)"),
        ({**plain(), "vertices_normal": plain()["vertices_normal"][:7]}, "vertices_normal: found shape (7, 3), expected"),
        ({**plain(), "vertices_tangent": [[0, 0, 1], [0, 1]]}, "rows of different lengths"),
        ({**plain(), "normal": [0.0, 0.0, float("nan")]}, "normal: found a value that is not finite"),
        ({**plain(), "normal": ["0", "0", "1"]}, "normal: found ['0', '0', '1']"),
        ({**plain(), "normal": [False, False, True]}, "normal: found [False"),
        ({**plain(), "normal": [0, 0, True]}, "normal: found [0, 0, True]"),
        ({**plain(), "normal": [0, 0, 1e200]}, "normal: found 1e+200"),
        ({**plain(), "inertia": 1e200}, "inertia: found 1e+200"),
        ({**plain(), "normal": [0, 0, 0]}, "normal: found the zero vector"),
        ({**plain(), "normal": None}, "normal: found None"),
        ({**plain(), "tangents": [[10**400, 0, 0], [0, 1, 0]]}, "tangents: found"),
        ({**plain(), "mass": -1.0}, "mass: found -1.0"),
        ({**plain(), "mass": [1.0]}, "mass: found shape (1,)"),
        ({**plain(), "inertia": [[1, 2, 0], [0, 1, 0], [0, 0, 1]]}, "expected a positive definite matrix"),
        ({**plain(), "inertia": 0.0}, "expected a positive definite matrix"),
        ({**plain(), "length_scale": 0.0}, "length_scale: found 0.0"),
        ({**plain(), "length_scale": 1e200, "inertia": 1.0}, "length_scale: found 1e+200"),
    ],
)
def test_anything_else_is_one_clear_line_that_names_the_file(tmp_path: Path, content: object, says: str) -> None:
    path = written(tmp_path, content)
    with pytest.raises(ContactCurationError) as caught:
        read_parameters(path, CONTACTNETS_CUBE)
    assert says in str(caught.value)
    assert str(caught.value).startswith(str(path))
    assert len(str(caught.value)) < 400 + len(str(path))


def test_a_file_that_is_not_there_or_is_a_folder_is_one_clear_line(tmp_path: Path) -> None:
    for path in (tmp_path / "none.json", tmp_path):
        with pytest.raises(ContactCurationError, match="cannot be read"):
            read_parameters(path, CONTACTNETS_CUBE)


def test_a_huge_file_is_refused_before_it_is_parsed(tmp_path: Path) -> None:
    with pytest.raises(ContactCurationError, match="more than 1048576 bytes"):
        read_parameters(written(tmp_path, " " * (1 << 20) + "{}"), CONTACTNETS_CUBE)
