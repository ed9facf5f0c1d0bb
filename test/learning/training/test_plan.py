"""A plan decides a training bit for bit: stopped and resumed, or cut into other calls, it ends in the same numbers."""

import json
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.models.polytope import PolytopeModel
from contact_curation.contact.parameter_form import Form
from contact_curation.errors import InvalidValueError, UnreadableInputError
from contact_curation.information.ranker import RankingConfig
from contact_curation.learning.checkpoints.checkpoint import checkpoint_bytes
from contact_curation.learning.checkpoints.safetensors_bytes import pack, unpack
from contact_curation.learning.checkpoints.selection_document import document_of_selections, selections_of
from contact_curation.learning.training.plan import TrainingPlan, begin, resume, stored
from contact_curation.learning.training.progress import TrainingState
from contact_curation.learning.training.protocols import budgeted, exact, published
from contact_curation.learning.training.reranking import RerankingConfig, StalenessConfig, Trigger
from contact_curation.motion.toss import Toss
from test.simulated import simulated_tosses

STEPS = 24


@pytest.fixture(scope="module")
def tosses() -> tuple[Toss, ...]:
    return simulated_tosses(8, seed=21)


@pytest.fixture(scope="module")
def plan(tosses: tuple[Toss, ...]) -> TrainingPlan:
    """It trains on 3 of 6 tosses, which it selects again on both occasions."""
    protocol = replace(budgeted("polytope"), steps=STEPS, evaluation_steps=6)
    staleness = StalenessConfig(tosses=6, steps=5, spearman=1.0, overlap=1.0)
    selection = RerankingConfig(RankingConfig("trace", top=3), epochs=2, staleness=staleness)
    return TrainingPlan("polytope", CONTACTNETS_CUBE, protocol, tosses[:6], tosses[6:], seed=4, selection=selection)


def test_the_kept_tosses_and_nothing_else_are_trained_on(plan: TrainingPlan) -> None:
    curated = begin(plan)
    while curated.training.progress.state is TrainingState.RUNNING:
        curated.advance(1)
        assert set(curated.training.data.toss_ids) == set(curated.selections[-1].toss_ids)
    assert {one.trigger for one in curated.selections} == set(Trigger) - {Trigger.OPTIMUM}
    assert len({frozenset(one.toss_ids) for one in curated.selections}) > 1
    assert curated.training.progress.gradient_steps == STEPS


@pytest.mark.slow
@pytest.mark.parametrize(("criterion", "most"), [("longest", 1), ("representative", 3)])
def test_an_exact_training_ends_however_many_steps_it_may_take(plan: TrainingPlan, criterion: str, most: int) -> None:
    selection = RerankingConfig(RankingConfig(criterion, top=3))
    whole, cut = (begin(replace(plan, protocol=exact(), selection=selection)) for _ in range(2))
    whole.advance(10**9)
    while cut.training.progress.state is TrainingState.RUNNING:
        cut.advance(1)
    assert 1 <= len(whole.selections) <= most
    assert whole.selections == cut.selections
    kept = [frozenset(one.toss_ids) for one in whole.selections]
    assert all(one != other for one, other in pairwise(kept[:-1]))  # the last may find that nothing changes
    assert whole.advance(10**9).state is TrainingState.CONVERGED
    assert whole.selections == cut.selections


def test_a_training_that_is_killed_anywhere_ends_in_the_same_numbers(plan: TrainingPlan) -> None:
    undisturbed = begin(plan)
    undisturbed.advance(STEPS)
    disturbed = begin(plan)
    for steps in (1, 4, 2, 5, 1, 3, 7, 50):
        disturbed = resume(plan, stored(plan, disturbed), "memory")
        disturbed.advance(steps)
    assert str(disturbed.selections) == str(undisturbed.selections)
    one, other = (unpack(stored(plan, curated), "memory") for curated in (disturbed, undisturbed))
    assert one.documents == other.documents
    assert {name: value.tobytes() for name, value in one.arrays.items()} == {n: v.tobytes() for n, v in other.arrays.items()}


def test_a_published_training_selects_at_the_same_steps_however_it_is_cut(plan: TrainingPlan) -> None:
    protocol = replace(published("polytope"), epochs=6)
    selection = RerankingConfig(RankingConfig("trace", top=2), epochs=2)
    whole, cut = (begin(replace(plan, protocol=protocol, selection=selection)) for _ in range(2))
    progress = whole.advance(10**6)
    while cut.training.progress.state is TrainingState.RUNNING:
        cut.advance(37)
    assert progress.state is TrainingState.SPENT
    assert [one.epochs for one in whole.selections] == [0, 2, 4]
    assert str(cut.selections) == str(whole.selections)
    found, expected = (one.training.model.tensors() for one in (cut, whole))
    assert {name: value.tobytes() for name, value in found.items()} == {n: v.tobytes() for n, v in expected.items()}


def test_without_a_selection_all_tosses_are_trained_on(plan: TrainingPlan) -> None:
    curated = begin(replace(plan, selection=None))
    assert curated.training.data.toss_ids == tuple(toss.toss_id for toss in plan.tosses)
    assert curated.selections == ()
    again = resume(replace(plan, selection=None), stored(replace(plan, selection=None), curated), "memory")
    assert again.advance(2) == curated.advance(2)


def test_a_given_start_is_trained_from_and_left_as_it_is(plan: TrainingPlan) -> None:
    start = PolytopeModel(ContactGeometry.of_body(CONTACTNETS_CUBE), CONTACTNETS_CUBE, Form.PHYSICAL)
    before = start.tensors()
    curated = begin(replace(plan, start=start))
    for name, value in curated.training.model.tensors().items():
        assert np.array_equal(value, before[name])
    curated.advance(2)
    assert not np.array_equal(curated.training.model.tensors()["vertices_normal"], before["vertices_normal"])
    assert np.array_equal(start.tensors()["vertices_normal"], before["vertices_normal"])


def changed(plan: TrainingPlan, name: str) -> TrainingPlan:
    corners = ContactGeometry.of_body(CONTACTNETS_CUBE)
    other = PolytopeModel(corners, CONTACTNETS_CUBE, Form.PHYSICAL)
    changes: dict[str, dict[str, Any]] = {
        "protocol": {"protocol": replace(plan.protocol, batch=64)},
        "seed": {"seed": 5},
        "tosses": {"tosses": plan.tosses[:5]},
        "held-out tosses": {"held_out": plan.held_out[:1]},
        "body": {"body": replace(CONTACTNETS_CUBE, mass=0.4)},
        "selection": {"selection": replace(plan.selection, epochs=7)} if plan.selection else {},
        "start": {"start": other},
    }
    return replace(plan, **changes[name])


@pytest.mark.parametrize(
    ("name", "line"),
    [
        ("protocol", "found training.batch=64, expected training.batch=128 as in m.safetensors: add --set training.batch=128"),
        ("seed", "found 5, expected 4 as in m.safetensors"),
        ("tosses", "found 5 tosses, digest"),
        ("held-out tosses", "found 1 tosses, digest"),
        ("selection", "found epochs=7, expected epochs=2 as in m.safetensors"),
        ("start", "found a polytope, digest"),
    ],
)
def test_another_plan_is_refused_by_name(plan: TrainingPlan, name: str, line: str) -> None:
    data = stored(plan, begin(plan))
    with pytest.raises(InvalidValueError, match=f"^{name} of the training to go on with: {line}"):
        resume(changed(plan, name), data, "m.safetensors")


def test_another_body_is_refused_by_the_value_that_differs(plan: TrainingPlan) -> None:
    with pytest.raises(UnreadableInputError, match=r"^m\.safetensors: is for the body 'cube', whose mass differs"):
        resume(changed(plan, "body"), stored(plan, begin(plan)), "m.safetensors")


def as_before_the_balanced_loss(data: bytes) -> bytes:
    """A checkpoint as it was when there was one loss and one start, and bodies were compared by a digest."""
    packed = unpack(data, "memory")
    protocol, selection = (json.loads(packed.documents["notes"][name]) for name in ("protocol", "selection"))
    for document in (protocol, selection["scoring"], packed.documents["training"]["config"]):
        document["loss"].pop("balanced")
    for document in (protocol, packed.documents["training"]["config"]):
        del document["starts"], document["restitution"], document["shape_known_to"]
    del selection["staleness"]
    packed.documents["notes"] |= {
        "protocol": json.dumps(protocol),
        "selection": json.dumps(selection),
        "body": "cube, digest 0",
    }
    return pack(packed.arrays, packed.documents)


def test_a_training_of_an_earlier_version_goes_on_with_the_settings_that_the_error_names(plan: TrainingPlan) -> None:
    plan = replace(plan, selection=plan.selection and replace(plan.selection, staleness=None))
    published_loss = replace(plan.protocol, loss=replace(plan.protocol.loss, balanced=False))
    before = replace(plan, protocol=published_loss, scoring=replace(plan.scoring, loss=published_loss.loss))
    curated = begin(before)
    data = as_before_the_balanced_loss(stored(before, curated))
    found, stored_as = "training.loss.balanced=true", "training.loss.balanced=false"
    line = f"found {found}, expected {stored_as} as in m.safetensors: add --set {stored_as}"
    with pytest.raises(InvalidValueError, match=f"^protocol of the training to go on with: {line}$"):
        resume(plan, data, "m.safetensors")
    assert resume(before, data, "m.safetensors").advance(5) == curated.advance(5)


def test_notes_of_no_protocol_are_refused(plan: TrainingPlan) -> None:
    damaged = checkpoint_bytes(begin(plan).training, {**plan.identity, "protocol": '{"batch": 1}'})
    with pytest.raises(UnreadableInputError, match="holds no protocol"):
        resume(plan, damaged, "m.safetensors")


def test_bytes_of_another_origin_are_refused(plan: TrainingPlan) -> None:
    with pytest.raises(UnreadableInputError, match="no safetensors"):
        resume(plan, b"nothing", "m.safetensors")
    without_plan = checkpoint_bytes(begin(plan).training)
    with pytest.raises(UnreadableInputError, match="says not which model it belongs to"):
        resume(plan, without_plan, "m.safetensors")
    damaged = checkpoint_bytes(begin(plan).training, {**plan.identity, "selections": "[{}]"})
    with pytest.raises(UnreadableInputError, match="says not what was selected"):
        resume(plan, damaged, "m.safetensors")


def test_selections_come_back_as_they_were(plan: TrainingPlan) -> None:
    curated = begin(plan)
    curated.advance(STEPS)
    assert len(curated.selections) > 1
    assert str(selections_of(document_of_selections(curated.selections))) == str(curated.selections)
