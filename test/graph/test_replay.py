"""A recording through four processes gives what the library gives."""

import time
from dataclasses import asdict, replace
from itertools import accumulate
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from contact_curation_msgs.msg import ModelParameters
from contact_curation_msgs.msg import Toss as TossMessage
from contact_curation_msgs.srv import SaveBuffer

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.information.scoring import parameters_version
from contact_curation.learning.checkpoints.theta_bytes import bytes_of_geometry, geometry_of_bytes
from contact_curation.motion.calibration import RigCalibration
from contact_curation.motion.toss import Toss
from contact_curation.nodes.messages.toss import toss_of
from contact_curation.nodes.messages.toss_bytes import EXPECTED_TOSS, toss_in
from contact_curation.nodes.ros.qos import latched, profile
from contact_curation.storage.inputs.inputs import InputsConfig, open_inputs
from contact_curation.storage.manifest.file import read_manifest
from test.graph.parts.graph import Graph
from test.graph.parts.offline import assert_same_buffer, curated, tosses_of

TOP = 6
RATE = 20.0
LONG = 90.0


def test_the_same_bag_gives_the_same_ranking_through_the_nodes_and_through_the_library(graph: Graph, golden_bag: Path) -> None:
    tosses, rejected, buffers = graph.tosses(), graph.rejected(), graph.buffers()
    for stage in ("pose_ingest", "fisher_scorer"):
        graph.start(stage)
    graph.start("curator", top=TOP)
    graph.start("player", bag=golden_bag, rate=RATE, wait_for=10.0, stay=True)

    expected = tosses_of(golden_bag)
    graph.until(lambda: buffers and buffers[-1].tosses_seen == len(expected), LONG, "every toss to be curated")
    assert [toss.toss_id for toss in tosses] == [toss.toss_id for toss in expected]
    assert [toss.sequence for toss in tosses] == list(range(1, len(expected) + 1))
    assert len(rejected) == 3
    assert_same_buffer(buffers[-1], curated(golden_bag, TOP))

    answer = graph.listener.call(SaveBuffer, "/save_buffer", SaveBuffer.Request(path="kept.csv"))
    assert answer.success, answer.message
    assert answer.path == str(graph.folder / "kept.csv")
    kept = read_manifest(graph.folder / "kept.csv").selected
    assert [row.toss_id for row in kept] == list(buffers[-1].toss_ids)
    first = {toss.toss_id: int(toss.stamps_ns[0]) for toss in expected}
    assert [row.first_stamp_ns for row in kept] == [first[row.toss_id] for row in kept]


@pytest.mark.slow
def test_a_rig_that_a_node_is_told_puts_its_tosses_right_as_in_the_library(graph: Graph, golden_bag: Path) -> None:
    rig = RigCalibration(normal=(0.004, -0.008, 1.0), centre=(0.2, 0.1, 0.0), scale=1.01)
    inputs = open_inputs([golden_bag], CONTACTNETS_CUBE, InputsConfig(rig=rig))
    expected = [item for item in inputs if isinstance(item, Toss)]
    tosses = graph.tosses()
    told: dict[str, Any] = {
        f"rig.{name}": list(value) if isinstance(value, tuple) else value for name, value in asdict(rig).items()
    }
    graph.start("pose_ingest", **told)
    graph.start("player", bag=golden_bag, rate=RATE, wait_for=10.0, stay=True)
    graph.until(lambda: len(tosses) == len(expected), LONG, "every toss")
    for message, toss in zip(tosses, expected, strict=True):
        assert toss_of(message).digest() == toss.digest()
    assert [toss.digest() for toss in expected] != [toss.digest() for toss in tosses_of(golden_bag)]


@pytest.mark.slow
def test_tosses_are_expected_before_they_come(graph: Graph, golden_bag: Path) -> None:
    tosses, rejected, expected = graph.tosses(), graph.rejected(), list[bytes]()
    qos = profile(100, reliable=True, latched=False)
    graph.listener.node.create_subscription(TossMessage, f"/{EXPECTED_TOSS}", expected.append, qos, raw=True)
    graph.start("pose_ingest")
    graph.start("player", bag=golden_bag, rate=1.0, wait_for=10.0, stay=True)
    graph.until(lambda: len(tosses) == len(tosses_of(golden_bag)), LONG, "every toss")
    ahead = {read.toss_id: read for read in map(toss_in, expected)}
    assert ahead.keys() <= {one.toss_id for one in (*tosses, *rejected)}
    both = [(ahead[toss.toss_id], toss) for toss in tosses if toss.toss_id in ahead]
    assert both  # a loaded machine may take several poses together, and expect none
    for read, toss in both:
        assert len(read.stamps) == len(toss.stamps)
        assert toss_of(read).positions.tobytes() == toss_of(toss).positions.tobytes()
    assert any(toss_of(read).digest() == toss_of(toss).digest() for read, toss in both)  # the last of them are complete


STAGES: dict[str, dict[str, Any]] = {"pose_ingest": {}, "fisher_scorer": {}, "curator": {"top": TOP}}


def slow(victim: str) -> Any:
    return pytest.param(victim, marks=pytest.mark.slow)


@pytest.mark.slow
@pytest.mark.parametrize("victim", ["pose_ingest", slow("fisher_scorer"), slow("curator"), slow("player")])
def test_a_node_that_is_killed_in_mid_stream_and_comes_back_changes_nothing(
    graph: Graph, golden_bag: Path, victim: str
) -> None:
    tosses, information, buffers = graph.tosses(), graph.information(), graph.buffers()
    parameters = STAGES | {"player": {"bag": golden_bag, "rate": 10.0, "wait_for": 10.0, "stay": True}}
    nodes = {name: graph.start(name, **chosen) for name, chosen in parameters.items()}

    graph.until(lambda: min(len(information), len(tosses)) >= 4, LONG, "the first tosses")
    nodes[victim].kill()
    graph.start(victim, **parameters[victim])

    expected = tosses_of(golden_bag)
    graph.until(lambda: buffers and buffers[-1].tosses_seen == len(expected), LONG, "every toss to be curated")
    assert_same_buffer(buffers[-1], curated(golden_bag, TOP))
    assert sorted({toss.toss_id for toss in tosses}) == [toss.toss_id for toss in expected]
    assert len({toss.sequence for toss in tosses}) == len(expected)


@pytest.mark.slow
def test_a_container_that_is_killed_in_mid_stream_and_comes_back_gives_the_ranking_of_the_library(
    graph: Graph, golden_bag: Path
) -> None:
    buffers, information = graph.buffers(), graph.information()
    container = graph.start_together(STAGES)
    graph.start("player", bag=golden_bag, rate=10.0, wait_for=20.0, stay=True)
    graph.until(lambda: len(information) >= 4, LONG, "the first tosses")
    container.kill()
    again = graph.start_together(STAGES)
    expected = tosses_of(golden_bag)
    graph.until(lambda: buffers and buffers[-1].tosses_seen == len(expected), LONG, "every toss to be curated")
    assert_same_buffer(buffers[-1], curated(golden_bag, TOP))
    assert "handed over in this process: /toss, /toss_information" in again.log()
    assert sorted(graph.folder.glob("*.sqlite")) == [
        graph.folder / name for name in ("buffer.sqlite", "information.sqlite", "tosses.sqlite")
    ]
    assert again.stop() == 0
    assert "Traceback" not in again.log()


@pytest.mark.slow
def test_a_node_that_cannot_start_ends_its_container_with_its_own_line(graph: Graph) -> None:
    container = graph.start_together({**STAGES, "curator": {"store": graph.folder / "none" / "buffer.sqlite"}})
    assert container.wait(LONG) == 1
    assert "curator: " in container.log()
    assert "Traceback" not in container.log()


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_nodes_that_are_killed_again_and_again_at_random_change_nothing(graph: Graph, golden_bag: Path, seed: int) -> None:
    draw = np.random.default_rng(seed)
    nodes = {name: graph.start(name, **chosen) for name, chosen in STAGES.items()}
    player = graph.start("player", bag=golden_bag, rate=3.0, wait_for=10.0, stay=True)
    tosses = graph.tosses()
    graph.until(lambda: tosses, LONG, "a toss")
    while "played" not in player.log():
        time.sleep(draw.uniform(0.1, 3.0))
        victim = str(draw.choice(list(STAGES)))
        nodes[victim].kill()
        nodes[victim] = graph.start(victim, **STAGES[victim])

    buffers = graph.buffers()
    expected = tosses_of(golden_bag)
    graph.until(lambda: buffers and buffers[-1].tosses_seen == len(expected), LONG, "every toss to be curated")
    assert_same_buffer(buffers[-1], curated(golden_bag, TOP))


@pytest.mark.slow
def test_while_parameters_come_faster_than_tosses_are_scored_no_buffer_ranks_few_of_them(
    graph: Graph, golden_bag: Path
) -> None:
    buffers = graph.buffers()
    for name, chosen in STAGES.items():
        graph.start(name, **chosen)
    graph.start("player", bag=golden_bag, rate=5.0, wait_for=10.0, stay=True)
    publisher = graph.listener.node.create_publisher(ModelParameters, "/model_parameters", latched(1))
    expected, sent = tosses_of(golden_bag), 0
    cube = ContactGeometry.of_body(CONTACTNETS_CUBE)
    while sent < 5000 and not (buffers and buffers[-1].tosses_seen == len(expected) and sent > 1000):
        sent += 1
        theta = bytes_of_geometry(replace(cube, vertices_normal=cube.vertices_normal * (1.0 + 1e-5 * sent)))
        publisher.publish(
            ModelParameters(
                format_version=ModelParameters.FORMAT_VERSION,
                body="cube",
                model="polytope",
                version=str(sent),
                safetensors=theta,
            )
        )
        time.sleep(0.01)
    newest = parameters_version(geometry_of_bytes(theta), CONTACTNETS_CUBE)
    graph.until(
        lambda: (buffers[-1].tosses_seen, buffers[-1].parameters_version) == (len(expected), newest), LONG, "the newest theta"
    )
    seen = [buffer.tosses_seen for buffer in buffers]
    assert all(now >= 0.9 * before for before, now in zip(accumulate(seen, max), seen[1:], strict=False)), seen
    assert len({buffer.parameters_version for buffer in buffers}) > 3
