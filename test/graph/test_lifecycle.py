"""Nodes that are deactivated in the middle of their work and activated again: no toss is lost or doubled, and no arm moves."""

from typing import Any

import numpy as np
import pytest
from action_msgs.msg import GoalStatus
from contact_curation_msgs.srv import GetTosses
from nav_msgs.msg import Odometry
from rclpy.publisher import Publisher
from std_msgs.msg import Bool

from contact_curation.motion.pose_stream import FramePose
from contact_curation.nodes.ros.qos import profile
from contact_curation.storage.stores.tosses import TossStore
from test.conftest import GOLDEN
from test.graph.parts.graph import Graph
from test.graph.parts.lifecycle import changed, state_of
from test.graph.parts.measured import measured_of, tosses_in
from test.graph.parts.thrower import Thrower
from test.graph.parts.tracker import Tracker, publish
from test.simulation.throws import PLAIN

pytestmark = [pytest.mark.slow, pytest.mark.live]

LONG = 90.0
MIDDLE, BEFORE_THIRD, BETWEEN, AFTER_FOURTH = 700, 1000, 1250, 1600
"""Poses of the golden recording: in the second toss, before the third, between it and the fourth, after that."""

SLOWED = 0.2
"""Rate at which there is time to deactivate an arm before its throw is over."""

STANDS = 60
"""Frames in which an arm that stands still is seen."""


def told(publisher: Publisher, poses: tuple[FramePose, ...]) -> None:
    """Publishes poses, and waits until every subscriber has them in its queue."""
    publish([publisher], poses)
    assert publisher.wait_for_all_acked()


def test_tosses_before_and_after_an_inactive_time_are_stored_once_and_numbered_on(graph: Graph) -> None:
    rig, *poses = measured_of(GOLDEN)[: AFTER_FOURTH + 1]
    tosses, tracked = graph.tosses(), graph.listener.listen(Bool, "/tracked", 1)
    node = graph.start("pose_ingest", topic="/odometry")
    tracker = Tracker(graph.listener, [rig])
    publisher = tracker.topic(Odometry, "/odometry", profile(1000, reliable=True, latched=False), 0)
    graph.until(publisher.get_subscription_count, LONG, "a subscriber of the poses")

    def turned(label: str, subscribers: int) -> None:
        assert changed(graph.listener, "/pose_ingest", label), graph.logs()
        graph.until(lambda: publisher.get_subscription_count() == subscribers, LONG, f"{subscribers} subscribers")
        graph.until(lambda: tracked and tracked[-1].data is bool(subscribers), LONG, f"tracked after {label}")

    before, after = tuple(poses[:MIDDLE]), tuple(poses[BEFORE_THIRD:])
    told(publisher, before)
    turned("deactivate", 0)
    told(publisher, tuple(poses[MIDDLE:BEFORE_THIRD]))
    assert not changed(graph.listener, "/pose_ingest", "deactivate")  # refused, and the node goes on
    answer: Any = graph.listener.call(GetTosses, "/get_tosses", GetTosses.Request())
    assert answer.last_sequence == 1
    turned("activate", 1)
    told(publisher, after[: BETWEEN - BEFORE_THIRD])
    turned("deactivate", 0)
    turned("activate", 1)
    told(publisher, after[BETWEEN - BEFORE_THIRD :])
    expected = tosses_in((rig, *before, *after), "/odometry")
    assert len(expected) == 3
    graph.until(lambda: len(tosses) >= len(expected), LONG, "the tosses")
    assert [toss.toss_id for toss in tosses] == [toss.toss_id for toss in expected]
    assert [toss.sequence for toss in tosses] == [1, 2, 3]
    assert changed(graph.listener, "/pose_ingest", "shutdown")
    assert node.wait(LONG) == 0
    with TossStore(graph.folder / "tosses.sqlite") as store:
        assert [one.toss.digest() for one in store.after(0, 10)] == [toss.digest() for toss in expected]


def test_a_node_that_does_not_start_itself_takes_its_first_pose_when_it_is_activated(graph: Graph) -> None:
    tracked = graph.listener.listen(Bool, "/tracked", 1)
    graph.start("pose_ingest", topic="/odometry", autostart=False)
    publisher = graph.listener.node.create_publisher(Odometry, "/odometry", 10)
    graph.until(lambda: tracked and not tracked[-1].data, LONG, "a node without a tracker")
    assert state_of(graph.listener, "/pose_ingest") == "unconfigured"
    assert changed(graph.listener, "/pose_ingest", "configure")
    assert publisher.get_subscription_count() == 0
    assert changed(graph.listener, "/pose_ingest", "activate")
    graph.until(publisher.get_subscription_count, LONG, "a subscriber of the poses")


def test_an_arm_that_is_deactivated_in_mid_goal_stops_and_moves_again_only_when_it_is_active_and_armed(graph: Graph) -> None:
    graph.start("sim_arm", rate=SLOWED)
    thrower = Thrower(graph)
    thrower.trigger("arm")
    goal = thrower.send(PLAIN)
    thrower.until_phase(goal, "moving")
    assert changed(graph.listener, "/sim_arm", "deactivate")
    answer = thrower.ended(goal)
    assert answer.status == GoalStatus.STATUS_ABORTED
    assert "stopped before the release: the node was deactivated" in answer.result.message
    thrower.set_rate(1.0)  # time and joint states go on, the arm does not
    thrower.until_still(STANDS)
    stands = np.array(thrower.joints[-1].position)
    line = "found it inactive, expected it active"
    assert line in thrower.ended(thrower.send(PLAIN)).result.message
    assert line in thrower.trigger("arm")
    assert changed(graph.listener, "/sim_arm", "activate")
    assert "disarmed (the node was deactivated)" in thrower.ended(thrower.send(PLAIN)).result.message
    thrower.until_still(STANDS)
    np.testing.assert_allclose(thrower.joints[-1].position, stands, atol=0.02)
    thrower.trigger("arm")
    thrower.set_rate(0.0)
    thrower.until_healthy("resting")
    thrower.throws(PLAIN)
    thrower.close()
