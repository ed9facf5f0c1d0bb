"""A tracker of the test's own: measured poses as messages of any type FIELD 1 names."""

import time
from collections.abc import Sequence
from typing import Any

from geometry_msgs.msg import Point, Pose, PoseArray, PoseStamped, Quaternion, TransformStamped
from nav_msgs.msg import Odometry
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile
from tf2_msgs.msg import TFMessage

from contact_curation.motion.pose_stream import FramePose
from contact_curation.nodes.messages.headers import Stamped, header_message
from contact_curation.nodes.ros.qos import latched
from test.graph.parts.graph import Listener, until

PERIOD = 0.001
"""[s] between messages; a tracker at 148 Hz is slower."""


def message_of(kind: type, pose: FramePose) -> Any:
    """The pose as a message of a type."""
    header = header_message(Stamped(pose.stamp_ns, pose.parent))
    x, y, z = pose.pose.position
    qw, qx, qy, qz = pose.pose.orientation_wxyz
    plain = Pose(position=Point(x=x, y=y, z=z), orientation=Quaternion(x=qx, y=qy, z=qz, w=qw))
    if kind is PoseStamped:
        return PoseStamped(header=header, pose=plain)
    if kind is PoseArray:
        return PoseArray(header=header, poses=[Pose(), plain])
    if kind is TFMessage:
        transform = TransformStamped(header=header, child_frame_id=pose.child)
        transform.transform.translation.x, transform.transform.translation.y, transform.transform.translation.z = x, y, z
        transform.transform.rotation = plain.orientation
        return TFMessage(transforms=[transform])
    message = kind(header=header)
    message.pose.pose = plain
    if isinstance(message, Odometry):
        message.child_frame_id = pose.child
    return message


class Tracker:
    """Publishes a body's poses on one topic, and the board's on /tf_static.

    Args:
        listener: whose node publishes.
        board: where the board stands.
    """

    def __init__(self, listener: Listener, board: Sequence[FramePose]) -> None:
        self._node = listener.node
        frames = self._node.create_publisher(TFMessage, "/tf_static", latched(10))
        frames.publish(TFMessage(transforms=[message_of(TFMessage, one).transforms[0] for one in board]))

    def topic(self, kind: type, name: str, qos: QoSProfile, subscribers: int = 1) -> Publisher:
        """A topic to publish on, once as many as are expected listen."""
        publisher = self._node.create_publisher(kind, name, qos)
        until(lambda: publisher.get_subscription_count() >= subscribers, 20.0, f"{subscribers} subscribers of {name}")
        return publisher


def publish(publishers: Sequence[Publisher], poses: Sequence[FramePose]) -> None:
    """The same poses on several topics."""
    for pose in poses:
        for publisher in publishers:
            publisher.publish(message_of(publisher.msg_type, pose))
        time.sleep(PERIOD)
