"""The ground's height is held near the board where a model learns one, and nowhere else."""

from dataclasses import replace

import numpy as np
import pytest

from contact_curation.contact.models.polytope import PolytopeModel
from contact_curation.contact.parameter_form import Form
from contact_curation.learning.training.objective import ground_excess, height_parameters
from contact_curation.learning.training.protocols import budgeted
from contact_curation.learning.training.training import new_training
from test.contact.cases import CUBE, tracked_transitions
from test.contact.model_cases import model_of


@pytest.mark.parametrize(
    ("kind", "form", "count"),
    [
        ("polytope", Form.PHYSICAL, 1),
        ("deep", Form.PHYSICAL, 1),
        ("polytope", Form.CONTACTNETS, 0),
        ("deepvertex", Form.PHYSICAL, 0),
        ("end_to_end", Form.PHYSICAL, 0),
    ],
)
def test_a_height_is_found_where_one_is_learned(kind: str, form: Form, count: int) -> None:
    assert len(height_parameters(model_of(kind, form))) == count


def test_the_excess_is_the_square_and_its_slope_twice_the_height() -> None:
    heights = height_parameters(model_of("polytope", Form.PHYSICAL))
    value, height = ground_excess(heights), float(heights[0].detach())
    value.backward()  # type: ignore[no-untyped-call]
    assert float(value.detach()) == pytest.approx(height**2)
    assert heights[0].grad is not None
    assert float(heights[0].grad) == pytest.approx(2.0 * height)


def height_after(weight: float) -> float:
    config = replace(budgeted("polytope"), steps=60, batch=32, ground=weight)
    training = new_training("polytope", CUBE, tracked_transitions(), None, config, 0)
    training.advance(60)
    assert isinstance(training.model, PolytopeModel)
    return abs(training.model.geometry().height)


def test_a_heavier_weight_holds_the_height_nearer_to_zero() -> None:
    free, held = height_after(0.0), height_after(100.0)
    assert held < 0.02 < free
    assert np.isfinite(free)
