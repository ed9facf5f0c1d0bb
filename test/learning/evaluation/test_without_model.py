"""Predictions without a model, rebounds of first impacts, and the line where a model is no better."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from contact_curation.contact.body import CONTACTNETS_CUBE as CUBE
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.models.polytope import PolytopeModel
from contact_curation.contact.parameter_form import Form
from contact_curation.geometry.quaternions import Array
from contact_curation.learning.evaluation.evaluation import EvaluationConfig, ModelEvaluation, evaluate_model
from contact_curation.learning.evaluation.motion_errors import motion_errors
from contact_curation.learning.evaluation.rebounds import rebounds
from contact_curation.learning.evaluation.without_model import FINAL, RELEASED, doubt, plain_errors
from test.simulated import simulated_tosses


@pytest.fixture(scope="module")
def evaluation() -> ModelEvaluation:
    """Of the model that made the tosses."""
    model = PolytopeModel(ContactGeometry.of_body(CUBE), CUBE, Form.PHYSICAL)
    return evaluate_model(model, simulated_tosses(6, seed=3), EvaluationConfig(threads=1))


def predicting(evaluation: ModelEvaluation, states: Array) -> ModelEvaluation:
    errors = motion_errors(states, evaluation.measured, evaluation.starts, CUBE)
    return replace(evaluation, predicted=states, errors=errors)


def test_plain_predictions_are_the_first_and_the_last_frame_held(evaluation: ModelEvaluation) -> None:
    found = plain_errors(evaluation, CUBE)
    for name, place in ((RELEASED, 0), (FINAL, -1)):
        off = []
        for first, last in zip(evaluation.starts[:-1], evaluation.starts[1:], strict=True):
            own = evaluation.measured[first:last, :3]
            off.append(50.0 * np.linalg.norm(own - own[place], axis=1).mean())
        assert found[name].position == pytest.approx(np.mean(off), rel=1e-9)
    assert found[RELEASED].position > found[FINAL].position > 20.0


def test_the_model_that_made_the_motions_raises_no_doubt(evaluation: ModelEvaluation) -> None:
    assert doubt(evaluation, CUBE) == ""


def test_a_model_no_better_than_the_final_pose_is_doubted_with_both_numbers(evaluation: ModelEvaluation) -> None:
    held = evaluation.measured[np.repeat(evaluation.starts[:-1], np.diff(evaluation.starts))]
    line = doubt(predicting(evaluation, held), CUBE)
    plain = plain_errors(evaluation, CUBE)
    assert line.startswith("the model does not describe these motions: position is off by")
    assert f"{plain[RELEASED].position:.1f} %" in line
    assert f"{plain[FINAL].position:.1f} if the body {FINAL}" in line
    assert "bounces" not in line  # a body that stays has no impact


def test_motions_that_are_not_finite_are_doubted(evaluation: ModelEvaluation) -> None:
    assert "finite" in doubt(predicting(evaluation, np.full_like(evaluation.measured, np.nan)), CUBE)


def dropped(restitution: float, tosses: int = 6) -> tuple[Array, NDArray[np.int64]]:
    """Upright cubes that fall 2 to 3 characteristic lengths and bounce with their face."""
    dt, gravity = 1.0 / 148.0, CUBE.scaled_gravity
    runs = []
    for number in range(tosses):
        height, speed, frames = 3.0 + 0.2 * number, 0.0, []
        for _ in range(90):
            frames.append([0.0, 0.0, height, 1.0, *[0.0] * 9])
            speed -= gravity * dt
            height += speed * dt
            if height < 1.0:
                height, speed = 1.0, -restitution * speed
        runs.append(frames)
    return np.concatenate(runs).astype(float), np.arange(0, 90 * tosses + 1, 90, dtype=np.int64)


@pytest.mark.parametrize("restitution", [0.0, 0.3, 0.6])
def test_rebounds_are_the_restitution_of_the_first_impact(restitution: float) -> None:
    found = rebounds(*dropped(restitution), CUBE)
    assert len(found) == 6
    assert np.median(found) == pytest.approx(restitution, abs=0.1)


def test_a_body_that_bounces_where_its_model_does_not_is_said_to(evaluation: ModelEvaluation) -> None:
    measured, starts = dropped(0.6)
    away = measured.copy()
    away[:, :3] = dropped(0.0)[0][:, :3] + [50.0, 0.0, 0.0]
    errors = motion_errors(away, measured, starts, CUBE)
    assert "it bounces: first impacts leave with 0." in doubt(
        replace(evaluation, measured=measured, predicted=away, starts=starts, errors=errors), CUBE
    )
