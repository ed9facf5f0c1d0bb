"""Columns of a pose are found by the names that programs give them, in their units, and those of one body among several."""

from pathlib import Path

import numpy as np
import pytest

import contact_curation as cc
from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.errors import UnreadableInputError
from contact_curation.storage.datasets.pose_columns import ColumnsError, columns_of
from contact_curation.storage.datasets.pose_table import PoseTable
from test.cli.commands import Cli
from test.cli.import_data.test_poses import check_same
from test.storage.pose_text import board_poses, text

NAMED = {
    "time,posX,posY,posZ,rotX,rotY,rotZ,rotW": 1.0,
    "Time,PositionX,PositionY,PositionZ,QuatX,QuatY,QuatZ,QuatW": 1.0,
    "time,x_pos,y_pos,z_pos,x_quat,y_quat,z_quat,w_quat": 1.0,
    "time,x_mm,y_mm,z_mm,qx,qy,qz,qw": 1e-3,
    "time,x_m,y_m,z_m,qx,qy,qz,qw": 1.0,
    "time,x [millimeter],y [millimeter],z [millimeter],qx,qy,qz,qw": 1e-3,
    "time,x (in),y (in),z (in),qx,qy,qz,qw": 0.0254,
    "time,x,y,z,rx,ry,rz,rw": 1.0,
    "t,cube_x,cube_y,cube_z,cube_qx,cube_qy,cube_qz,cube_qw": 1.0,
    "t,position_mm.x,position_mm.y,position_mm.z,qx,qy,qz,qw": 1e-3,
    "t,pos_cm_x,pos_cm_y,pos_cm_z,qx,qy,qz,qw": 1e-2,
    "t,cm_pos_x,cm_pos_y,cm_pos_z,cm_qx,cm_qy,cm_qz,cm_qw": 1.0,
    "t,foot_x,foot_y,foot_z,foot_qx,foot_qy,foot_qz,foot_qw": 1.0,
}


@pytest.mark.parametrize("header", NAMED)
def test_names_and_units_that_programs_write_are_known(header: str) -> None:
    found = columns_of(header.split(","))
    assert (found.time, found.pose, found.length) == (0, (1, 2, 3, 7, 4, 5, 6), NAMED[header])


def test_of_several_times_the_one_of_the_pose_is_taken() -> None:
    pose = ["x", "y", "z", "qx", "qy", "qz", "qw"]
    assert columns_of(["recv_time", "time", *pose]).time == 1
    assert columns_of(["time", "header.stamp", *pose]).time == 1
    assert columns_of(["ball/stamp", "cube/stamp", *names("cube")]).time == 1


def names(body: str) -> list[str]:
    return [f"{body}/{name}" for name in ("x", "y", "z", "qx", "qy", "qz", "qw")]


def test_of_several_bodies_the_wanted_one_is_taken() -> None:
    several = ["time", *names("ball"), *names("my cube 2")]
    assert columns_of(several, "my_cube_2").pose == (8, 9, 10, 14, 11, 12, 13)
    with pytest.raises(ColumnsError, match="poses of several: ball, my cube 2, none or several of them of brick"):
        columns_of(several, "brick")


def test_a_body_whose_name_begins_another_one_s_is_taken_where_both_are_there() -> None:
    assert columns_of(["time", *names("rig brick2"), *names("rig brick")], "brick").pose == (8, 9, 10, 14, 11, 12, 13)
    with pytest.raises(ColumnsError, match="poses of several: left brick, right brick 2, none or several"):
        columns_of(["time", *names("left brick"), *names("right brick2")], "brick")


def test_a_position_of_one_body_and_an_orientation_of_another_are_no_pose() -> None:
    mixed = ["time", "ball.pos.x", "ball.pos.y", "ball.pos.z", *names("cube")[3:]]
    with pytest.raises(ColumnsError, match=r"different names \(ball\.pos\.x, cube/qw\)"):
        columns_of(mixed, "cube")


@pytest.mark.slow
def test_motive_s_export_with_markers_units_and_several_bodies_is_read(cli: Cli, golden_bag: Path, tmp_path: Path) -> None:
    """The export as it is by default: markers beside each body, and the unit of lengths in the first line."""
    rows = [line.split(",") for line in text("motive", board_poses(golden_bag)).splitlines()]
    head, blank, kinds, named, numbers, axes, *frames = rows
    head += ["Length Units", "Millimeters", "Coordinate Space", "Global"]
    marker = [["Rigid Body Marker"] * 3, ["{}:Marker1"] * 3, ["Position"] * 3, ["X", "Y", "Z"]]
    made = [head, blank]
    for line, of_marker in zip((kinds, named, numbers, axes), marker, strict=True):
        body = line[2:]
        ball = [cell.replace("cube", "ball") for cell in body]
        made.append(
            [*line[:2], *ball, *(one.format("ball") for one in of_marker), *body, *(one.format("cube") for one in of_marker)]
        )
    for frame in frames:
        body = [*frame[2:6], *(str(1e3 * float(value)) for value in frame[6:9]), frame[9]]
        made.append([*frame[:2], "0", "0", "0", "1", "5", "6", "7", "0.1", "1", "2", "3", *body, "", "", ""])
    (tmp_path / "take.csv").write_text("\n".join(",".join(line) for line in made))
    done = cli("import", "poses", tmp_path / "take.csv", "--up", "y", "--out", tmp_path / "take.mcap")
    assert (done.status, done.err) == (0, "")
    check_same(cc.read(tmp_path / "take.mcap", CONTACTNETS_CUBE), cc.read(golden_bag, CONTACTNETS_CUBE))


def test_rows_of_other_bodies_are_left_out_and_counted(cli: Cli, tmp_path: Path) -> None:
    lines = [f"{row // 2},{'ball' if row % 2 else 'cube'},{row % 2},0,1,0,0,0,1" for row in range(20)]
    (tmp_path / "poses.csv").write_text("\n".join(["time,name,x,y,z,qx,qy,qz,qw", *lines]))
    done = cli("import", "poses", tmp_path / "poses.csv", "--out", tmp_path / "poses.mcap", "--json")
    assert (done.status, done.json["poses"]) == (0, 10)
    assert done.json["left_out"] == [f"{tmp_path / 'poses.csv'}: left out 10 rows of other bodies than cube"]
    assert all(np.array(pose.position)[0] == 0.0 for _, pose in PoseTable(tmp_path / "poses.csv", body="cube"))


def test_rows_of_several_bodies_none_of_them_the_wanted_one_are_refused(cli: Cli, tmp_path: Path) -> None:
    lines = [f"{row // 2},{3 + row % 2},{row % 2},0,1,0,0,0,1" for row in range(20)]
    (tmp_path / "poses.csv").write_text("\n".join(["time,tag_id,x,y,z,qx,qy,qz,qw", *lines]))
    done = cli("import", "poses", tmp_path / "poses.csv", "--out", tmp_path / "poses.mcap")
    assert (done.status, done.err.count("\n")) == (1, 1)
    assert "found poses of 3, 4 in column 'tag_id', none of them cube's; name the body (--body-name)" in done.err
    numbered = [f"{row},{row},0,0,1,0,0,0,1" for row in range(20)]
    (tmp_path / "poses.csv").write_text("\n".join(["time,id,x,y,z,qx,qy,qz,qw", *numbered]))
    assert cli("import", "poses", tmp_path / "poses.csv", "--out", tmp_path / "poses.mcap", "--json").json["poses"] == 20


@pytest.mark.parametrize(("body", "other"), [("cube (left)", "cube (right)"), ("20261128", "20261129"), ("body_cube", "cube2")])
def test_rows_are_of_the_body_whose_name_they_have_as_it_is(body: str, other: str, tmp_path: Path) -> None:
    lines = [f"{row // 2},{other if row % 2 else body},{row % 2},0,1,0,0,0,1" for row in range(20)]
    (tmp_path / "poses.csv").write_text("\n".join(["time,name,x,y,z,qx,qy,qz,qw", *lines]))
    table = PoseTable(tmp_path / "poses.csv", body=body.removeprefix("body_"))
    assert [pose.position[0] for _, pose in table] == [0.0] * 10
    assert table.of_others == 10


def test_rows_of_several_bodies_of_almost_the_wanted_name_are_refused(tmp_path: Path) -> None:
    lines = [f"{row // 2},cube[{row % 2}],{row % 2},0,1,0,0,0,1" for row in range(20)]
    (tmp_path / "poses.csv").write_text("\n".join(["time,name,x,y,z,qx,qy,qz,qw", *lines]))
    said = r"found poses of cube\[0\], cube\[1\] in column 'name', several of them cube's"
    with pytest.raises(UnreadableInputError, match=said):
        PoseTable(tmp_path / "poses.csv", body="cube")


@pytest.mark.parametrize(("names", "said"), [("stamp_received,stamp_camera", True), ("recv_time,time", False)])
def test_of_two_columns_that_may_be_the_times_it_says_which_is_taken(names: str, said: bool, cli: Cli, tmp_path: Path) -> None:
    rows = [f"{0.01 * row:.6g},{0.01 * row:.6g},0,0,1,0,0,0,1" for row in range(20)]
    (tmp_path / "poses.csv").write_text("\n".join([f"{names},x,y,z,qx,qy,qz,qw", *rows]))
    done = cli("import", "poses", tmp_path / "poses.csv", "--out", tmp_path / "poses.mcap")
    line = "times are taken from stamp_received, not from stamp_camera: leave out the wrong one"
    assert (done.status, line in done.err, bool(done.err)) == (0, said, said)


@pytest.mark.parametrize("name", ["{0} (cube) [{1}]", "{0} [{1}] (cube)", "{0}_{1} [cube]", "{0}_{1}"])
def test_the_unit_of_a_length_is_in_brackets_before_or_behind_others(name: str) -> None:
    for unit, metres in (("mm", 1e-3), ("um", 1e-6), ("\u00b5m", 1e-6), ("\u03bcm", 1e-6), ("dm", 0.1), ("yards", 0.9144)):
        found = columns_of(["t", *(name.format(axis, unit) for axis in "xyz"), "qx", "qy", "qz", "qw"])
        assert found.length == metres, unit


def test_positions_of_different_units_are_refused() -> None:
    with pytest.raises(ColumnsError, match=r"positions of different units \(x, y, z_mm\)"):
        columns_of(["t", "x", "y", "z_mm", "qx", "qy", "qz", "qw"])


@pytest.mark.parametrize("times", [["2026-11-28"] * 20, [f"{1.0 - 0.01 * row}" for row in range(20)]], ids=["one", "backwards"])
def test_times_that_never_grow_are_refused(cli: Cli, times: list[str], tmp_path: Path) -> None:
    (tmp_path / "poses.csv").write_text("\n".join(["date,x,y,z,qx,qy,qz,qw", *(f"{time},0,0,1,0,0,0,1" for time in times)]))
    done = cli("import", "poses", tmp_path / "poses.csv", "--out", tmp_path / "poses.mcap")
    assert (done.status, done.err.count("\n")) == (1, 1)
    assert "found no row of 20 that is later than the one before it, expected a time of each, in order" in done.err
    assert not (tmp_path / "poses.mcap").exists()
