"""Steps of one transition in the kernel: the same training as along the long way."""

from dataclasses import replace

import numpy as np
import pytest

from contact_curation.contact.model_kind import ModelKind
from contact_curation.contact.models import tensors_of
from contact_curation.contact.parameter_form import Form
from contact_curation.errors import InvalidValueError
from contact_curation.learning.progress import TrainingState
from contact_curation.learning.protocols import TrainingConfig, budgeted, published
from contact_curation.learning.single_steps import SingleSteps
from contact_curation.learning.training import Training, new_training
from contact_curation.motion.transitions import Transitions
from test.contact.cases import CUBE, tracked_transitions

CONFIG = replace(published(ModelKind.POLYTOPE), patience=None, epochs=2)


@pytest.fixture
def long_way(monkeypatch: pytest.MonkeyPatch) -> pytest.MonkeyPatch:
    monkeypatch.setattr(SingleSteps, "of", staticmethod(lambda *_: None))
    return monkeypatch


def training(config: TrainingConfig = CONFIG, data: Transitions | None = None) -> Training:
    return new_training(ModelKind.POLYTOPE, CUBE, tracked_transitions() if data is None else data, None, config, 0)


def told(one: Training) -> tuple[object, ...]:
    return one.progress, one.history, {name: value.tolist() for name, value in tensors_of(one.model).items()}


def assert_alike(one: Training, other: Training) -> None:
    """But for rounding."""
    for name in ("gradient_steps", "epochs", "not_solved", "state"):
        assert getattr(one.progress, name) == getattr(other.progress, name)
    assert one.progress.training_loss == pytest.approx(other.progress.training_loss, rel=1e-12)
    theirs = tensors_of(other.model)
    for name, value in tensors_of(one.model).items():
        np.testing.assert_allclose(value, theirs[name], rtol=0.0, atol=1e-11)


def test_both_ways_give_the_same_numbers(long_way: pytest.MonkeyPatch) -> None:
    other = training()
    other.advance(10**6)
    long_way.undo()
    ours = training()
    assert SingleSteps.of(ours.model, ours.data, CONFIG, ours.optimizer) is not None
    ours.advance(10**6)
    assert ours.progress.state is TrainingState.SPENT
    assert_alike(ours, other)


@pytest.mark.parametrize("config", [CONFIG, replace(CONFIG, evaluation_steps=7, steps=100)])
def test_however_steps_are_cut_into_calls_the_bits_are_the_same(config: TrainingConfig) -> None:
    whole, cut = training(config), training(config)
    whole.advance(10**6)
    for steps in (1, 2, 30, 5, 10**6):
        cut.advance(steps)
    assert whole.progress.state is TrainingState.SPENT
    assert told(cut) == told(whole)


def test_evaluations_come_at_the_steps_that_they_come_at_along_the_long_way(long_way: pytest.MonkeyPatch) -> None:
    config = replace(CONFIG, evaluation_steps=7, steps=100)
    other = training(config)
    other.advance(10**6)
    long_way.undo()
    ours = training(config)
    ours.advance(10**6)
    assert [one.gradient_steps for one in ours.history] == [*range(7, 100, 7), 100]
    assert [one.gradient_steps for one in other.history] == [one.gradient_steps for one in ours.history]
    assert_alike(ours, other)


def test_rows_that_are_not_solved_are_left_out_by_both_ways(long_way: pytest.MonkeyPatch) -> None:
    config = replace(CONFIG, epochs=1, loss=replace(CONFIG.loss, max_iterations=9))
    other = training(config)
    other.advance(10**6)
    long_way.undo()
    ours = training(config)
    ours.advance(10**6)
    assert 0 < ours.progress.not_solved < ours.progress.gradient_steps
    assert_alike(ours, other)


def test_a_fresh_budget_on_other_data_gives_the_same_numbers_both_ways(long_way: pytest.MonkeyPatch) -> None:
    whole = tracked_transitions()
    first = slice(0, int(whole.starts[1]))
    half = Transitions(whole.toss_ids[:1], whole.before[first], whole.after[first], whole.dt[first], whole.starts[:2])
    ends = []
    for _ in range(2):
        one = training(data=half)
        one.advance(10**6)
        one.replace_data(whole, fresh_budget=True)
        one.advance(60)
        one.replace_data(half)
        one.advance(60)
        ends.append(one)
        long_way.undo()
    assert_alike(*ends)


def test_a_resumed_training_goes_on_with_the_same_bits() -> None:
    whole, first = training(), training()
    whole.advance(90)
    first.advance(40)
    resumed = Training.resumed(first.model, first.data, None, CONFIG, first.memory)
    resumed.advance(50)
    assert told(resumed) == told(whole)


@pytest.mark.parametrize(
    "config", [replace(CONFIG, batch=2), replace(CONFIG, form=Form.PHYSICAL), budgeted(ModelKind.POLYTOPE)]
)
def test_other_protocols_go_the_long_way(config: TrainingConfig) -> None:
    one = training(config)
    assert SingleSteps.of(one.model, one.data, config, one.optimizer) is None


def test_a_loss_that_is_not_finite_ends_the_training_by_name_and_changes_nothing_in_that_step() -> None:
    one = training()
    for value in one.model.parameters():
        value.data.fill_(1e200)
    broken = told(one)[-1]
    progress = one.advance(1)
    assert progress.state is TrainingState.FAILED
    assert "is not finite" in progress.reason
    assert told(one)[-1] == broken


def test_states_that_the_loss_is_not_defined_for_are_refused() -> None:
    data = tracked_transitions()
    before = data.before.copy()
    before[3, 3:7] *= 2.0
    with pytest.raises(InvalidValueError, match="norm"):
        training(data=replace(data, before=before))
