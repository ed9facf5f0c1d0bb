"""A namespace holds a whole graph: two of them on one domain give what each gives alone."""

from collections.abc import Iterable
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from contact_curation_msgs.msg import CuratedBuffer
from diagnostic_msgs.msg import DiagnosticArray

from contact_curation.motion.toss import first_stamp_in
from contact_curation.nodes.ros.health import node_of
from contact_curation.pipeline.api import rank
from contact_curation.storage.bags.reader import BagReader
from test.graph.parts.cell import THROWS, TOP, Cell, CellResult
from test.graph.parts.graph import Graph
from test.graph.parts.offline import tosses_of

LONG = 90.0
STAGES = ("pose_ingest", "fisher_scorer", "curator", "session_recorder")
SEEDS = {"/cell_1": 1, "/cell_2": 2}
"""Of the cells with an arm, by namespace."""

LONGEST_RUN = 1500.0
"""[s] for all throws of two cells on a busy machine."""

OFFSET = 20.0
"""[s] of the recording that the second cell leaves out."""


@pytest.mark.slow
def test_two_cells_on_one_domain_do_not_hear_each_other(graph: Graph, golden_bag: Path) -> None:
    begins = [int(toss.stamps_ns[0]) for toss in tosses_of(golden_bag)]
    starts = {"/cell_1": 0.0, "/cell_2": OFFSET}
    tosses = {cell: graph.tosses(f"{cell}/toss") for cell in starts}
    buffers = {cell: graph.listener.listen(CuratedBuffer, f"{cell}/curated_buffer") for cell in starts}
    diagnostics = graph.diagnostics()
    for cell, offset in starts.items():
        label = cell.strip("/")
        for name in STAGES:
            more = {"bag": graph.folder / f"{label}.mcap"} if name == "session_recorder" else {}
            graph.start(name, {"__ns": cell}, f"{label}_{name}_", **more)
        graph.start(
            "player",
            {"__ns": cell},
            f"{label}_player",
            bag=golden_bag,
            rate=20.0,
            wait_for=10.0,
            stay=True,
            start_offset=offset,
        )
    last = buffers["/cell_1"]
    graph.until(lambda: last and last[-1].tosses_seen == len(begins), LONG, "the first cell's tosses")
    graph.until(lambda: tosses["/cell_2"] and first(tosses["/cell_2"][-1]) == begins[-1], LONG, "the second cell's last toss")
    heard = {cell: [first(one) for one in messages] for cell, messages in tosses.items()}
    assert heard["/cell_1"] == begins
    assert 0 < len(heard["/cell_2"]) < len(begins)
    assert heard["/cell_2"] == begins[-len(heard["/cell_2"]) :]
    assert {one.source for one in tosses["/cell_2"]} == {"/cell_2/tagslam/odom/body_cube"}
    for cell in starts:  # the recorder hears late what was published before it came
        graph.until(partial(at_rest, diagnostics, f"{cell}/session_recorder"), LONG, f"the recording of {cell}")
    for process in graph.processes:
        process.stop()
    for cell in starts:
        recorded = tosses_of(graph.folder / f"{cell.strip('/')}.mcap")
        np.testing.assert_array_equal([int(toss.stamps_ns[0]) for toss in recorded], heard[cell])


@pytest.mark.slow
@pytest.mark.live
def test_two_whole_graphs_on_one_domain_give_what_each_gives_alone(graph: Graph) -> None:
    alone = {cell: run_of(graph, [cell], "alone")[cell] for cell in SEEDS}
    together = run_of(graph, list(SEEDS), "together")
    assert together == alone
    for result in together.values():
        assert len(result.tosses) + len(result.rejected) == THROWS
        assert len(result.selected) == TOP
    first, second = together.values()
    assert first.tosses.keys().isdisjoint(second.tosses)
    assert first.throws != second.throws
    assert first.version != second.version


def run_of(graph: Graph, namespaces: list[str], run: str) -> dict[str, CellResult]:
    """Results of cells that run at the same time, each with nothing of another's in what it keeps."""
    diagnostics = graph.diagnostics()
    cells = {namespace: Cell(graph, namespace, SEEDS[namespace], run) for namespace in namespaces}
    graph.until(lambda: all(cell.is_over() for cell in cells.values()), LONGEST_RUN, "all throws of all cells")
    for namespace, cell in cells.items():
        shown = str(len(cell.ids_in("pose_ingest")))
        graph.until(partial(shows, diagnostics, f"{namespace}/dashboard", shown), LONG, f"a dashboard with {shown} tosses")
    for cell in cells.values():
        cell.end()
    results = {namespace: cell.result() for namespace, cell in cells.items()}
    for namespace, cell in cells.items():
        own = results[namespace].tosses.keys()
        for node in ("fisher_scorer", "curator"):
            assert cell.ids_in(node) == own
        assert cell.ids_in("trainer") <= own
        with BagReader(cell.folder.bag) as bag:
            assert {info.name for info in bag.topics if not info.name.startswith(f"{namespace}/")} == set()
            assert {one.message.toss_id for one in bag.messages([f"{namespace}/toss"])} == own
        ranked = rank(cell.folder.bag, TOP, model=cell.folder.checkpoint)
        assert stamps_of(ranked.selected_ids) == stamps_of(results[namespace].selected)
    return results


def shows(diagnostics: list[DiagnosticArray], dashboard: str, tosses: str) -> bool:
    """Whether a dashboard has last reported so many tosses."""
    reports = [status for array in diagnostics for status in array.status if node_of(status.name) == dashboard]
    return bool(reports) and {"tosses": tosses}.items() <= {value.key: value.value for value in reports[-1].values}.items()


def stamps_of(ids: Iterable[str]) -> list[int | None]:
    """First stamps of tosses, whose ids also depend on what a recording's topic is called."""
    return [first_stamp_in(one) for one in ids]


def at_rest(diagnostics: list[DiagnosticArray], node: str) -> bool:
    """Whether a recorder has written the poses, and nothing more in its last three reports."""
    reports = [status for array in diagnostics for status in array.status if node_of(status.name) == node]
    written = [next(value.value for value in report.values if value.key == "written") for report in reports[-3:]]
    return len(written) == 3 and len(set(written)) == 1 and int(written[0]) > 1000


def first(message: object) -> int:
    stamp = message.stamps[0]  # type: ignore[attr-defined]
    return int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)
