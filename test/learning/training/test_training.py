"""A training goes down its loss the same way every time, stops when it should, and says which transition stopped it."""

import json
from dataclasses import replace

import numpy as np
import pytest

from contact_curation.errors import InvalidValueError
from contact_curation.learning.training.progress import EarlyStop, Progress, TrainingState
from contact_curation.learning.training.protocols import Patience, TrainingConfig
from contact_curation.learning.training.training import Training
from contact_curation.motion.transitions import Transitions
from test.learning.toy import BURSTING, DIVERGING, SOLVED, STEEP, UNSOLVED, Toy, toy_config, toy_data


def toy_training(
    data: Transitions, config: TrainingConfig, held_out: Transitions | None = None, theta: float = 0.0, seed: int = 0
) -> Training:
    return Training(Toy(theta), data, held_out, config, seed)


def theta_of(training: Training) -> float:
    return float(training.model.tensors()["theta"])


def test_a_training_goes_down_to_the_mean_of_the_targets() -> None:
    training = toy_training(toy_data([1.0, 2.0, 3.0, 6.0]), toy_config(batch=4))
    training.advance(500)
    assert theta_of(training) == pytest.approx(3.0, abs=1e-3)


def test_the_regularizer_pulls_with_its_weight() -> None:
    training = toy_training(toy_data([3.0]), toy_config(regularizer=0.5))
    training.advance(500)
    assert theta_of(training) == pytest.approx(2.0, abs=1e-3)  # the minimum of (theta - 3)^2 + theta^2 / 2


def test_the_same_seed_gives_the_same_bits_however_the_steps_are_cut() -> None:
    data, config = toy_data(list(np.arange(20.0))), toy_config(batch=3, evaluation_steps=5)
    whole, cut, other = toy_training(data, config), toy_training(data, config), toy_training(data, config, seed=1)
    last = whole.advance(40)
    for steps in (1, 4, 17, 18):
        progress = cut.advance(steps)
    other.advance(40)
    assert (progress, theta_of(cut), cut.history) == (last, theta_of(whole), whole.history)
    assert theta_of(other) != theta_of(whole)


def test_an_epoch_trains_on_every_transition_once() -> None:
    training = toy_training(toy_data(list(np.arange(20.0))), toy_config(batch=3))
    progress = training.advance(7)
    assert isinstance(training.model, Toy)
    assert progress.epochs == 1
    np.testing.assert_array_equal(np.sort(np.concatenate(training.model.rows_seen)), np.arange(20.0))


def test_what_is_not_solved_is_left_out_and_counted_never_a_zero() -> None:
    mixed = toy_training(toy_data([1.0, 500.0, 3.0], [SOLVED, UNSOLVED, SOLVED]), toy_config(batch=3))
    clean = toy_training(toy_data([1.0, 3.0]), toy_config(batch=3))
    progress, expected = mixed.advance(9), clean.advance(9)
    assert theta_of(mixed) == pytest.approx(theta_of(clean), rel=1e-14)
    assert progress.training_loss == pytest.approx(expected.training_loss, rel=1e-14)
    assert (progress.not_solved, expected.not_solved) == (9, 0)


def test_a_training_of_which_nothing_can_be_solved_fails_and_changes_nothing() -> None:
    training = toy_training(toy_data([1.0, 2.0], [UNSOLVED, UNSOLVED]), toy_config(), theta=0.5)
    progress = training.advance(10)
    assert (progress.state, progress.gradient_steps) == (TrainingState.FAILED, 2)
    assert "no transition was solved" in progress.reason
    assert theta_of(training) == 0.5


@pytest.mark.parametrize(
    ("what", "said"),
    [(BURSTING, "loss is not finite"), (DIVERGING, "loss is not finite"), (STEEP, "gradient is not finite")],
)
def test_what_is_not_finite_stops_the_training_and_names_its_toss_and_transition(what: float, said: str) -> None:
    data = toy_data([1.0] * 6, [SOLVED] * 4 + [what, SOLVED], tosses=2)
    training = toy_training(data, toy_config(batch=2))
    progress = training.advance(10)
    assert progress.state is TrainingState.FAILED
    assert progress.reason == f"toss b, transition 1: its {said}"
    assert np.isfinite(theta_of(training))
    assert training.advance(10) == progress


def test_a_batch_that_fails_leaves_the_parameters_as_they_were() -> None:
    training = toy_training(toy_data([1.0, 1.0], [SOLVED, STEEP]), toy_config(batch=2), theta=0.25)
    assert training.advance(1).gradient_steps == 0
    assert theta_of(training) == 0.25


@pytest.mark.parametrize("column", ["before", "after", "dt"])
def test_data_that_are_not_finite_are_refused_by_name(column: str) -> None:
    data = toy_data([1.0] * 6, tosses=2)
    spoilt = getattr(data, column).copy()
    spoilt[5, ...] = np.nan
    with pytest.raises(InvalidValueError, match="toss b, transition 2"):
        toy_training(replace(data, **{column: spoilt}), toy_config())


def test_no_transitions_at_all_are_refused() -> None:
    with pytest.raises(InvalidValueError, match="transitions: found none"):
        toy_training(toy_data([]), toy_config())


def test_a_budget_of_steps_ends_with_a_last_evaluation() -> None:
    training = toy_training(toy_data([1.0, 2.0]), toy_config(steps=7, epochs=None, evaluation_steps=3))
    progress = training.advance(100)
    assert (progress.state, progress.gradient_steps) == (TrainingState.SPENT, 7)
    assert [entry.gradient_steps for entry in training.history] == [3, 6, 7]


def test_a_budget_of_epochs_ends_after_them() -> None:
    progress = toy_training(toy_data([1.0, 2.0, 3.0]), toy_config(epochs=2)).advance(100)
    assert (progress.state, progress.gradient_steps, progress.epochs) == (TrainingState.SPENT, 6, 2)


def test_evaluations_report_the_mean_training_loss_since_the_one_before() -> None:
    training = toy_training(toy_data([2.0]), toy_config(rate=1e-9, evaluation_steps=2), held_out=toy_data([4.0, 6.0]))
    training.advance(2)
    assert training.history[0].training_loss == pytest.approx(4.0)
    assert training.history[0].held_out_loss == pytest.approx((16.0 + 36.0) / 2)


def test_patience_counts_evaluations_without_a_lower_loss() -> None:
    stop = EarlyStop().after(3.0).after(2.0)
    assert stop == EarlyStop(2.0, 0)
    assert stop.after(2.0) == EarlyStop(2.0, 1)
    assert stop.after(float("nan")).after(5.0) == EarlyStop(2.0, 2)
    assert stop.after(5.0).after(1.9) == EarlyStop(1.9, 0)


def overfitting(patience: int, turn: int) -> Progress:
    """Down towards 10 while the held-out target is what theta passes after `turn` steps."""
    config = toy_config(rate=1.0, patience=Patience(patience, tosses=0))
    return toy_training(toy_data([10.0]), config, held_out=toy_data([float(turn)])).advance(turn + 3)


def test_a_training_stops_after_its_patience_and_not_before() -> None:
    assert overfitting(patience=4, turn=3).state is TrainingState.RUNNING  # three evaluations without a lower loss
    stopped = overfitting(patience=3, turn=3)
    assert (stopped.state, stopped.gradient_steps) == (TrainingState.CONVERGED, 6)
    assert "has not fallen for 3 evaluations" in stopped.reason


def test_an_early_stop_needs_something_held_out() -> None:
    with pytest.raises(InvalidValueError, match="held-out transitions"):
        toy_training(toy_data([1.0]), toy_config(patience=Patience()))


def test_the_best_parameters_are_those_of_the_lowest_held_out_loss() -> None:
    config = toy_config(rate=1.0, patience=Patience(3, tosses=0))
    training = toy_training(toy_data([10.0]), config, held_out=toy_data([3.0]))
    training.advance(6)
    assert training.best_tensors is not None
    assert training.best_tensors["theta"] == pytest.approx(3.0, abs=0.2)
    assert theta_of(training) > 5.0


def test_replaced_data_are_learned_from_within_the_same_budget() -> None:
    training = toy_training(toy_data([1.0, 1.0]), toy_config(steps=400, epochs=None))
    training.advance(3)
    training.replace_data(toy_data([-2.0]))
    progress = training.advance(1000)
    assert progress.gradient_steps == 400
    assert theta_of(training) == pytest.approx(-2.0, abs=1e-3)


def test_a_spent_training_goes_on_with_a_fresh_budget_and_not_without() -> None:
    training = toy_training(toy_data([1.0]), toy_config(steps=5, epochs=None))
    training.advance(100)
    training.replace_data(toy_data([2.0]))
    assert training.advance(100).gradient_steps == 5
    training.replace_data(toy_data([2.0]), fresh_budget=True)
    assert training.optimizer.moments() == {}
    progress = training.advance(100)
    assert (progress.state, progress.gradient_steps) == (TrainingState.SPENT, 10)


def test_steps_must_be_at_least_one() -> None:
    with pytest.raises(InvalidValueError, match="steps"):
        toy_training(toy_data([1.0]), toy_config()).advance(0)


def test_progress_is_one_line_of_json_where_nothing_is_not_finite() -> None:
    training = toy_training(toy_data([1.0]), toy_config())
    line = training.progress.json_line()
    assert "\n" not in line
    assert json.loads(line) == {
        "gradient_steps": 0, "epochs": 0, "training_loss": None, "held_out_loss": None, "best_held_out_loss": None,
        "not_solved": 0, "state": "running", "reason": "",
    }  # fmt: skip
    assert json.loads(training.advance(3).json_line())["training_loss"] > 0.0
