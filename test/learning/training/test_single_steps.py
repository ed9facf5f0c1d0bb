"""Steps of one transition in the kernel: the same training as along the long way."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import torch

from contact_curation.contact.body import Body
from contact_curation.contact.models.end_to_end import EndToEndModel, ImpulseLoss
from contact_curation.contact.parameter_form import Form
from contact_curation.errors import InvalidValueError
from contact_curation.learning.training.data import rows_of
from contact_curation.learning.training.optimizer import SingleSteps
from contact_curation.learning.training.progress import TrainingState
from contact_curation.learning.training.protocols import AdamWConfig, Schedule, TrainingConfig, budgeted, published
from contact_curation.learning.training.training import Training, new_training
from contact_curation.motion.transitions import Transitions
from contact_curation.solver.cone_problem import Cone
from test.contact.cases import CUBE, tracked_transitions

CONFIG = replace(published("polytope"), patience=None, epochs=2)
LONG_WAY = replace(CONFIG, steps=80)
"""A step takes some milliseconds there."""
NETWORKS = ("deep", "deepvertex", "end_to_end")


@pytest.fixture
def long_way(monkeypatch: pytest.MonkeyPatch) -> pytest.MonkeyPatch:
    monkeypatch.setattr(SingleSteps, "of", staticmethod(lambda *_: None))
    return monkeypatch


def training(config: TrainingConfig = CONFIG, data: Transitions | None = None, kind: str = "polytope") -> Training:
    return new_training(kind, CUBE, tracked_transitions() if data is None else data, None, config, 0)


def networks_config(kind: str, **changes: Any) -> TrainingConfig:
    """So fast that a step counts, the two paces apart, at falling rates."""
    fast = replace(
        published(kind),
        polytope=AdamWConfig(1e-2, 0.1),
        network=AdamWConfig(2e-3, 0.2),
        schedule=Schedule.COSINE,
        patience=None,
        steps=60,
    )
    return replace(fast, **changes)


def told(one: Training) -> tuple[object, ...]:
    return one.progress, one.history, {name: value.tolist() for name, value in one.model.tensors().items()}


def assert_alike(one: Training, other: Training) -> None:
    """But for rounding."""
    for name in ("gradient_steps", "epochs", "not_solved", "state"):
        assert getattr(one.progress, name) == getattr(other.progress, name)
    assert one.progress.training_loss == pytest.approx(other.progress.training_loss, rel=1e-12)
    theirs = other.model.tensors()
    for name, value in one.model.tensors().items():
        np.testing.assert_allclose(value, theirs[name], rtol=0.0, atol=1e-11)


def test_both_ways_give_the_same_numbers(long_way: pytest.MonkeyPatch) -> None:
    other = training(LONG_WAY)
    other.advance(10**6)
    long_way.undo()
    ours = training(LONG_WAY)
    assert SingleSteps.of(ours.model, ours.data, LONG_WAY, ours.optimizer) is not None
    ours.advance(10**6)
    assert ours.progress.state is TrainingState.SPENT
    assert_alike(ours, other)


@pytest.mark.parametrize("kind", NETWORKS)
def test_both_ways_give_the_same_networks(long_way: pytest.MonkeyPatch, kind: str) -> None:
    config = networks_config(kind)
    other = training(config, kind=kind)
    began = other.model.tensors()
    other.advance(10**6)
    long_way.undo()
    ours = training(config, kind=kind)
    assert SingleSteps.of(ours.model, ours.data, config, ours.optimizer) is not None
    ours.advance(10**6)
    assert ours.progress.state is TrainingState.SPENT
    assert_alike(ours, other)
    ended = ours.model.tensors()
    for name, _ in ours.model.named_parameters():
        assert np.abs(ended[name] - began[name]).max() > 1e-4, name


def test_both_ways_give_the_same_squared_end_to_end(long_way: pytest.MonkeyPatch) -> None:
    config = networks_config("end_to_end")
    ends = []
    for _ in range(2):
        model = EndToEndModel(CUBE, ImpulseLoss.SQUARED)
        model.initialise(rows_of(tracked_transitions()), np.random.default_rng(0))
        one = Training(model, tracked_transitions(), None, config, seed=3)
        one.advance(10**6)
        ends.append(one)
        long_way.undo()
    assert_alike(*ends)


@pytest.mark.parametrize("kind", NETWORKS)
def test_networks_whose_steps_are_cut_or_resumed_have_the_same_bits(kind: str) -> None:
    config = networks_config(kind, evaluation_steps=7)
    whole, cut = training(config, kind=kind), training(config, kind=kind)
    whole.advance(40)
    for steps in (1, 2, 20):
        cut.advance(steps)
    resumed = Training.resumed(cut.model, cut.data, None, config, cut.memory)
    resumed.advance(17)
    assert told(resumed) == told(whole)


@pytest.mark.parametrize("kind", NETWORKS[:2])
def test_rows_that_are_not_solved_are_left_out_by_networks_both_ways(long_way: pytest.MonkeyPatch, kind: str) -> None:
    config = networks_config(kind, loss=replace(CONFIG.loss, max_iterations=9))
    ends = []
    for _ in range(2):
        one = training(config, kind=kind)
        one.advance(10**6)
        ends.append(one)
        long_way.undo()
    assert 0 < ends[1].progress.not_solved < ends[1].progress.gradient_steps
    assert_alike(*ends)


@pytest.mark.parametrize("kind", NETWORKS)
@pytest.mark.parametrize("size", [1e200, np.inf])
def test_networks_that_are_not_finite_end_the_training_and_change_nothing(kind: str, size: float) -> None:
    one = training(networks_config(kind), kind=kind)
    for value in one.model.parameters():
        value.data.fill_(size)
    broken = told(one)[-1]
    progress = one.advance(1)
    assert progress.state is TrainingState.FAILED
    assert "is not finite" in progress.reason
    assert told(one)[-1] == broken


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
    config = replace(LONG_WAY, loss=replace(CONFIG.loss, max_iterations=9))
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


@pytest.mark.parametrize("config", [replace(CONFIG, batch=2), replace(CONFIG, form=Form.PHYSICAL), budgeted("polytope")])
def test_other_protocols_go_the_long_way(config: TrainingConfig) -> None:
    one = training(config)
    assert SingleSteps.of(one.model, one.data, config, one.optimizer) is None


def test_deep_in_the_physical_form_goes_the_long_way() -> None:
    config = networks_config("deep", form=Form.PHYSICAL)
    one = training(config, kind="deep")
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


def test_a_slope_that_is_not_finite_ends_the_training_by_name_and_changes_nothing() -> None:
    one = training(networks_config("end_to_end"), kind="end_to_end")
    for name, value in one.model.named_parameters():
        value.data.fill_({"network.layers.0.bias": 1e-310}.get(name, 0.0))
    for depth, weight in ((1, 1.0), (2, 1e160), (3, 1e160), (4, 1e-17)):  # a loss of some hundred, slopes of 1e310
        dict(one.model.named_parameters())[f"network.layers.{depth}.weight"].data.fill_(weight)
    broken = told(one)[-1]
    progress = one.advance(1)
    assert progress.state is TrainingState.FAILED
    assert "its gradient is not finite" in progress.reason
    assert told(one)[-1] == broken


@pytest.mark.parametrize("kind", ["polytope", *NETWORKS])
def test_states_that_the_loss_is_not_defined_for_are_refused(kind: str) -> None:
    data = tracked_transitions()
    before = data.before.copy()
    before[3, 3:7] *= 2.0
    with pytest.raises(InvalidValueError, match="norm"):
        training(replace(published(kind), patience=None), replace(data, before=before), kind)


@pytest.mark.parametrize("kind", ["polytope", *NETWORKS])
def test_data_that_are_refused_change_nothing(kind: str) -> None:
    data = tracked_transitions()
    bad = data.before.copy()
    bad[3, 3:7] *= 2.0
    config = replace(published(kind), patience=None, epochs=3)
    undisturbed, refused = training(config, kind=kind), training(config, kind=kind)
    for one in (undisturbed, refused):
        one.advance(20)
    for fresh_budget in (False, True):
        with pytest.raises(InvalidValueError, match="norm"):
            refused.replace_data(replace(data, before=bad), fresh_budget)
    for one in (undisturbed, refused):
        one.advance(20)
    assert told(refused) == told(undisturbed)


PYRAMID = Body(
    name="pyramid",
    vertices=np.array([[0.0, 0.0, 0.07], *([x, y, -0.03] for x in (-0.05, 0.06) for y in (-0.04, 0.05))]),
    mass=0.5,
    inertia=np.array([[9e-4, 1e-4, 0.0], [1e-4, 7e-4, -5e-5], [0.0, -5e-5, 6e-4]]),
    friction=0.4,
    length_scale=0.05,
)


@pytest.mark.parametrize("kind", NETWORKS)
def test_both_ways_give_the_same_networks_of_another_body_in_a_polyhedral_cone(long_way: pytest.MonkeyPatch, kind: str) -> None:
    config = networks_config(kind, loss=replace(CONFIG.loss, cone=Cone.POLYHEDRAL))
    ends = []
    for _ in range(2):
        one = new_training(kind, PYRAMID, tracked_transitions(), None, config, 0)
        one.advance(10**6)
        ends.append(one)
        long_way.undo()
    assert ends[1].progress.not_solved < 30
    assert_alike(*ends)


def test_frozen_parameters_go_the_long_way() -> None:
    config = networks_config("deep")
    one = training(config, kind="deep")
    one.model.get_submodule("polytope").requires_grad_(False)
    frozen = Training(one.model, one.data, None, config, seed=0)
    frozen.advance(3)
    assert frozen.progress.gradient_steps == 3


def test_deepvertex_stands_on_the_plane_that_it_was_loaded_with(long_way: pytest.MonkeyPatch) -> None:
    config = networks_config("deepvertex")
    ends = []
    for _ in range(2):
        model = training(config, kind="deepvertex").model
        model.get_buffer("normal").copy_(torch.tensor([0.1, 0.0, 1.0]))
        one = Training(model, tracked_transitions(), None, config, seed=3)
        one.advance(10**6)
        ends.append(one)
        long_way.undo()
    assert_alike(*ends)


def test_moments_of_a_part_of_the_parameters_are_refused() -> None:
    config = networks_config("deep")
    one = training(config, kind="deep")
    one.advance(3)
    part = {name: value for name, value in one.optimizer.moments().items() if name.startswith("polytope.")}
    with pytest.raises(InvalidValueError, match="of all of them, or of none"):
        training(config, kind="deep").optimizer.restore(part)
