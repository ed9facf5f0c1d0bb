"""Numbers of a body that the kernel works with."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from contact_curation.contact.body import CONTACTNETS_CUBE, Body
from contact_curation.errors import InvalidValueError


@pytest.mark.parametrize("seed", range(5))
def test_the_inverse_inertia_undoes_the_inertia(seed: int) -> None:
    axes, _ = np.linalg.qr(np.random.default_rng(seed).standard_normal((3, 3)))
    inertia = axes @ np.diag([6e-4, 7e-4, 1.1e-3]) @ axes.T
    body = Body("one", CONTACTNETS_CUBE.vertices, 0.4, inertia, 0.2, 0.05)
    np.testing.assert_allclose(body.scaled_inverse_inertia @ body.scaled_inertia, np.eye(3), rtol=0.0, atol=1e-15)
    np.testing.assert_allclose(body.scaled_inverse_inertia, np.linalg.inv(body.scaled_inertia), rtol=1e-14, atol=1e-13)


def test_the_inverse_of_principal_moments_is_rounded_once() -> None:
    moments = np.diag(CONTACTNETS_CUBE.scaled_inertia)
    np.testing.assert_array_equal(CONTACTNETS_CUBE.scaled_inverse_inertia, np.diag(1.0 / moments))


def test_a_body_is_given_back_by_its_named_values() -> None:
    body = replace(CONTACTNETS_CUBE, gravity=9.8, center_of_mass=np.array([0.1, 0.2, 0.3]))
    values = body.to_mapping()
    assert values["name"] == "cube"
    assert values["center_of_mass"] == [0.1, 0.2, 0.3]
    again = Body.from_mapping(values)
    assert again.to_mapping() == values
    assert body.first_difference(again) == ""


@pytest.mark.parametrize(
    ("name", "value"),
    [("mass", 0.5), ("vertices", 2.0 * CONTACTNETS_CUBE.vertices), ("friction", 0.1), ("center_of_mass", np.ones(3))],
)
def test_the_first_value_in_which_bodies_differ_is_named_and_a_name_is_none(name: str, value: object) -> None:
    other = replace(CONTACTNETS_CUBE, name="other", gravity=1.0, **{name: value})  # type: ignore[arg-type]
    assert CONTACTNETS_CUBE.first_difference(other) == (name if name != "center_of_mass" else "gravity")
    assert CONTACTNETS_CUBE.first_difference(replace(CONTACTNETS_CUBE, name="other")) == ""


def test_a_body_keeps_copies_that_cannot_be_written_to() -> None:
    given: dict[str, Any] = {
        "vertices": CONTACTNETS_CUBE.vertices.copy(),
        "inertia": np.diag([8e-4] * 3),
        "center_of_mass": np.zeros(3),
    }
    body = replace(CONTACTNETS_CUBE, **given)
    for name, array in given.items():
        array[:] = 7.0
        assert not (getattr(body, name) == 7.0).any()
        with pytest.raises(ValueError, match="read-only"):
            getattr(body, name)[0] = 7.0


@pytest.mark.parametrize(
    ("name", "value", "why"),
    [
        ("mass", "heavy", "mass: found heavy, expected numbers"),
        ("mass", None, "mass: found None, expected numbers"),
        ("mass", True, "mass: found True, expected numbers"),
        ("mass", np.array([0.4]), r"mass: found \[0.4\], expected one number"),
        ("friction", None, "friction: found None, expected numbers"),
        ("name", 3, "name of the body: found 3, expected letters"),
        ("vertices", [[0.0, 0.0, 1.0], [1.0]], "vertices: found .*, expected numbers"),
        ("vertices", "cube", "vertices: found cube, expected numbers"),
        ("center_of_mass", [0.0, 0.0], "center_of_mass: found .*, expected 3 finite numbers"),
    ],
)
def test_what_is_no_body_is_refused_with_what_was_found(name: str, value: Any, why: str) -> None:
    with pytest.raises(InvalidValueError, match=why):
        replace(CONTACTNETS_CUBE, **{name: value})


def test_a_centre_of_mass_elsewhere_is_three_numbers() -> None:
    with pytest.raises(InvalidValueError, match=r"center_of_mass: found .*, expected 3 finite numbers"):
        CONTACTNETS_CUBE.about([0.0, 0.0])
