"""Rounds of training without a node: when they begin, when they stop, and that a kill changes no digit."""

import json
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import cache, partial
from pathlib import Path

import numpy as np
import pytest

from contact_curation.contact.body import CONTACTNETS_CUBE, Body
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.loss_config import LossConfig
from contact_curation.contact.models.model import Model, Rows
from contact_curation.contact.models.polytope import PolytopeModel
from contact_curation.contact.models.registry import model_class
from contact_curation.contact.parameter_form import Form
from contact_curation.errors import InvalidValueError, UnreadableInputError
from contact_curation.information.model_version import model_version
from contact_curation.learning.checkpoints.safetensors_bytes import pack, unpack
from contact_curation.learning.evaluation.evaluation import EvaluationConfig
from contact_curation.learning.training.plan import first_model
from contact_curation.learning.training.progress import TrainingState
from contact_curation.learning.training.protocols import ROUND_TRIMMED, TrainingConfig, budgeted, exact
from contact_curation.learning.training.training import Training
from contact_curation.learning.uncertainty.more_throws import more_throws
from contact_curation.motion.toss import Toss
from contact_curation.motion.transitions import transitions_of
from contact_curation.pipeline.learned_model import load_model
from contact_curation.stages.held_out_tosses import HeldOutTosses
from contact_curation.stages.records import TrainingRecord, load_record, stored_records
from contact_curation.stages.training import Moment, RoundsConfig, SelectedSet, TrainingStage, made_of
from contact_curation.storage.checkpoint_file import save_checkpoint
from contact_curation.storage.stores.tosses import TossStore
from test.simulated import simulated_tosses

CONFIG = replace(budgeted("polytope"), steps=20, evaluation_steps=20, batch=16)
ROUNDS = RoundsConfig(settling_rounds=2, slice_steps=6, checkpoint_steps=5)


@cache
def tosses() -> tuple[Toss, ...]:
    return tuple(simulated_tosses(6, seed=3))


def first(data: Rows) -> Model:
    return model_class("polytope").initial(CONTACTNETS_CUBE, Form.PHYSICAL, data, np.random.default_rng(0))


def untrained() -> Model:
    data = transitions_of(tosses()[:1], 1.0)
    return first(Rows(data.before, data.after, data.dt))


def stage(folder: Path, store: TossStore, config: TrainingConfig = CONFIG) -> TrainingStage:
    return TrainingStage(first, CONTACTNETS_CUBE.length_scale, config, ROUNDS, 0, store, folder / "model.safetensors")


def of_body(folder: Path, store: TossStore, kind: str, body: Body) -> TrainingStage:
    path = folder / "model.safetensors"
    return TrainingStage(first, body.length_scale, CONFIG, ROUNDS, 0, store, path, made_of(kind, body))


@pytest.fixture
def store(tmp_path: Path) -> Iterator[TossStore]:
    with TossStore(tmp_path / "tosses.sqlite") as made:
        yield made


def chosen(revision: int, seen: int, *numbers: int) -> SelectedSet:
    return SelectedSet(revision, seen, tuple(tosses()[number].toss_id for number in numbers))


def until_idle(training: TrainingStage) -> list[Moment]:
    moments = []
    while training.due:
        moment = training.advance()
        moments += [moment] if moment else []
    return moments


def numbers_of(model: Model) -> dict[str, bytes]:
    return {name: value.tobytes() for name, value in model.tensors().items()}


def test_a_checkpoint_of_another_body_or_kind_of_model_is_refused(tmp_path: Path, store: TossStore) -> None:
    heavier = replace(CONTACTNETS_CUBE, mass=0.5)
    for toss in tosses()[:2]:
        store.add(toss)
    training = of_body(tmp_path, store, "polytope", CONTACTNETS_CUBE)
    training.follow(chosen(1, 2, 0, 1))
    until_idle(training)
    assert of_body(tmp_path, store, "polytope", CONTACTNETS_CUBE).round.number == 1
    for kind, body in (("polytope", heavier), ("deep", CONTACTNETS_CUBE)):
        with pytest.raises(InvalidValueError, match=r"found polytope of cube, 0\.37 kg \(.*\), expected .*another checkpoint"):
            of_body(tmp_path, store, kind, body)


def test_a_round_waits_for_its_tosses_and_says_which_are_missing(tmp_path: Path, store: TossStore) -> None:
    training = stage(tmp_path, store)
    training.follow(chosen(1, 3, 2, 0))
    training.add(tosses()[2])
    assert list(training.missing) == [tosses()[0].toss_id]
    assert not training.due
    training.add(tosses()[0])
    assert list(training.missing) == []
    assert training.due


def test_a_round_ends_with_other_parameters_and_a_checkpoint_and_the_next_waits_for_another_set(
    tmp_path: Path, store: TossStore
) -> None:
    for toss in tosses():
        store.add(toss)
    training = stage(tmp_path, store)
    training.follow(chosen(1, 3, 2, 0))
    before, after = until_idle(training)
    assert (before.ended, after.ended) == (False, True)
    assert after.progress.gradient_steps == 20
    assert numbers_of(before.model) != numbers_of(after.model)
    training.follow(chosen(2, 4, 0, 2))  # the same tosses in another order
    assert not training.due
    training.follow(chosen(3, 4, 0, 1))
    assert until_idle(training)[-1].progress.gradient_steps == 40


@pytest.mark.parametrize("config", [CONFIG, exact(ROUND_TRIMMED)], ids=["budgeted", "exact"])
def test_a_checkpoint_says_what_its_theta_follows_from(tmp_path: Path, store: TossStore, config: TrainingConfig) -> None:
    for toss in tosses():
        store.add(toss)
    training = stage(tmp_path, store, config)
    for revision, numbers in enumerate(((0, 1, 2), (2, 3, 4)), start=1):
        training.follow(chosen(revision, 3 + revision, *numbers))
        until_idle(training)
    told = load_model(tmp_path / "model.safetensors", CONTACTNETS_CUBE)
    last = frozenset(tosses()[number].toss_id for number in (2, 3, 4))
    earlier = frozenset() if config.exact else frozenset(tosses()[number].toss_id for number in (0, 1))
    assert (told.fitted_to, told.learned_from) == (last, last | earlier)


def test_the_loop_comes_to_rest_when_no_new_toss_comes(tmp_path: Path, store: TossStore) -> None:
    for toss in tosses():
        store.add(toss)
    training = stage(tmp_path, store)
    ended = []
    for revision in range(6):  # a ranking that swings to and fro, as that of a new theta may
        training.follow(chosen(revision, 6, 0, 1 + revision % 2))
        ended += [moment.round.settling for moment in until_idle(training) if moment.ended]
    assert ended == [0, 1, 2]
    training.follow(chosen(9, 7, 0, 5))
    assert [moment.round.settling for moment in until_idle(training)] == [0]


def test_tosses_that_are_selected_in_another_way_are_trained_on_after_the_loop_came_to_rest(
    tmp_path: Path, store: TossStore
) -> None:
    for toss in tosses():
        store.add(toss)
    training = stage(tmp_path, store)
    for revision in range(6):
        training.follow(chosen(revision, 6, 0, 1 + revision % 2)._replace(chosen_by="trace 2", version=str(revision)))
        until_idle(training)
    assert training.round.settling == 2
    training.follow(chosen(6, 6, 0, 3)._replace(chosen_by="trace 2", version="5"))  # of another prior, say
    assert [moment.round.settling for moment in until_idle(training)] == [0]
    training.follow(chosen(7, 6, 0, 2)._replace(chosen_by="trace 2", version="6"))
    assert [moment.round.settling for moment in until_idle(training)] == [1]
    again = stage(tmp_path, store)
    again.follow(chosen(7, 6, 0, 3, 4)._replace(chosen_by="trace 3", version="6"))  # while it was away
    assert [moment.round.settling for moment in until_idle(again)] == [0]
    again.follow(chosen(8, 6, 0, 3)._replace(chosen_by="trace 3", version="7"))
    assert [moment.round.settling for moment in until_idle(again)] == [1]


def noted(store: TossStore) -> TrainingRecord:
    """What a supervisor reads."""
    record = load_record(store.states.load, TrainingRecord)
    assert record is not None
    return record


def test_a_supervisor_reads_when_nothing_is_left_to_train_on(tmp_path: Path, store: TossStore) -> None:
    training = stage(tmp_path, store)
    assert noted(store) == TrainingRecord()
    training.follow(chosen(1, 1, 0))
    assert noted(store).revision == 0  # a toss is missing
    training.add(tosses()[0])  # and is too few
    assert (noted(store).revision, noted(store).tosses_seen) == (1, 1)
    training.follow(chosen(2, 3, 2, 0))  # one is missing
    assert noted(store).revision == 0
    for toss in tosses():
        training.add(toss)
    assert noted(store).revision == 0  # a round is due
    training.advance()
    assert (noted(store).running, noted(store).round, noted(store).revision) == (True, 1, 0)
    last = until_idle(training)[-1]
    assert noted(store) == TrainingRecord(1, 20, False, model_version(last.model), 2, 3)
    training.follow(chosen(3, 3, 0, 2))  # the same tosses in another order
    assert noted(store).revision == 3
    training.follow(chosen(4, 3, 0, 1))
    assert noted(store).revision == 0
    for revision in range(5, 7):
        until_idle(training)
        training.follow(chosen(revision, 3, 0, 1 + revision % 2))
    assert (noted(store).revision, training.round.settling) == (6, 2)  # without a new toss it has settled
    training.follow(chosen(7, 4, 0, 1))  # another toss was seen, and not selected
    assert noted(store).revision == 0


def test_what_a_supervisor_reads_is_right_again_after_a_kill(tmp_path: Path, store: TossStore) -> None:
    for toss in tosses():
        store.add(toss)
    training = stage(tmp_path, store)
    training.follow(chosen(1, 3, 2, 0))
    until_idle(training)
    before = noted(store)
    store.states.save(stored_records(replace(before, running=True, gradient_steps=12)))  # of before the end
    again = stage(tmp_path, store)
    assert noted(store) == replace(before, revision=0, tosses_seen=0)  # which buffer there is now it has not heard
    again.follow(chosen(1, 3, 2, 0))
    assert noted(store) == before


def test_a_round_that_was_noted_before_notes_had_a_format_is_gone_on_with(tmp_path: Path, store: TossStore) -> None:
    for toss in tosses():
        store.add(toss)
    training = stage(tmp_path, store)
    training.follow(chosen(1, 3, 2, 0))
    until_idle(training)
    path = tmp_path / "model.safetensors"
    packed = unpack(path.read_bytes(), path)
    note = json.loads(packed.documents["notes"]["round"])
    del note["format"]
    packed.documents["notes"]["round"] = json.dumps(note)
    path.write_bytes(pack(packed.arrays, packed.documents))
    assert stage(tmp_path, store).round == training.round
    packed.documents["notes"]["round"] = json.dumps({**note, "format": 2})
    path.write_bytes(pack(packed.arrays, packed.documents))
    with pytest.raises(UnreadableInputError, match="holds a Round of format 2, this package knows formats up to 1"):
        stage(tmp_path, store)


@pytest.mark.parametrize("slices", range(1, 6))
def test_a_kill_at_any_slice_changes_no_digit(tmp_path: Path, slices: int) -> None:
    results = []
    for name, killed in (("undisturbed", False), ("killed", True)):
        folder = tmp_path / name
        folder.mkdir()
        with TossStore(folder / "tosses.sqlite") as store:
            for toss in tosses():
                store.add(toss)
            training = stage(folder, store)
            training.follow(chosen(1, 3, 2, 0))
            for _ in range(slices):
                training.advance()
            if killed:
                training = stage(folder, store)
            until_idle(training)
            training.follow(chosen(2, 4, 3, 0))
            results.append(until_idle(training)[-1])
    assert numbers_of(results[0].model) == numbers_of(results[1].model)
    assert results[0].round == results[1].round


def test_an_exact_round_ends_at_once_and_neither_the_rounds_before_nor_a_kill_change_a_digit(tmp_path: Path) -> None:
    begun, ended = [], []
    for name, rounds, kills in (("alone", [(3, 0)], False), ("after", [(2, 0), (3, 0)], False), ("killed", [(3, 0)], True)):
        folder = tmp_path / name
        folder.mkdir()
        with TossStore(folder / "tosses.sqlite") as store:
            for toss in tosses():
                store.add(toss)
            config, path = exact(ROUND_TRIMMED), folder / "model.safetensors"
            training = TrainingStage(lambda _: untrained(), 1.0, config, ROUNDS, 0, store, path)
            for revision, numbers in enumerate(rounds, start=1):
                training.follow(chosen(revision, 2 + revision, *numbers))
                begun.append(training.advance())
                if kills:
                    training = TrainingStage(lambda _: untrained(), 1.0, config, ROUNDS, 0, store, path)
                ended.append(training.advance())
                assert not training.due
    assert begun[0] is not None
    alone, _, after, killed = (moment for moment in ended if moment is not None)
    assert alone.progress.state is TrainingState.CONVERGED
    assert alone.progress.training_loss < 0.1
    assert numbers_of(begun[0].model) == numbers_of(untrained())
    assert numbers_of(alone.model) == numbers_of(after.model) == numbers_of(killed.model)


@pytest.mark.parametrize("judges", [pytest.param(0, marks=pytest.mark.slow), 2])
def test_rounds_that_end_at_the_optimum_tell_how_far_more_throws_would_change_it(
    tmp_path: Path, store: TossStore, judges: int
) -> None:
    for toss in tosses():
        store.add(toss)
    shape, path = ContactGeometry.of_body(CONTACTNETS_CUBE).rigid(), tmp_path / "model.safetensors"
    begin = PolytopeModel(shape, CONTACTNETS_CUBE, Form.RIGID)
    config, scale = replace(exact(ROUND_TRIMMED), form=Form.RIGID), CONTACTNETS_CUBE.length_scale
    training = TrainingStage(lambda _: begin, scale, config, ROUNDS, 0, store, path)
    assert training.more_throws() is None
    training.follow(chosen(1, 6, *range(6 - judges)))
    until_idle(training)
    learned = load_model(path, CONTACTNETS_CUBE)
    assert learned.at_optimum
    fitted, judging = sorted(tosses()[: 6 - judges], key=lambda toss: toss.toss_id), tosses()[6 - judges :]
    expected = more_throws(learned.model, transitions_of(fitted, scale), judging or fitted, EvaluationConfig(config.loss))
    assert training.more_throws(judging) == expected
    assert expected is not None
    assert expected.throws == 6 - judges


def test_what_was_stepped_is_not_stepped_again_after_a_kill(tmp_path: Path, store: TossStore) -> None:
    for toss in tosses():
        store.add(toss)
    training = stage(tmp_path, store)
    training.follow(chosen(1, 3, 2, 0))
    for expected in (0, 6, 12, 18, 20):
        training.advance()
        resumed = stage(tmp_path, store)
        assert resumed.progress is not None
        assert resumed.progress.gradient_steps == expected
    assert not resumed.due
    assert resumed.now is not None
    assert resumed.now.ended


def test_a_round_trains_on_every_toss_of_the_set_whatever_their_order(tmp_path: Path, store: TossStore) -> None:
    for toss in tosses():
        store.add(toss)
    learned = []
    for name, numbers in (("one", (0, 2)), ("other", (0, 3)), ("turned", (2, 0))):
        folder = tmp_path / name
        folder.mkdir()
        training = stage(folder, store)
        training.follow(chosen(1, 3, *numbers))
        learned.append(numbers_of(until_idle(training)[-1].model))
    assert learned[0] != learned[1]
    assert learned[0] == learned[2]


def test_where_the_tosses_of_a_round_are_lost_it_goes_on_from_its_parameters(tmp_path: Path, store: TossStore) -> None:
    for toss in tosses():
        store.add(toss)
    training = stage(tmp_path, store)
    training.follow(chosen(1, 3, 2, 0))
    learned = until_idle(training)[-1].model
    with TossStore(tmp_path / "empty.sqlite") as empty:
        again = stage(tmp_path, empty)
        assert not again.due
        again.follow(chosen(1, 3, 2, 0))
        for toss in tosses():
            again.add(toss)
        start = again.advance()
    assert start is not None
    assert numbers_of(start.model) == numbers_of(learned)


def test_another_protocol_goes_on_from_the_parameters_too(tmp_path: Path, store: TossStore) -> None:
    for toss in tosses():
        store.add(toss)
    training = stage(tmp_path, store)
    training.follow(chosen(1, 3, 2, 0))
    until_idle(training)
    again = stage(tmp_path, store, replace(CONFIG, steps=9, evaluation_steps=9))
    again.follow(chosen(1, 3, 2, 0))
    assert until_idle(again)[-1].progress.gradient_steps == 9


def test_a_training_that_fails_says_so_and_goes_on_with_another_set(tmp_path: Path, store: TossStore) -> None:
    for toss in tosses():
        store.add(toss)
    explosive = replace(CONFIG, polytope=replace(CONFIG.polytope, learning_rate=500.0))
    training = stage(tmp_path, store, explosive)
    training.follow(chosen(1, 3, 2, 0))
    failed = until_idle(training)[-1].progress
    assert failed.state is TrainingState.FAILED
    assert "cube-" in failed.reason
    training.follow(chosen(2, 4, 2, 1))
    assert training.due


def test_a_checkpoint_that_no_trainer_wrote_is_refused_in_one_line(tmp_path: Path, store: TossStore) -> None:
    data = transitions_of(tosses()[:2], CONTACTNETS_CUBE.length_scale)
    model = first(Rows(data.before, data.after, data.dt))
    save_checkpoint(tmp_path / "model.safetensors", Training(model, data, None, CONFIG, 0))
    with pytest.raises(InvalidValueError, match="found none of a trainer node, expected one; `params` takes others"):
        stage(tmp_path, store)


@pytest.mark.parametrize("name", ["least_tosses", "slice_steps", "checkpoint_steps"])
def test_rounds_cannot_be_cut_into_nothing(name: str) -> None:
    with pytest.raises(InvalidValueError, match=f"{name}: found 0, expected a whole number of at least 1"):
        RoundsConfig(**{name: 0})


def rigid(data: Rows) -> Model:
    return model_class("polytope").initial(CONTACTNETS_CUBE, Form.RIGID, data, np.random.default_rng(0))


def test_a_round_says_what_its_model_lacks(tmp_path: Path) -> None:
    """Of tosses that bounce, as far as the model does not, whether the rounds learn a restitution or begin with one."""
    geometry = replace(ContactGeometry.of_body(CONTACTNETS_CUBE).rigid(), restitution=0.3)
    given = PolytopeModel(geometry, CONTACTNETS_CUBE, Form.RIGID)
    for name, bouncing, config, said, begin in (
        ("bouncing", True, exact(), ["the body bounces"], rigid),
        ("learned", True, replace(exact(), restitution=True), [], rigid),
        ("given", True, exact(), [], lambda _: given),
        ("still", False, exact(), [], rigid),
    ):
        thrown = simulated_tosses(8, 3, geometry=geometry if bouncing else None)
        with TossStore(tmp_path / f"{name}.sqlite") as kept:
            (tmp_path / name).mkdir()
            path = tmp_path / name / "model.safetensors"
            trained = TrainingStage(begin, CONTACTNETS_CUBE.length_scale, config, ROUNDS, 0, kept, path)
            assert trained.misfits() == ()
            for toss in thrown:
                trained.add(toss)
            trained.follow(SelectedSet(1, 8, tuple(toss.toss_id for toss in thrown)))
            trained.advance()
            assert [line.partition(":")[0] for line in trained.misfits()] == said


@contextmanager
def knowing_the_cube(folder: Path, thrown: Sequence[Toss]) -> Iterator[TrainingStage]:
    """Rounds over tosses, with the cube's corners known to half a millimetre."""
    config = replace(exact(), shape_known_to=0.0005)
    begin = partial(first_model, "polytope", CONTACTNETS_CUBE, config, seed=0)
    with TossStore(folder / "trainer.sqlite") as kept:
        trained = TrainingStage(begin, CONTACTNETS_CUBE.length_scale, config, ROUNDS, 0, kept, folder / "model.safetensors")
        for toss in thrown:
            trained.add(toss)
        trained.follow(SelectedSet(1, len(thrown), tuple(toss.toss_id for toss in thrown)))
        yield trained


@pytest.mark.slow
def test_rounds_begin_at_a_shape_that_is_known_and_stay_near_it(tmp_path: Path) -> None:
    thrown = simulated_tosses(4, 3)
    with knowing_the_cube(tmp_path, thrown) as trained:
        moments = until_idle(trained)
    off = [np.abs(geometry.vertices_normal - CONTACTNETS_CUBE.scaled_vertices).max() for geometry in (
        moment.model.geometry() for moment in moments
    ) if geometry is not None]  # fmt: skip
    assert off[0] == 0.0
    assert 0.0 < off[-1] < 0.04


@pytest.mark.slow
def test_a_round_says_that_corners_are_not_where_they_are_known_to_be(tmp_path: Path) -> None:
    geometry = ContactGeometry.of_body(CONTACTNETS_CUBE).rigid()
    smaller = replace(
        geometry, vertices_normal=0.92 * geometry.vertices_normal, vertices_tangent=0.92 * geometry.vertices_tangent
    )
    thrown = simulated_tosses(8, 3, geometry=smaller)
    with knowing_the_cube(tmp_path, thrown) as trained:
        until_idle(trained)
        assert any(line.startswith("corners were learned up to") for line in trained.misfits())


def test_the_loss_of_held_out_tosses_is_the_one_that_is_trained_on() -> None:
    rigid = PolytopeModel(ContactGeometry.of_body(CONTACTNETS_CUBE), CONTACTNETS_CUBE, Form.RIGID)
    balanced, published = (LossConfig(threads=1, balanced=balanced) for balanced in (True, False))
    held_out, of_data = HeldOutTosses(tosses()), transitions_of(tosses(), CONTACTNETS_CUBE.length_scale)
    losses = []
    for loss in (balanced, published):
        found = rigid.batch_loss(Rows(of_data.before, of_data.after, of_data.dt), loss).losses
        losses.append(held_out.errors(rigid, loss).loss)
        assert losses[-1] == pytest.approx(float(found.detach().mean()))
    assert losses[0] != losses[1]
    assert held_out.errors(rigid).loss == losses[0]
