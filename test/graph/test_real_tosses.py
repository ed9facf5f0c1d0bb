"""All public tosses, much faster than real time: none is lost."""

from pathlib import Path
from typing import Any

import pytest

from contact_curation.storage.datasets.tagslam_bag import import_contactnets
from test.graph.parts.graph import Graph
from test.graph.parts.offline import assert_same_buffer, curated, tosses_of


@pytest.mark.slow
@pytest.mark.parametrize(
    "pace", [{"rate": 20.0}, {"as_fast_as_possible": True}], ids=["20 times real time", "as fast as possible"]
)
def test_570_real_tosses_are_all_scored_and_ranked_as_offline(
    graph: Graph, contactnets_folder: Path, pace: dict[str, Any]
) -> None:
    bag = graph.folder / "real.mcap"
    report = import_contactnets(contactnets_folder, bag)
    assert report.tosses == 570
    expected = tosses_of(bag)
    buffers, information, rejected = graph.buffers(), graph.information(), graph.rejected()
    graph.start("pose_ingest", rules_of=bag, queue_depth=1 << 17)  # all poses, however slowly they are processed
    graph.start("fisher_scorer")
    graph.start("curator", top=32)
    graph.start("player", bag=bag, **pace, wait_for=10.0, stay=True)

    graph.until(lambda: buffers and buffers[-1].tosses_seen == len(expected), 240.0, "every toss to be curated")
    assert {one.toss_id for one in information} == {toss.toss_id for toss in expected}
    assert len(expected) + len(rejected) == 570
    assert_same_buffer(buffers[-1], curated(bag, 32))
