"""Translates tosses and rejected motions; quaternions change from wxyz to xyzw and back here."""

from typing import Any

import numpy as np
from contact_curation_msgs.msg import Toss as TossMessage
from contact_curation_msgs.msg import TossRejected
from geometry_msgs.msg import Point, Pose, Quaternion, Vector3
from numpy.typing import NDArray

from contact_curation.geometry.quaternions import Array
from contact_curation.motion.toss import NANOSECONDS, Rejected, Toss
from contact_curation.nodes.messages.bounds import (
    LARGEST_POSITION,
    LARGEST_SPEED,
    LARGEST_SPIN,
    MOST_FRAMES,
    check_numbers,
    check_size,
)
from contact_curation.nodes.messages.headers import Stamped, check_format, header_message, time_message
from contact_curation.nodes.messages.toss_bytes import TossArrays


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

    Args:
        message: Toss message, or what `toss_bytes.toss_in` read.

    Raises:
        InvalidValueError: the format is newer, arrays have different lengths, there are too many frames, or a number is out of
            bounds.
    """
    check_format(message)
    for name in ("stamps", "poses", "linear_velocities", "body_angular_velocities"):
        check_size(f"{name} of toss {message.toss_id[:80]}", getattr(message, name), MOST_FRAMES)
    stamps, poses, linear, angular = _arrays(message)
    toss = Toss(
        toss_id=message.toss_id,
        body=message.body,
        source=message.source,
        frame_period=message.frame_period,
        stamps_ns=stamps[:, 0] * np.int64(NANOSECONDS) + stamps[:, 1],
        positions=poses[:, :3],
        orientations_wxyz=np.roll(poses[:, 3:], 1, axis=1),
        linear_velocities=linear,
        angular_velocities=angular,
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


def _arrays(message: Any) -> tuple[NDArray[Any], ...]:
    """Stamps (T, 2), poses (T, 7) in xyzw, linear and angular velocities (T, 3) of a message."""
    if isinstance(message, TossArrays):
        return message.stamps, message.poses, message.linear_velocities, message.body_angular_velocities
    poses = [(p.position, p.orientation) for p in message.poses]
    return (
        np.array([[stamp.sec, stamp.nanosec] for stamp in message.stamps], dtype=np.int64).reshape(-1, 2),
        _rows([[p.x, p.y, p.z, q.x, q.y, q.z, q.w] for p, q in poses], 7),
        _rows([[v.x, v.y, v.z] for v in message.linear_velocities], 3),
        _rows([[v.x, v.y, v.z] for v in message.body_angular_velocities], 3),
    )


def _rows(values: list[list[float]], width: int) -> Array:
    return np.array(values, dtype=float).reshape(-1, width)
