"""Translates tosses and rejected motions; quaternions change from wxyz to xyzw and back here."""

from typing import Any

import numpy as np
from contact_curation_msgs.msg import Toss as TossMessage
from contact_curation_msgs.msg import TossRejected
from geometry_msgs.msg import Point, Pose, Quaternion, Vector3

from contact_curation.geometry.quaternions import Array
from contact_curation.motion.toss import Rejected, Toss
from contact_curation.nodes.messages.bounds import (
    LARGEST_POSITION,
    LARGEST_SPEED,
    LARGEST_SPIN,
    MOST_FRAMES,
    check_numbers,
    check_size,
)
from contact_curation.nodes.messages.headers import Stamped, check_format, header_message, nanoseconds_of, time_message


def toss_message(toss: Toss, sequence: int, board_frame: str) -> TossMessage:
    """Makes the message that announces a toss.

    Args:
        toss: the record.
        sequence: its number in the store, from 1.
        board_frame: frame of its poses.
    """
    poses = zip(toss.positions.tolist(), toss.orientations_wxyz.tolist())
    return TossMessage(
        format_version=TossMessage.FORMAT_VERSION,
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
        linear_velocities=_vectors(toss.linear_velocities),
        body_angular_velocities=_vectors(toss.angular_velocities),
    )


def toss_of(message: Any) -> Toss:
    """Reads the toss of a message, with the same bits.

    Raises:
        InvalidValueError: the format is newer, arrays have different lengths, there are too many frames, or a number is out of
            bounds.
    """
    check_format(message)
    for name in ("stamps", "poses", "linear_velocities", "body_angular_velocities"):
        check_size(f"{name} of toss {message.toss_id[:80]}", getattr(message, name), MOST_FRAMES)
    orientations = [[p.orientation.w, p.orientation.x, p.orientation.y, p.orientation.z] for p in message.poses]
    toss = Toss(
        toss_id=message.toss_id,
        body=message.body,
        source=message.source,
        frame_period=message.frame_period,
        stamps_ns=np.array([nanoseconds_of(stamp) for stamp in message.stamps], dtype=np.int64),
        positions=_rows([[p.position.x, p.position.y, p.position.z] for p in message.poses], 3),
        orientations_wxyz=_rows(orientations, 4),
        linear_velocities=_rows([[v.x, v.y, v.z] for v in message.linear_velocities], 3),
        angular_velocities=_rows([[v.x, v.y, v.z] for v in message.body_angular_velocities], 3),
    )
    check_numbers(f"positions [m] of toss {toss.toss_id}", toss.positions, LARGEST_POSITION)
    check_numbers(f"linear velocities [m/s] of toss {toss.toss_id}", toss.linear_velocities, LARGEST_SPEED)
    check_numbers(f"angular velocities [rad/s] of toss {toss.toss_id}", toss.angular_velocities, LARGEST_SPIN)
    return toss


def rejected_message(rejected: Rejected, board_frame: str) -> TossRejected:
    """Makes the message that announces a rejected motion."""
    toss = rejected.toss
    return TossRejected(
        format_version=TossRejected.FORMAT_VERSION,
        header=header_message(Stamped(int(toss.stamps_ns[0]), board_frame)),
        toss_id=toss.toss_id,
        body=toss.body,
        source=toss.source,
        frames=toss.frames,
        reasons=list(rejected.reasons),
    )


def _vectors(rows: Array) -> list[Vector3]:
    return [Vector3(x=x, y=y, z=z) for x, y, z in rows.tolist()]


def _rows(values: list[list[float]], width: int) -> Array:
    return np.array(values, dtype=float).reshape(-1, width)
