"""Learning from tosses as they come: to the optimum each time, or a round of gradient steps each time."""

from dataclasses import replace

import numpy as np
import pytest

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.loss_config import LossConfig
from contact_curation.contact.models.polytope import PolytopeModel
from contact_curation.contact.parameter_form import Form
from contact_curation.errors import InvalidValueError
from contact_curation.experiments.thrown.cell import ThrowsCell
from contact_curation.experiments.thrown.designed_throws import RoundsLearner
from contact_curation.learning.training.protocols import ROUND_TRIMMED, budgeted, exact
from test.simulated import simulated_tosses

CONFIG = replace(exact(ROUND_TRIMMED), loss=LossConfig(threads=1))
TOSSES = simulated_tosses(3, seed=4)


def start() -> PolytopeModel:
    """A cube that is too large."""
    described = ContactGeometry.of_body(CONTACTNETS_CUBE)
    vertices = 1.2 * described.vertices_normal
    geometry = replace(described, vertices_normal=vertices, vertices_tangent=vertices)
    return PolytopeModel(geometry, CONTACTNETS_CUBE, Form.PHYSICAL)


def off(model: PolytopeModel) -> float:
    return float(np.abs(model.geometry().vertices_normal - CONTACTNETS_CUBE.scaled_vertices).mean())


def test_an_exact_learner_knows_only_which_tosses_came() -> None:
    one, other = (RoundsLearner(start(), CONFIG, 1, 0) for _ in range(2))
    begun = off(one.model)
    assert one.learn(TOSSES[:2])
    assert one.learn(TOSSES)
    assert other.learn(TOSSES)
    assert np.array_equal(one.model.geometry().vertices_normal, other.model.geometry().vertices_normal)
    assert off(one.model) < 0.5 * begun


def test_a_budgeted_learner_goes_on_from_round_to_round_from_two_tosses_on() -> None:
    learner = RoundsLearner(start(), budgeted("polytope"), 5, 0)
    begun = learner.model.geometry().vertices_normal
    assert not learner.learn(TOSSES[:1])
    assert np.array_equal(learner.model.geometry().vertices_normal, begun)
    assert learner.learn(TOSSES[:2])
    first = learner.model.geometry().vertices_normal
    assert learner.learn(TOSSES)
    second = learner.model.geometry().vertices_normal
    assert 0.0 < np.abs(second - first).max() < np.abs(second - begun).max()


@pytest.mark.parametrize(
    ("cell", "line"),
    [
        ({"rule": "longest"}, "unknown rule of designed-throws longest: expected one of "),
        ({"model": "deep"}, "unknown model of designed-throws deep: expected one of polytope"),
        ({"protocol": "published"}, "unknown protocol of designed-throws published"),
        ({"world": "icy"}, "unknown world of designed-throws icy: expected one of bouncing, firm"),
        ({"restitution": True, "protocol": "budgeted", "steps": 5}, "restitution: found protocol budgeted"),
        ({"judged": (0, 2)}, "numbers of throws: found \\(0, 2\\), expected rising numbers from 1 on"),
        ({"judged": (4, 2)}, "numbers of throws"),
        ({"steps": 5}, "steps: found 5"),
    ],
)
def test_cells_that_there_cannot_be(cell: dict[str, object], line: str) -> None:
    with pytest.raises(InvalidValueError, match=line):
        ThrowsCell(**{"rule": "random", "judged": (2,), "seed": 0, **cell})  # type: ignore[arg-type]


def test_cells_differ_by_their_keys() -> None:
    cells = [ThrowsCell(rule, judged, seed) for rule in ("random", "raw") for judged in ((2,), (1, 2)) for seed in (0, 1)]
    assert len({cell.key for cell in cells}) == len(cells)
    assert cells[0].key == ThrowsCell("random", (2,), 0).key
    fields = {"rule": "random", "seed": 0, "protocol": "exact", "steps": 0, "model": "polytope"}
    assert cells[0].fields == fields | {"world": "firm", "restitution": False}
