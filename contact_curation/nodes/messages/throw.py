"""Translates throws, and checks the headers of ExecuteThrow's goals and results (contract: docs/ros/nodes.md)."""

from typing import Any

import numpy as np
from contact_curation_msgs.msg import Throw as ThrowMessage
from geometry_msgs.msg import Point, Pose, Quaternion, Vector3

from contact_curation.design.throw import Throw
from contact_curation.errors import InvalidValueError
from contact_curation.motion.toss import NANOSECONDS
from contact_curation.nodes.messages.headers import Stamped, check_format, header_message, nanoseconds_of


def throw_message(throw: Throw, stamped: Stamped) -> ThrowMessage:
    """Makes the message of a commanded or executed throw.

    Args:
        throw: the record.
        stamped: time of the release, 0 if unknown, and frame of the board.
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
    """Reads the throw of a message, with the same bits.

    Raises:
        InvalidValueError: the format is newer, or the throw is invalid.
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


def commanded_throw_of(message: Any, board_frame: str, now_ns: int, oldest: float) -> Throw:
    """Reads the throw of a goal, and refuses stale goals and other frames.

    Args:
        message: message of the goal's throw; a stamp of 0 and an empty frame are accepted.
        board_frame: the thrower's frame of the board.
        now_ns: time of the thrower's ROS clock [ns].
        oldest: largest accepted difference between stamp and now, in both directions [s]; 0 accepts any.

    Raises:
        InvalidValueError: the goal is stale, it is given in another frame, or as in `throw_of`.
    """
    _check_frame(message, board_frame)
    stamp_ns = nanoseconds_of(message.header.stamp)
    age = (now_ns - stamp_ns) / NANOSECONDS
    if stamp_ns and oldest and abs(age) > oldest:
        found = f"{abs(age):.1f} s {'ago' if age > 0.0 else 'ahead'}"
        raise InvalidValueError(
            "stamp of the goal", found, f"at most {oldest:g} s from now, or 0: a stale goal, or another clock"
        )
    return throw_of(message)


def executed_throw_of(message: Any, board_frame: str) -> tuple[Throw, int]:
    """Reads the executed throw of a result, and the time of its release [ns].

    Raises:
        InvalidValueError: the stamp is 0 or negative, so that its toss cannot be found; the frame is another one; or as in
            `throw_of`.
    """
    _check_frame(message, board_frame)
    stamp_ns = nanoseconds_of(message.header.stamp)
    if stamp_ns <= 0:
        found = f"{stamp_ns / NANOSECONDS:g}"
        raise InvalidValueError("stamp of the executed throw", found, "the time of the release, by the clock of the tracker")
    return throw_of(message), stamp_ns


def _check_frame(message: Any, board_frame: str) -> None:
    frame = message.header.frame_id
    if frame not in ("", board_frame):
        raise InvalidValueError(f"frame of throw {message.throw_id[:80]}", frame[:80], f"{board_frame}, or an empty one")
