"""A training goes on from its checkpoint bit for bit; what is no checkpoint, or of another body, is refused in a line."""

import json
import pickle
from dataclasses import replace

import numpy as np
import pytest
import safetensors.numpy

from contact_curation.contact.body import Body
from contact_curation.contact.models.registry import MODELS
from contact_curation.errors import InvalidValueError, UnreadableInputError
from contact_curation.learning.checkpoints import safetensors_bytes
from contact_curation.learning.checkpoints.checkpoint import (
    HowTrained,
    checkpoint_bytes,
    config_of,
    how_trained,
    training_of_bytes,
)
from contact_curation.learning.checkpoints.safetensors_bytes import pack, unpack
from contact_curation.learning.checkpoints.stored_model import model_bytes, model_of_bytes, notes_of_bytes
from contact_curation.learning.training.progress import EarlyStop, TrainingState
from contact_curation.learning.training.protocols import Patience, TrainingConfig, budgeted, exact, published
from contact_curation.learning.training.training import Training, new_training
from contact_curation.motion.transitions import Transitions
from test.contact.cases import CUBE, tracked_transitions


def part(first: int, last: int) -> Transitions:
    """Some of the simulated tosses' transitions, as one toss."""
    rows = tracked_transitions()
    return Transitions(
        (f"{first}",), rows.before[first:last], rows.after[first:last], rows.dt[first:last], np.array([0, last - first])
    )


def config_for(kind: str) -> TrainingConfig:
    """With everything that has a state: a schedule, small epochs, early stop."""
    return replace(budgeted(kind), batch=5, evaluation_steps=3, patience=Patience())


def training_for(kind: str = "polytope", seed: int = 0) -> Training:
    return new_training(kind, CUBE, part(0, 18), part(200, 210), config_for(kind), seed)


def again(training: Training, data: Transitions | None = None, held_out: Transitions | None = None) -> Training:
    """The training from its checkpoint."""
    return training_of_bytes(
        checkpoint_bytes(training), "checkpoint", data or training.data, held_out or training.held_out, CUBE
    )


def bits(training: Training) -> bytes:
    """All that a training holds."""
    return checkpoint_bytes(training)


@pytest.mark.parametrize("kind", list(MODELS))
@pytest.mark.parametrize("steps", [0, 4, 5])
def test_a_resumed_training_is_bit_for_bit_an_uninterrupted_one(kind: str, steps: int) -> None:
    training = training_for(kind)
    if steps:
        training.advance(steps)
    resumed = again(training)
    assert resumed.advance(6) == training.advance(6)
    assert bits(resumed) == bits(training)


def test_a_resumed_training_is_the_same_after_its_data_were_replaced() -> None:
    training = training_for()
    training.advance(3)
    training.replace_data(part(300, 311))
    training.advance(2)
    resumed = again(training)
    assert resumed.advance(5) == training.advance(5)
    assert bits(resumed) == bits(training)


def test_resuming_with_other_data_is_replacing_them() -> None:
    training = training_for()
    training.advance(3)
    resumed = again(training, data=part(300, 311))
    training.replace_data(part(300, 311))
    assert resumed.advance(5) == training.advance(5)
    assert bits(resumed) == bits(training)


def test_other_held_out_transitions_make_the_best_so_far_no_measure() -> None:
    training = training_for()
    training.advance(6)
    resumed = again(training, held_out=part(220, 230))
    assert training.best_tensors is not None
    assert (resumed.early_stop, resumed.best_tensors) == (EarlyStop(), None)
    assert resumed.history == training.history


def test_an_ended_training_is_still_ended() -> None:
    training = training_for()
    training.counters = replace(training.counters, state=TrainingState.CONVERGED, reason="enough")
    assert again(training).advance(3) == training.progress


def test_a_training_without_held_out_transitions_resumes_too() -> None:
    config = replace(config_for("polytope"), patience=None)
    training = new_training("polytope", CUBE, part(0, 18), None, config, 0)
    training.advance(4)
    resumed = training_of_bytes(checkpoint_bytes(training), "checkpoint", part(0, 18), None)
    training.advance(3)
    resumed.advance(3)
    assert bits(resumed) == bits(training)


@pytest.mark.parametrize("kind", list(MODELS))
def test_the_model_of_a_checkpoint_is_the_best_one_or_if_wanted_the_last(kind: str) -> None:
    training = training_for(kind)
    training.advance(3)
    best = training.model.tensors()
    training.early_stop = EarlyStop(-1.0)  # nothing is better from here on
    training.advance(4)
    data = checkpoint_bytes(training)
    for last, expected in ((False, best), (True, training.model.tensors())):
        found = model_of_bytes(data, "checkpoint", CUBE, last).tensors()
        assert all(np.array_equal(found[name], expected[name]) for name in expected)
    trained = training.trained().tensors()
    assert all(np.array_equal(trained[name], best[name]) for name in best)


def test_a_model_alone_is_read_with_its_body_and_its_notes() -> None:
    model = training_for().model
    data = model_bytes(model, {"version": "7"})
    read = model_of_bytes(data, "model")
    assert (read.kind, read.settings(), read.body.name) == (model.kind, model.settings(), "cube")
    np.testing.assert_array_equal(read.body.inertia, CUBE.inertia)
    assert notes_of_bytes(data, "model") == {"version": "7"}
    with pytest.raises(UnreadableInputError, match="a model without its training"):
        training_of_bytes(data, "model", part(0, 18), None)


@pytest.mark.parametrize("name", ["mass", "friction", "length_scale", "gravity", "inertia", "vertices"])
def test_a_checkpoint_for_another_body_is_refused_by_the_constant_that_differs(name: str) -> None:
    other: Body = replace(CUBE, name="other", **{name: getattr(CUBE, name) * 1.01})
    with pytest.raises(UnreadableInputError, match=f"whose {name} differs from that of the body 'other'"):
        model_of_bytes(model_bytes(training_for().model), "model", other)


def test_the_name_of_a_body_makes_no_other_body() -> None:
    assert model_of_bytes(model_bytes(training_for().model), "model", replace(CUBE, name="die")).body.name == "die"


@pytest.fixture(scope="module")
def whole() -> bytes:
    training = training_for()
    training.advance(4)
    return checkpoint_bytes(training)


def refused(data: bytes) -> str:
    """The one line that says why."""
    with pytest.raises(UnreadableInputError) as error:
        training_of_bytes(data, "some.safetensors", part(0, 18), part(200, 210))
    line = str(error.value)
    assert line.startswith("some.safetensors: ")
    assert "\n" not in line
    return line


def test_a_checkpoint_cut_short_anywhere_is_refused(whole: bytes) -> None:
    for length in (0, 1, 8, 100, len(whole) // 2, len(whole) - 1):
        refused(whole[:length])


def test_a_single_flipped_bit_of_a_number_is_noticed(whole: bytes) -> None:
    for place in (-1, -100, -1000):
        spoilt = bytearray(whole)
        spoilt[place] ^= 1
        assert "is damaged" in refused(bytes(spoilt))


def test_foreign_files_are_refused(whole: bytes) -> None:
    refused(pickle.dumps({"a": 1}))
    refused(b"PK\x03\x04" + bytes(100))  # how torch.save begins
    refused(b"{}")
    assert "found metadata of no kind" in refused(safetensors.numpy.save({"a": np.zeros(3)}))
    assert "found metadata format" in refused(safetensors.numpy.save({"a": np.zeros(3)}, {"format": "other"}))
    for header in ("[" * 10**5, "{}", "3", '{"digest": 1, "documents": "3"}'):
        assert "no JSON in its header" in refused(safetensors.numpy.save({}, {safetensors_bytes.FORMAT: header}))


def test_too_many_bytes_are_refused_unread(whole: bytes, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(safetensors_bytes, "LARGEST_BYTES", len(whole) - 1)
    assert "expected at most" in refused(whole)


@pytest.mark.parametrize(
    ("document", "path", "value"),
    [
        ("model", ["kind"], "cubist"),
        ("model", ["settings", "form"], "round"),
        ("model", ["body", "mass"], -1.0),
        ("model", ["body"], 3),
        ("model", [], []),
        ("training", ["counters", "gradient_steps"], -1),
        ("training", ["counters", "gradient_steps"], "many"),
        ("training", ["counters", "state"], "asleep"),
        ("training", ["config", "batch"], 0),
        ("training", ["config", "loss"], None),
        ("training", ["batches", "generator", "state", "state"], "random"),
        ("training", ["batches", "generator", "bit_generator"], "MT19937"),
        ("training", ["history"], [{"epochs": 1}]),
        ("training", ["best"], "low"),
        ("training", [], None),
    ],
)
def test_a_document_of_another_form_is_refused(whole: bytes, document: str, path: list[str], value: object) -> None:
    packed = unpack(whole, "whole")
    documents = json.loads(json.dumps(packed.documents))
    if path:
        inner = documents[document]
        for key in path[:-1]:
            inner = inner[key]
        inner[path[-1]] = value
    else:
        documents[document] = value
    refused(pack(packed.arrays, documents))


def test_a_checkpoint_says_how_exactly_its_corners_were_known_as_far_as_it_says_anything(whole: bytes) -> None:
    packed = unpack(whole, "whole")
    for value, expected in ((None, None), (0.001, 0.001)):
        documents = json.loads(json.dumps(packed.documents))
        documents["training"]["config"]["shape_known_to"] = value
        assert how_trained(pack(packed.arrays, documents), "whole").shape_known_to == expected
    del documents["training"]["config"]["shape_known_to"]  # of an earlier version
    assert how_trained(pack(packed.arrays, documents), "earlier").shape_known_to is None
    assert how_trained(model_bytes(training_for().model), "a model alone") == HowTrained()
    for spoilt in (-1.0, "much", [0.001]):
        documents["training"]["config"]["shape_known_to"] = spoilt
        with pytest.raises(UnreadableInputError, match=r"^spoilt: (found shape_known_to -1\.0, expected|holds no training)"):
            how_trained(pack(packed.arrays, documents), "spoilt")


@pytest.mark.parametrize("name", ["model/vertices_normal", "moments/vertices_normal/exp_avg", "order"])
def test_arrays_that_do_not_fit_are_refused(whole: bytes, name: str) -> None:
    packed = unpack(whole, "whole")
    for arrays in (
        {**packed.arrays, name: np.zeros((3, 3))},
        {key: value for key, value in packed.arrays.items() if key != name},
    ):
        with pytest.raises((UnreadableInputError, InvalidValueError)):
            training_of_bytes(pack(arrays, packed.documents), "spoilt", part(0, 18), part(200, 210))


def test_numbers_that_are_not_finite_are_refused(whole: bytes) -> None:
    packed = unpack(whole, "whole")
    for name in ("model/vertices_normal", "moments/vertices_normal/exp_avg"):
        spoilt = packed.arrays[name].copy()
        spoilt[0] = np.nan
        with pytest.raises((UnreadableInputError, InvalidValueError), match="not finite"):
            training_of_bytes(pack({**packed.arrays, name: spoilt}, packed.documents), "spoilt", part(0, 18), part(200, 210))


def test_the_published_protocol_resumes_in_the_middle_of_an_epoch() -> None:
    training = new_training("polytope", CUBE, part(0, 18), part(200, 210), published("polytope"), 3)
    training.advance(11)
    resumed = again(training)
    assert resumed.advance(20) == training.advance(20)
    assert bits(resumed) == bits(training)


@pytest.mark.parametrize("protocol", [budgeted("polytope"), exact(starts=2)], ids=["budgeted", "exact"])
def test_a_checkpoint_says_whether_its_training_ended_at_an_optimum(protocol: TrainingConfig) -> None:
    training = new_training("polytope", CUBE, part(0, 60), None, replace(protocol, steps=3), 3)
    assert not how_trained(checkpoint_bytes(training), "before").at_optimum
    while training.progress.state is TrainingState.RUNNING:
        training.advance(1)
    assert how_trained(checkpoint_bytes(training), "after").at_optimum is protocol.exact


def test_a_training_of_an_earlier_version_had_the_published_weights(whole: bytes) -> None:
    packed = unpack(whole, "whole")
    documents = json.loads(json.dumps(packed.documents))
    assert config_of(documents["training"]["config"]).loss.balanced
    assert how_trained(whole, "whole").loss == config_of(documents["training"]["config"]).loss
    del documents["training"]["config"]["loss"]["balanced"]
    assert not config_of(documents["training"]["config"]).loss.balanced
    assert how_trained(pack(packed.arrays, documents), "earlier").loss == config_of(documents["training"]["config"]).loss
    documents["training"]["config"]["loss"]["match"] = -1.0
    with pytest.raises(UnreadableInputError, match=r"^spoilt: holds no training"):
        how_trained(pack(packed.arrays, documents), "spoilt")
