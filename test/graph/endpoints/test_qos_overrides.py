"""`qos_overrides` changes what every node really offers or asks for, and a wrong value ends the node in one line."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from rclpy.qos import ReliabilityPolicy

from contact_curation.session.free_domain import free_domain
from test.graph.parts.made_node import lone_domain, made_node

pytestmark = pytest.mark.slow

RELIABLE, BEST_EFFORT = ReliabilityPolicy.RELIABLE, ReliabilityPolicy.BEST_EFFORT
TOPICS = {
    "pose_ingest": ("/toss", "publisher", BEST_EFFORT),
    "fisher_scorer": ("/toss", "subscription", BEST_EFFORT),
    "curator": ("/curated_buffer", "publisher", BEST_EFFORT),
    "trainer": ("/training_status", "publisher", BEST_EFFORT),
    "throw_designer": ("/tracked", "subscription", BEST_EFFORT),
    "sim_arm": ("/ground_truth", "publisher", BEST_EFFORT),
    "trajectory_thrower": ("/joint_states", "subscription", RELIABLE),
    "sim_camera": ("/ground_truth", "subscription", BEST_EFFORT),
    "dashboard": ("/curated_buffer", "subscription", BEST_EFFORT),
    "session_recorder": ("/diagnostics", "publisher", BEST_EFFORT),
    "player": ("/clock", "publisher", BEST_EFFORT),
}
"""A topic of each node, and a reliability that it has not by itself."""


@pytest.mark.parametrize("name", TOPICS)
def test_an_override_changes_the_quality_of_service_that_the_graph_shows(name: str) -> None:
    topic, side, wanted = TOPICS[name]
    override = f"qos_overrides.{topic}.{side}"
    given = (f"{override}.reliability:={wanted.name.lower()}", f"{override}.depth:=7")
    with lone_domain() as domain, made_node(name, domain, *given) as (node, tracker):
        infos = tracker.get_publishers_info_by_topic(topic) + tracker.get_subscriptions_info_by_topic(topic)
        kind = {"publisher": "PUBLISHER", "subscription": "SUBSCRIPTION"}[side]
        own = [one for one in infos if one.node_name == name and one.endpoint_type.name == kind]
        assert [one.qos_profile.reliability for one in own] == [wanted]
        ends = [end for end in (*node.publishers, *node.subscriptions) if end.topic_name == topic]
        assert 7 in [end.qos_profile.depth for end in ends]


@pytest.mark.parametrize(
    ("name", "wrong", "found"),
    [
        ("curator", "/curated_buffer.publisher.depth:=0", "depth 0 of publisher /curated_buffer, expected"),
        ("fisher_scorer", "/toss.subscription.reliability:=sometimes", ""),
    ],
)
def test_an_override_that_cannot_be_is_one_line_with_status_1(name: str, wrong: str, found: str, tmp_path: Path) -> None:
    with free_domain() as domain:
        done = subprocess.run(
            [sys.executable, "-m", f"contact_curation.nodes.{name}", "--ros-args", "-p", f"qos_overrides.{wrong}"],
            cwd=tmp_path, env={**os.environ, "ROS_DOMAIN_ID": str(domain)}, stderr=subprocess.PIPE, text=True, check=False,
            timeout=300.0,
        )  # fmt: skip
    lines = [line for line in done.stderr.splitlines() if "[INFO]" not in line]
    assert (done.returncode, len(lines)) == (1, 1), done.stderr
    assert lines[0].startswith(f"{name}: qos_overrides: found {found}")
