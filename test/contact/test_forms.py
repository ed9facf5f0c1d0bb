"""Forms of theta: their charts against finite differences of the geometry, their gauge, their names."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from contact_curation.contact.evaluation import evaluate
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.models.polytope import PolytopeModel
from contact_curation.contact.parameter_form import Form, is_physical, moved_geometry, parameter_form
from contact_curation.errors import InvalidValueError
from contact_curation.geometry import quaternions
from contact_curation.geometry.quaternions import Array
from contact_curation.learning.fits import polytope_sums
from test.contact.cases import CUBE, DT, TRUE, full_vector, noisy_geometry, rows_of_kind

FRICTION, TILT, HEIGHT = 48, slice(49, 51), 51


def tilted_cube() -> ContactGeometry:
    """A physical geometry with nothing special about it."""
    turn = quaternions.to_matrix(quaternions.exp([0.2, -0.1, 0.7]))
    corners = CUBE.scaled_vertices + 0.05 * np.random.default_rng(1).standard_normal((8, 3))
    return ContactGeometry(corners, turn[2], 0.9 * corners, 0.31 * turn[:2], np.array([0.5, -2.0, 0.3]), 0.07)


def moved(geometry: ContactGeometry, step: Array) -> ContactGeometry:
    """A physical geometry after a step (52,) in its own parameters: corners, log friction, a turn of the plane, height."""
    axes = geometry.tangents / np.linalg.norm(geometry.tangents[0])
    # A turn about axis b moves the normal towards axis a, one about -a towards b.
    turn = quaternions.to_matrix(quaternions.exp(step[TILT][0] * axes[1] - step[TILT][1] * axes[0]))
    return ContactGeometry(
        geometry.vertices_normal + step[:24].reshape(8, 3),
        turn @ geometry.normal,
        geometry.vertices_tangent + step[24:48].reshape(8, 3),
        np.exp(step[FRICTION]) * geometry.tangents @ turn.T,
        geometry.pivot,
        geometry.height + step[HEIGHT],
    )


@pytest.mark.parametrize("geometry", [TRUE, tilted_cube()], ids=["true", "tilted"])
def test_the_physical_chart_is_the_derivative_of_the_geometry(geometry: ContactGeometry) -> None:
    chart = parameter_form(geometry, Form.PHYSICAL).chart
    for k in range(52):
        step = 1e-6 * (np.arange(52) == k)
        slope = (full_vector(moved(geometry, step)) - full_vector(moved(geometry, -step))) / 2e-6
        np.testing.assert_allclose(chart[:, k], slope, atol=1e-9)


def test_a_step_in_the_physical_form_stays_physical() -> None:
    step = 0.1 * np.random.default_rng(2).standard_normal(52)
    assert is_physical(moved(tilted_cube(), step))


@pytest.mark.parametrize(
    ("form", "restitution"), [(Form.PHYSICAL, None), *((Form.RIGID, bounce) for bounce in (None, 0.3, 0.0, 1.0))]
)
def test_a_geometry_moves_as_the_model_does(form: Form, restitution: float | None) -> None:
    geometry = replace(TRUE.rigid() if form is Form.RIGID else tilted_cube(), restitution=restitution)
    own = parameter_form(geometry, form)
    for side in (0.05, -0.05):
        step = side * np.random.default_rng(3).standard_normal(own.size)
        with torch.no_grad():
            expected = polytope_sums.moved(PolytopeModel(geometry, CUBE, form), step).geometry()
        found = moved_geometry(geometry, own, step)
        for name in ("vertices_normal", "vertices_tangent", "normal", "tangents", "pivot", "height"):
            np.testing.assert_allclose(getattr(found, name), getattr(expected, name), atol=1e-12, err_msg=name)
        assert found.restitution == (None if restitution is None else pytest.approx(expected.restitution))
        assert found.noise == geometry.noise


@pytest.mark.parametrize("step", [-300.0, -8.0, 10.0, 40.0])
def test_a_geometry_is_physical_whatever_its_friction(step: float) -> None:
    assert is_physical(moved(tilted_cube(), step * (np.arange(52) == FRICTION)))


def test_the_contactnets_chart_leaves_out_the_height_and_the_gauge_and_changes_nothing_else() -> None:
    form = parameter_form(noisy_geometry(1), Form.CONTACTNETS)
    steps = np.random.default_rng(0).standard_normal((5, 57))
    along = steps @ form.gauge.T
    np.testing.assert_allclose(
        (steps - along * form.gauge) @ form.chart.T, np.pad(steps - along * form.gauge, ((0, 0), (0, 1))), atol=1e-14
    )
    np.testing.assert_allclose(form.chart @ form.gauge.T, 0.0, atol=1e-15)
    np.testing.assert_array_equal(form.chart[57], 0.0)


def test_scores_have_nothing_along_the_gauge() -> None:
    """method.md 6.5: a turn of the tangents leaves a circular cone's loss as it is."""
    geometry = noisy_geometry(4)
    gauge = parameter_form(geometry, Form.CONTACTNETS).gauge[0]
    assert np.linalg.norm(gauge) == pytest.approx(1.0)
    for kind in ("impact", "sliding"):
        rows = rows_of_kind(kind)
        scores = evaluate(geometry, CUBE, rows.before, rows.after, DT).scores[:, :57]
        assert (np.square(scores @ gauge) / np.square(scores).sum(axis=1)).max() < 1e-12


def test_the_names_of_the_physical_form_say_what_they_count() -> None:
    form = parameter_form(TRUE, Form.PHYSICAL)
    names = form.names()
    assert len(names) == form.size == 52
    assert names[47:] == ("vertices_tangent[7][2]", "friction", "tilt[0]", "tilt[1]", "height")


def test_every_form_names_its_blocks_and_their_places() -> None:
    point = ContactGeometry(np.zeros((1, 3)), TRUE.normal, np.zeros((1, 3)), TRUE.tangents, restitution=0.3)
    corner = tuple(f"vertices_normal[0][{axis}]" for axis in range(3))
    rigid = parameter_form(point, Form.RIGID)
    assert rigid.names() == (*corner, "restitution", "friction", "tilt[0]", "tilt[1]", "height")
    assert rigid.chart.shape == (17, 8)
    np.testing.assert_array_equal(rigid.chart[16], np.arange(8) == 3)
    np.testing.assert_array_equal(rigid.chart[:, 3], np.arange(17) == 16)
    still = parameter_form(replace(point, restitution=None), Form.RIGID)
    assert still.names() == (*corner, "friction", "tilt[0]", "tilt[1]", "height")
    np.testing.assert_array_equal(still.chart, np.delete(rigid.chart[:16], 3, axis=1))
    assert rigid.gauge.shape == (0, 8)
    np.testing.assert_allclose(still.tilt_axes, np.eye(2, 3))
    own = parameter_form(replace(point, restitution=None), Form.CONTACTNETS)
    tangents = tuple(f"tangents[{row}][{axis}]" for row in range(2) for axis in range(3))
    tangent_corner = tuple(f"vertices_tangent[0][{axis}]" for axis in range(3))
    assert own.names() == (*corner, "normal[0]", "normal[1]", "normal[2]", *tangent_corner, *tangents)
    assert own.tilt_axes.shape == (0, 3)
    with pytest.raises(
        InvalidValueError, match=r"^form: found physical, expected rigid, since the parameters have a restitution$"
    ):
        parameter_form(point, Form.PHYSICAL)


def test_a_geometry_that_is_not_physical_has_no_physical_form() -> None:
    assert not is_physical(noisy_geometry(5))
    long = replace(TRUE, normal=2.0 * TRUE.normal)
    with pytest.raises(InvalidValueError) as refused:
        parameter_form(long, Form.PHYSICAL)
    assert str(refused.value) == (
        "parameters: found a normal of length 2 or tangents that are not orthogonal, expected a unit normal and "
        "one friction coefficient, as the physical form has; use the contactnets form"
    )
    slippery = ContactGeometry(TRUE.vertices_normal, TRUE.normal, TRUE.vertices_tangent, np.zeros((2, 3)))
    assert not is_physical(slippery)
