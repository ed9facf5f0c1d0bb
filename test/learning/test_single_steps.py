"""Steps of one transition straight from the kernel: the same training as along the long way."""

from dataclasses import replace

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


def test_both_ways_give_the_same_bits(long_way: pytest.MonkeyPatch) -> None:
    other = training()
    other.advance(10**6)
    long_way.undo()
    ours = training()
    assert SingleSteps.of(ours.model, ours.data, CONFIG, ours.optimizer) is not None
    for steps in (1, 30, 10**6):
        ours.advance(steps)
    assert ours.progress.state is TrainingState.SPENT
    assert told(ours) == told(other)


def test_a_fresh_budget_on_other_data_gives_the_same_bits_both_ways(long_way: pytest.MonkeyPatch) -> None:
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
        ends.append(told(one))
        long_way.undo()
    assert ends[0] == ends[1]


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
