"""Whatever diverges is told from what merely was not solved, and found among its neighbours."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from contact_curation.contact.loss_config import DEFAULT_LOSS
from contact_curation.contact.models.registry import MODELS
from contact_curation.contact.parameter_form import Form
from contact_curation.learning.training.data import rows_of
from contact_curation.learning.training.objective import not_finite, not_finite_gradient
from contact_curation.learning.training.progress import TrainingState
from contact_curation.learning.training.protocols import published
from contact_curation.learning.training.training import Training
from test.contact.cases import tracked_transitions
from test.contact.model_cases import VARIANTS, model_of
from test.contact.model_cases import rows_of as rows_of_kind
from test.learning.toy import SOLVED, STEEP, UNSOLVED, Toy, toy_data


@pytest.mark.parametrize(("kind", "form"), VARIANTS[:-1])
def test_contacts_that_cannot_be_squared_are_not_finite(kind: str, form: Form) -> None:
    model, rows = model_of(kind, form), rows_of_kind("impact", 3)
    assert not not_finite(model, rows).any()
    after = rows.after.copy()
    after[1, 2] = 1e200
    assert not_finite(model, rows._replace(after=after)).tolist() == [False, True, False]


def test_what_an_end_to_end_model_could_not_solve_is_not_finite() -> None:
    assert not_finite(model_of("end_to_end", Form.PHYSICAL), rows_of_kind("impact", 2)).all()


@pytest.mark.parametrize(
    ("targets", "what", "culprit"),
    [
        ([1.0, 2.0, 3.0], [SOLVED, STEEP, SOLVED], 1),
        ([1.0, 1e200, 3.0], [SOLVED, SOLVED, SOLVED], 1),  # its square is not finite
        ([1.0, 2.0, 9.0], [UNSOLVED, SOLVED, SOLVED], 2),  # none alone: the largest
    ],
)
def test_the_culprit_has_a_gradient_that_is_not_finite_or_the_largest(
    targets: list[float], what: list[float], culprit: int
) -> None:
    assert not_finite_gradient(Toy(), rows_of(toy_data(targets, what)), DEFAULT_LOSS) == culprit


@pytest.mark.parametrize("kind", list(MODELS))
def test_parameters_that_have_run_away_stop_the_training_by_name(kind: str) -> None:
    data = tracked_transitions()
    model = model_of(kind, Form.CONTACTNETS)
    with torch.no_grad():
        for value in model.parameters():
            value.mul_(1e200)
    training = Training(model, data, None, replace(published(kind), patience=None), 0)
    progress = training.advance(3)
    assert progress.state is TrainingState.FAILED
    name, place = progress.reason.split(",")[0], int(progress.reason.split("transition ")[1].split(":")[0])
    assert name.removeprefix("toss ") in data.toss_ids
    assert 0 <= place < np.diff(data.starts).max()
    assert "not finite" in progress.reason
