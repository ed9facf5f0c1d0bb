"""The loop of learning through real processes: what is kept is trained on, and what was learned ranks again."""

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.contact.models.polytope import PolytopeModel
from contact_curation.information.model_version import model_version
from contact_curation.learning.checkpoints.theta_bytes import geometry_of_bytes
from contact_curation.storage.checkpoint_file import read_model
from test.cli.commands import write_parameters
from test.graph.parts.graph import Graph
from test.graph.parts.made_node import lone_domain, made_node
from test.graph.parts.offline import tosses_of

LONG = 90.0
TOP = 6
TRAINER: dict[str, Any] = {"settling_rounds": 1}
STEPPING: dict[str, Any] = {"protocol": "budgeted", "steps": 60}


def started(graph: Graph, bag: Path, **changed: Any) -> None:
    for stage in ("pose_ingest", "fisher_scorer"):
        graph.start(stage)
    graph.start("curator", top=TOP)
    graph.start("trainer", evaluate_on=[bag], **{**TRAINER, **changed})
    graph.start("player", bag=bag, rate=20.0, wait_for=10.0, stay=True)


def at_rest(graph: Graph, seen: int) -> bool:
    """Whether all tosses were curated at the newest parameters, and the trainer has nothing left to train on."""
    heard = [graph.listener.heard[topic] for topic in ("/training_status", "/curated_buffer", "/model_parameters")]
    if not all(heard):
        return False
    status, buffer, parameters = (messages[-1] for messages in heard)
    newest = buffer.parameters_version == parameters.version == status.parameters_version
    considered = (status.buffer_revision, status.header.stamp) == (buffer.revision, buffer.header.stamp)
    return bool(newest and considered and buffer.tosses_seen == seen and status.state == "waiting")


def staying(condition: Callable[[], bool], seconds: float = 2.0) -> Callable[[], bool]:
    """Whether it has held so long: what is kept may change once more when the last toss is scored at what was learned last."""
    since: list[float] = []

    def held() -> bool:
        since[:] = (since or [time.monotonic()]) if condition() else []
        return bool(since) and time.monotonic() - since[0] >= seconds

    return held


def test_tosses_are_in_the_unit_of_length_of_the_first_parameters(tmp_path: Path) -> None:
    scale = 2.0 * CONTACTNETS_CUBE.length_scale
    vertices = (CONTACTNETS_CUBE.vertices / scale).tolist()
    path = write_parameters(tmp_path / "theta.json", vertices_normal=vertices, vertices_tangent=vertices, length_scale=scale)
    with lone_domain() as domain, made_node("trainer", domain, f"params:={path}") as (node, _):
        assert node._stage._length_scale == scale


def test_what_is_kept_is_trained_on_and_everything_is_scored_and_ranked_again_at_what_was_learned(
    graph: Graph, golden_bag: Path
) -> None:
    parameters, statuses, _, information = graph.parameters(), graph.statuses(), graph.buffers(), graph.information()
    started(graph, golden_bag)
    tosses = {toss.toss_id for toss in tosses_of(golden_bag)}

    graph.until(lambda: at_rest(graph, len(tosses)), LONG, "the loop to come to rest")
    published = {message.version for message in parameters}
    scored_at = {one.parameters_version for one in information}
    assert published & scored_at
    assert all(one.parameters_version in published for one in information[-len(tosses) :])
    assert {one.toss_id for one in information if one.parameters_version == parameters[-1].version} == tosses
    first = next(status for status in statuses if status.parameters_version)  # before, the trainer waits for a second toss
    assert (first.gradient_steps, statuses[0].gradient_steps) == (0, 0)
    assert statuses[-1].held_out_loss < 0.1 * first.held_out_loss
    assert statuses[-1].position_error < 0.1 * first.position_error

    assert "more throws like these" in statuses[-1].detail
    model = read_model(graph.folder / "trainer.safetensors")
    assert isinstance(model, PolytopeModel)
    assert model_version(model) == parameters[-1].version == statuses[-1].parameters_version
    heard = geometry_of_bytes(bytes(parameters[-1].safetensors))
    assert (heard.vertices_normal == model.geometry().vertices_normal).all()


@pytest.mark.slow
@pytest.mark.parametrize("protocol", [STEPPING, {"protocol": "exact"}], ids=["budgeted", "exact"])
def test_a_trainer_that_is_killed_in_mid_stream_goes_on_from_its_checkpoint(
    graph: Graph, golden_bag: Path, protocol: dict[str, Any]
) -> None:
    statuses, _, _ = graph.statuses(), graph.buffers(), graph.parameters()
    seen = len(tosses_of(golden_bag))
    started(graph, golden_bag, **protocol)
    graph.until(lambda: statuses and statuses[-1].gradient_steps > 0, LONG, "a first round")
    next(process for process in graph.processes if process.name == "trainer").kill()
    steps, told = statuses[-1].gradient_steps, len(statuses)
    graph.start("trainer", evaluate_on=[golden_bag], **TRAINER, **protocol)
    # On a busy machine all tosses may have been trained on before the kill: then it tells of its last round again, and rests.
    graph.until(lambda: len(statuses) > told and at_rest(graph, seen), LONG, "the loop to come to rest")
    assert statuses[-1].gradient_steps >= steps
    counted = [status.gradient_steps for status in statuses]
    assert counted == sorted(counted)
    if protocol is STEPPING:
        assert all(count % STEPPING["steps"] == 0 for count in counted)


@pytest.mark.slow
def test_held_out_recordings_that_are_not_there_are_one_line(graph: Graph) -> None:
    trainer = graph.start("trainer", evaluate_on=[graph.folder / "nothing.mcap"])
    assert trainer.wait(30.0) == 1
    assert "trainer: parameter evaluate_on: found " in trainer.log()
    assert "Traceback" not in trainer.log()


@pytest.mark.slow
def test_an_exact_protocol_for_a_network_is_one_line(graph: Graph) -> None:
    trainer = graph.start("trainer", model="deep", protocol="exact")
    assert trainer.wait(30.0) == 1
    assert "trainer: protocol: found exact for deep, physical, expected budgeted" in trainer.log()


@pytest.mark.slow
def test_a_trainer_that_is_asked_to_end_while_it_trains_ends_with_status_0_and_a_checkpoint(
    graph: Graph, golden_bag: Path
) -> None:
    statuses = graph.statuses()
    for stage in ("pose_ingest", "fisher_scorer", "curator"):
        graph.start(stage)
    trainer = graph.start("trainer", evaluate_on=[golden_bag], protocol="budgeted", steps=1_000_000)
    graph.start("player", bag=golden_bag, rate=20.0, wait_for=10.0, stay=True)
    graph.until(lambda: any(one.state == "training" for one in statuses), LONG, "the first round to begin")
    assert trainer.stop() == 0, trainer.log()
    assert "Traceback" not in trainer.log()
    assert (graph.folder / "trainer.safetensors").exists()


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["deep", "deepvertex", "end_to_end"])
def test_a_network_goes_round_the_same_loop(graph: Graph, golden_bag: Path, kind: str) -> None:
    parameters, _, _, information = graph.parameters(), graph.statuses(), graph.buffers(), graph.information()
    started(graph, golden_bag, model=kind, steps=5, settling_rounds=0)
    tosses = {toss.toss_id for toss in tosses_of(golden_bag)}
    graph.until(staying(lambda: at_rest(graph, len(tosses))), 4 * LONG, "the loop to come to rest")
    at_newest = [one for one in information if one.parameters_version == parameters[-1].version]
    assert {one.toss_id for one in at_newest} == tosses
    assert {one.model for one in at_newest} == {kind}
    model = read_model(graph.folder / "trainer.safetensors")
    assert (model.kind, model_version(model)) == (kind, parameters[-1].version)
