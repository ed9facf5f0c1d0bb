"""Parts of recordings hold the selected tosses' messages byte for byte, and give the same tosses when they are read again."""

from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.errors import UnreadableInputError
from contact_curation.motion.pose_stream import FramePose
from contact_curation.motion.segmenter_config import SegmenterConfig
from contact_curation.motion.toss import Toss
from contact_curation.storage.bags.reader import BagReader
from contact_curation.storage.bags.records import OfferedQos, RawMessage
from contact_curation.storage.bags.writer import BagWriter
from contact_curation.storage.export import mcap as export_mcap
from contact_curation.storage.export.mcap import BagExport, export_bag
from contact_curation.storage.inputs.inputs import open_inputs
from contact_curation.storage.inputs.pose_messages import ODOMETRY, TF
from contact_curation.storage.inputs.pose_source import PoseTopicConfig
from contact_curation.storage.inputs.recording_notes import RULES_NOTE
from contact_curation.storage.inputs.records import InputsConfig
from test.motion.streams import PERIOD_NS, board_in_map, in_map, stream
from test.storage.inputs.test_inputs import (
    BODY,
    POSES,
    logged_late,
    mcap_file,
    ros1,
    rosbag2_mcap,
    rosbag2_sqlite,
    storage_file,
    tagslam,
)
from test.storage.pose_recordings import LOG_OFFSET_NS, recorded, transforms
from test.storage.tag_recordings import write_detections
from test.storage.test_tag_map_file import SHIPPED
from test.storage.written_bags import Sent, note, write_mcap, write_ours
from test.tagged_tosses import tagged_tosses, without_tags

GOLDEN = Path(__file__).resolve().parents[3] / "bags" / "golden.mcap"
FORCE = "lab_msgs/msg/Force"
DEFINITION = "float64 newton\n"


def tosses_in(path: Path, config: InputsConfig | None = None) -> dict[str, str]:
    found = [item for item in open_inputs([path], CONTACTNETS_CUBE, config) if isinstance(item, Toss)]
    return {toss.toss_id: toss.digest() for toss in found}


@cache
def golden_tosses() -> dict[str, str]:
    return tosses_in(GOLDEN)


def exported(bag: Path, ids: list[str], out: Path, config: InputsConfig | None = None) -> BagExport:
    return export_bag(bag, dict.fromkeys(ids, out), CONTACTNETS_CUBE, config or InputsConfig(), lambda _: None)


def raw(path: Path) -> list[RawMessage]:
    with BagReader(path) as reader:
        messages = list(reader.raw_messages())
        assert reader.losses == ()
        return messages


def rich_bag(path: Path) -> Path:
    """Two throws with what else a rig records: a latched description, words, a type that nobody knows, 200 times a second."""
    body = tagslam()
    with BagWriter(path) as bag:
        bag.note("lab", {"operator": "ü"})
        bag.note("rosbag2", {"serialized_metadata": "counts of the whole"})
        bag.write("/robot_description", note("<robot/>"), LOG_OFFSET_NS - 10, latched=True)
        bag.write("/mode", note("old"), LOG_OFFSET_NS - 9, latched=True)
        bag.write("/mode", note("idle"), LOG_OFFSET_NS - 8, latched=True)
        for one in body:
            latched = one.topic == "/tf_static"
            bag.write(one.topic, one.message, one.log_time_ns, latched=latched)
            if not latched:
                offered = OfferedQos(reliable=False, depth=7)
                bag.write_raw("/force", FORCE, DEFINITION, b"\0\1\0\0" + one.log_time_ns.to_bytes(8), one.log_time_ns + 1,
                              qos=offered, type_hash="RIHS01_" + 64 * "a", publish_time_ns=one.log_time_ns - 5)  # fmt: skip
    return path


@pytest.mark.parametrize("made", [mcap_file, rosbag2_mcap, rosbag2_sqlite, storage_file, ros1, logged_late])
def test_every_kind_of_bag_gives_its_kept_toss_and_no_other(tmp_path: Path, made: Callable[[Path], Path]) -> None:
    bag = made(tmp_path)
    all_of_it = tosses_in(bag)
    for number, toss_id in enumerate(all_of_it):
        out = tmp_path / f"part{number}.mcap"
        assert exported(bag, [toss_id], out).files == {toss_id: out}
        assert tosses_in(out) == {toss_id: all_of_it[toss_id]}
        whole = Counter((one.topic, one.type, one.log_time_ns, one.data) for one in raw(bag))
        part = Counter((one.topic, one.type, one.log_time_ns, one.data) for one in raw(out))
        assert part <= whole
        assert sum(part.values()) < 0.65 * sum(whole.values())


def test_all_topics_of_the_time_go_along_with_their_types_times_and_qualities_of_service(tmp_path: Path) -> None:
    bag, out = rich_bag(tmp_path / "rich.mcap"), tmp_path / "part.mcap"
    second = list(tosses_in(bag))[1]
    exported(bag, [second], out)
    whole, part = raw(bag), raw(out)
    assert [one for one in whole if one in part] == part, "as recorded, in the order of log times"
    first_ns, last_ns = (part[place].log_time_ns for place in (3, -1))
    assert [one.topic for one in part[:3]] == ["/robot_description", "/mode", "/tf_static"]
    assert b"idle" in part[1].data
    inside = [one for one in whole if first_ns <= one.log_time_ns <= last_ns]
    assert part[3:] == inside
    assert {one.topic for one in inside} == {BODY, "/force"}
    with BagReader(bag) as one, BagReader(out) as other:
        for topic in {message.topic for message in part}:
            assert other.qos(topic) == one.qos(topic)
        assert other.qos("/force") == OfferedQos(reliable=False, depth=7)
        assert other.note("lab") == {"operator": "ü"}
        assert "rosbag2" not in other.notes
        assert other.note("contact_curation.export") == {"input": str(bag), "sha256": one.sha256}
        assert other.note(RULES_NOTE) == {**one.note(RULES_NOTE), "tracker_noise": "1.0"}, "a short part tells it less well"


def test_several_tosses_of_a_real_layout_are_those_of_the_whole_and_nothing_else_is_in_the_file(tmp_path: Path) -> None:
    wanted = {toss_id: digest for place, (toss_id, digest) in enumerate(golden_tosses().items()) if place % 3 == 0}
    out = tmp_path / "part.mcap"
    report = exported(GOLDEN, list(wanted), out)
    assert tosses_in(out) == wanted
    assert not any("not selected" in line for line in report.warnings)
    assert out.stat().st_size < 0.5 * GOLDEN.stat().st_size


def test_a_file_per_toss(tmp_path: Path) -> None:
    wanted = dict(list(golden_tosses().items())[5:9])
    files = {toss_id: tmp_path / f"{toss_id}.mcap" for toss_id in wanted}
    assert export_bag(GOLDEN, files, CONTACTNETS_CUBE, InputsConfig(), lambda _: None).files == files
    assert {toss_id: tosses_in(file) for toss_id, file in files.items()} == {
        toss_id: {toss_id: digest} for toss_id, digest in wanted.items()
    }


def test_poses_that_are_latched_are_no_state_that_holds(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "a.mcap") as writer:
        for one in tagslam():
            writer.write(one.topic, one.message, one.log_time_ns, latched=True)
    second = list(tosses_in(writer.path))[1]
    exported(writer.path, [second], tmp_path / "part.mcap")
    stamps = [one.log_time_ns for one in raw(tmp_path / "part.mcap") if one.topic == BODY]
    assert max(later - earlier for earlier, later in pairwise(stamps)) < 10_000_000


def test_a_board_that_moves_is_taken_from_before_and_after_the_toss(tmp_path: Path) -> None:
    boards = [
        FramePose(one.stamp_ns, "map", "body_surface", board_in_map().pose) for one in (*POSES[::34], POSES[169], POSES[-1])
    ]
    both = recorded("/tagslam/odom/body_surface", ODOMETRY, boards) + recorded(BODY, ODOMETRY, in_map(POSES))
    bag = write_ours(tmp_path / "a.mcap", sorted(both, key=lambda one: one.log_time_ns))
    all_of_it = tosses_in(bag)
    assert len(all_of_it) == 2
    for toss_id, digest in all_of_it.items():
        out = tmp_path / f"{toss_id}.mcap"
        exported(bag, [toss_id], out)
        assert tosses_in(out) == {toss_id: digest}


def test_poses_on_tf_are_found_too(tmp_path: Path) -> None:
    board = Sent("/tf_static", LOG_OFFSET_NS, transforms([board_in_map()]))
    bag = write_ours(tmp_path / "a.mcap", [board, *recorded("/tf", TF, in_map(POSES))])
    first = dict(list(tosses_in(bag).items())[:1])
    exported(bag, list(first), tmp_path / "part.mcap")
    assert tosses_in(tmp_path / "part.mcap") == first


def check_that_the_camera_goes_along(bag: Path, kept: int, out: Path) -> None:
    """The export itself compares the toss with that of the whole bag."""
    config = InputsConfig(poses=PoseTopicConfig(tag_map=str(SHIPPED)))
    toss_id = list(tosses_in(bag, config))[kept]
    assert exported(bag, [toss_id], out, config).files == {toss_id: out}
    assert Counter(one.topic for one in raw(out))["/camera_info"] == 1


@pytest.mark.slow
def test_detections_take_a_camera_along_that_was_told_of_long_before_them(tmp_path: Path) -> None:
    images = tagged_tosses(2)
    second = next(place for place, one in enumerate(images) if one.stamp_ns - images[place - 1].stamp_ns > 10**8)
    bag = write_detections(tmp_path / "a.mcap", without_tags(images, 0, second - 1))
    check_that_the_camera_goes_along(bag, 0, tmp_path / "part.mcap")


@pytest.mark.slow
def test_detections_take_a_camera_along_that_was_told_of_long_after_them(tmp_path: Path) -> None:
    images = tagged_tosses(2)
    bag = write_detections(tmp_path / "a.mcap", images, info_after=len(images) - 1)
    check_that_the_camera_goes_along(bag, 0, tmp_path / "part.mcap")


def test_where_a_toss_needs_what_was_long_before_it_all_since_the_last_motion_is_taken(tmp_path: Path) -> None:
    """On a bounded board a body must have been away from it: so it was, a second before it is let go."""
    first = stream()[0]
    away = replace(first, pose=first.pose._replace(position=(2.0, 0.2, 0.2)))
    held = [replace(first, stamp_ns=first.stamp_ns + k * PERIOD_NS) for k in range(1, 150)]
    poses = [away, *held, *stream(start_ns=held[-1].stamp_ns + PERIOD_NS)]
    board = Sent("/tf_static", LOG_OFFSET_NS, transforms([board_in_map()]))
    bag = write_ours(tmp_path / "a.mcap", [board, *recorded(BODY, ODOMETRY, in_map(poses))])
    config = InputsConfig(segmenter=SegmenterConfig(region_x=(-1.0, 1.0)))
    expected = tosses_in(bag, config)
    assert len(expected) == 1
    exported(bag, list(expected), tmp_path / "part.mcap", config)
    assert tosses_in(tmp_path / "part.mcap", config) == expected


def test_a_toss_that_comes_out_otherwise_is_an_error_and_leaves_no_word_unsaid(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(export_mcap, "digests_in", lambda *_: {})
    with pytest.raises(UnreadableInputError, match="changed when read from a part of it, expected the same"):
        exported(GOLDEN, list(golden_tosses())[:1], tmp_path / "part.mcap")


def test_bags_without_definitions_get_those_of_ros(tmp_path: Path) -> None:
    nothing: dict[str, Any] = dict.fromkeys((ODOMETRY, TF), ("", ""))
    bag = write_mcap(tmp_path / "a.mcap", tagslam(), nothing)
    first = dict(list(tosses_in(bag).items())[:1])
    exported(bag, list(first), tmp_path / "part.mcap")
    assert all("covariance" in one.schema for one in raw(tmp_path / "part.mcap") if one.topic == BODY)
    assert tosses_in(tmp_path / "part.mcap") == first


def test_a_bag_without_wanted_tosses_gives_no_file(tmp_path: Path) -> None:
    assert exported(GOLDEN, ["nobody"], tmp_path / "part.mcap").files == {}
    assert list(tmp_path.iterdir()) == []
