"""Throw, record and message."""

from typing import Any

import numpy as np
from contact_curation_msgs.msg import Throw as ThrowMessage
from geometry_msgs.msg import Point, Pose, Quaternion, Vector3

from contact_curation.design.throw import Throw
from contact_curation.nodes.messages.headers import Stamped, check_format, header_message


def throw_message(throw: Throw, stamped: Stamped) -> ThrowMessage:
    """A throw as it is commanded, or as it was executed.

    Args:
        throw: the record.
        stamped: time of the release, 0 while nobody knows it; frame of the board.
    """
    w, qx, qy, qz = throw.orientation_wxyz.tolist()
    x, y, z = throw.position.tolist()
    linear, angular = (
        Vector3(x=vx, y=vy, z=vz) for vx, vy, vz in (throw.linear_velocity.tolist(), throw.angular_velocity.tolist())
    )
    return ThrowMessage(
        format_version=ThrowMessage.FORMAT_VERSION,
        header=header_message(stamped),
        throw_id=throw.throw_id,
        body=throw.body,
        release_pose=Pose(position=Point(x=x, y=y, z=z), orientation=Quaternion(w=w, x=qx, y=qy, z=qz)),
        release_linear_velocity=linear,
        release_body_angular_velocity=angular,
        expected_information=throw.expected_information,
        parameters_version=throw.parameters_version,
    )


def throw_of(message: Any) -> Throw:
    """The record that a message carries, bit for bit.

    Raises:
        InvalidValueError: a newer format, or it is no throw.
    """
    check_format(message)
    place, turn = message.release_pose.position, message.release_pose.orientation
    linear, angular = message.release_linear_velocity, message.release_body_angular_velocity
    return Throw(
        throw_id=message.throw_id,
        body=message.body,
        position=np.array([place.x, place.y, place.z]),
        orientation_wxyz=np.array([turn.w, turn.x, turn.y, turn.z]),
        linear_velocity=np.array([linear.x, linear.y, linear.z]),
        angular_velocity=np.array([angular.x, angular.y, angular.z]),
        expected_information=float(message.expected_information),
        parameters_version=message.parameters_version,
    )
