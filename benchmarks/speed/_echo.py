"""The least that a node does: it publishes a message of the same stamp for every pose that it receives."""

import sys
from contextlib import suppress

import rclpy
from nav_msgs.msg import Odometry
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node

from contact_curation.nodes.ros.qos import latched

DEPTH = 10000


def main() -> int:
    """Runs the node until a signal ends it."""
    rclpy.init(args=sys.argv)
    node = Node("echo")
    publisher = node.create_publisher(Odometry, "/echo", latched(DEPTH))
    node.create_subscription(
        Odometry, "/tagslam/odom/body_cube", lambda pose: publisher.publish(Odometry(header=pose.header)), latched(DEPTH)
    )
    with suppress(KeyboardInterrupt, ExternalShutdownException):
        rclpy.spin(node)
    return 0


if __name__ == "__main__":
    sys.exit(main())
