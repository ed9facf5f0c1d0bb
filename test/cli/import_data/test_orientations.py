"""Tables with rotation matrices and with angles give the exact poses; what names do not say is asked for, and never guessed."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import contact_curation as cc
from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.geometry import quaternions
from contact_curation.storage.datasets.orientations import ORDERS, AngleConvention
from contact_curation.storage.datasets.pose_columns import ColumnsError, columns_of
from contact_curation.storage.datasets.pose_table import PoseTable
from test.cli.commands import Cli
from test.cli.import_data.test_poses import check_same
from test.storage.pose_text import board_poses

TURNS = Rotation.random(200, rng=np.random.default_rng(5))
PLACES = np.random.default_rng(6).normal(size=(200, 3))
MATRICES = {
    "r00 to r22": [f"r{row}{column}" for row in range(3) for column in range(3)],
    "r11 to r33": [f"r{row}{column}" for row in (1, 2, 3) for column in (1, 2, 3)],
    "R_11 to R_33": [f"R_{row}{column}" for row in (1, 2, 3) for column in (1, 2, 3)],
    "m00 to m22": [f"m{row}{column}" for row in range(3) for column in range(3)],
    "rot_0_0": [f"cube.rotation_matrix_{row}_{column}" for row in range(3) for column in range(3)],
    "rot_0 to rot_8": [f"rot_{place}" for place in range(9)],
    "R1 to R9": [f"R{place}" for place in range(1, 10)],
}
ANGLES = ("roll,pitch,yaw", "rx,ry,rz", "RotX,RotY,RotZ", "euler_x,euler_y,euler_z", "cube/roll,cube/pitch,cube/yaw")


def write(path: Path, names: str, numbers: np.ndarray) -> Path:
    """A table of the places and these numbers beside them; columns of orientations of a body have its positions, too."""
    body = "cube." if "cube" in names else ""
    rows = [",".join(repr(float(value)) for value in row) for row in np.column_stack([np.arange(200) / 128, PLACES, numbers])]
    path.write_text("\n".join([f"time,{body}x,{body}y,{body}z,{names}", *rows]))
    return path


def assert_true(table: PoseTable) -> None:
    poses = [pose for _, pose in table]
    assert table.left_out == (0, "")
    np.testing.assert_array_equal([pose.position for pose in poses], PLACES)
    turns = quaternions.to_matrix([pose.orientation_wxyz for pose in poses])
    np.testing.assert_allclose(turns, TURNS.as_matrix(), rtol=0, atol=1e-12)


@pytest.mark.parametrize("names", MATRICES)
@pytest.mark.parametrize("mixed", [False, True])
def test_a_rotation_matrix_is_read_by_the_names_of_its_entries(names: str, mixed: bool, tmp_path: Path) -> None:
    order = np.random.default_rng(7).permutation(9) if mixed else np.arange(9)
    columns = ",".join(np.array(MATRICES[names])[order])
    table = PoseTable(write(tmp_path / "a.csv", columns, TURNS.as_matrix().reshape(-1, 9)[:, order]))
    assert_true(table)
    assert bool(table.assumed) == (names in ("rot_0 to rot_8", "R1 to R9"))


@pytest.mark.slow
@pytest.mark.parametrize("names", ANGLES)
@pytest.mark.parametrize("unit", ["deg", "rad"])
@pytest.mark.parametrize("order", ORDERS)
def test_angles_turn_in_the_order_and_unit_that_are_said(names: str, unit: str, order: str, tmp_path: Path) -> None:
    degrees = unit == "deg"
    if order == "rotvec":
        angles = TURNS.as_rotvec(degrees=degrees)
    else:
        told = TURNS.as_euler(order, degrees=degrees)
        angles = np.column_stack([told[:, order.lower().index(axis)] for axis in "xyz"])
    source = write(tmp_path / "a.csv", names, angles)
    assert_true(PoseTable(source, body="cube", angles=AngleConvention(order, unit)))
    named = write(tmp_path / "b.csv", ",".join(f"{name} [{unit}]" for name in names.split(",")), angles)
    assert_true(PoseTable(named, body="cube", angles=AngleConvention(order)))


def test_quaternions_with_three_decimals_are_rotations_and_exact_ones_stay(tmp_path: Path) -> None:
    exact = TURNS.as_quat()
    exact[0] = [1.01, 0.0, 0.0, 0.0]  # no rounding
    for decimals in (3, 17):
        given = exact.round(decimals)
        table = PoseTable(write(tmp_path / "a.csv", "qx,qy,qz,qw", given))
        found = np.array([pose.orientation_wxyz for _, pose in table])[:, [1, 2, 3, 0]]
        if decimals > 3:
            np.testing.assert_array_equal(found, given)
        else:
            np.testing.assert_allclose(np.linalg.norm(found[1:], axis=1), 1.0, atol=1e-6)
            np.testing.assert_allclose(found, exact, atol=2e-3)
            np.testing.assert_array_equal(found[0], given[0])


def test_roll_pitch_and_yaw_turn_about_x_y_and_z(tmp_path: Path) -> None:
    """A hand case: yawed to the left by 90 degrees, then pitched down by 30 about the body's own y."""
    (tmp_path / "a.csv").write_text("t,x,y,z,roll_deg,pitch_deg,yaw_deg\n1,0,0,0,0,30,90\n")
    ((_, pose),) = PoseTable(tmp_path / "a.csv", angles=AngleConvention("ZYX"))
    forwards = quaternions.rotate(pose.orientation_wxyz, [1.0, 0.0, 0.0])
    np.testing.assert_allclose(forwards, [0.0, np.sqrt(0.75), -0.5], atol=1e-15)


def test_a_row_of_units_says_that_of_the_angles(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("time,x,y,z,roll,pitch,yaw\ns,mm,mm,mm,deg,deg,deg\n1,5,0,0,0,0,90\n")
    ((stamp_ns, pose),) = PoseTable(tmp_path / "a.csv", angles=AngleConvention("xyz"))
    assert (stamp_ns, pose.position) == (1_000_000_000, (0.005, 0.0, 0.0))
    np.testing.assert_allclose(pose.orientation_wxyz, np.sqrt([0.5, 0.0, 0.0, 0.5]), atol=1e-15)


@pytest.mark.parametrize("beside", ["roll,pitch,yaw", "r11,r12,r13,r21,r22,r23,r31,r32,r33", "rot_x,rot_y,rot_z"])
def test_a_quaternion_is_taken_before_what_stands_beside_it(beside: str) -> None:
    names = ["t", "x", "y", "z", *beside.split(","), "qx", "qy", "qz", "qw"]
    if beside.startswith("rot"):
        names = [name for name in names if name not in ("qx", "qy", "qz")]  # then these are the quaternion's
    found = columns_of(names)
    assert found.form == ("qw", "qx", "qy", "qz")
    assert found.pose[3] == len(names) - 1


def test_of_a_4_by_4_matrix_the_upper_left_is_the_rotation() -> None:
    for first in (0, 1):
        names = [f"m{row + first}{column + first}" for row in range(4) for column in range(4)]
        pose = columns_of(["t", "x", "y", "z", *names]).pose
        assert pose[3:] == tuple(4 + 4 * row + column for row in range(3) for column in range(3))


def test_matrices_of_several_bodies_are_told_apart() -> None:
    names = ["t", *(f"{body}_{part}" for body in ("ball", "cube_2") for part in ("x", "y", "z", *MATRICES["r11 to r33"]))]
    assert columns_of(names, "cube_2").pose == tuple(range(13, 25))
    with pytest.raises(ColumnsError, match="poses of several: ball, cube 2"):
        columns_of(names, "brick")


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda matrix: 1.01 * matrix, "a matrix with determinant 1.03, of which R R^T is 0.0201 off the identity"),
        (lambda matrix: -matrix, "a matrix with determinant -1"),
        (lambda matrix: 1e200 * matrix, "a matrix with determinant inf"),
        (lambda matrix: 0.0 * matrix, "a matrix with determinant 0"),
        (lambda matrix: np.nan * matrix, "found 'nan', expected a number"),
    ],
)
def test_a_matrix_that_is_no_rotation_is_no_pose(change: Callable[[np.ndarray], np.ndarray], said: str, tmp_path: Path) -> None:
    matrices = TURNS.as_matrix()
    matrices[7] = change(matrices[7])
    table = PoseTable(write(tmp_path / "a.csv", ",".join(MATRICES["r00 to r22"]), matrices.reshape(-1, 9)))
    assert len(list(table)) == 199
    assert table.left_out[0] == 1
    assert table.left_out[1].startswith(f"line 9: found {said.removeprefix('found ')}")


def test_a_rotation_vector_that_is_too_long_is_no_pose(tmp_path: Path) -> None:
    angles = np.zeros((200, 3))
    angles[7] = 1e200
    table = PoseTable(write(tmp_path / "a.csv", "rx,ry,rz", angles), angles=AngleConvention("rotvec", "rad"))
    assert len(list(table)) == 199
    assert table.left_out == (1, "line 9: found numbers too large for angles, expected a rotation")


def test_rounded_matrices_are_rotations(tmp_path: Path) -> None:
    table = PoseTable(write(tmp_path / "a.csv", ",".join(MATRICES["r00 to r22"]), TURNS.as_matrix().round(3).reshape(-1, 9)))
    found = quaternions.to_matrix([pose.orientation_wxyz for _, pose in table])
    assert table.left_out == (0, "")
    np.testing.assert_allclose(found, TURNS.as_matrix(), atol=1e-3)


@pytest.mark.parametrize(
    ("names", "options", "said"),
    [
        ("roll,pitch,yaw", [], "found angles roll, pitch, yaw, expected in which order they turn, --angles (xyz: about fixed"),
        ("rx,ry,rz", [], "found angles rx, ry, rz, expected in which order they turn"),
        (
            "roll,pitch,yaw",
            ["--angles", "xyz"],
            "found angles roll, pitch, yaw, expected a unit in their names, or --angle-unit",
        ),
        ("roll_deg,pitch_deg,yaw_rad", ["--angles", "xyz"], "angles of different units (roll_deg, pitch_deg, yaw_rad)"),
        ("roll_deg,pitch_deg,yaw_deg", ["--angles", "xyz", "--angle-unit", "rad"], "angle_unit: found rad, and deg in"),
        ("qx,qy,qz", [], "found no column of qw in time, x, y, z, qx, qy, qz"),
        ("qx,qy,qz", ["--angles", "xyz"], "found no column of qw in time, x, y, z, qx, qy, qz"),
        ("roll,pitch", ["--angles", "xyz"], "found no column of az in time, x, y, z, roll, pitch"),
    ],
)
def test_what_is_not_said_of_angles_is_one_line(cli: Cli, names: str, options: list[str], said: str, tmp_path: Path) -> None:
    source = write(tmp_path / "a.csv", names, np.zeros((200, names.count(",") + 1)))
    if names.count(",") == 1:
        source = write(tmp_path / "a.csv", f"{names},flag", np.zeros((200, 3)))
    done = cli("import", "poses", source, *options, "--out", tmp_path / "poses.mcap")
    assert (done.status, done.out, done.err.count("\n")) == (1, "", 1)
    assert said in done.err
    assert not (tmp_path / "poses.mcap").exists()


@pytest.mark.parametrize(("option", "value"), [("--angles", "xyz"), ("--angle-unit", "deg")])
def test_angles_are_not_said_of_a_table_without_any(cli: Cli, option: str, value: str, tmp_path: Path) -> None:
    source = write(tmp_path / "a.csv", "qw,qx,qy,qz", TURNS.as_quat(scalar_first=True))
    done = cli("import", "poses", source, option, value, "--out", tmp_path / "poses.mcap")
    assert (done.status, done.err.count("\n")) == (1, 1)
    assert f"angles: found {value}, and no angles in {source}, expected angles, or no such option" in done.err


def test_numbered_entries_are_taken_row_by_row_and_that_is_said(cli: Cli, tmp_path: Path) -> None:
    source = write(tmp_path / "a.csv", ",".join(MATRICES["rot_0 to rot_8"]), TURNS.as_matrix().reshape(-1, 9))
    done = cli("import", "poses", source, "--out", tmp_path / "poses.mcap")
    assert done.status == 0
    assert done.err == f"contact-curation: warning: {source}: rot_0 to rot_8 are taken as a rotation matrix row by row\n"


@pytest.mark.slow
@pytest.mark.parametrize("form", ["matrix", "angles"])
def test_a_recording_gives_the_tosses_of_its_bag(cli: Cli, golden_bag: Path, form: str, tmp_path: Path) -> None:
    poses = board_poses(golden_bag)
    turns = Rotation.from_quat(poses.orientations_wxyz, scalar_first=True)
    numbers = turns.as_matrix().reshape(-1, 9) if form == "matrix" else turns.as_euler("ZYX", degrees=True)[:, ::-1]
    names = ",".join(MATRICES["r11 to r33"]) if form == "matrix" else "roll,pitch,yaw"
    rows = [
        ",".join([str(stamp_ns), *(repr(float(one)) for one in (*place, *row))])
        for stamp_ns, place, row in zip(poses.stamps_ns, poses.positions, numbers, strict=True)
    ]
    (tmp_path / "a.csv").write_text("\n".join([f"time_ns,x,y,z,{names}", *rows]))
    options = [] if form == "matrix" else ["--angles", "ZYX", "--angle-unit", "deg"]
    done = cli("import", "poses", tmp_path / "a.csv", *options, "--out", tmp_path / "poses.mcap")
    assert (done.status, done.err) == (0, "")
    check_same(cc.read(tmp_path / "poses.mcap", CONTACTNETS_CUBE), cc.read(golden_bag, CONTACTNETS_CUBE))


@pytest.mark.parametrize("order", ["rpy", "zxz", ""])
def test_an_order_that_there_is_not_is_bad_usage(cli: Cli, order: str, tmp_path: Path) -> None:
    source = write(tmp_path / "a.csv", "roll,pitch,yaw", np.zeros((200, 3)))
    done = cli("import", "poses", source, "--angles", order, "--out", tmp_path / "poses.mcap")
    assert (done.status, done.out, done.err.count("\n")) == (2, "", 1)
    assert f"--angles: found {order}, expected one of xyz, xzy, " in done.err
