"""Training to a polytope's optimum at once: it arrives, the optimum is one, and what it cannot train it refuses."""

from dataclasses import replace

import numpy as np
import pytest

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.loss_config import DEFAULT_LOSS
from contact_curation.contact.models.model import Rows
from contact_curation.contact.models.polytope import PolytopeModel
from contact_curation.contact.models.registry import model_class
from contact_curation.contact.parameter_form import Form
from contact_curation.errors import InvalidValueError
from contact_curation.information.impacts import as_described
from contact_curation.learning.checkpoints.checkpoint import checkpoint_bytes, training_of_bytes
from contact_curation.learning.fits import exact_fit
from contact_curation.learning.fits.exact_fit import _only, optimum, theta_0
from contact_curation.learning.fits.held_fit import HeldFit, HeldFitConfig
from contact_curation.learning.training.data import rows_of
from contact_curation.learning.training.objective import mean_loss
from contact_curation.learning.training.progress import TrainingState
from contact_curation.learning.training.protocols import ROUND_TRIMMED, TrainingConfig, budgeted, exact
from contact_curation.learning.training.training import Training
from contact_curation.motion.transitions import Transitions, transitions_of
from test.simulated import RIG_NOISE, TrackerNoise, simulated_tosses

EXACT = exact()


@pytest.fixture(scope="module")
def data() -> Transitions:
    return transitions_of(simulated_tosses(4, seed=2), CONTACTNETS_CUBE.length_scale)


def begun(data: Transitions, seed: int = 1, config: TrainingConfig = EXACT) -> Training:
    model = model_class("polytope").initial(CONTACTNETS_CUBE, Form.PHYSICAL, rows_of(data), np.random.default_rng(seed))
    return Training(model, data, None, config, seed)


def test_one_step_goes_all_the_way_and_ends_the_training(data: Transitions) -> None:
    fitted, steps = begun(data), 30
    untrained = mean_loss(fitted.model, rows_of(data), fitted.config.loss).loss
    progress = fitted.advance(1)
    assert progress.state is TrainingState.CONVERGED
    assert progress.gradient_steps > 10
    assert "Gauss-Newton steps" in progress.reason
    assert progress.training_loss < 0.01 * untrained
    stepped = Training(begun(data).model, data, None, replace(budgeted("polytope"), steps=steps), 1)
    stepped.advance(steps)
    assert progress.training_loss < 0.5 * mean_loss(stepped.model, rows_of(data), fitted.config.loss).loss
    assert fitted.advance(5).gradient_steps == progress.gradient_steps  # it has ended


@pytest.mark.slow
@pytest.mark.parametrize("config", [exact(), exact(ROUND_TRIMMED)])
def test_as_much_is_left_out_as_is_asked_for_and_nothing_otherwise(data: Transitions, config: TrainingConfig) -> None:
    fitted = begun(data, config=config)
    start = theta_0(fitted.model)
    fitted.advance(1)
    ends = {share: optimum(start, data, config.loss, share).model.tensors() for share in (0.0, ROUND_TRIMMED)}
    alike = [
        share for share, end in ends.items() if all((end[name] == one).all() for name, one in fitted.model.tensors().items())
    ]
    assert alike == [config.trimmed]


def test_a_training_that_was_stored_after_its_fit_fits_other_tosses_from_the_same_theta_0(data: Transitions) -> None:
    first, second = (transitions_of(simulated_tosses(2, seed=seed), CONTACTNETS_CUBE.length_scale) for seed in (3, 4))
    through = begun(data)
    through.replace_data(first, fresh_budget=True)
    through.advance(1)
    resumed = training_of_bytes(checkpoint_bytes(through), "bytes", first, None)
    for training in (through, resumed):
        training.replace_data(second, fresh_budget=True)
        training.advance(1)
    one, other = (training.model.tensors() for training in (through, resumed))
    assert {name: value.tobytes() for name, value in one.items()} == {name: value.tobytes() for name, value in other.items()}


def test_the_ground_is_taken_as_known_and_the_rest_as_it_was_drawn(data: Transitions) -> None:
    drawn = begun(data).model
    assert isinstance(drawn, PolytopeModel)
    level = theta_0(drawn).geometry()
    assert level.height == 0.0
    np.testing.assert_array_equal(level.normal, [0.0, 0.0, 1.0])
    np.testing.assert_array_equal(level.vertices_normal, drawn.geometry().vertices_normal)
    assert np.linalg.norm(level.tangents[0]) == pytest.approx(np.linalg.norm(drawn.geometry().tangents[0]))


def test_some_frames_that_are_far_off_are_left_out_and_change_little() -> None:
    tosses = transitions_of(simulated_tosses(4, seed=2), CONTACTNETS_CUBE.length_scale)
    after = tosses.after.copy()
    after[20:380:60, 7:9] += 3.0 * np.random.default_rng(0).standard_normal((6, 2))
    training = begun(tosses)
    start, frictions = theta_0(training.model), []
    for trimmed in (0.0, 0.02):
        found = optimum(start, replace(tosses, after=after), training.config.loss, trimmed).model
        frictions.append(float(np.linalg.norm(found.geometry().tangents[0])))
    off = [abs(friction - CONTACTNETS_CUBE.friction) for friction in frictions]
    assert off[1] < 0.2 * off[0], frictions


def test_a_toss_of_which_nothing_is_left_leaves_no_gap() -> None:
    data = transitions_of(simulated_tosses(3, seed=2), CONTACTNETS_CUBE.length_scale)
    kept = data.toss_index != 1
    left = _only(data, kept)
    assert left.toss_ids == (data.toss_ids[0], data.toss_ids[2])
    assert left.starts[-1] == len(left.dt) == kept.sum()
    assert (np.diff(left.starts) > 0).all()


def test_a_network_and_the_published_form_have_no_exact_protocol(data: Transitions) -> None:
    rows: Rows = rows_of(data)
    for kind, form, found in (
        ("deep", Form.PHYSICAL, "a deep,"),
        ("polytope", Form.CONTACTNETS, "a polytope in the contactnets form"),
    ):
        model = model_class(kind).initial(CONTACTNETS_CUBE, form, rows, np.random.default_rng(0))
        with pytest.raises(InvalidValueError, match=f"model to train exactly: found {found}"):
            Training(model, data, None, exact(), 0)


def test_a_loss_that_is_not_finite_names_the_toss_and_leaves_the_parameters(data: Transitions) -> None:
    training = begun(data)
    before = training.model.tensors()
    far = data.before.copy()
    far[3, 2] = 1e200
    training.replace_data(replace(data, before=far))
    progress = training.advance(1)
    assert progress.state is TrainingState.FAILED
    assert f"{data.toss_ids[0]}, transition 3: its loss is not finite" in progress.reason
    after = training.model.tensors()
    assert all((before[name] == after[name]).all() for name in before)


def test_of_several_starts_the_lowest_minimum_counts(data: Transitions, monkeypatch: pytest.MonkeyPatch) -> None:
    """Here the sum is the distance from the body as described, and no fit moves."""
    begins: list[tuple[PolytopeModel, PolytopeModel | None]] = []

    def stays(start: PolytopeModel, data: Transitions, config: HeldFitConfig, origin: PolytopeModel | None = None) -> HeldFit:
        begins.append((start, origin))
        away = start.geometry().vertices_normal - CONTACTNETS_CUBE.scaled_vertices
        return HeldFit(start, float(np.square(away).sum()), 1)

    monkeypatch.setattr(exact_fit, "fit_held", stays)
    start = theta_0(begun(data).model)
    found = optimum(start, data, EXACT.loss, 0.0, 3)
    assert np.array_equal(found.model.geometry().vertices_normal, CONTACTNETS_CUBE.scaled_vertices)
    assert found.steps == 4
    assert [origin for _, origin in begins] == [None, start, start, start]
    assert len({each.geometry().vertices_normal.tobytes() for each, _ in begins}) == 3  # the last goes on from the second
    assert optimum(start, data, EXACT.loss, 0.0).model is start


@pytest.mark.slow
def test_the_number_of_starts_is_a_setting_that_a_checkpoint_keeps(data: Transitions) -> None:
    config = replace(EXACT, starts=2)
    fitted = begun(data, config=config)
    start = theta_0(fitted.model)
    assert fitted.advance(1).state is TrainingState.CONVERGED
    again = optimum(start, data, config.loss, 0.0, 2).model.tensors()
    assert all((again[name] == one).all() for name, one in fitted.model.tensors().items())
    resumed = training_of_bytes(checkpoint_bytes(fitted, {}), "here", data, None, CONTACTNETS_CUBE)
    assert resumed.config.starts == 2
    with pytest.raises(InvalidValueError, match="starts: found 0, expected a whole number of at least 1"):
        replace(EXACT, starts=0)


@pytest.mark.parametrize("noise", [13.0, 20.0])
def test_friction_is_learned_from_tosses_of_a_noisy_tracker(noise: float) -> None:
    tracker = TrackerNoise(noise * RIG_NOISE.position, noise * RIG_NOISE.orientation)
    data = transitions_of(simulated_tosses(8, 1, tracker), CONTACTNETS_CUBE.length_scale)
    start = theta_0(PolytopeModel(ContactGeometry.of_body(CONTACTNETS_CUBE).rigid(), CONTACTNETS_CUBE, Form.RIGID))
    found, each_frame = (
        optimum(start, rows, DEFAULT_LOSS, 0.0).model.geometry().friction / CONTACTNETS_CUBE.friction
        for rows in (as_described(data, start.geometry(), CONTACTNETS_CUBE), data)
    )
    assert found == pytest.approx(1.0, abs=0.1)
    assert each_frame > 1.2
