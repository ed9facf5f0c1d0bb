"""The dashboard of a running graph, in a browser: every view shows something that is not there in an empty one."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.dashboard.live.layout import live_layout
from contact_curation.session.free_domain import free_domain
from test.browser.viewer import CHROMIUM, Page, Picture, opened, regions, settled, share_changed
from test.conftest import GOLDEN
from test.dashboard.live.test_serving import free_port
from test.dashboard.recorded import Recorded
from test.graph.parts.graph import Graph
from test.graph.parts.offline import tosses_of
from test.graph.parts.storyteller import Storyteller

pytest.importorskip("playwright", reason="pip install playwright")

LONG = 120.0
TOP, ROUNDS = 6, 4
LEAST_CHANGE = 0.01
"""Of a view's dots."""


@pytest.fixture
def graph(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Graph]:
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    with free_domain() as domain, Graph(tmp_path, domain) as made:
        yield made


def drawn(page: Page) -> bool:
    """Whether the viewer is there: it draws the board."""
    region = regions(live_layout(CONTACTNETS_CUBE))["Toss: measured black, predicted blue"]
    return len(np.unique(region.of(page.picture()).reshape(-1, 3), axis=0)) > 2


def changes(before: Picture, after: Page | Picture) -> dict[str, float]:
    """The share of each view's dots that are not as they were."""
    picture = after.picture() if isinstance(after, Page) else after
    layout = regions(live_layout(CONTACTNETS_CUBE))
    return {name: share_changed(region.of(before), region.of(picture)) for name, region in layout.items()}


@pytest.mark.slow
@pytest.mark.skipif(CHROMIUM is None, reason="no chromium: sudo apt install chromium")
def test_every_view_of_a_running_session_is_filled(graph: Graph, tmp_path: Path) -> None:
    buffers: list[Any] = graph.buffers()
    web_port, grpc_port, path = free_port(), free_port(), tmp_path / "session.rrd"
    node = graph.start("dashboard", web_port=web_port, grpc_port=grpc_port, recording=path)
    graph.until(lambda: "dashboard at http" in node.log(), LONG, "an address")
    address = node.log().split("dashboard at ")[1].split()[0]

    with opened(address) as page:
        graph.until(lambda: drawn(page), LONG, "the viewer to draw")
        empty = settled(page)

        for stage in ("pose_ingest", "fisher_scorer"):
            graph.start(stage)
        graph.start("curator", top=TOP)
        graph.start("player", bag=GOLDEN, as_fast_as_possible=True, wait_for=20.0, stay=True)
        expected = len(tosses_of(GOLDEN))
        graph.until(lambda: buffers and buffers[-1].tosses_seen == expected, LONG, "every toss to be curated")
        story = Storyteller(graph, GOLDEN)
        for number in range(1, ROUNDS + 1):
            story.tell(number)
        graph.until(lambda: min(changes(empty, page).values()) > LEAST_CHANGE, LONG, "every view to show something")
        (tmp_path / "filled.png").write_bytes(page.png())
        changed = changes(empty, settled(page, most=10))

    assert len(changed) == 11
    assert min(changed.values()) > LEAST_CHANGE, changed

    assert node.stop() == 0
    written = Recorded(path)
    for entity in (
        "scene/moving",
        "scene/next/velocity",
        "body/uncertainty",
        "ranking",
        "spectrum",
        "throws",
        "rejected",
        "health",
    ):
        assert written.rows(f"/{entity}"), entity
    for curve in ("epsilon/epsilon", "friction/high", "known/worst", "errors/position", "losses/held_out", "gains/planned"):
        assert written.scalars(f"/{curve}"), curve
