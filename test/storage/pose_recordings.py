"""Recordings of made-up streams in every pose message there is, for ROS 2 (rosbags) and ROS 1."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from rosbags.typesys import get_types_from_msg

from contact_curation.geometry.scalars import Quaternion, ScalarPose, Vector
from contact_curation.motion.pose_stream import FramePose
from contact_curation.storage.inputs.pose_messages import (
    NAMED_POSES,
    ODOMETRY,
    POSE,
    POSE_ARRAY,
    POSE_WITH_COVARIANCE,
    RIGID_BODIES,
    TF,
    TRANSFORM,
)
from test.storage.written_bags import JAZZY, NOETIC, Sent

NOETIC.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", TF))  # rosbags' set for ROS 1 lacks it

MARKER, RIGID_BODY = "mocap4r2_msgs/msg/Marker", "mocap4r2_msgs/msg/RigidBody"
NAMED_POSE = "motion_capture_tracking_interfaces/msg/NamedPose"
MOCAP = {
    MARKER: "int8 id_type\nint32 marker_index\nstring marker_name\ngeometry_msgs/Point translation",
    RIGID_BODY: "string rigid_body_name\nmocap4r2_msgs/Marker[] markers\ngeometry_msgs/Pose pose",
    RIGID_BODIES: "std_msgs/Header header\nuint32 frame_number\nmocap4r2_msgs/RigidBody[] rigidbodies",
    NAMED_POSE: "string name\ngeometry_msgs/Pose pose",
    NAMED_POSES: "std_msgs/Header header\nmotion_capture_tracking_interfaces/NamedPose[] poses",
}
for name, definition in MOCAP.items():
    JAZZY.register(get_types_from_msg(definition, name))

LOG_OFFSET_NS = 86_400_000_000_000
"""Log times are a day after header stamps: nobody may look at them."""


def recorded(topic: str, type_name: str, poses: Sequence[FramePose], store: Any = JAZZY) -> list[Sent]:
    """Each pose as a message of its own on `topic`, late in the log by a day."""
    return [Sent(topic, LOG_OFFSET_NS + one.stamp_ns, message(type_name, one, store)) for one in poses]


def message(type_name: str, one: FramePose, store: Any = JAZZY) -> Any:
    types, pose = store.types, _pose(one.pose, store)
    head = _header(one.stamp_ns, one.parent, store)
    if type_name == POSE:
        return types[POSE](head, pose)
    other = _pose(ScalarPose((9.0, 9.0, 9.0), (1.0, 0.0, 0.0, 0.0)), store)
    if type_name == RIGID_BODIES:
        return types[RIGID_BODIES](head, 7, [types[RIGID_BODY]("wand", [], other), types[RIGID_BODY](one.child, [], pose)])
    if type_name == NAMED_POSES:
        return types[NAMED_POSES](head, [types[NAMED_POSE]("wand", other), types[NAMED_POSE](one.child, pose)])
    if type_name == POSE_ARRAY:
        return types[POSE_ARRAY](head, [other, pose])
    if type_name == TF:
        return transforms([one], store)
    if type_name == TRANSFORM:
        return transforms([one], store).transforms[0]
    with_covariance = types["geometry_msgs/msg/PoseWithCovariance"](pose, np.zeros(36))
    if type_name == POSE_WITH_COVARIANCE:
        return types[POSE_WITH_COVARIANCE](head, with_covariance)
    assert type_name == ODOMETRY
    zero = types["geometry_msgs/msg/Vector3"](0.0, 0.0, 0.0)
    twist = types["geometry_msgs/msg/TwistWithCovariance"](types["geometry_msgs/msg/Twist"](zero, zero), np.zeros(36))
    return types[ODOMETRY](head, one.child, with_covariance, twist)


def transforms(poses: Sequence[FramePose], store: Any = JAZZY) -> Any:
    types = store.types
    stamped = []
    for one in poses:
        turn = _quaternion(one.pose.orientation_wxyz, store)
        transform = types["geometry_msgs/msg/Transform"](types["geometry_msgs/msg/Vector3"](*one.pose.position), turn)
        head = _header(one.stamp_ns, one.parent, store)
        stamped.append(types["geometry_msgs/msg/TransformStamped"](head, one.child, transform))
    return types[TF](stamped)


def _header(stamp_ns: int, frame: str, store: Any) -> Any:
    stamp = store.types["builtin_interfaces/msg/Time"](*divmod(stamp_ns, 10**9))
    return store.types["std_msgs/msg/Header"](*((0,) if store is NOETIC else ()), stamp, frame)


def _pose(pose: ScalarPose, store: Any) -> Any:
    place: Vector = pose.position
    return store.types["geometry_msgs/msg/Pose"](
        store.types["geometry_msgs/msg/Point"](*place), _quaternion(pose.orientation_wxyz, store)
    )


def _quaternion(wxyz: Quaternion, store: Any) -> Any:
    w, x, y, z = wxyz
    return store.types["geometry_msgs/msg/Quaternion"](x, y, z, w)
