"""TagSLAM calls the frames of `body_cube` and `body_surface` by their names alone; a board that nothing leads to is told of."""

from pathlib import Path
from typing import Any

import pytest

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.errors import MissingTopicError
from contact_curation.motion.pose_stream import FramePose
from contact_curation.storage.inputs.inputs import InputsConfig, Problem, open_inputs
from contact_curation.storage.inputs.pose_messages import ODOMETRY, POSE, TF
from contact_curation.storage.inputs.pose_source import PoseTopicConfig, TypedTopic, find_pose_source
from test.motion.streams import board_in_map, in_map, stream
from test.storage.pose_recordings import LOG_OFFSET_NS, recorded, transforms
from test.storage.written_bags import Sent, write_ours

POSES = stream()
BODY = "/tagslam/odom/body_cube"


def read(path: Path, **poses: Any) -> tuple[list[str], list[str]]:
    """Kinds of what is found, and the lines of what is not."""
    found = list(open_inputs([path], CONTACTNETS_CUBE, InputsConfig(PoseTopicConfig(**poses))))
    problems = [str(one) for one in found if isinstance(one, Problem)]
    return [type(one).__name__ for one in found if not isinstance(one, Problem)], problems


def board(parent: str, child: str, static: bool = False) -> Sent:
    pose = FramePose(0, parent, child, board_in_map().pose, static=True)
    return Sent("/tf_static" if static else "/tf", LOG_OFFSET_NS, transforms([pose]))


def test_frames_that_are_called_by_the_name_alone_are_found_on_tf(tmp_path: Path) -> None:
    moved = [FramePose(one.stamp_ns, "map", "cube", one.pose) for one in in_map(POSES)]
    path = write_ours(tmp_path / "a.mcap", [board("map", "surface", static=True), *recorded("/tf", TF, moved)])
    assert read(path) == (["Toss"], [])


def test_a_static_body_that_is_on_tf_only_is_the_board(tmp_path: Path) -> None:
    boards = [FramePose(one.stamp_ns, "map", "surface", board_in_map().pose) for one in POSES]
    sent = [*recorded("/tf", TF, boards), *recorded(BODY, ODOMETRY, in_map(POSES))]
    assert read(write_ours(tmp_path / "a.mcap", sent)) == (["Toss"], [])


def test_poses_that_nothing_leads_to_the_board_are_taken_as_given_on_it_but_not_in_silence(tmp_path: Path) -> None:
    elsewhere = [FramePose(one.stamp_ns, "world", "body_cube", one.pose) for one in POSES]
    path = write_ours(tmp_path / "a.mcap", recorded("/pose", POSE, elsewhere))
    found, (line,) = read(path)
    assert found == ["Toss"]
    assert "poses are given in frame 'world' and nothing in the recording leads to the board 'body_surface'" in line
    assert line.endswith("if so, say --board-frame ''")
    assert read(path, board_frame="") == (["Toss"], [])
    assert read(path, board_frame="world") == (["Toss"], [])


def test_a_topic_that_is_called_like_the_frame_of_the_board_is_the_bodys_where_it_is_named(tmp_path: Path) -> None:
    poses = [FramePose(one.stamp_ns, "odom", "body_cube", one.pose) for one in POSES]
    path = write_ours(tmp_path / "a.mcap", recorded("/odom", ODOMETRY, poses))
    assert read(path, topic="/odom", board_frame="odom") == (["Toss"], [])


def test_frames_may_be_named_with_the_slash_of_ros_1() -> None:
    named = PoseTopicConfig(body_frame="/tool", board_frame="/table")
    assert named == PoseTopicConfig(body_frame="tool", board_frame="table")


def test_where_no_type_carries_poses_those_that_do_are_listed() -> None:
    path = [TypedTopic("/planned/cube", "nav_msgs/msg/Path")]
    with pytest.raises(MissingTopicError, match=rf"Path\); expected .*of a type that is read: {ODOMETRY}, .*{TF}"):
        find_pose_source("a.mcap", path, "cube", PoseTopicConfig())
