"""Nodes end on one signal and on several, at once and in order: no traceback, status 0, nothing left behind."""

import os
import signal
import time
from pathlib import Path
from typing import Any

import pytest

from contact_curation.nodes.ros.health import node_of
from test.graph.parts.graph import Graph, until

LONGEST = 30.0
"""[s] a node may take to end here; it gives up what it is doing after 4.5 s, and a busy machine adds to that."""
RECORDING: dict[str, dict[str, Any]] = {
    "pose_ingest": {},
    "fisher_scorer": {},
    "curator": {"top": 6},
    "trainer": {"protocol": "budgeted", "steps": 100_000},
}


def ended(pid: int, how: tuple[signal.Signals, ...], pause: float) -> None:
    for one in how:
        try:
            os.kill(pid, one)
        except ProcessLookupError:
            return
        time.sleep(pause)


@pytest.mark.slow
@pytest.mark.parametrize(
    "how",
    [
        (signal.SIGINT,),
        (signal.SIGTERM,),
        (signal.SIGINT, signal.SIGINT, signal.SIGTERM),
    ],
    ids=lambda how: "-".join(one.name for one in how),
)
@pytest.mark.parametrize("pause", [0.0, 0.3])
def test_working_nodes_end_in_order_on_one_signal_and_on_several(
    graph: Graph, golden_bag: Path, how: tuple[signal.Signals, ...], pause: float
) -> None:
    information, diagnostics = graph.information(), graph.diagnostics()
    nodes = [graph.start(name, **chosen) for name, chosen in RECORDING.items()]
    nodes.append(graph.start("session_recorder", bag=graph.folder / "session.mcap"))
    nodes.append(graph.start("player", bag=golden_bag, rate=20.0, wait_for=10.0, loop=True))
    named = {f"/{name}" for name in (*RECORDING, "session_recorder")}
    graph.until(lambda: named <= {node_of(one.status[0].name) for one in diagnostics}, 90.0, "all nodes")
    graph.until(lambda: len(information) >= 2, 90.0, "scored tosses")
    for node in nodes:
        ended(node.pid, how, pause)
    until(
        lambda: all(node.status is not None for node in nodes),
        LONGEST,
        f"the end of {[n.name for n in nodes if n.status is None]}",
    )
    assert {node.name: node.status for node in nodes} == dict.fromkeys((node.name for node in nodes), 0), graph.logs()
    assert "Traceback" not in graph.logs()
