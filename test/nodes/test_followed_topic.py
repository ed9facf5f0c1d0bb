"""A subscription that is replaced because its topic's publishers changed loses no message and gives none twice."""

import time
from collections.abc import Callable, Iterator

import pytest
import rclpy
from geometry_msgs.msg import PoseStamped
from rclpy.executors import SingleThreadedExecutor
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile

from contact_curation.nodes.ros import qos
from contact_curation.nodes.ros.node_main import StageNode
from contact_curation.nodes.ros.pose_topics import PoseTopics, Received
from contact_curation.nodes.ros.qos import profile
from contact_curation.session.free_domain import free_domain
from contact_curation.storage.inputs.pose_source import PoseTopicConfig

LONG = 60.0
"""[s]"""

BURST = 300
LIVE, LATCHED = profile(10_000, reliable=True, latched=False), profile(10_000, reliable=True, latched=True)
BEST_EFFORT = profile(10_000, reliable=False, latched=False)
LATCHED_BEST_EFFORT = profile(10_000, reliable=False, latched=True)


class Listening:
    """A node that follows a topic, and publishers on it."""

    def __init__(self) -> None:
        self.node, self.tracker, self.heard = StageNode("follower"), rclpy.create_node("tracker"), list[int]()
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self.node)
        self.sent = 0
        self.topics = PoseTopics(self.node, "cube", PoseTopicConfig(), "", 10_000, lambda _: {}, self._arrived)

    def publisher(self, offer: QoSProfile) -> Publisher:
        before = len(self._publishers())
        publisher = self.tracker.create_publisher(PoseStamped, "pose", offer)
        self.until(lambda: len(self._publishers()) > before)
        return publisher

    def remove(self, publisher: Publisher) -> None:
        before = len(self._publishers())
        self.tracker.destroy_publisher(publisher)
        self.until(lambda: len(self._publishers()) < before)

    def publish(self, publisher: Publisher) -> None:
        """Publishes messages that nobody takes yet."""
        for _ in range(BURST):
            self.sent += 1
            message = PoseStamped()
            message.header.stamp.sec = self.sent
            publisher.publish(message)

    def take(self) -> None:
        """Takes all that was published."""
        self.until(lambda: self.heard and self.heard[-1] == self.sent, self.spin)
        self.spin()
        assert self.heard == list(range(1, self.sent + 1))

    def spin(self) -> None:
        self._executor.spin_once(0.02)

    def until(self, true: Callable[[], object], do: Callable[[], None] = lambda: time.sleep(0.01)) -> None:
        end = time.monotonic() + LONG
        while not true():
            assert time.monotonic() < end, (len(self.heard), self.sent)
            do()

    def close(self) -> None:
        self._executor.shutdown()
        self.node.destroy_node()
        self.tracker.destroy_node()

    def _arrived(self, received: Received) -> None:
        self.heard.append(received.message.header.stamp.sec)

    def _publishers(self) -> list[object]:
        return list(self.node.get_publishers_info_by_topic("/pose"))


@pytest.fixture
def listening(monkeypatch: pytest.MonkeyPatch) -> Iterator[Listening]:
    monkeypatch.setattr(qos, "BOTH", 0.3)
    with free_domain() as domain:
        rclpy.init(args=[], domain_id=domain)
        made = Listening()
        yield made
        made.close()
        rclpy.try_shutdown()


@pytest.mark.parametrize(("first", "second"), [(LIVE, BEST_EFFORT), (LATCHED, LIVE), (LATCHED, LATCHED_BEST_EFFORT)])
def test_a_publisher_that_comes_and_goes_costs_no_message_of_another(
    listening: Listening, first: QoSProfile, second: QoSProfile
) -> None:
    publisher = listening.publisher(first)
    listening.until(lambda: publisher.get_subscription_count(), listening.topics.follow)
    listening.publish(publisher)
    listening.take()
    listening.publish(publisher)
    other = listening.publisher(second)
    listening.topics.follow()
    (replaced,) = listening.topics.offers.values()
    assert (replaced.qos.reliable, replaced.qos.latched) == (second is LIVE, second is LATCHED_BEST_EFFORT)
    listening.publish(publisher)
    time.sleep(qos.BOTH)
    listening.publish(publisher)
    listening.topics.follow()
    listening.publish(publisher)
    listening.take()
    listening.publish(publisher)
    listening.remove(other)
    listening.topics.follow()
    listening.publish(publisher)
    listening.take()
    assert list(listening.topics.offers.values()) == [replaced]


def test_what_a_publisher_keeps_that_comes_in_place_of_another_is_heard(listening: Listening) -> None:
    publisher = listening.publisher(LIVE)
    listening.until(lambda: publisher.get_subscription_count(), listening.topics.follow)
    listening.publish(publisher)
    listening.take()
    listening.remove(publisher)
    publisher = listening.tracker.create_publisher(PoseStamped, "pose", LATCHED)
    listening.publish(publisher)
    listening.until(lambda: all(one.qos.latched for one in listening.topics.offers.values()), listening.topics.follow)
    listening.publish(publisher)
    listening.take()
