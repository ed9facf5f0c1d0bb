"""Every node, made in this process beside a tracker and with an arm's description, so that it has all that it ever makes."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from unittest import mock

import rclpy
from nav_msgs.msg import Odometry
from rclpy.node import Node
from tf2_msgs.msg import TFMessage

from contact_curation.nodes.container import node_of
from contact_curation.nodes.ros.node_main import StageNode
from contact_curation.nodes.ros.qos import latched
from contact_curation.session.free_domain import free_domain
from test.conftest import GOLDEN
from test.foreign_arm.arms import FILES
from test.graph.parts.declared_parameters import SET, in_empty_folder

POSES = "tagslam/odom/body_cube"
"""Of TagSLAM and of sim_camera."""

MADE_WITH = {
    **SET,
    "session_recorder": ["bag:=session.mcap"],
    "sim_arm": ["external_heartbeat:=true", "clock:=100.0"],
    "trajectory_thrower": [f"arm:={FILES['ur5e']}"],
    "dashboard": ["web_port:=0", "grpc_port:=0", "rrd:=session.rrd"],
    "player": [f"bag:={GOLDEN}", "clock:=100.0"],
}
CLOCKS = ("sim_arm", "player")
"""Nodes that publish the clock and follow none."""


@contextmanager
def lone_domain() -> Iterator[int]:
    """A domain that nobody else uses, and an empty current folder for the nodes' files."""
    with in_empty_folder(), free_domain() as domain, mock.patch.dict(os.environ, ROS_AUTOMATIC_DISCOVERY_RANGE="LOCALHOST"):
        yield domain


@contextmanager
def made_node(name: str, domain: int, *more: str) -> Iterator[tuple[StageNode, Node]]:
    """The node, with parameters such as top:=3 besides, and a tracker, which sees the same graph; it is taken down."""
    parameters = [*MADE_WITH.get(name, []), *([] if name in CLOCKS else ["use_sim_time:=true"]), *more]
    rclpy.init(args=["--ros-args", *(word for one in parameters for word in ("-p", one))], domain_id=domain)
    try:
        tracker = Node("tracker")
        for kind, topic in ((Odometry, POSES), (TFMessage, "tf"), (TFMessage, "tf_static")):
            tracker.create_publisher(kind, topic, latched(1))
        node = node_of(name)
        try:
            yield node, tracker
        finally:
            node.close()
            node.destroy_node()
    finally:
        rclpy.try_shutdown()
