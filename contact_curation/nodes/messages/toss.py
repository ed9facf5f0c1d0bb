"""Toss and TossRejected: this is where wxyz becomes xyzw and back."""

from typing import Any

import numpy as np
from contact_curation_msgs.msg import Toss as TossMessage
from contact_curation_msgs.msg import TossRejected
from geometry_msgs.msg import Point, Pose, Quaternion, Twist, Vector3

from contact_curation.motion.toss import Rejected, Toss
from contact_curation.nodes.messages.headers import Stamped, header_message, nanoseconds_of, time_message


def toss_message(toss: Toss, sequence: int, board_frame: str) -> TossMessage:
    """A toss as it is announced.

    Args:
        toss: the record.
        sequence: its place in the store, from 1.
        board_frame: frame that its poses are given in.
    """
    poses = zip(toss.positions.tolist(), toss.orientations_wxyz.tolist())
    twists = zip(toss.linear_velocities.tolist(), toss.angular_velocities.tolist())
    return TossMessage(
        header=header_message(Stamped(int(toss.stamps_ns[0]), board_frame)),
        toss_id=toss.toss_id,
        body=toss.body,
        source=toss.source,
        sequence=sequence,
        frame_period=toss.frame_period,
        stamps=[time_message(stamp_ns) for stamp_ns in toss.stamps_ns.tolist()],
        poses=[
            Pose(position=Point(x=x, y=y, z=z), orientation=Quaternion(x=qx, y=qy, z=qz, w=qw))
            for (x, y, z), (qw, qx, qy, qz) in poses
        ],
        twists=[Twist(linear=_vector(linear), angular=_vector(angular)) for linear, angular in twists],
    )


def toss_of(message: Any) -> Toss:
    """The record that a message carries, bit for bit.

    Raises:
        InvalidValueError: arrays of different lengths, or numbers that no toss has.
    """
    orientations = [[p.orientation.w, p.orientation.x, p.orientation.y, p.orientation.z] for p in message.poses]
    return Toss(
        toss_id=message.toss_id,
        body=message.body,
        source=message.source,
        frame_period=message.frame_period,
        stamps_ns=np.array([nanoseconds_of(stamp) for stamp in message.stamps], dtype=np.int64),
        positions=_rows([[p.position.x, p.position.y, p.position.z] for p in message.poses], 3),
        orientations_wxyz=_rows(orientations, 4),
        linear_velocities=_rows([[t.linear.x, t.linear.y, t.linear.z] for t in message.twists], 3),
        angular_velocities=_rows([[t.angular.x, t.angular.y, t.angular.z] for t in message.twists], 3),
    )


def rejected_message(rejected: Rejected, board_frame: str) -> TossRejected:
    """A motion that was kept back, as it is announced."""
    toss = rejected.toss
    return TossRejected(
        header=header_message(Stamped(int(toss.stamps_ns[0]), board_frame)),
        toss_id=toss.toss_id,
        body=toss.body,
        source=toss.source,
        frames=toss.frames,
        reasons=list(rejected.reasons),
    )


def _vector(values: list[float]) -> Vector3:
    x, y, z = values
    return Vector3(x=x, y=y, z=z)


def _rows(values: list[list[float]], width: int) -> np.ndarray[Any, np.dtype[np.float64]]:
    return np.array(values, dtype=float).reshape(-1, width)
