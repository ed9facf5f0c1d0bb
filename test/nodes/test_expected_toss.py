"""A toss is published before it is announced, and scored then; what cannot be read does no harm."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pytest
import rclpy

from contact_curation.nodes.fisher_scorer import FisherScorer
from contact_curation.nodes.messages.toss_bytes import EXPECTED_TOSS, toss_bytes
from contact_curation.nodes.pose_ingest import PoseIngest
from contact_curation.session.free_domain import free_domain
from test.simulated import simulated_tosses

(TOSS,) = simulated_tosses(1, seed=3)


@pytest.fixture(autouse=True)
def this_machine(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")


@contextmanager
def scorer(folder: Path) -> Iterator[FisherScorer]:
    """A scorer that is not spun."""
    with free_domain() as domain:
        rclpy.init(args=["--ros-args", "-p", f"store:={folder}/information.sqlite"], domain_id=domain)
        try:
            node = FisherScorer()
            yield node
            node.destroy_node()
        finally:
            rclpy.try_shutdown()


@pytest.mark.parametrize("shared", [False, True])
def test_a_complete_toss_is_published_ahead_but_in_a_container(
    tmp_path: Path, shared: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    heard = list[bytes]()
    with free_domain() as domain:
        rclpy.init(args=["--ros-args", "-p", f"store:={tmp_path}/tosses.sqlite"], domain_id=domain)
        try:
            node = PoseIngest()
            node.shares_process = shared
            monkeypatch.setattr(node._expected, "publish", heard.append)
            node._complete(TOSS)  # while the journal is read again
            assert not heard
            node._found("/poses")
            node._complete(TOSS)
            node.close()
            node.destroy_node()
        finally:
            rclpy.try_shutdown()
    assert heard == [toss_bytes(TOSS, 0, "body_surface")] * (not shared)


@pytest.mark.parametrize("data", [b"", b"\x00\x01\x00\x00", toss_bytes(replace(TOSS, body="bottle"), 0, "board")])
def test_what_is_no_expected_toss_of_the_body_is_ignored(tmp_path: Path, data: bytes) -> None:
    with scorer(tmp_path) as node:
        node._expected_came(data)
        node.close()  # after all jobs
        assert node._stage._begun is None
        assert node.failure is None


def test_an_expected_toss_is_begun_and_not_stored(tmp_path: Path) -> None:
    with scorer(tmp_path) as node:
        (heard,) = [one for one in node.subscriptions if one.topic_name == f"/{EXPECTED_TOSS}"]
        heard.callback(toss_bytes(TOSS, 0, "board"))
        node._worker.stop()
        assert node._stage._begun is not None
        assert node._stage.last_sequence == 0
        node._informations.close()
