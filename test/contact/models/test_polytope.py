"""A tilted plane is a turned one, the shortest way, and its slopes are derivatives."""

import numpy as np
import pytest
import torch
from torch import Tensor

from contact_curation.contact.models.polytope import PolytopeModel, tilted_plane
from contact_curation.contact.parameter_form import Form
from contact_curation.geometry import quaternions
from test.contact.cases import CUBE
from test.contact.model_cases import tossed_rows

FRAME = torch.as_tensor(quaternions.to_matrix(quaternions.normalized([0.3, -0.5, 0.7, 0.2])))
TILTS = pytest.mark.parametrize("tilt", [[0.0, 0.0], [0.4, -0.3], [-2.0, 1.0]])


def given(tilt: list[float]) -> tuple[Tensor, Tensor]:
    return torch.tensor(tilt, dtype=torch.float64), torch.tensor(-1.7, dtype=torch.float64)


@TILTS
def test_normal_and_axes_stay_a_frame_with_one_friction(tilt: list[float]) -> None:
    normal, tangents = tilted_plane(*given(tilt), FRAME)
    axes = torch.cat([normal[None], tangents / np.exp(-1.7)])
    torch.testing.assert_close(axes @ axes.T, torch.eye(3, dtype=torch.float64), rtol=0.0, atol=1e-14)
    assert float(torch.linalg.det(axes)) == pytest.approx(float(torch.linalg.det(FRAME)))


@TILTS
def test_it_turns_the_shortest_way_to_where_the_tilt_points(tilt: list[float]) -> None:
    normal, tangents = tilted_plane(*given(tilt), FRAME)
    wanted = FRAME[0] + tilt[0] * FRAME[1] + tilt[1] * FRAME[2]
    torch.testing.assert_close(normal, wanted / wanted.norm(), rtol=0.0, atol=1e-14)
    axes = torch.cat([normal[None], tangents / np.exp(-1.7)])
    cosine = float(normal @ FRAME[0])  # of the angle between the normals; the turn's own is no larger
    assert float(torch.trace(axes.T @ FRAME)) == pytest.approx(1.0 + 2.0 * cosine)


@TILTS
def test_slopes_are_derivatives(tilt: list[float]) -> None:
    values = tuple(value.requires_grad_() for value in given(tilt))
    assert torch.autograd.gradcheck(lambda lean, friction: tilted_plane(lean, friction, FRAME), values)


@pytest.mark.parametrize("form", list(Form))
def test_a_body_as_described_is_on_a_level_board_that_tilts_about_a_point_amid_the_data(form: Form) -> None:
    model, rows = PolytopeModel.as_described(CUBE, form, tossed_rows()), tossed_rows()
    found = model.geometry()
    assert (model.body, model.form, found.height) == (CUBE, form, 0.0)
    for vertices in (found.vertices_normal, found.vertices_tangent):
        np.testing.assert_array_equal(vertices, CUBE.scaled_vertices)
    np.testing.assert_array_equal(found.normal, [0.0, 0.0, 1.0])
    np.testing.assert_allclose(found.tangents, CUBE.friction * np.eye(2, 3), rtol=1e-15)
    pivot = np.zeros(3) if form is Form.CONTACTNETS else [*rows.before[:, :2].mean(axis=0), 0.0]
    np.testing.assert_array_equal(found.pivot, pivot)
