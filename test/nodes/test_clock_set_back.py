"""A clock that was set back while pose topics were left is noticed as soon as they are followed again."""

import time
from collections.abc import Callable

import rclpy
from geometry_msgs.msg import PoseStamped
from rclpy.executors import SingleThreadedExecutor

from contact_curation.nodes.ros.node_main import StageNode
from contact_curation.nodes.ros.pose_topics import PoseTopics, Received
from contact_curation.nodes.ros.qos import profile
from contact_curation.session.free_domain import free_domain
from contact_curation.storage.inputs.pose_source import PoseTopicConfig

HOUR_NS = 3_600_000_000_000
LONG = 60.0
"""[s]"""


def test_what_is_published_after_the_clock_was_set_back_is_new() -> None:
    with free_domain() as domain:
        rclpy.init(args=[], domain_id=domain)
        try:
            node, heard = StageNode("follower"), list[Received]()
            executor = SingleThreadedExecutor()
            executor.add_node(node)
            publisher = node.create_publisher(PoseStamped, "pose", profile(10, reliable=True, latched=False))
            topics = PoseTopics(node, "cube", PoseTopicConfig(), "", 10, lambda _: {}, heard.append)

            def spin_until(true: Callable[[], object]) -> None:
                end = time.monotonic() + LONG
                while not true():
                    assert time.monotonic() < end
                    topics.follow()
                    publisher.publish(PoseStamped())
                    executor.spin_once(0.05)

            spin_until(lambda: heard)
            topics.leave()
            before = len(heard)
            topics._newest = {name: published_ns + HOUR_NS for name, published_ns in topics._newest.items()}
            spin_until(lambda: len(heard) > before)
            assert topics.known == 0
            executor.shutdown()
            node.destroy_node()
        finally:
            rclpy.try_shutdown()
