"""The dashboard in a live graph: it shows what was said before it came, drops what it cannot hold, and slows nobody."""

import os
import signal
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.request import urlopen

import pytest
from contact_curation_msgs.msg import CuratedBuffer, TossRejected

from contact_curation.nodes.ros.health import node_of
from contact_curation.nodes.ros.qos import latched
from test.dashboard.live.test_serving import free_port
from test.dashboard.recorded import Recorded
from test.graph.parts.graph import Graph
from test.graph.parts.offline import tosses_of
from test.graph.parts.processes import NodeProcess
from test.graph.parts.storyteller import Storyteller, stamped
from test.listeners import family

LONG = 90.0
NODES = ("pose_ingest", "fisher_scorer", "curator", "dashboard")
TOP = 6
FLOOD = 400
PLAYED_AT = 10.0
"""Times real time."""


def rejected(number: int) -> TossRejected:
    toss_id = f"cube-{1_600_000_100 + number}000000000-abcdef01"
    return TossRejected(header=stamped(1_600_000_100.0 + number), toss_id=toss_id, frames=9, reasons=["too short"])


def said(heard: list[Any], node: str) -> dict[str, str]:
    """What a node reported last on /diagnostics."""
    statuses = [status for array in heard for status in array.status if node_of(status.name) == f"/{node}"]
    return {value.key: value.value for value in statuses[-1].values} if statuses else {}


def shows(heard: list[Any], tosses: int, revision: int) -> bool:
    values = said(heard, "dashboard")
    return (values.get("tosses"), values.get("buffer"), values.get("queue")) == (str(tosses), str(revision), "0")


def start_stages(graph: Graph) -> None:
    for stage in ("pose_ingest", "fisher_scorer"):
        graph.start(stage)
    graph.start("curator", top=TOP)


def curate(graph: Graph, bag: Path) -> tuple[list[CuratedBuffer], int]:
    """Has all tosses of a bag curated: the buffers heard meanwhile, and how many tosses there are."""
    buffers, expected = graph.buffers(), len(tosses_of(bag))
    start_stages(graph)
    graph.start("player", bag=bag, as_fast_as_possible=True, wait_for=10.0, stay=True)
    graph.until(lambda: buffers and buffers[-1].tosses_seen == expected, LONG, "every toss to be curated")
    return buffers, expected


@pytest.mark.slow
def test_a_dashboard_that_starts_late_fills_every_view(graph: Graph, golden_bag: Path) -> None:
    diagnostics = graph.diagnostics()
    story = Storyteller(graph, golden_bag)
    story.tell()
    buffers, expected = curate(graph, golden_bag)
    path, ports = graph.folder / "late.rrd", (free_port(), free_port())
    node = graph.start("dashboard", recording=path, web_port=ports[0], grpc_port=ports[1])
    graph.until(lambda: shows(diagnostics, expected, buffers[-1].revision), LONG, "the dashboard to show all tosses")
    address = f"http://127.0.0.1:{ports[0]}/?url=rerun%2Bhttp://127.0.0.1:{ports[1]}/proxy&hide_welcome_screen"
    (line,) = (line for line in node.log().splitlines() if "http://" in line)
    assert line.endswith(f"dashboard at {address}")
    with urlopen(f"http://127.0.0.1:{ports[0]}/", timeout=10.0) as page:
        assert b"Rerun" in page.read()
    graph.until(lambda: all(said(diagnostics, one) for one in NODES), LONG, "word of all nodes")
    time.sleep(2.5)  # the page of the nodes' health is written once a second
    assert node.stop() == 0, node.log()
    assert "Traceback" not in node.log()

    written = Recorded(path)
    assert written.rows("/scene/moving") == sum(toss.frames for toss in tosses_of(golden_bag))
    assert sorted(set(written.times("/scene/measured/trail", "toss"))) == list(range(1, expected + 1))
    assert f"{TOP} of {expected} tosses selected" in written.texts("/ranking")[-1]
    for entity in ("body/uncertainty", "body/learned/edges", "spectrum", "scene/impulses", "scene/next/velocity"):
        assert written.rows(f"/{entity}"), entity
    for curve in ("epsilon/epsilon", "known/worst", "errors/position", "losses/held_out", "gains/planned", "gains/realised"):
        assert written.scalars(f"/{curve}"), curve
    assert written.texts("/rejected")[-1].count("frames): ") == 3
    assert "planned to add 1.50 nats" in written.texts("/throws")[-1]
    for name in NODES:
        assert f"| {name} | " in written.texts("/health")[-1]
    assert "everything that was heard is shown" in written.texts("/health")[-1]


@pytest.mark.slow
def test_a_dashboard_that_starts_late_asks_again_for_what_it_had_to_drop_at_first(graph: Graph, golden_bag: Path) -> None:
    diagnostics = graph.diagnostics()
    buffers, expected = curate(graph, golden_bag)
    graph.start("dashboard", recording=graph.folder / "narrow.rrd", web_port=0, queue=1)
    graph.until(lambda: shows(diagnostics, expected, buffers[-1].revision), LONG, "what was dropped to be asked for again")
    assert int(said(diagnostics, "dashboard").get("dropped_toss", 0)) > 0


@pytest.mark.slow
def test_a_flood_is_dropped_counted_and_shown_and_the_node_goes_on(graph: Graph) -> None:
    diagnostics, path = graph.diagnostics(), graph.folder / "flood.rrd"
    node = graph.start("dashboard", recording=path, web_port=0, queue=1)
    publisher = graph.listener.node.create_publisher(TossRejected, "/toss_rejected", latched(FLOOD))
    graph.until(publisher.get_subscription_count, LONG, "the dashboard to listen")
    for number in range(FLOOD):
        publisher.publish(rejected(number))

    def dropped() -> int:
        return int(said(diagnostics, "dashboard").get("dropped_toss_rejected", 0))

    graph.until(lambda: dropped() and said(diagnostics, "dashboard")["queue"] == "0", LONG, "drops to be counted")
    time.sleep(1.5)
    lost = dropped()
    publisher.publish(rejected(FLOOD))
    time.sleep(1.5)
    assert node.stop() == 0, node.log()
    written = Recorded(path)
    pages = written.texts("/rejected")[1:]
    assert len(pages) + lost == FLOOD + 1
    assert f"{FLOOD + 1 - lost} rejected" in written.texts("/session")[-1]
    assert f"behind: {lost} of toss_rejected" in written.texts("/health")[-1]
    assert "| dashboard | **warns** |" in written.texts("/health")[-1]


@pytest.mark.slow
def test_a_page_whose_server_has_ended_is_a_warning(graph: Graph) -> None:
    diagnostics = graph.diagnostics()
    node = graph.start("dashboard", web_port=free_port(), grpc_port=free_port())
    graph.until(lambda: "dashboard at http" in node.log(), LONG, "the page")
    _, server = family(node.pid)
    os.kill(server, signal.SIGKILL)

    def warned() -> bool:
        reports = [status for array in diagnostics for status in array.status if node_of(status.name) == "/dashboard"]
        return bool(reports) and "the page's server has ended" in reports[-1].message

    graph.until(warned, LONG, "a warning")
    assert node.stop() == 0, node.log()


@pytest.mark.parametrize(
    ("parameters", "line"),
    [
        ({"web_port": 0}, "dashboard: dashboard: found neither a web_port nor a file (rrd), expected at least one of them"),
        ({"web_port": 0, "rrd": "nowhere/a.rrd"}, "dashboard: rrd: found nowhere/a.rrd, expected a path that"),
    ],
)
def test_what_cannot_be_is_one_line_and_status_1(graph: Graph, parameters: dict[str, Any], line: str) -> None:
    node = graph.start("dashboard", **parameters)
    assert node.wait(30.0) == 1
    (said,) = (one for one in node.log().splitlines() if "no body given" not in one)
    assert said.startswith(line)


@pytest.fixture
def stopped(graph: Graph) -> Iterator[NodeProcess]:
    """A dashboard that was listening and then stands still."""
    node = graph.start("dashboard", recording=graph.folder / "stopped.rrd", web_port=0)
    diagnostics = graph.diagnostics()
    graph.until(lambda: said(diagnostics, "dashboard"), LONG, "the dashboard to come up")
    yield node
    os.kill(node.pid, signal.SIGCONT)


@pytest.mark.slow
def test_a_dashboard_that_stands_still_holds_up_nobody(graph: Graph, golden_bag: Path, stopped: NodeProcess) -> None:
    buffers, expected = graph.buffers(), len(tosses_of(golden_bag))
    start_stages(graph)
    node = graph.listener.node
    graph.until(lambda: node.count_subscribers("/toss") >= 2, LONG, "the dashboard to have found the stages")
    time.sleep(1.0)
    os.kill(stopped.pid, signal.SIGSTOP)
    graph.start("player", bag=golden_bag, wait_for=10.0, stay=True, as_fast_as_possible=True)
    graph.until(lambda: buffers and buffers[-1].tosses_seen == expected, LONG, "every toss to be curated")
