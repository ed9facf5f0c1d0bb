"""A recorded session of an arm of one's own ranks offline as the nodes ranked it while the arm threw."""

from pathlib import Path

import pytest

from contact_curation.nodes.messages.toss import toss_of
from contact_curation.pipeline.api import rank
from contact_curation.storage.bags.reader import BagReader
from test.foreign_arm.arms import throw
from test.graph.parts.described_arm import ready, started
from test.graph.parts.graph import Graph
from test.graph.parts.offline import assert_same_buffer, curated, tosses_of

pytestmark = [pytest.mark.slow, pytest.mark.live]

THROWS, TOP = 3, 2
LONG = 90.0


def recorded_tosses(bag: Path) -> set[str]:
    """Ids of the tosses that the recording tells of."""
    with BagReader(bag) as reader:
        return {one.message.toss_id for one in reader.messages(["/toss"])}


def test_a_recorded_session_of_a_foreign_arm_gives_the_same_tosses_scores_and_order_offline(graph: Graph) -> None:
    bag = graph.folder / "session.mcap"
    tosses, buffers = graph.tosses(), graph.buffers()
    recorder = graph.start("session_recorder", bag=bag)
    for stage in ("pose_ingest", "fisher_scorer"):
        graph.start(stage)
    graph.start("curator", top=TOP)
    node = started(graph)
    thrower = ready(graph)
    thrower.trigger("arm")
    for number in range(THROWS):
        seen = len(tosses)
        result = thrower.ended(thrower.send(throw(number))).result
        assert result.success, f"{result.message}\n{graph.logs()}"
        graph.until(lambda seen=seen: len(tosses) > seen, LONG, "the toss of a throw")  # type: ignore[misc]
    graph.until(lambda: buffers and buffers[-1].tosses_seen == len(tosses), LONG, "every toss to be curated")
    thrower.close()
    assert node.stop() == 0
    assert recorder.stop() == 0
    assert len(tosses) == THROWS

    offline = tosses_of(bag)
    assert [toss.toss_id for toss in offline] == [one.toss_id for one in tosses]
    assert [toss.digest() for toss in offline] == [toss_of(one).digest() for one in tosses]
    assert recorded_tosses(bag) == {toss.toss_id for toss in offline}
    assert_same_buffer(buffers[-1], curated(bag, TOP))
    assert list(rank(bag, TOP).selected_ids) == list(buffers[-1].toss_ids)
    assert len(buffers[-1].toss_ids) == TOP
