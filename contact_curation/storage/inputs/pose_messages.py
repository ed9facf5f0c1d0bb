"""Translation of pose messages to frame poses. Messages of rclpy, rosbags and others work: only attributes are read.

This is where xyzw becomes wxyz, and where stamps are header stamps: log times are never looked at. Leading slashes of ROS 1
frame names are dropped. What is no pose comes out as a `BadPose` with its reason.
"""

import re
from collections import Counter
from collections.abc import Callable, Iterable
from typing import Any

from contact_curation.motion.pose_stream import BadPose, FramePose, checked_pose
from contact_curation.motion.toss import NANOSECONDS

Measured = FramePose | BadPose

ODOMETRY = "nav_msgs/msg/Odometry"
POSE = "geometry_msgs/msg/PoseStamped"
POSE_WITH_COVARIANCE = "geometry_msgs/msg/PoseWithCovarianceStamped"
POSE_ARRAY = "geometry_msgs/msg/PoseArray"
ONLY = -1
"""Index of the pose in a PoseArray that holds no other."""
RIGID_BODIES = "mocap4r2_msgs/msg/RigidBodies"
NAMED_POSES = "motion_capture_tracking_interfaces/msg/NamedPoseArray"
TRANSFORM = "geometry_msgs/msg/TransformStamped"
TF = "tf2_msgs/msg/TFMessage"
ISAAC_TAGS = "isaac_ros_apriltag_interfaces/msg/AprilTagDetectionArray"
APRILTAG_ROS, APRILTAGS2_ROS = (f"{name}/msg/AprilTagDetectionArray" for name in ("apriltag_ros", "apriltags2_ros"))

BODY_PREFIX, MOST_NAMES = "body_", 8
"""Prefix of TagSLAM's topic names for bodies, whose frames have the body's name alone; and names in a message."""


def stamp_ns_of(header: Any) -> int:
    """The stamp of a header [ns]."""
    return int(header.stamp.sec) * NANOSECONDS + int(header.stamp.nanosec)


type Translator = Callable[[Any, str, int], Measured]
"""Gives the pose that a message carries: of the frame named, and of several poses the one with this index."""


def with_covariance(message: Any, child: str, index: int) -> Measured:
    """Pose of an Odometry or a PoseWithCovarianceStamped."""
    pose = message.pose.pose
    return on_header(message.header, child, pose.position, pose.orientation)


def stamped(message: Any, child: str, index: int) -> Measured:
    """Pose of a PoseStamped."""
    return on_header(message.header, child, message.pose.position, message.pose.orientation)


def transformed(message: Any, child: str, index: int) -> Measured:
    """Pose of a TransformStamped, which motion capture publishes on a topic of the body's own."""
    return on_header(message.header, child, message.transform.translation, message.transform.rotation)


def of_array(message: Any, child: str, index: int) -> Measured:
    """Pose of a PoseArray."""
    if index == ONLY and len(message.poses) != 1:
        found = f"{len(message.poses)} poses, expected one, or `array_index`, which of them is the body"
        return BadPose(stamp_ns_of(message.header), child, f"pose array: found {found}", "array")
    if index >= len(message.poses):
        found = f"{len(message.poses)} poses, expected one with index {index}"
        return BadPose(stamp_ns_of(message.header), child, f"pose array: found {found}", "array")
    return on_header(message.header, child, message.poses[index].position, message.poses[index].orientation)


def of_rigid_bodies(message: Any, child: str, index: int) -> Measured:
    """Pose of the body of that name in a RigidBodies of mocap4r2 (OptiTrack, Vicon, Qualisys)."""
    return _of_names(message.header, child, ((one.rigid_body_name, one.pose) for one in message.rigidbodies))


def of_named_poses(message: Any, child: str, index: int) -> Measured:
    """Pose of that name in a NamedPoseArray of motion_capture_tracking."""
    return _of_names(message.header, child, ((one.name, one.pose) for one in message.poses))


def _of_names(header: Any, child: str, poses: Iterable[tuple[str, Any]]) -> Measured:
    """The pose of a name; where a body is lost, the only pose may be that of another one."""
    named: dict[str, list[Any]] = {}
    for name, pose in poses:
        named.setdefault(frame_name(str(name)), []).append(pose)
    own = named.get(child, named.get(child.removeprefix(BODY_PREFIX), []))
    if not own:
        found = ", ".join(sorted(named)[:MOST_NAMES]) or "no name"
        return BadPose(stamp_ns_of(header), child, f"poses of bodies: found {found}, expected {child}", "name")
    if len(own) > 1:
        return BadPose(stamp_ns_of(header), child, f"poses of bodies: found {len(own)} called {child}, expected one", "twice")
    return on_header(header, child, own[0].position, own[0].orientation)


POSE_MESSAGES: dict[str, Translator] = {
    ODOMETRY: with_covariance,
    POSE_WITH_COVARIANCE: with_covariance,
    POSE: stamped,
    TRANSFORM: transformed,
    RIGID_BODIES: of_rigid_bodies,
    NAMED_POSES: of_named_poses,
    POSE_ARRAY: of_array,
}
"""The message types that carry a body's pose, by their ROS 2 names, the most detailed first.

Reading bags and following live topics both go by this table: another type takes a function and a line here.
"""


def measured_pose(type_name: str, message: Any, child: str, index: int = ONLY) -> Measured:
    """Reads the pose in a message of one of `POSE_MESSAGES`.

    Args:
        type_name: ROS 2 type name.
        message: message of that type.
        child: frame whose pose it is.
        index: index of the pose in a PoseArray; ONLY for one that holds no other.

    Raises:
        KeyError: the type is not in `POSE_MESSAGES`.
    """
    return POSE_MESSAGES[type_name](message, child, index)


def measured_transforms(message: Any, *, static: bool) -> tuple[Measured, ...]:
    """Reads the transforms of a TFMessage; each is the pose of a child frame in its parent frame.

    Args:
        message: message of /tf or /tf_static.
        static: whether it came on /tf_static.
    """
    return tuple(
        on_header(one.header, frame_name(one.child_frame_id), one.transform.translation, one.transform.rotation, static=static)
        for one in message.transforms
    )


def _named_by_ids(detection: Any) -> str:
    return "_".join(("tag", *map(str, detection.id)))


TAG_FRAMES: dict[str, Callable[[Any], str]] = {
    ISAAC_TAGS: lambda detection: f"{detection.family}:{detection.id}",
    **dict.fromkeys((APRILTAG_ROS, APRILTAGS2_ROS), _named_by_ids),
}
"""The message types with poses of tags in a camera, and what a tag's frame is called there.

isaac_ros_apriltag calls it so on TF, `tag36h11:3`. apriltag_ros of ROS 1 and what was ported from it have neither families nor
names: `tag_3`, as on TF by default, and `tag_3_4_5` for a bundle of tags with these ids.
"""
TAG_FRAME = re.compile(r"\w*\d:\d+|tag(_\d+)+")
"""What these frames are called."""


def measured_tags(type_name: str, message: Any) -> tuple[Measured, ...]:
    """Reads the poses of tags in a message of one of `TAG_FRAMES`, each the pose of the tag's frame in the camera's.

    The array's header counts: isaac_ros_apriltag leaves those of the poses empty.
    """
    named = [(TAG_FRAMES[type_name](one), one.pose.pose.pose) for one in message.detections]
    times = Counter(child for child, _ in named)
    return tuple(
        on_header(message.header, child, pose.position, pose.orientation)
        if times[child] == 1
        else BadPose(stamp_ns_of(message.header), child, f"tags: found {times[child]} called {child}, expected one", "twice")
        for child, pose in named
    )


def on_header(header: Any, child: str, place: Any, turn: Any, *, static: bool = False) -> Measured:
    """The pose of a frame in the header's frame, at the header's stamp, from messages with x, y, z and x, y, z, w."""
    position = (float(place.x), float(place.y), float(place.z))
    orientation_wxyz = (float(turn.w), float(turn.x), float(turn.y), float(turn.z))
    return checked_pose(stamp_ns_of(header), frame_name(header.frame_id), child, position, orientation_wxyz, static=static)


def frame_name(name: str) -> str:
    """A frame's name without the leading slash of ROS 1."""
    return name.lstrip("/")
