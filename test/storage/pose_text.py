"""The poses of a bag as text, as other programs write them."""

from collections.abc import Iterator
from decimal import Decimal
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from rosbags.highlevel import AnyReader

from contact_curation.geometry import quaternions
from contact_curation.geometry.quaternions import Array

POSES, STATIC = "/tagslam/odom/body_cube", "/tf_static"
Y_UP = np.array([np.sqrt(0.5), -np.sqrt(0.5), 0.0, 0.0])
"""From a frame with z up to one with y up."""

PLOTTED = (
    "{0}/header/stamp/sec,{0}/header/stamp/nanosec,{0}/pose/pose/position/x,{0}/pose/pose/position/y,"
    "{0}/pose/pose/position/z,{0}/pose/pose/orientation/x,{0}/pose/pose/orientation/y,{0}/pose/pose/orientation/z,"
    "{0}/pose/pose/orientation/w,{0}/pose/covariance[0;0],{0}/twist/twist/linear/x"
)
MOTIVE = (
    "Format Version,1.23,Capture Frame Rate,148.0,Export Frame Rate,148.0,Total Frames in Take,9143,Rotation Type,Quaternion",
    "",
    ",Type" + 8 * ",Rigid Body",
    ",Name" + 8 * ",cube",
    ",,Rotation,Rotation,Rotation,Rotation,Position,Position,Position,Mean Marker Error",
    "Frame,Time (Seconds),X,Y,Z,W,X,Y,Z,",
)


class Poses(NamedTuple):
    """(T,) stamps [ns], (T, 3) positions on the board and (T, 4) orientations."""

    stamps_ns: list[int]
    positions: Array
    orientations_wxyz: Array


def board_poses(bag: Path) -> Poses:
    stamps_ns, seen, board = [], [], np.zeros(7)
    with AnyReader([bag]) as reader:
        for connection, _, raw in reader.messages(reader.connections):
            message: Any = reader.deserialize(raw, connection.msgtype)
            if connection.topic == STATIC:
                place = message.transforms[0].transform
                board = np.array([*_numbers(place.translation, "xyz"), *_numbers(place.rotation, "wxyz")])
            elif connection.topic == POSES:
                pose = message.pose.pose
                stamps_ns.append(message.header.stamp.sec * 10**9 + message.header.stamp.nanosec)
                seen.append([*_numbers(pose.position, "xyz"), *_numbers(pose.orientation, "wxyz")])
    poses, back = np.array(seen), quaternions.conjugate(board[3:])
    return Poses(stamps_ns, quaternions.rotate(back, poses[:, :3] - board[:3]), quaternions.multiply(back, poses[:, 3:]))


def _numbers(message: object, names: str) -> list[float]:
    return [getattr(message, name) for name in names]


def text(dialect: str, poses: Poses) -> str:
    """What a program writes: tum, bare, euroc, plotjuggler, echo, excel or motive."""
    return "\n".join(_lines(dialect, poses)) + "\n"


def _lines(dialect: str, poses: Poses) -> Iterator[str]:
    if dialect == "tum":
        yield from ("# ground truth trajectory", "# file: 'session.bag'", "# timestamp tx ty tz qx qy qz qw")
    elif dialect == "euroc":
        places, turns = ", ".join(f"p_RS_R_{axis} [m]" for axis in "xyz"), ", ".join(f"q_RS_{axis} []" for axis in "wxyz")
        yield f"#timestamp, {places}, {turns}, v_RS_R_x [m s^-1], b_w_RS_S_x [rad s^-1]"
    elif dialect == "plotjuggler":
        yield "__time," + PLOTTED.format(POSES)
    elif dialect == "echo":
        places = ",".join(f"field.pose.position.{axis}" for axis in "xyz")
        turns = ",".join(f"field.pose.orientation.{axis}" for axis in "xyzw")
        yield f"%time,field.header.seq,field.header.stamp,field.header.frame_id,{places},{turns}"
    elif dialect == "excel":
        yield "Frame;Time [ms];X [mm];Y [mm];Z [mm];QW;QX;QY;QZ"
    elif dialect == "motive":
        yield from MOTIVE
    for number, (stamp_ns, (x, y, z), (qw, qx, qy, qz)) in enumerate(zip(*poses)):
        seconds, elapsed_ns = Decimal(stamp_ns).scaleb(-9), stamp_ns - poses.stamps_ns[0]
        if dialect in ("tum", "bare"):
            yield f"{seconds} {x} {y} {z} {qx} {qy} {qz} {qw}"
        elif dialect == "euroc":
            yield f"{stamp_ns},{x},{y},{z},{qw},{qx},{qy},{qz},0.5,0.1"
        elif dialect == "plotjuggler":
            yield f"{seconds:.6f},{stamp_ns // 10**9},{stamp_ns % 10**9},{x},{y},{z},{qx},{qy},{qz},{qw},0.01,0.5"
        elif dialect == "echo":
            yield f"{stamp_ns + 7},{number},{stamp_ns},map,{x},{y},{z},{qx},{qy},{qz},{qw}"
        elif dialect == "excel":
            row = (elapsed_ns * 1e-6, 1e3 * x, 1e3 * y, 1e3 * z, qw, qx, qy, qz)
            yield f"{number};" + ";".join(f"{value:.9f}" for value in row).replace(".", ",")
        else:
            (x, y, z), (qw, qx, qy, qz) = quaternions.rotate(Y_UP, [x, y, z]), quaternions.multiply(Y_UP, [qw, qx, qy, qz])
            yield f"{number},{elapsed_ns * 1e-9:.6f},{qx},{qy},{qz},{qw},{x},{y},{z},0.0003"
