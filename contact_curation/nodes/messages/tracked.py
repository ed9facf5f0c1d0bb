"""Makes TagSLAM's messages for body and board: Odometry with a covariance and without a twist, and a static transform."""

from typing import Any

import numpy as np
from geometry_msgs.msg import Point, PoseWithCovariance, Quaternion, TransformStamped, Vector3
from geometry_msgs.msg import Pose as PoseMessage
from nav_msgs.msg import Odometry
from tf2_msgs.msg import TFMessage

from contact_curation.geometry.poses import Pose
from contact_curation.nodes.messages.headers import Stamped, header_message


def odometry_message(stamped: Stamped, child: str, pose: Pose, deviations: tuple[float, float]) -> Odometry:
    """Makes the Odometry message of a body's pose.

    Args:
        stamped: stamp, and frame in which the pose is given.
        child: frame of the body.
        pose: pose of the body.
        deviations: standard deviations of position [m] and orientation [rad], per axis.
    """
    x, y, z = pose.position.tolist()
    covariance = np.diag(np.repeat(deviations, 3) ** 2).ravel()
    placed = PoseMessage(position=Point(x=x, y=y, z=z), orientation=_quaternion(pose))
    message = Odometry(header=header_message(stamped), child_frame_id=child)
    message.pose = PoseWithCovariance(pose=placed, covariance=covariance)
    return message


def static_transform_message(stamped: Stamped, child: str, pose: Pose) -> TFMessage:
    """Makes the static transform of a frame."""
    x, y, z = pose.position.tolist()
    transform = TransformStamped(header=header_message(stamped), child_frame_id=child)
    transform.transform.translation = Vector3(x=x, y=y, z=z)
    transform.transform.rotation = _quaternion(pose)
    return TFMessage(transforms=[transform])


def _quaternion(pose: Pose) -> Any:
    w, x, y, z = pose.orientation_wxyz.tolist()
    return Quaternion(x=x, y=y, z=z, w=w)
