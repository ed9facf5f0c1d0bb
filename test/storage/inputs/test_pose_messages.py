"""Every pose message says the same pose, whoever decoded it; what is no pose is never repaired."""

from dataclasses import replace
from math import nan
from typing import Any

import pytest
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Odometry

from contact_curation.errors import InvalidValueError, MissingTopicError
from contact_curation.geometry.scalars import ScalarPose
from contact_curation.motion.pose_stream import BadPose, FramePose
from contact_curation.storage.inputs.pose_messages import (
    NAMED_POSES,
    ODOMETRY,
    POSE,
    POSE_ARRAY,
    POSE_MESSAGES,
    POSE_WITH_COVARIANCE,
    RIGID_BODIES,
    TF,
    measured_pose,
    measured_transforms,
)
from contact_curation.storage.inputs.pose_source import PoseSource, PoseTopicConfig, TypedTopic, find_pose_source
from test.storage.pose_recordings import message, transforms
from test.storage.written_bags import NOETIC

WXYZ = (0.5, -0.5, 0.1, 0.7)
ONE = FramePose(1_600_000_000_123_456_789, "map", "body_cube", ScalarPose((1.0, 2.0, 3.0), WXYZ))
STATIC = FramePose(5, "map", "body_surface", ONE.pose, static=True)


@pytest.mark.parametrize("type_name", POSE_MESSAGES)
def test_every_type_gives_the_same_pose_with_w_in_front_and_the_header_s_stamp(type_name: str) -> None:
    assert measured_pose(type_name, message(type_name, ONE), "body_cube", index=1) == ONE


@pytest.mark.parametrize("type_name", [POSE, ODOMETRY])
def test_ros_1_messages_and_their_leading_slashes_are_understood(type_name: str) -> None:
    slashed = FramePose(ONE.stamp_ns, "/map", "/body_cube", ONE.pose)
    assert measured_pose(type_name, message(type_name, slashed, NOETIC), "body_cube") == ONE


@pytest.mark.parametrize(("made", "type_name"), [(PoseStamped(), POSE), (Odometry(), ODOMETRY)])
def test_messages_of_rclpy_are_read_by_the_same_attributes(made: Any, type_name: str) -> None:
    made.header.stamp.sec, made.header.stamp.nanosec = divmod(ONE.stamp_ns, 10**9)
    made.header.frame_id = "map"
    pose = made.pose if type_name == POSE else made.pose.pose
    pose.position.x, pose.position.y, pose.position.z = ONE.pose.position
    pose.orientation.w, pose.orientation.x, pose.orientation.y, pose.orientation.z = WXYZ
    assert measured_pose(type_name, made, "body_cube") == ONE


def test_a_type_that_is_added_to_the_table_is_found_and_read(monkeypatch: pytest.MonkeyPatch) -> None:
    tracked = "my_msgs/msg/Tracked"
    monkeypatch.setitem(POSE_MESSAGES, tracked, lambda message, child, index: ONE)
    source = find_pose_source("bag", [TypedTopic("/tracked", tracked)], "cube", PoseTopicConfig())
    assert source.measured("/tracked", object()) == (ONE,)


@pytest.mark.parametrize("type_name", [RIGID_BODIES, NAMED_POSES])
def test_of_bodies_with_names_the_one_that_is_called_so_is_taken_and_no_other_where_it_is_lost(type_name: str) -> None:
    """Motion capture publishes all bodies in one message, and leaves out those that it lost."""
    cube = replace(ONE, child="cube")
    assert measured_pose(type_name, message(type_name, cube), "body_cube") == ONE
    lost = measured_pose(type_name, message(type_name, replace(ONE, child="ball")), "body_cube")
    assert lost == BadPose(ONE.stamp_ns, "body_cube", "poses of bodies: found ball, wand, expected body_cube", "name")
    source = find_pose_source("bag", [TypedTopic("/rigid_bodies", type_name)], "cube", PoseTopicConfig())
    assert source.measured("/rigid_bodies", message(type_name, cube)) == (ONE,)
    twice = measured_pose(type_name, message(type_name, replace(ONE, child="wand")), "wand")
    assert twice == BadPose(ONE.stamp_ns, "wand", "poses of bodies: found 2 called wand, expected one", "twice")


def test_transforms_are_poses_of_their_children_and_static_on_tf_static() -> None:
    assert measured_transforms(transforms([ONE]), static=False) == (ONE,)
    assert measured_transforms(transforms([STATIC]), static=True) == (STATIC,)


@pytest.mark.parametrize(
    ("pose", "why"),
    [
        (ScalarPose((nan, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)), "expected finite numbers"),
        (ScalarPose((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0)), "quaternion norm: found 0, expected 1 within 0.001"),
        (ScalarPose((0.0, 0.0, 0.0), (0.7, 0.7, 0.7, 0.7)), "quaternion norm: found 1.4, expected 1"),
    ],
)
def test_what_is_no_pose_says_why(pose: ScalarPose, why: str) -> None:
    for type_name in POSE_MESSAGES:
        bad = measured_pose(type_name, message(type_name, FramePose(7, "map", "b", pose)), "b", index=1)
        assert isinstance(bad, BadPose)
        assert (bad.stamp_ns, bad.child) == (7, "b")
        assert why in bad.why


def test_a_pose_array_without_the_body_s_pose_says_what_it_holds() -> None:
    bad = measured_pose(POSE_ARRAY, message(POSE_ARRAY, ONE), "body_cube", index=2)
    assert bad == BadPose(ONE.stamp_ns, "body_cube", "pose array: found 2 poses, expected one with index 2", "array")
    bad = measured_pose(POSE_ARRAY, message(POSE_ARRAY, ONE), "body_cube")
    which = "pose array: found 2 poses, expected one, or `array_index`, which of them is the body"
    assert bad == BadPose(ONE.stamp_ns, "body_cube", which, "array")


def test_the_only_pose_of_an_array_needs_no_index() -> None:
    both = message(POSE_ARRAY, ONE)
    del both.poses[0]
    assert measured_pose(POSE_ARRAY, both, ONE.child) == ONE


def source_of(*topics: tuple[str, str], **config: Any) -> PoseSource:
    return find_pose_source("a.mcap", [TypedTopic(*topic) for topic in topics], "cube", PoseTopicConfig(**config))


TAGSLAM = (("/tagslam/odom/body_cube", ODOMETRY), ("/tagslam/odom/body_surface", ODOMETRY), ("/tf", TF), ("/tf_static", TF))


def test_of_a_tagslam_bag_the_body_the_board_and_the_transforms_are_read() -> None:
    source = source_of(*TAGSLAM, ("/camera", "sensor_msgs/msg/Image"))
    assert source.body.name == "/tagslam/odom/body_cube"
    assert source.board is not None
    assert source.topics == ("/tagslam/odom/body_cube", "/tagslam/odom/body_surface", "/tf", "/tf_static")
    assert (source.body_frame, source.board_frame) == ("body_cube", "body_surface")


@pytest.mark.parametrize(
    ("topics", "chosen"),
    [
        ([("/pose", POSE)], "/pose"),
        ([("/pose", POSE), ("/odom", ODOMETRY)], "/odom"),
        ([("/a", POSE), ("/b", POSE), ("/cube", POSE)], "/cube"),
        ([("/vrpn/brick/odom", ODOMETRY), ("/vrpn/cube/pose", POSE)], "/vrpn/cube/pose"),
        ([("/cube/pose", POSE), ("/cube/odom", ODOMETRY)], "/cube/odom"),
        ([("/poses", POSE_ARRAY), ("/filtered", POSE_WITH_COVARIANCE)], "/filtered"),
        ([("/odom/body_surface", ODOMETRY), ("/pose", POSE)], "/pose"),
        ([("/tf_static", TF), ("/tf", TF)], "/tf"),
    ],
)
def test_the_topic_that_fits_is_found(topics: list[tuple[str, str]], chosen: str) -> None:
    assert source_of(*topics).body.name == chosen


@pytest.mark.parametrize(
    ("topics", "config", "said"),
    [
        ([], {}, "a.mcap: found no topics at all; expected one topic with poses of cube"),
        (
            [("/image", "sensor_msgs/msg/Image")],
            {},
            "found /image (sensor_msgs/msg/Image); expected one topic",
        ),
        ([("/a", POSE), ("/b", POSE)], {}, "name it (`topic`) if there are several"),
        ([("/a", POSE)], {"topic": "/b"}, "found /a (geometry_msgs/msg/PoseStamped); expected topic /b with poses"),
        ([("/a", "std_msgs/msg/String")], {"topic": "/a"}, "expected topic /a with poses"),
    ],
)
def test_where_none_or_several_fit_the_line_lists_what_there_is(
    topics: list[tuple[str, str]], config: dict[str, str], said: str
) -> None:
    with pytest.raises(MissingTopicError) as caught:
        source_of(*topics, **config)
    assert said in str(caught.value)


def test_a_named_topic_is_taken_with_or_without_its_slash() -> None:
    assert source_of(("/a", POSE), ("/b", POSE), topic="b").body == TypedTopic("/b", POSE)


def test_where_nothing_leads_to_a_board_the_poses_are_on_it() -> None:
    assert source_of(("/pose", POSE)).board_frame == ""
    assert source_of(("/pose", POSE), ("/tf", TF)).board_frame == "body_surface"
    assert source_of(("/pose", POSE), ("/body_surface", POSE)).board_frame == "body_surface"


def test_what_tf_repeats_of_the_body_is_left_out_unless_it_is_all_there_is() -> None:
    repeated = transforms([ONE, FramePose(ONE.stamp_ns, "map", "camera", ONE.pose)])
    assert [one.child for one in source_of(*TAGSLAM).measured("/tf", repeated)] == ["camera"]
    assert [one.child for one in source_of(("/tf", TF)).measured("/tf", repeated)] == ["body_cube", "camera"]


def test_each_topic_s_poses_are_of_its_frame_whatever_the_message_calls_it() -> None:
    source = source_of(*TAGSLAM, body_frame="dice", array_index=1)
    other = FramePose(ONE.stamp_ns, "map", "odom_child", ONE.pose)
    assert [one.child for one in source.measured("/tagslam/odom/body_cube", message(ODOMETRY, other))] == ["dice"]
    assert [one.child for one in source.measured("/tagslam/odom/body_surface", message(ODOMETRY, other))] == ["body_surface"]
    (static,) = source.measured("/tf_static", transforms([STATIC]))
    assert static == STATIC


def test_an_index_is_not_negative() -> None:
    with pytest.raises(InvalidValueError, match="array_index: found -2"):
        PoseTopicConfig(array_index=-2)
