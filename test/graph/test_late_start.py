"""Whoever comes late misses nothing; a new theta ranks everything anew."""

import signal
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import yaml
from contact_curation_msgs.msg import ModelParameters
from contact_curation_msgs.srv import GetInformation, GetTosses
from rcl_interfaces.msg import Parameter, ParameterValue
from rcl_interfaces.srv import DescribeParameters, ListParameters, SetParameters

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.information.curation import curate
from contact_curation.information.ranker import RankingConfig
from contact_curation.learning.checkpoints.theta_bytes import bytes_of_geometry
from contact_curation.nodes.messages.toss import toss_of
from contact_curation.nodes.messages.toss_information import information_of
from contact_curation.nodes.ros.qos import latched
from test.graph.parts.graph import Graph
from test.graph.parts.offline import assert_same_buffer, curated, scored, tosses_of

NODES_YAML = Path(__file__).resolve().parents[2] / "contact_curation" / "config" / "nodes.yaml"
TOP = 5
LONG = 90.0


def set_criterion(graph: Graph, criterion: str, top: int = TOP) -> Any:
    """Both at once, as `ros2 param load` does; what became of the first."""
    values = {"criterion": ParameterValue(type=4, string_value=criterion), "top": ParameterValue(type=2, integer_value=top)}
    request = SetParameters.Request(parameters=[Parameter(name=name, value=value) for name, value in values.items()])
    return graph.listener.call(SetParameters, "/curator/set_parameters", request).results[0]


@pytest.mark.slow
def test_scorer_and_curator_that_come_late_and_a_new_theta_and_criterion(graph: Graph, golden_bag: Path) -> None:
    tosses = graph.tosses()
    expected = tosses_of(golden_bag)
    graph.start("pose_ingest")
    player = graph.start("player", bag=golden_bag, rate=40.0, wait_for=10.0)
    graph.until(lambda: len(tosses) == len(expected), LONG, "the tosses")
    assert player.wait(10.0) == 0

    graph.start("fisher_scorer")
    graph.start("curator", top=TOP)
    buffers = graph.buffers()
    graph.until(lambda: buffers and buffers[-1].tosses_seen == len(expected), LONG, "every toss to be curated")
    assert_same_buffer(buffers[-1], curated(golden_bag, TOP))

    stored = graph.listener.call(GetTosses, "/get_tosses", GetTosses.Request(after_sequence=2, limit=3))
    assert [toss_of(toss).digest() for toss in stored.tosses] == [toss.digest() for toss in expected[2:5]]
    named = graph.listener.call(GetTosses, "/get_tosses", GetTosses.Request(toss_ids=[expected[7].toss_id, "nobody"]))
    assert [toss.sequence for toss in named.tosses] == [8]
    assert named.unknown_ids == ["nobody"]

    cube = ContactGeometry.of_body(CONTACTNETS_CUBE)
    theta = replace(cube, vertices_normal=cube.vertices_normal * 1.005, tangents=cube.tangents * 1.2)
    parameters = graph.listener.node.create_publisher(ModelParameters, "/model_parameters", latched(1))
    published = ModelParameters(body="cube", model="polytope", version="theta", safetensors=bytes_of_geometry(theta))
    parameters.publish(published)
    new = curated(golden_bag, TOP, theta)
    version = scored(expected[:1], theta)[0].parameters_version
    graph.until(lambda: buffers[-1].parameters_version == version and buffers[-1].tosses_seen == len(expected), LONG, "theta")
    assert_same_buffer(buffers[-1], new)

    assert set_criterion(graph, "trace", TOP - 1).successful
    graph.until(lambda: (buffers[-1].criterion, buffers[-1].capacity) == ("trace", TOP - 1), LONG, "another criterion")
    page = graph.listener.call(GetInformation, "/get_information", GetInformation.Request(after_sequence=len(expected)))
    informations = [information_of(message) for message in page.information]
    assert_same_buffer(buffers[-1], curate(informations, RankingConfig(criterion="trace", top=TOP - 1)))
    for service, name in ((GetTosses, "/get_tosses"), (GetInformation, "/get_information")):
        assert graph.listener.call(service, name, service.Request(after_sequence=(1 << 64) - 1)).last_sequence > 0
    refused = set_criterion(graph, "beauty")
    assert not refused.successful
    assert "log-det" in refused.reason


WRONG: dict[str, tuple[str, dict[str, Any], str]] = {
    "no body": ("pose_ingest", {"body": "/nowhere/body.yaml"}, "/nowhere/body.yaml"),
    "a word for a number": ("pose_ingest", {"gates.depth": "deep"}, "gates.depth"),
    "out of bounds": ("pose_ingest", {"queue_depth": 5}, "queue_depth"),
    "not positive": ("pose_ingest", {"segmenter.shortest": -1.0}, "segmenter.shortest out of range Min: 0.0"),
    "no such word": (
        "fisher_scorer",
        {"estimator": "guess"},
        "unknown estimator guess: expected one of empirical, gauss-newton",
    ),
    "no store": ("fisher_scorer", {"store": "/nowhere/store"}, "/nowhere/store"),
    "no criterion": ("curator", {"criterion": "beauty"}, "unknown criterion beauty"),
    "no bag": ("player", {}, "the path of a recording"),
    "no topic": ("player", {"topics": ["/nothing"]}, "expected /nothing"),
}


def test_a_wrong_parameter_ends_a_node_with_one_line_and_status_1(graph: Graph, golden_bag: Path) -> None:
    for label, (name, parameters, _) in WRONG.items():
        bag = {"bag": golden_bag} if "topics" in parameters else {}
        graph.start(name, None, label, **parameters, **bag)
    for process, (label, (_, _, line)) in zip(graph.processes, WRONG.items()):
        assert process.wait(LONG) == 1, label
        said = [one for one in process.log().strip().splitlines() if not one.startswith("[INFO]")]  # of the body taken
        assert len(said) == 1, process.log()
        assert line in said[0]


def assert_described(graph: Graph, name: str) -> None:
    """A node knows all parameters of config/nodes.yaml and describes each of its own."""
    listed = graph.listener.call(ListParameters, f"/{name}/list_parameters", ListParameters.Request()).result.names
    own = [parameter for parameter in listed if parameter not in ("use_sim_time", "start_type_description_service")]
    request = DescribeParameters.Request(names=own)
    described = graph.listener.call(DescribeParameters, f"/{name}/describe_parameters", request).descriptors
    assert [one.name for one in described if not one.description] == []
    assert set(yaml.safe_load(NODES_YAML.read_text())[f"/**/{name}"]["ros__parameters"]) <= set(own)


def test_nodes_describe_their_parameters_and_end_quietly_when_asked_to(graph: Graph) -> None:
    for name in ("pose_ingest", "fisher_scorer", "curator"):
        graph.start(name)
    expected = {process.name for process in graph.processes}
    graph.until(lambda: expected <= set(graph.listener.node.get_node_names()), LONG, "the nodes")
    for process in graph.processes:
        assert_described(graph, process.name)
    for process, how in zip(graph.processes, (signal.SIGINT, signal.SIGTERM, signal.SIGTERM)):
        assert process.stop(how) == 0
        said = [line for line in process.log().splitlines() if ": waiting for " not in line]  # on a busy machine they wait
        assert [line.partition("no body given")[1] for line in said] == ["no body given"]
