"""Pose messages become frame poses, whoever decoded them: attributes are all that is asked of a message (rclpy, rosbags, ...).

This is where xyzw becomes wxyz, and where stamps are header stamps: log times are never looked at. Leading slashes of ROS 1
frame names are dropped. What is no pose comes out as a `BadPose` with its reason.
"""

from collections.abc import Callable
from typing import Any

from contact_curation.motion.pose_stream import BadPose, FramePose, checked_pose
from contact_curation.motion.toss import NANOSECONDS

Measured = FramePose | BadPose

ODOMETRY = "nav_msgs/msg/Odometry"
POSE = "geometry_msgs/msg/PoseStamped"
POSE_WITH_COVARIANCE = "geometry_msgs/msg/PoseWithCovarianceStamped"
POSE_ARRAY = "geometry_msgs/msg/PoseArray"
TF = "tf2_msgs/msg/TFMessage"

POSE_TYPES = (ODOMETRY, POSE_WITH_COVARIANCE, POSE, POSE_ARRAY)
"""Types that carry a body's pose, those that say more of it first."""


def stamp_ns_of(header: Any) -> int:
    """A header's stamp [ns]."""
    return int(header.stamp.sec) * NANOSECONDS + int(header.stamp.nanosec)


def measured_pose(type_name: str, message: Any, child: str, index: int = 0) -> Measured:
    """The pose that a message of one of `POSE_TYPES` carries.

    Args:
        type_name: ROS 2 type name.
        message: of that type.
        child: frame the pose is of.
        index: which pose of a PoseArray.

    Raises:
        KeyError: another type.
    """
    pose = _POSE_OF[type_name](message, index)
    if pose is None:
        found = f"{len(message.poses)} poses, expected one with index {index}"
        return BadPose(stamp_ns_of(message.header), child, f"pose array: found {found}")
    return _checked(message.header, child, pose.position, pose.orientation)


def measured_transforms(message: Any, *, static: bool) -> tuple[Measured, ...]:
    """The transforms of a TFMessage: each a child frame in its parent.

    Args:
        message: of /tf or /tf_static.
        static: whether it came on /tf_static.
    """
    return tuple(
        _checked(one.header, _frame(one.child_frame_id), one.transform.translation, one.transform.rotation, static=static)
        for one in message.transforms
    )


def _checked(header: Any, child: str, place: Any, turn: Any, *, static: bool = False) -> Measured:
    position = (float(place.x), float(place.y), float(place.z))
    orientation_wxyz = (float(turn.w), float(turn.x), float(turn.y), float(turn.z))
    return checked_pose(stamp_ns_of(header), _frame(header.frame_id), child, position, orientation_wxyz, static=static)


def _frame(name: str) -> str:
    return name.lstrip("/")


def _of_array(message: Any, index: int) -> Any:
    return message.poses[index] if index < len(message.poses) else None


_POSE_OF: dict[str, Callable[[Any, int], Any]] = {
    ODOMETRY: lambda message, _: message.pose.pose,
    POSE: lambda message, _: message.pose,
    POSE_WITH_COVARIANCE: lambda message, _: message.pose.pose,
    POSE_ARRAY: _of_array,
}
