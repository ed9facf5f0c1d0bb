"""`import poses`: tables of poses, as other programs write them, give the tosses of the bag that they came from."""

import os
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader

import contact_curation as cc
from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.errors import InvalidValueError
from contact_curation.geometry import quaternions
from contact_curation.storage.datasets.pose_bag import UPRIGHT
from contact_curation.storage.datasets.pose_table import PoseTable
from test.cli.commands import Cli
from test.storage.pose_text import Poses, board_poses, text


@pytest.fixture(scope="module")
def poses(golden_bag: Path) -> Poses:
    return board_poses(golden_bag)


@pytest.fixture(scope="module")
def tosses(golden_bag: Path) -> cc.Tosses:
    return cc.read(golden_bag, CONTACTNETS_CUBE)


def check_same(found: cc.Tosses, expected: cc.Tosses) -> None:
    assert (len(found.accepted), len(found.rejected)) == (len(expected.accepted), len(expected.rejected))
    for one, other in zip(found.accepted, expected.accepted):
        np.testing.assert_allclose(one.positions, other.positions, atol=2e-6)
        np.testing.assert_allclose(np.diff(one.stamps_ns), np.diff(other.stamps_ns), atol=1100)


@pytest.mark.parametrize("dialect", ["tum", "bare", "euroc", "plotjuggler", "echo", "excel", "motive"])
def test_a_table_gives_the_tosses_of_its_bag(cli: Cli, poses: Poses, tosses: cc.Tosses, dialect: str, tmp_path: Path) -> None:
    source, out = tmp_path / f"{dialect}.csv", tmp_path / "poses.mcap"
    source.write_text(text(dialect, poses))
    done = cli("import", "poses", source, "--out", out, *(["--up", "y"] if dialect == "motive" else []))
    assert (done.status, done.out.split(", ")[1].split(" poses")[0]) == (0, str(len(poses.stamps_ns)))
    assert ("columns have no names" in done.err) == (dialect == "bare")
    found = cc.read(out, CONTACTNETS_CUBE)
    check_same(found, tosses)
    if dialect not in ("excel", "motive"):  # whose times begin at 0
        assert [toss.toss_id for toss in found.accepted] == [toss.toss_id for toss in tosses.accepted]


@pytest.mark.parametrize("unit", ["s", "ms", "us", "ns"])
@pytest.mark.parametrize("rate", [30.0, 1000.0])
def test_the_unit_of_times_is_told_by_their_steps(cli: Cli, unit: str, rate: float, tmp_path: Path) -> None:
    scale = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9}[unit]
    rows = [f"{(5.0 + number / rate) * scale:.12g} 0 0 1 0 0 0 1" for number in range(1, 40)]
    (tmp_path / "poses.txt").write_text("\n".join(rows))
    done = cli("import", "poses", tmp_path / "poses.txt", "--out", tmp_path / "poses.mcap", "--json")
    assert done.json["seconds"] == pytest.approx(38 / rate, rel=1e-4)


@pytest.mark.parametrize(
    ("date", "after_ns"), [("2026-11-28 10:00:00.006756757", 6756757), ("1970-01-01T00:00:00.0000000015Z", 1)]
)
def test_a_date_keeps_its_nanoseconds(date: str, after_ns: int, tmp_path: Path) -> None:
    rows = [f"{one},0,0,1,0,0,0,1" for one in (date.partition(".")[0] + "Z" * date.endswith("Z"), date)]
    (tmp_path / "a.csv").write_text("\n".join(["time,x,y,z,qx,qy,qz,qw", *rows]))
    (before, _), (after, _) = PoseTable(tmp_path / "a.csv")
    assert after - before == pytest.approx(after_ns, abs=1)


def test_times_may_be_dates(cli: Cli, tmp_path: Path) -> None:
    rows = ["time,x,y,z,qx,qy,qz,qw", "2026-11-28 10:00:00.0067,0,0,1,0,0,0,1", "2026-11-28T11:00:00.0134+01:00,0,0,1,0,0,0,1"]
    (tmp_path / "poses.csv").write_text("\n".join(rows))
    done = cli("import", "poses", tmp_path / "poses.csv", "--out", tmp_path / "poses.mcap", "--json")
    assert (done.json["poses"], done.json["moved"], done.json["seconds"]) == (2, 0, pytest.approx(0.0067))


@pytest.mark.parametrize("names", ["date,time", "Date,Time", "cube date,time of day", "date,timestamp [s]"])
@pytest.mark.parametrize("order", [1, -1])
def test_date_and_time_of_day_may_be_two_columns(names: str, order: int, tmp_path: Path) -> None:
    times = [datetime(2026, 11, 28, 23, 59, 58, 123456, UTC) + timedelta(microseconds=6757) * row for row in range(700)]
    rows = [",".join([*[f"{one:%Y-%m-%d}", f"{one:%H:%M:%S.%f}"][::order], "0,0,1,0,0,0,1"]) for one in times]
    header = ",".join([*names.split(",")[::order], "x,y,z,qx,qy,qz,qw"])
    (tmp_path / "poses.csv").write_text("\n".join([header, *rows]))
    first_ns = 1_795_910_398_123_456_000
    stamps = [stamp_ns for stamp_ns, _ in PoseTable(tmp_path / "poses.csv")]
    assert stamps == [first_ns + row * 6_757_000 for row in range(700)]


def test_a_column_named_date_may_have_the_time_too_and_may_stand_beside_seconds(tmp_path: Path) -> None:
    pose = "0,0,1,0,0,0,1"
    (tmp_path / "a.csv").write_text(f"date,x,y,z,qx,qy,qz,qw\n2026-11-28T23:59:58.5Z,{pose}\n2026-11-29 00:00:00.5,{pose}")
    assert [stamp_ns for stamp_ns, _ in PoseTable(tmp_path / "a.csv")] == [1_795_910_398_500_000_000, 1_795_910_400_500_000_000]
    assert [stamp_ns for stamp_ns, _ in PoseTable(tmp_path / "a.csv", rate=50.0)] == [0, 20_000_000]
    (tmp_path / "b.csv").write_text(f"date,time,x,y,z,qx,qy,qz,qw\n2026-11-28,5,{pose}\n2026-11-28,5.25,{pose}")
    assert [stamp_ns for stamp_ns, _ in PoseTable(tmp_path / "b.csv")] == [5_000_000_000, 5_250_000_000]


@pytest.mark.parametrize("rows", [["6,0", "7,250000000"], ["6,6000000000", "7.25,7250000000"], ["6,0", "7.25,250000000"]])
def test_nanoseconds_beside_seconds_count_where_they_are_a_part_of_them(rows: list[str], tmp_path: Path) -> None:
    rows = [f"{one},0,0,1,0,0,0,1" for one in rows]
    (tmp_path / "a.csv").write_text("\n".join(["seconds,nanoseconds,x,y,z,qx,qy,qz,qw", *rows]))
    assert [stamp_ns for stamp_ns, _ in PoseTable(tmp_path / "a.csv")] == [6_000_000_000, 7_250_000_000]


@pytest.mark.parametrize(("unit", "seconds"), [("min", 60), ("hours", 3600)])
def test_times_may_be_in_minutes_and_hours(unit: str, seconds: int, tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(f"time [{unit}],x,y,z,qx,qy,qz,qw\n1,0,0,1,0,0,0,1\n1.5,0,0,1,0,0,0,1")
    assert [stamp_ns for stamp_ns, _ in PoseTable(tmp_path / "a.csv")] == [seconds * 10**9, 3 * seconds * 10**9 // 2]


def test_the_bag_begins_with_the_first_pose(cli: Cli, tmp_path: Path) -> None:
    (tmp_path / "poses.txt").write_text("1600000000 0 0 1 0 0 0 1\n1600000000.5 0 0 1 0 0 0 1")
    cli("import", "poses", tmp_path / "poses.txt", "--out", tmp_path / "poses.mcap")
    with (tmp_path / "poses.mcap").open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    assert summary.statistics is not None
    seen = summary.statistics
    assert (seen.message_start_time, seen.message_end_time) == (1_600_000_000_000_000_000, 1_600_000_000_500_000_000)


@pytest.mark.parametrize("axis", ["x", "y", "z"])
def test_the_axis_that_points_up_becomes_z(axis: str) -> None:
    np.testing.assert_allclose(
        quaternions.rotate(UPRIGHT[axis].orientation_wxyz, np.eye(3)["xyz".index(axis)]), [0, 0, 1], atol=1e-15
    )


def test_values_may_be_quoted_with_commas_in_names(cli: Cli, tmp_path: Path) -> None:
    rows = ['"take, 1","time",x,y,z,qx,qy,qz,qw', '"a, b",1.0,0,0,1,0,0,0,1', '"a, b",1.5,0,0,1,0,0,0,1']
    (tmp_path / "poses.csv").write_text("\n".join(rows))
    done = cli("import", "poses", tmp_path / "poses.csv", "--out", tmp_path / "poses.mcap", "--json")
    assert (done.json["poses"], done.json["seconds"]) == (2, 0.5)


def test_rows_without_a_pose_are_counted_and_a_file_cut_short_is_read(cli: Cli, tmp_path: Path) -> None:
    rows = ["t,x,y,z,qx,qy,qz,qw", "1,0,0,1,0,0,0,1", "1.01,,,,,,,", "1.02,nan,0,1,0,0,0,1", "1.03,0,0,1,0,0,0,1", "1.04,0,0"]
    (tmp_path / "poses.csv").write_text("\n".join(rows))
    done = cli("import", "poses", tmp_path / "poses.csv", "--out", tmp_path / "poses.mcap")
    assert done.out == f"{tmp_path / 'poses.mcap'}: 1 recording, 2 poses in 0.0 s (33.33 Hz)\n"
    where = f"contact-curation: warning: {tmp_path / 'poses.csv'}"
    assert done.err == f"{where}: left out 3 rows without a pose (line 3: found '', expected a number)\n"


def test_it_says_the_rate_between_missing_frames_and_by_how_much_times_were_moved(cli: Cli, tmp_path: Path) -> None:
    rows = [f"{row / 100:.2f},0,0,1,0,0,0,1" for row in range(200) if row % 50 < 40]
    for name in "ab":
        (tmp_path / f"{name}.csv").write_text("\n".join(["t,x,y,z,qx,qy,qz,qw", *rows]))
    done = cli("import", "poses", tmp_path / "a.csv", "--out", tmp_path / "one.mcap")
    assert done.out.endswith("160 poses in 1.9 s (100 Hz); times of 1 recording moved by 1 s: they began at 0\n")
    done = cli("import", "poses", tmp_path / "a.csv", tmp_path / "b.csv", "--out", tmp_path / "two.mcap")
    assert "; times of 2 recordings moved by 1 to 3.89 s: they began at 0, or before" in done.out
    rounded = [f"{row / 1e3:.3f},0,0,1,0,0,0,1" for row in np.rint(np.arange(1, 300) * 1e3 / 148.0)]
    (tmp_path / "rounded.csv").write_text("\n".join(["t,x,y,z,qx,qy,qz,qw", *rounded]))
    assert "(148 Hz)\n" in cli("import", "poses", tmp_path / "rounded.csv", "--out", tmp_path / "rounded.mcap").out


def test_recordings_that_begin_at_0_follow_each_other_and_lose_nothing(cli: Cli, poses: Poses, tmp_path: Path) -> None:
    half = len(poses.stamps_ns) // 2
    for name, part in (("a", slice(0, half)), ("b", slice(half, None))):
        cut = Poses(poses.stamps_ns[part], poses.positions[part], poses.orientations_wxyz[part])
        (tmp_path / f"{name}.csv").write_text(text("excel", cut))
    done = cli("import", "poses", tmp_path / "a.csv", tmp_path / "b.csv", "--out", tmp_path / "poses.mcap", "--json")
    assert (done.json["recordings"], done.json["poses"], done.json["moved"]) == (2, len(poses.stamps_ns), 2)
    found = cc.read(tmp_path / "poses.mcap", CONTACTNETS_CUBE)
    assert len(found.accepted) + len(found.rejected) in (23, 24, 25)  # the cut may lie in a motion
    assert len({toss.toss_id for toss in found.accepted}) == len(found.accepted)


def test_times_that_begin_again_in_a_file_are_another_recording(
    cli: Cli, poses: Poses, tosses: cc.Tosses, tmp_path: Path
) -> None:
    """Takes that were joined to one table: their poses would lie between each other."""
    half = np.searchsorted(poses.stamps_ns, tosses.accepted[10].stamps_ns[-1] + 200_000_000)
    parts = [
        Poses(poses.stamps_ns[part], poses.positions[part], poses.orientations_wxyz[part])
        for part in (slice(0, int(half)), slice(int(half), None))
    ]
    first, second = (text("excel", part).splitlines() for part in parts)
    (tmp_path / "takes.csv").write_text("\n".join(first + second[1:]))
    done = cli("import", "poses", tmp_path / "takes.csv", "--out", tmp_path / "poses.mcap", "--json")
    assert (done.json["recordings"], done.json["poses"], done.json["moved"]) == (2, len(poses.stamps_ns), 2)
    assert done.json["seconds"] == pytest.approx(1e-9 * (poses.stamps_ns[-1] - poses.stamps_ns[0]), abs=0.1)
    check_same(cc.read(tmp_path / "poses.mcap", CONTACTNETS_CUBE), tosses)


def test_poses_at_a_rate_need_no_times(cli: Cli, tmp_path: Path) -> None:
    (tmp_path / "poses.txt").write_text("0 0 1 0 0 0 1\n" * 101)
    done = cli("import", "poses", tmp_path / "poses.txt", "--rate", "50", "--out", tmp_path / "poses.mcap", "--json")
    assert (done.status, done.json["poses"], done.json["seconds"]) == (0, 101, 2.0)


def test_microseconds_and_milliseconds_stand_beside_seconds_too(tmp_path: Path) -> None:
    stamps = [7_000_001_000, 7_006_668_000, 7_999_000_000, 8_005_667_000]
    for names, unit in (("sec,usec", 1_000), ("time_sec,time_microsec", 1_000), ("seconds,milliseconds", 1_000_000)):
        rows = [f"{stamp // 10**9},{stamp % 10**9 / unit:.7g},0,0,1,0,0,0,1" for stamp in stamps]
        (tmp_path / "a.csv").write_text("\n".join([f"{names},x,y,z,qx,qy,qz,qw", *rows]))
        assert [stamp for stamp, _ in PoseTable(tmp_path / "a.csv")] == stamps, names
    rows = [f"{stamp // 10**9},{stamp // 1_000},0,0,1,0,0,0,1" for stamp in stamps]  # whole times themselves
    (tmp_path / "a.csv").write_text("\n".join(["sec,usec,x,y,z,qx,qy,qz,qw", *rows]))
    assert [stamp for stamp, _ in PoseTable(tmp_path / "a.csv")] == stamps


@pytest.mark.parametrize("begin", [0, 1_700_000_000])
@pytest.mark.parametrize("seconds", ["{0:.0f}", "{0:.2f}", "{1:.2f}"])
def test_nanoseconds_beside_seconds_may_be_whole_times_themselves(seconds: str, begin: int, tmp_path: Path) -> None:
    stamps = [begin * 10**9 + 6_756_757 * frame for frame in range(200)]
    rows = [f"{seconds.format(one // 10**9, (one - stamps[0]) / 1e9)},{one},0,0,1,0,0,0,1" for one in stamps]
    (tmp_path / "a.csv").write_text("\n".join(["seconds,nanoseconds,x,y,z,qx,qy,qz,qw", *rows]))
    assert [stamp_ns for stamp_ns, _ in PoseTable(tmp_path / "a.csv")] == stamps


def test_seconds_that_are_whole_times_count_alone(tmp_path: Path) -> None:
    rows = [f"{0.5 * frame},{500_000_000 * (frame % 2)},0,0,1,0,0,0,1" for frame in range(20)]
    (tmp_path / "a.csv").write_text("\n".join(["seconds,nanoseconds,x,y,z,qx,qy,qz,qw", *rows]))
    assert [stamp_ns for stamp_ns, _ in PoseTable(tmp_path / "a.csv")] == [500_000_000 * frame for frame in range(20)]


@pytest.mark.parametrize("every", [1, 3])
@pytest.mark.parametrize("name", ["Frame", "frame_number"])
def test_numbers_of_frames_are_times_at_a_rate_so_that_missing_rows_are_a_gap(name: str, every: int, tmp_path: Path) -> None:
    frames = [every * frame for frame in (0, 6, 7, 8, 9, 10, 11)]
    (tmp_path / "a.csv").write_text("\n".join([f"{name},x,y,z,qx,qy,qz,qw", *(f"{one},0,0,1,0,0,0,1" for one in frames)]))
    stamps = [stamp_ns for stamp_ns, _ in PoseTable(tmp_path / "a.csv", rate=50.0)]
    assert stamps == [20_000_000 * frame // every for frame in frames]


def test_frames_of_a_tracker_that_is_slower_than_its_camera_are_at_the_cameras_rate(tmp_path: Path) -> None:
    frames = [frame for frame in range(100) if frame % 5 not in (1, 3)]
    (tmp_path / "a.csv").write_text("\n".join(["frame,x,y,z,qx,qy,qz,qw", *(f"{one},0,0,1,0,0,0,1" for one in frames)]))
    assert [stamp_ns for stamp_ns, _ in PoseTable(tmp_path / "a.csv", rate=100.0)] == [10_000_000 * one for one in frames]


@pytest.mark.parametrize("name", ["frame", "note"])
def test_rows_of_other_bodies_take_no_time_at_a_rate(name: str, tmp_path: Path) -> None:
    rows = [f"{row // 2},{'ball' if row % 2 else 'cube'},0,0,1,0,0,0,1" for row in range(20)]
    (tmp_path / "a.csv").write_text("\n".join([f"{name},body,x,y,z,qx,qy,qz,qw", *rows]))
    stamps = [stamp_ns for stamp_ns, _ in PoseTable(tmp_path / "a.csv", rate=50.0, body="cube")]
    assert stamps == [20_000_000 * frame for frame in range(10)]


@pytest.mark.parametrize("frames", ["7777777777", "a1 a2 a3 a4 a5 a6 a7 a8 a9 a0"])
def test_a_column_of_frames_that_numbers_none_is_none(frames: str, tmp_path: Path) -> None:
    rows = [f"{one},0,0,1,0,0,0,1" for one in (frames.split() if " " in frames else frames)]
    (tmp_path / "a.csv").write_text("\n".join(["frame,x,y,z,qx,qy,qz,qw", *rows]))
    stamps = [stamp_ns for stamp_ns, _ in PoseTable(tmp_path / "a.csv", rate=50.0)]
    assert stamps == [20_000_000 * frame for frame in range(10)]


@pytest.mark.parametrize(
    ("content", "options", "said"),
    [
        ("", [], "found no numbers in the first 100 lines; expected columns named time, x, y, z, qx, qy, qz, qw"),
        ("\0\1\2" * 50, [], "found no text in line 1, expected a row of numbers"),
        ("[" * 60_000 + "\n" + "1 2 3 4 5 6 7 8\n" * 5, [], "found no column of x, y, z, qw, qx, qy, qz in [[["),
        ("1 2 3\n" * 5, [], "found no numbers in the first 100 lines"),
        ("1 2 3 4 5 6 7 8 9\n", [], "found 9 columns without names; expected columns named"),
        (
            "t,x,y,z,roll,pitch,yaw,flag\n1,2,3,4,5,6,7,8\n",
            [],
            "found angles roll, pitch, yaw, expected in which order they turn, --angles (xyz",
        ),
        ("t,a/x,a/y,a/z,b.position.x,qx,qy,qz,qw\n" + "1," * 9, [], "found no column of x, y, z in t, a/x"),
        ("t,p.x,y,z,x,qx,qy,qz,qw\n" + "1," * 9, [], "found 2 columns of x (p.x, x); expected columns named"),
        ("x,y,z,qx,qy,qz,qw\n0,0,1,0,0,0,1\n", [], "rate: found none, and no times in"),
        ("t,x,y,z,qx,qy,qz,qw\n1,0,0,1,0,0,0,1\n", ["--rate", "50"], "rate: found 50, and times in"),
        ("t,x,y,z,qx,qy,qz,qw\n1,0,0,1,0,0,0,?\n", [], "found no pose (line 2: found '?', expected a number)"),
        ("t,x,y,z,qx,qy,qz,qw\n1e99,0,0,1,0,0,0,1\n", [], "found no pose (line 2: found no time in '1e99', expected a number"),
        (
            "t,x,y,z,qx,qy,qz,qw\n1e9999999,0,0,1,0,0,0,1\n",
            [],
            "found no pose (line 2: found no time in '1e9999999'",
        ),
        (
            "time,x,y,z,qx,qy,qz,qw\n14:03:05.12,0,0,1,0,0,0,1\n",
            [],
            "found no time in '14:03:05.12', expected a number, or a date",
        ),
        (
            "date,time,x,y,z,qx,qy,qz,qw\n28/11/2026,14:03:05.12,0,0,1,0,0,0,1\n",
            [],
            "no time in '28/11/2026 14:03:05.12', expected a number, or a date with a time such as 2026-11-28 10:00:00.0067",
        ),
        ("t,x,y,z,qx,qy,qz,qw\n3e18,0,0,1,0,0,0,1\n", [], "times: found 3e+18 s, expected less than 2.14748e+09 s"),
        ("x,y,z,qx,qy,qz,qw\n" + "0,0,1,0,0,0,1\n" * 2, ["--rate", "1e-300"], "rate: found 1e-300, expected at least 0.001"),
        ("t,x,y,z,qx,qy,qz,qw\n5,0,0,1,0,0,0,1\n-9,0,0,1,0,0,0,1\n", [], "times that go back in 1 of 2 rows, expected rows"),
    ],
)
def test_what_is_no_table_of_poses_is_one_line_and_leaves_no_bag(
    cli: Cli, content: str, options: list[str], said: str, tmp_path: Path
) -> None:
    (tmp_path / "poses.csv").write_text(content)
    done = cli("import", "poses", tmp_path / "poses.csv", *options, "--out", tmp_path / "poses.mcap")
    assert (done.status, done.out, done.err.count("\n")) == (1, "", 1)
    assert said in done.err
    assert [path.name for path in tmp_path.iterdir()] == ["poses.csv"]


def test_a_pipe_is_refused_because_it_is_read_several_times(cli: Cli, tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "poses.csv")
    done = cli("import", "poses", tmp_path / "poses.csv", "--out", tmp_path / "poses.mcap")
    assert (done.status, done.err.count("\n")) == (1, 1)
    assert "is no regular file, expected one: it is read several times" in done.err


def test_a_file_that_is_not_there_is_one_line(cli: Cli, tmp_path: Path) -> None:
    done = cli("import", "poses", tmp_path / "none.csv", "--out", tmp_path / "poses.mcap")
    assert (done.status, done.err) == (1, f"contact-curation: error: {tmp_path / 'none.csv'}: No such file or directory\n")


def test_poses_in_arrays_are_written_likewise(poses: Poses, tosses: cc.Tosses, tmp_path: Path) -> None:
    out, times = tmp_path / "poses.mcap", 1e-9 * (np.array(poses.stamps_ns) - poses.stamps_ns[0])
    lost = np.array(poses.positions)
    lost[5] = np.nan
    written = cc.write_poses(out, times, lost, poses.orientations_wxyz, CONTACTNETS_CUBE)
    assert written == len(times) - 1
    check_same(cc.read(out, CONTACTNETS_CUBE), tosses)
    with pytest.raises(InvalidValueError, match="overwrite=True"):
        cc.write_poses(out, times, lost, poses.orientations_wxyz, CONTACTNETS_CUBE)
    rounded = np.round(poses.orientations_wxyz, 3)
    cc.write_poses(out, times, lost, rounded, CONTACTNETS_CUBE, overwrite=True)
    assert len(cc.read(out, CONTACTNETS_CUBE).accepted) == len(tosses.accepted)


@pytest.mark.parametrize(
    ("times", "positions", "orientations", "said"),
    [
        ([0.0, 1.0], np.zeros((3, 3)), np.tile([1.0, 0, 0, 0], (2, 1)), r"positions: found shape \(3, 3\), expected \(2, 3\)"),
        ([1.7e18, 1.71e18], np.zeros((2, 3)), np.tile([1.0, 0, 0, 0], (2, 1)), r"times: found 1.7e\+18 s, expected less than"),
        ([-5.0, 0.0], np.zeros((2, 3)), np.tile([1.0, 0, 0, 0], (2, 1)), "times: found -5 s, expected times of at least 0 s"),
        ([0.5, 0.5 + 1e-10], np.zeros((2, 3)), np.tile([1.0, 0, 0, 0], (2, 1)), "times that ascend, by 1 ns at least"),
        ([0.0, 1.0], [[0.0], [1.0, 2.0]], np.tile([1.0, 0, 0, 0], (2, 1)), "positions: found .*, expected numbers"),
        (iter([0.0, 1.0]), np.zeros((2, 3)), np.tile([1.0, 0, 0, 0], (2, 1)), "times: found .*, expected numbers"),
        ([0.0, 0.0], np.zeros((2, 3)), np.tile([1.0, 0, 0, 0], (2, 1)), "times: found 0 s and then 0 s, expected times that"),
        (
            [0.0, 1.0],
            np.zeros((2, 3)),
            np.zeros((2, 4)),
            "orientations_wxyz: found length 0, expected unit quaternions",
        ),
        ([0.0], np.zeros((1, 3)), [[1.004, 0, 0, 0]], "orientations_wxyz: found length 1.004, expected unit quaternions"),
        ([], np.zeros((0, 3)), np.zeros((0, 4)), "at least one pose"),
    ],
)
def test_arrays_that_are_no_poses_are_refused(times: Any, positions: Any, orientations: Any, said: str, tmp_path: Path) -> None:
    with pytest.raises(InvalidValueError, match=said):
        cc.write_poses(tmp_path / "poses.mcap", times, positions, orientations, CONTACTNETS_CUBE)
    assert not list(tmp_path.iterdir())
