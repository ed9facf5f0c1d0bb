"""Whatever the input, out come its tosses; what is left out is a line, and the other inputs go on."""

import itertools
import os
import shutil
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from rosbags.rosbag2 import StoragePlugin

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.errors import InvalidValueError, MissingTopicError
from contact_curation.geometry.scalars import ScalarPose
from contact_curation.motion.calibration import RigCalibration, apply_calibration
from contact_curation.motion.gate_config import GateConfig
from contact_curation.motion.pose_stream import FramePose, FrameRun, PoseRun
from contact_curation.motion.segmenter_config import SegmenterConfig
from contact_curation.motion.toss import Rejected, Toss
from contact_curation.pipeline.diagnosis import diagnose
from contact_curation.pipeline.reading import ReadingConfig
from contact_curation.storage.inputs.bag_tosses import in_order_of_stamps
from contact_curation.storage.inputs.inputs import InputsConfig, InputSummary, Problem, open_inputs
from contact_curation.storage.inputs.pose_messages import (
    ODOMETRY,
    POSE,
    POSE_ARRAY,
    POSE_MESSAGES,
    TAG_FRAMES,
    TF,
    TRANSFORM,
)
from contact_curation.storage.inputs.pose_runs import MeasuredMessage, MeasuredRun
from contact_curation.storage.inputs.pose_source import PoseTopicConfig, TypedTopic, find_pose_source
from test.motion.streams import PERIOD_NS, board_in_map, in_map, noisy, stream
from test.storage.datasets.test_tagslam_bag import save_contactnets, synthetic_toss
from test.storage.pose_recordings import LOG_OFFSET_NS, recorded, transforms
from test.storage.written_bags import NOETIC, Sent, note, write_ours, write_ros1, write_rosbag2

GOLDEN = Path(__file__).resolve().parents[3] / "bags" / "golden.mcap"
BODY = "/tagslam/odom/body_cube"
POSES = [*stream(), *stream(start_ns=9_000_000_000)]
IN_MAP = in_map(POSES)
ON_BOARD = [FramePose(one.stamp_ns, "body_surface", "body_cube", one.pose) for one in POSES]

Items = list[Toss | Rejected | Problem]


def tagslam(store: object = None) -> list[Sent]:
    """Two throws over a static board, as TagSLAM gives them; in ROS 1 with the older store."""
    chosen = {} if store is None else {"store": store}
    board = Sent("/tf_static", LOG_OFFSET_NS, transforms([board_in_map()], **chosen))
    return [board, *recorded(BODY, ODOMETRY, IN_MAP, **chosen)]


def opened(*paths: Path, **config: object) -> tuple[Items, list[InputSummary]]:
    inputs = open_inputs(paths, CONTACTNETS_CUBE, InputsConfig(**config))  # type: ignore[arg-type]
    return list(inputs), inputs.summaries


def kinds(items: Items) -> list[str]:
    return [type(item).__name__ for item in items]


def lines(items: Items) -> list[str]:
    return [str(item) for item in items if isinstance(item, Problem)]


def ros1(folder: Path) -> Path:
    return write_ros1(folder / "a.bag", tagslam(NOETIC))


def rosbag2_sqlite(folder: Path) -> Path:
    return write_rosbag2(folder / "a", tagslam(), StoragePlugin.SQLITE3)


def rosbag2_mcap(folder: Path) -> Path:
    return write_rosbag2(folder / "a", tagslam(), StoragePlugin.MCAP)


def storage_file(folder: Path) -> Path:
    return next(rosbag2_sqlite(folder).glob("*.db3"))


def mcap_file(folder: Path) -> Path:
    return write_ours(folder / "a.mcap", tagslam())


@pytest.mark.parametrize("made", [mcap_file, rosbag2_mcap, rosbag2_sqlite, storage_file, ros1])
def test_every_kind_of_bag_gives_the_same_tosses(tmp_path: Path, made: Callable[[Path], Path]) -> None:
    items, (summary,) = opened(made(tmp_path))
    expected, _ = opened(mcap_file(tmp_path))
    assert kinds(items) == ["Toss", "Toss"]
    assert [item.digest() for item in items if isinstance(item, Toss)] == [
        item.digest() for item in expected if isinstance(item, Toss)
    ]
    assert summary.topic == BODY
    assert (summary.first_stamp_ns, summary.last_stamp_ns) == (POSES[0].stamp_ns, POSES[-1].stamp_ns)
    assert summary.counts == {"poses": len(POSES), "tosses": 2}
    assert len(summary.sha256) == 64


def test_messages_that_were_logged_up_to_30_ms_out_of_order_cost_no_toss(tmp_path: Path) -> None:
    late = np.random.default_rng(3).integers(0, 30_000_000, len(POSES) + 1)
    sent = [one._replace(log_time_ns=one.log_time_ns + int(by)) for one, by in zip(tagslam(), late, strict=True)]
    shuffled = write_ours(tmp_path / "late.mcap", sorted(sent, key=lambda one: one.log_time_ns))
    items, (summary,) = opened(shuffled)
    expected, (sound,) = opened(mcap_file(tmp_path))
    assert [item.digest() for item in items if isinstance(item, Toss)] == [
        item.digest() for item in expected if isinstance(item, Toss)
    ]
    assert summary.counts == sound.counts == {"poses": len(POSES), "tosses": 2}


def to_nothing(split: Path) -> None:
    split.symlink_to("/nowhere/at.mcap")


def to_itself(split: Path) -> None:
    split.symlink_to(split.name)


def to_a_device(split: Path) -> None:
    split.symlink_to("/dev/zero")


@pytest.mark.parametrize("spoilt", [to_nothing, to_itself, to_a_device, os.mkfifo, Path.mkdir])
def test_a_split_that_is_no_file_costs_only_itself_and_is_not_waited_for(
    tmp_path: Path, spoilt: Callable[[Path], None]
) -> None:
    folder = tmp_path / "split"
    folder.mkdir()
    half = len(POSES) // 2
    write_ours(folder / "split_0.mcap", tagslam()[:half])
    write_ours(folder / "split_1.mcap", tagslam()[half:])
    spoilt(folder / "split_2.mcap")
    items, (summary,) = opened(folder)
    assert kinds(items) == ["Toss", "Toss"]
    (line,) = summary.losses
    assert "split_2.mcap: is no file" in line
    assert "left out, the other files of the bag are read" in line


@pytest.mark.parametrize("places", [len(POSES) // 2, len(POSES)])
def test_a_board_that_is_logged_late_costs_no_toss(tmp_path: Path, places: int) -> None:
    board, *sent = tagslam()
    late = board._replace(log_time_ns=sent[places - 1].log_time_ns)
    items, _ = opened(write_ours(tmp_path / "late.mcap", [*sent[:places], late, *sent[places:]]))
    assert kinds(items) == ["Toss", "Toss"]


def logged_late(folder: Path, sent: Sequence[Sent] = ()) -> Path:
    """Messages, by default the poses of `tagslam`, that were logged up to a fifth of a second late each."""
    board, *poses = tagslam()
    sent = sent or poses
    late = (1e9 * np.random.default_rng(3).uniform(0.0, 0.2, len(sent))).astype(np.int64).tolist()
    logged = [one._replace(log_time_ns=one.log_time_ns + by) for one, by in zip(sent, late, strict=True)]
    return write_ours(folder / "late.mcap", [board, *sorted(logged, key=lambda one: one.log_time_ns)])


def test_messages_that_are_logged_up_to_a_fifth_of_a_second_late_each_cost_no_toss(tmp_path: Path) -> None:
    items, _ = opened(logged_late(tmp_path))
    assert [kind for kind in kinds(items) if kind != "Problem"] == ["Toss", "Toss"], lines(items)


def test_messages_with_several_transforms_that_are_logged_late_cost_no_toss(tmp_path: Path) -> None:
    sent = [Sent("/tf", LOG_OFFSET_NS + one.stamp_ns, transforms([replace(one, child="robot"), one])) for one in IN_MAP]
    items, _ = opened(logged_late(tmp_path, sent))
    assert [kind for kind in kinds(items) if kind != "Problem"] == ["Toss", "Toss"], lines(items)


@pytest.mark.parametrize("size", [2e-3, 3e-3])
def test_stamps_that_jitter_by_milliseconds_in_a_recording_cost_no_toss_and_exchange_no_poses(
    tmp_path: Path, size: float
) -> None:
    by = np.random.default_rng(5).normal(0.0, 1e9 * size, len(POSES)).astype(np.int64)
    late = in_map([replace(one, stamp_ns=one.stamp_ns + int(off)) for one, off in zip(POSES, by, strict=True)])
    sent = [one._replace(log_time_ns=logged.log_time_ns) for one, logged in zip(recorded(BODY, ODOMETRY, late), tagslam()[1:])]
    items, _ = opened(write_ours(tmp_path / "jitter.mcap", [tagslam()[0], *sent]))
    assert [kind for kind in kinds(items) if kind != "Problem"] == ["Toss", "Toss"]
    assert "header stamps jitter by" in lines(items)[0]
    jittering = [MeasuredMessage(BODY, one.log_time_ns, (pose,)) for one, pose in zip(sent, late, strict=True)]
    assert list(in_order_of_stamps(jittering)) == jittering


def test_order_of_stamps_is_bounded_in_time_and_number() -> None:
    def said(log_time_ns: int, stamp_ns: int) -> MeasuredMessage:
        return MeasuredMessage("/odom", log_time_ns, (FramePose(stamp_ns, "board", "cube", ON_BOARD[0].pose),))

    jump = [said(1_000_000_000, 5_000_000_000), said(1_010_000_000, 3_000_000_000)]
    assert list(in_order_of_stamps(jump)) == jump
    wrong = [said(10_000_000 * k, 10_000_000 * k - 29_000_000 * (k % 5 == 4)) for k in range(100, 130)]
    assert list(in_order_of_stamps(wrong)) == wrong  # no recorder's order explains them
    endless = in_order_of_stamps(said(7, number) for number in itertools.count())
    assert next(endless) == said(7, 0)


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 10**6), st.lists(st.integers(1, 199), max_size=8))
def test_messages_are_put_in_order_of_stamps_in_runs_as_one_by_one(seed: int, cuts: list[int]) -> None:
    chance = np.random.default_rng(seed)
    steps = chance.choice([1, 7, 30, 7, 7, 7, 200, 0], 200) * 1_000_000
    sizes, two_topics = sorted({0, 200, *cuts}), chance.integers(2)
    is_late = chance.random(200) < chance.choice([0.0, 0.01, 0.1])
    is_late[sizes[:-1]] |= chance.random(len(sizes) - 1) < 0.5
    logged = np.cumsum(steps)
    stamps = logged - is_late * chance.choice([12, 30, -2_000], 200) * 1_000_000
    one = np.ones((200, 1))
    poses = PoseRun(stamps, one * [0.0, 0.0, 1.0], one * [1.0, 0.0, 0.0, 0.0])
    whole = MeasuredRun("/odom", logged, FrameRun("board", "cube", poses))
    runs = [whole.part(start, stop) for start, stop in itertools.pairwise(sizes)]
    runs = [run._replace(topic="/other") if two_topics and place % 3 == 2 else run for place, run in enumerate(runs)]
    singles = [message for run in runs for message in run.messages()]
    found = [message for one in in_order_of_stamps(runs) for message in one.messages()]
    assert repr(found) == repr(list(in_order_of_stamps(singles)))


def test_the_end_of_a_run_stays_a_run() -> None:
    stamps, one = np.arange(200) * 7_000_000, np.ones((200, 1))
    poses = PoseRun(stamps, one * [0.0, 0.0, 1.0], one * [1.0, 0.0, 0.0, 0.0])
    whole = MeasuredRun("/odom", stamps, FrameRun("board", "cube", poses))
    turned = whole._replace(measured=FrameRun("map", "cube", poses)).part(140, 200)
    given = list(in_order_of_stamps([whole.part(0, 60), whole.part(60, 140), turned]))
    assert all(isinstance(run, MeasuredRun) for run in given)
    assert [message for run in given for message in run.messages()] == [*whole.part(0, 140).messages(), *turned.messages()]


@pytest.mark.parametrize("type_name", [*POSE_MESSAGES])
def test_poses_given_on_the_board_need_no_frames(tmp_path: Path, type_name: str) -> None:
    bag = write_rosbag2(tmp_path / "a", recorded("/pose", type_name, ON_BOARD), StoragePlugin.MCAP)
    items, _ = opened(bag, poses=PoseTopicConfig(array_index=int(type_name == POSE_ARRAY)))
    assert kinds(items) == ["Toss", "Toss"]


@pytest.mark.parametrize("before", [0, 300])
@pytest.mark.parametrize("type_name", [ODOMETRY, TRANSFORM])
def test_of_a_topic_with_several_bodies_the_body_s_own_poses_are_taken(tmp_path: Path, type_name: str, before: int) -> None:
    places = [replace(one, child="wand") for one in ON_BOARD[::-1]]
    wand = [replace(one, stamp_ns=other.stamp_ns + 2_000_000) for one, other in zip(places, ON_BOARD, strict=True)]
    wand = [replace(wand[0], stamp_ns=wand[0].stamp_ns - k * PERIOD_NS) for k in range(before, 0, -1)] + wand
    both = recorded("/poses", type_name, wand) + recorded("/poses", type_name, ON_BOARD)
    bag = write_ours(tmp_path / "a.mcap", sorted(both, key=lambda one: one.log_time_ns))
    items, _ = opened(bag)
    assert kinds(items) == ["Toss", "Toss"]
    items, _ = opened(bag, poses=PoseTopicConfig(body_frame="other"))
    assert "/poses has poses of 'body_cube', 'wand', none of them cube's: name one with --body-frame" in "\n".join(lines(items))


def test_poses_may_be_only_on_tf(tmp_path: Path) -> None:
    board = Sent("/tf_static", LOG_OFFSET_NS, transforms([board_in_map()]))
    items, (summary,) = opened(write_ours(tmp_path / "a.mcap", [board, *recorded("/tf", TF, IN_MAP)]))
    assert kinds(items) == ["Toss", "Toss"]
    assert summary.topic == "/tf"


def test_a_board_with_odometry_of_its_own_is_followed(tmp_path: Path) -> None:
    boards = [FramePose(one.stamp_ns, "map", "body_surface", board_in_map().pose) for one in POSES]
    both = recorded("/tagslam/odom/body_surface", ODOMETRY, boards) + recorded(BODY, ODOMETRY, IN_MAP)
    bag = write_ours(tmp_path / "a.mcap", sorted(both, key=lambda one: one.log_time_ns))
    assert kinds(opened(bag)[0]) == ["Toss", "Toss"]


def test_the_golden_bag_gives_its_21_tosses_and_keeps_3_back() -> None:
    items, (summary,) = opened(GOLDEN)
    assert (summary.counts["tosses"], summary.counts["rejected"]) == (21, 3)
    assert [number for number, item in enumerate(items) if isinstance(item, Rejected)] == [5, 12, 19]
    ungated, _ = opened(GOLDEN, gates=GateConfig(enabled=False))
    assert kinds(ungated).count("Toss") == 22, "only the spike is the gates'; the segmenter sees the other two"


def test_a_folder_of_contactnets_files_passes_the_gates_too(tmp_path: Path) -> None:
    good = synthetic_toss()
    positions = good.positions.copy()
    positions[30] += [0.005, 0.0, 0.0]
    save_contactnets(tmp_path, 0, good)
    save_contactnets(tmp_path, 10, synthetic_toss(0.18))
    save_contactnets(tmp_path, 9, type(good)(**{**vars(good), "positions": positions}))
    (tmp_path / "2.pt").write_bytes(b"nothing")
    items, (summary,) = opened(tmp_path)
    assert kinds(items) == ["Toss", "Problem", "Rejected", "Toss"]
    assert lines(items)[0].startswith(f"{tmp_path}: 2.pt: found no plain tensor")
    assert summary.counts == {"tosses": 2, "rejected": 1, "poses": 2 * good.frames + synthetic_toss(0.18).frames}
    assert kinds(opened(tmp_path / "10.pt")[0]) == ["Toss"]


def test_a_folder_of_other_pt_files_is_one_line(tmp_path: Path) -> None:
    for number in range(5):
        torch.save({"weights": torch.zeros(3)}, tmp_path / f"{number}.pt")
    items, summaries = opened(tmp_path)
    (line,) = lines(items)
    assert line.startswith(f"{tmp_path}: found 5 .pt files, none of them a toss of ContactNets', e.g. 0.pt: found a dict")
    assert summaries == []


@pytest.mark.parametrize(
    ("name", "content", "why"),
    [
        ("empty", None, "is a folder without storage files"),
        ("gone", b"", "No such file"),
        ("a.mcap", b"nothing", ""),
        ("a.db3", b"nothing", ""),
        ("a.bag", b"nothing", ""),
        ("a.pt", b"nothing", "found no plain tensor"),
        ("a.txt", b"nothing", ""),
    ],
)
def test_a_bad_input_is_one_line_and_the_others_go_on(tmp_path: Path, name: str, content: bytes | None, why: str) -> None:
    bad = tmp_path / name
    if content is None:
        bad.mkdir()
    elif name != "gone":
        bad.write_bytes(content)
    items, summaries = opened(bad, mcap_file(tmp_path / ".." if name == "a.mcap" else tmp_path))
    assert kinds(items) == ["Problem", "Toss", "Toss"]
    assert lines(items)[0].startswith(f"{bad}: ")
    assert why in lines(items)[0]
    assert lines(items)[0].count(str(bad)) == 1
    assert "\n" not in lines(items)[0]
    assert len(summaries) == 1


def test_a_bag_without_poses_lists_what_it_has(tmp_path: Path) -> None:
    bag = write_ours(tmp_path / "a.mcap", [Sent("/note", 5, note("hello"))])
    kinds_read = ", ".join((*POSE_MESSAGES, TF, *TAG_FRAMES))
    expected = f"one topic with poses of cube; name it (`topic`) if there are several, of a type that is read: {kinds_read}"
    assert lines(opened(bag)[0]) == [f"{bag}: found /note (std_msgs/msg/String); expected {expected}"]


def test_a_bag_without_a_toss_says_so(tmp_path: Path) -> None:
    bag = write_ours(tmp_path / "a.mcap", recorded("/pose", POSE, ON_BOARD[:15]))
    expected = "motions that fall freely (in metres, z up on the board) and come to rest; `contact-curation check` says why"
    assert lines(opened(bag)[0]) == [f"{bag}: found no toss in 15 poses of /pose, expected {expected}"]


def test_poses_that_come_too_seldom_are_told_of(tmp_path: Path) -> None:
    for every, told in ((2, 0), (5, 1)):
        bag = write_ours(tmp_path / f"{every}.mcap", recorded("/pose", POSE, ON_BOARD[::every]))
        assert sum("Hz, expected 60 Hz or more: tosses may go unseen" in line for line in lines(opened(bag)[0])) == told


def test_poses_that_nothing_connects_to_the_board_are_counted(tmp_path: Path) -> None:
    elsewhere = Sent(
        "/tf_static", LOG_OFFSET_NS, transforms([FramePose(0, "world", "body_surface", IN_MAP[0].pose, static=True)])
    )
    bag = write_ours(tmp_path / "a.mcap", [elsewhere, *recorded(BODY, ODOMETRY, IN_MAP)])
    first, second = lines(opened(bag)[0])
    assert f"{len(POSES)} poses were left out, the first one, of 'body_cube' at 5.000000 s, for this: board: found" in first
    assert "expected poses that lead from frame 'body_surface' to frame 'map'" in first
    assert "frames here: body_surface, world" in first
    assert f"found no toss in 0 poses of {BODY}: found body_cube, body_surface, map, world, expected frames" in second


@pytest.mark.parametrize("of_others", [False, True])
def test_a_recording_of_the_board_in_the_body_is_told_to_publish_the_inverse(of_others: bool, tmp_path: Path) -> None:
    frames = ("body_cube", "body_surface") if not of_others else ("body_surface", "tag")
    inverted = [FramePose(one.stamp_ns, *frames, one.pose) for one in ON_BOARD]
    fixed = FramePose(0, "body_cube", "tag36h11:0", ON_BOARD[0].pose, static=True)  # a tag of the body is nothing inverted
    sent = [Sent("/tf_static", LOG_OFFSET_NS, transforms([fixed]))]
    sent += [Sent("/tf", one.stamp_ns + LOG_OFFSET_NS, transforms([one])) for one in inverted]
    bag = write_ours(tmp_path / "a.mcap", sent)
    said = "found poses of others in body_cube, expected those of body_cube in others: publish the inverse"
    for line in (lines(opened(bag)[0])[-1], diagnose([bag], ReadingConfig(CONTACTNETS_CUBE)).verdict):
        assert (said in line) != of_others, line


def test_poses_that_are_none_are_told_by_kind_and_break_their_toss(tmp_path: Path) -> None:
    broken = list(ON_BOARD)
    broken[50] = FramePose(broken[50].stamp_ns, "table", "body_cube", ScalarPose((0.0, 0.0, 0.1), (0.0, 0.0, 0.0, 0.0)))
    broken[55] = broken[54]
    items, (summary,) = opened(write_ours(tmp_path / "a.mcap", recorded("/pose", POSE, broken)))
    assert kinds(items) == ["Rejected", "Toss", "Problem", "Problem"]
    assert "quaternion norm: found 0, expected 1" in lines(items)[0]
    assert "stamp: found the same one twice" in lines(items)[1]
    assert (summary.counts["pose"], summary.counts["stamp"]) == (1, 1)


def test_where_every_pose_is_none_no_frames_are_asked_for(tmp_path: Path) -> None:
    nowhere = ScalarPose((0.0, 0.0, 0.1), (0.0, 0.0, 0.0, 0.0))
    broken = [replace(one, pose=nowhere) for one in ON_BOARD]
    _, last = lines(opened(write_ours(tmp_path / "a.mcap", recorded("/pose", POSE, broken)))[0])
    assert last.endswith("found no toss in 0 poses of /pose, since all were left out")


def test_a_bag_that_defines_odometry_its_own_way_is_read_as_far_as_it_goes(tmp_path: Path) -> None:
    class Strange:
        header = None

    from contact_curation.storage.bags.records import BagMessage
    from contact_curation.storage.inputs.bag_tosses import BagTosses
    from contact_curation.storage.provenance import TossProvenance

    source = find_pose_source("a", [TypedTopic(BODY, ODOMETRY)], "cube", PoseTopicConfig())
    tosses = BagTosses(TossProvenance("a"), source, CONTACTNETS_CUBE, InputsConfig())
    assert list(tosses.taken(tosses.measured(BagMessage(BODY, ODOMETRY, 5, Strange())), BODY)) == []
    assert "found fields that are not its own" in next(tosses.left_out())


def test_the_same_toss_in_two_inputs_counts_once(tmp_path: Path) -> None:
    bag = mcap_file(tmp_path)
    copy = Path(shutil.copy(bag, tmp_path / "copy.mcap"))
    items, summaries = opened(bag, copy)
    assert kinds(items) == ["Toss", "Toss", "Problem", "Problem"]
    assert all(f"is left out: found the same one in {bag}, expected each once" in line for line in lines(items))
    assert all(line.startswith(str(copy)) for line in lines(items))
    assert len(summaries) == 2


def cut_short(folder: Path) -> Path:
    """The recording of `mcap_file`, which ends during the second throw."""
    return write_ours(folder / "cut.mcap", tagslam()[: 1 + len(POSES) * 3 // 4])


def test_a_whole_toss_takes_the_place_of_one_that_was_cut_short_whichever_comes_first(tmp_path: Path) -> None:
    cut, whole = cut_short(tmp_path), mcap_file(tmp_path)
    assert kinds(opened(cut)[0]) == ["Toss", "Rejected"]
    expected = {item.toss_id: item.digest() for item in opened(whole)[0] if isinstance(item, Toss)}
    orders = {
        (cut, whole): ["Toss", "Rejected", "Problem", "Problem", "Toss"],
        (whole, cut): ["Toss", "Toss", "Problem", "Problem"],
    }
    for paths, expected_kinds in orders.items():
        items, _ = opened(*paths)
        assert kinds(items) == expected_kinds
        assert {item.toss_id: item.digest() for item in items if isinstance(item, Toss)} == expected
        assert lines(items)[1].startswith(f"{cut}: toss ")
        assert lines(items)[1].endswith(f"is left out: found it rejected here and accepted in {whole}, expected each once")


def test_another_toss_under_the_same_id_is_not_taken_for_the_first(tmp_path: Path) -> None:
    for name, height in (("a", 0.2), ("b", 0.25)):
        (tmp_path / name).mkdir()
        save_contactnets(tmp_path / name, 7, synthetic_toss(height))
    items, _ = opened(tmp_path / "a", tmp_path / "b")
    assert kinds(items) == ["Toss", "Problem"]
    assert "toss 7 is left out: found another one of that id in" in lines(items)[0]


def test_while_reading_the_recording_of_each_toss_is_known(tmp_path: Path) -> None:
    bag = mcap_file(tmp_path)
    save_contactnets(tmp_path, 7, synthetic_toss())
    inputs = open_inputs([bag, tmp_path / "7.pt"], CONTACTNETS_CUBE)
    origins = [inputs.origin for item in inputs if isinstance(item, Toss)]
    assert [(origin.input, origin.topic) for origin in origins] == [(str(bag), BODY)] * 2 + [(str(tmp_path / "7.pt"), "")]
    assert origins[0].input_sha256 == inputs.summaries[0].sha256


def test_tosses_of_any_input_are_corrected_before_the_gates_see_them(tmp_path: Path) -> None:
    rig = RigCalibration(normal=(0.02, -0.02, 1.0), centre=(0.3, 0.1, 0.0), scale=1.02)
    (tmp_path / "tosses").mkdir()
    save_contactnets(tmp_path / "tosses", 1, synthetic_toss())
    for path in (mcap_file(tmp_path), tmp_path / "tosses"):
        seen = [item for item in opened(path)[0] if isinstance(item, Toss)]
        tilted = [item for item in opened(path, rig=rig)[0] if isinstance(item, Rejected)]
        assert [one.toss.digest() for one in tilted] == [apply_calibration(toss, rig).digest() for toss in seen] != []
        assert all(any("tilt at rest: found 1." in reason for reason in one.reasons) for one in tilted)


def test_tosses_as_stored_have_headings_that_no_rig_had() -> None:
    with pytest.raises(InvalidValueError, match=r"rig: found RigCalibration\(.*scale=1.01.*\), expected none here"):
        InputsConfig(as_stored=True, rig=RigCalibration(scale=1.01))


def test_a_topic_can_be_named_where_several_would_do(tmp_path: Path) -> None:
    sent = recorded("/a", POSE, ON_BOARD) + recorded("/b", POSE, ON_BOARD)
    bag = write_ours(tmp_path / "a.mcap", sorted(sent, key=lambda one: one.log_time_ns))
    assert kinds(opened(bag)[0]) == ["Problem"]
    items, (summary,) = opened(bag, poses=PoseTopicConfig(topic="/b"))
    assert kinds(items) == ["Toss", "Toss"]
    assert summary.topic == "/b"


@pytest.mark.parametrize("name", ["/ground_truth", "/trajectory_thrower/grip"])
def test_poses_that_no_tracker_measured_are_taken_only_by_their_name(name: str) -> None:
    unmeasured = TypedTopic(name, ODOMETRY)
    with pytest.raises(MissingTopicError):
        find_pose_source("a", [unmeasured], "cube", PoseTopicConfig())
    other = TypedTopic("/my_tracker/pose", ODOMETRY)
    assert find_pose_source("a", [unmeasured, other], "cube", PoseTopicConfig()).body == other
    assert find_pose_source("a", [unmeasured, other], "cube", PoseTopicConfig(topic=name)).body == unmeasured


def test_poses_noisier_than_was_told_are_a_line_and_with_what_it_says_their_tosses_are_found(tmp_path: Path) -> None:
    scattered = in_map(noisy(POSES, 8.0))
    board = Sent("/tf_static", LOG_OFFSET_NS, transforms([board_in_map()]))
    path = write_ours(tmp_path / "a.mcap", [board, *recorded(BODY, ODOMETRY, scattered)])
    items, _ = opened(path, segmenter=SegmenterConfig(tracker_noise=1.0))
    assert "Toss" not in kinds(items)
    (line,) = (line for line in lines(items) if "scatter" in line)
    noise = float(line.partition("say segmenter.tracker_noise=")[2].partition(",")[0])
    told, _ = opened(path, segmenter=SegmenterConfig(tracker_noise=noise))
    assert kinds(told) == ["Toss", "Toss"]


def test_bounds_follow_the_noise_of_a_recording_and_a_line_says_since_when(tmp_path: Path) -> None:
    """The first toss is over before anything is known of the noise."""
    scattered = in_map(noisy([*stream(), *stream(start_ns=8_000_000_000), *stream(start_ns=11_000_000_000)], 5.0))
    board = Sent("/tf_static", LOG_OFFSET_NS, transforms([board_in_map()]))
    items, _ = opened(write_ours(tmp_path / "a.mcap", [board, *recorded(BODY, ODOMETRY, scattered)]))
    assert kinds(items)[-2:] == ["Toss", "Toss"] or kinds(items)[1:3] == ["Toss", "Toss"], kinds(items)
    (line,) = (line for line in lines(items) if "scatter" in line)
    assert "found positions that scatter by 0.1" in line
    assert "s after the first pose on the bounds of segmenting and quality checks are those for" in line
