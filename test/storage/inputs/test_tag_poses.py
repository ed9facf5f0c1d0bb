"""Arrays of detections that carry poses of tags, of isaac_ros_apriltag and of apriltag_ros, are read as the same tags on TF."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin
from rosbags.typesys import get_types_from_msg

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.geometry import quaternions
from contact_curation.geometry.scalars import IDENTITY, ScalarPose, compose, inverse
from contact_curation.motion.pose_stream import FramePose
from contact_curation.motion.toss import Rejected, Toss
from contact_curation.storage.inputs.inputs import InputsConfig, InputSummary, Problem, open_inputs
from contact_curation.storage.inputs.pose_messages import APRILTAG_ROS, APRILTAGS2_ROS, ISAAC_TAGS, POSE_WITH_COVARIANCE, TF
from contact_curation.storage.inputs.pose_source import PoseTopicConfig
from test.motion.streams import BOARD, stream
from test.storage.pose_recordings import LOG_OFFSET_NS, message, transforms
from test.storage.test_tag_map_file import SHIPPED
from test.storage.written_bags import JAZZY, NOETIC, Sent, write_mcap, write_ros1, write_rosbag2

APRILTAG_ROS_DETECTION = "int32[] id\nfloat64[] size\ngeometry_msgs/PoseWithCovarianceStamped pose"
DETECTION = {
    ISAAC_TAGS: "string family\nint32 id\ngeometry_msgs/Point center\ngeometry_msgs/Point[4] corners\n"
    "geometry_msgs/PoseWithCovarianceStamped pose",
    APRILTAG_ROS: APRILTAG_ROS_DETECTION,
    APRILTAGS2_ROS: APRILTAG_ROS_DETECTION,
}
"""As https://github.com/NVIDIA-ISAAC-ROS/isaac_ros_common and https://github.com/AprilRobotics/apriltag_ros define them."""
for array, definition in DETECTION.items():
    for store in (JAZZY, NOETIC):
        detection = array.removesuffix("Array")
        store.register(get_types_from_msg(definition, detection))
        fields = f"std_msgs/Header header\n{detection.replace('/msg', '')}[] detections"
        store.register(get_types_from_msg(fields, array))

TOPIC, CAMERA = "/tag_detections", "camera_optical"
POSES = [*stream(), *stream(start_ns=9_000_000_000)]
ON_BODY = ScalarPose((0.01, -0.02, 0.03), (0.8, 0.2, -0.4, 0.4))
"""Of tag 3, where it is not the body's frame itself."""
ON_BOARD = ScalarPose((-0.3, 0.2, 0.0), (0.6, 0.0, 0.0, 0.8))
"""Of tag 100, where it is not the board's frame itself."""

Tags = Mapping[tuple[int, ...], ScalarPose]


def seen(place: int, tag_on_body: ScalarPose = IDENTITY, tag_on_board: ScalarPose = IDENTITY) -> Tags:
    """The tags of an image in the camera: of the board, of another body, and of the body."""
    return {
        (100,): compose(BOARD, tag_on_board),
        (7,): ScalarPose((9.0, 0.0, float(place)), (0.0, 1.0, 0.0, 0.0)),
        (3,): compose(compose(BOARD, POSES[place].pose), tag_on_body),
    }


def detections(type_name: str, stamp_ns: int, tags: Sequence[tuple[tuple[int, ...], ScalarPose]], store: Any = JAZZY) -> Sent:
    """An image's array; of isaac_ros_apriltag without headers of the poses, as it leaves them."""
    head = message(POSE_WITH_COVARIANCE, FramePose(stamp_ns, CAMERA, "", IDENTITY), store).header
    made = store.types[type_name.removesuffix("Array")]
    point = store.types["geometry_msgs/msg/Point"](0.0, 0.0, 0.0)
    found = []
    for ids, pose in tags:
        named = FramePose(*((0, "") if type_name == ISAAC_TAGS else (stamp_ns, CAMERA)), "", pose)
        measured = message(POSE_WITH_COVARIANCE, named, store)
        if type_name == ISAAC_TAGS:
            found.append(made("tag36h11", ids[0], point, [point] * 4, measured))
        else:
            found.append(made(np.array(ids, np.int32), np.full(len(ids), 0.05), measured))
    return Sent(TOPIC, LOG_OFFSET_NS + stamp_ns, store.types[type_name](head, found))


def images(type_name: str, store: Any = JAZZY, lost: range = range(0), **places: ScalarPose) -> list[Sent]:
    """Two throws, without the body's tag in some images."""
    sent = []
    for place, one in enumerate(POSES):
        tags = [(ids, pose) for ids, pose in seen(place, **places).items() if ids != (3,) or place not in lost]
        sent.append(detections(type_name, one.stamp_ns, tags, store))
    return sent


def on_tf(name: Callable[[int], str], lost: range = range(0), **places: ScalarPose) -> list[Sent]:
    """The same on TF."""
    sent = []
    for place, one in enumerate(POSES):
        tags = [(ids[0], pose) for ids, pose in seen(place, **places).items() if ids != (3,) or place not in lost]
        poses = [FramePose(one.stamp_ns, CAMERA, name(number), pose) for number, pose in tags]
        sent.append(Sent("/tf", LOG_OFFSET_NS + one.stamp_ns, transforms(poses)))
    return sent


def static(*poses: tuple[str, str, ScalarPose], store: Any = JAZZY) -> Sent:
    sent = transforms([FramePose(0, parent, child, pose, static=True) for parent, child, pose in poses], store)
    return Sent("/tf_static", LOG_OFFSET_NS, sent)


def isaac(number: int) -> str:
    return f"tag36h11:{number}"


def read(path: Path, **poses: Any) -> tuple[list[Toss | Rejected | Problem], InputSummary]:
    inputs = open_inputs([path], CONTACTNETS_CUBE, InputsConfig(poses=PoseTopicConfig(**poses)))
    return list(inputs), inputs.summaries[0]


def motions(items: Sequence[Toss | Rejected | Problem]) -> list[Toss]:
    """The tosses, accepted and rejected."""
    return [one.toss if isinstance(one, Rejected) else one for one in items if not isinstance(one, Problem)]


def assert_true(items: Sequence[object]) -> None:
    """Two tosses with the true poses, and nothing that was left out."""
    true = {one.stamp_ns: one.pose for one in POSES}
    assert [type(one) for one in items] == [Toss, Toss], [str(one) for one in items]
    for toss in (one for one in items if isinstance(one, Toss)):
        poses = [true[stamp_ns] for stamp_ns in toss.stamps_ns.tolist()]
        np.testing.assert_allclose(toss.positions, [pose.position for pose in poses], rtol=0, atol=1e-12)
        turns = quaternions.to_matrix([pose.orientation_wxyz for pose in poses])
        np.testing.assert_allclose(quaternions.to_matrix(toss.orientations_wxyz), turns, rtol=0, atol=1e-12)


def mcap(folder: Path, type_name: str) -> Path:
    return write_mcap(folder / "a.mcap", images(type_name))


def sqlite(folder: Path, type_name: str) -> Path:
    return write_rosbag2(folder / "a", images(type_name), StoragePlugin.SQLITE3)


def ros1(folder: Path, type_name: str) -> Path:
    return write_ros1(folder / "a.bag", images(type_name, NOETIC))


@pytest.mark.parametrize("made", [mcap, sqlite, ros1])
@pytest.mark.parametrize("type_name", DETECTION)
def test_a_tag_s_poses_in_the_camera_are_the_body_s_on_the_board(
    tmp_path: Path, type_name: str, made: Callable[[Path, str], Path]
) -> None:
    name = "tag36h11:{}" if type_name == ISAAC_TAGS else "tag_{}"
    items, summary = read(made(tmp_path, type_name), body_frame=name.format(3), board_frame=name.format(100))
    assert_true(items)
    assert (summary.topic, summary.counts) == (TOPIC, {"poses": len(POSES), "tosses": 2})
    assert (summary.first_stamp_ns, summary.last_stamp_ns) == (POSES[0].stamp_ns, POSES[-1].stamp_ns)


def test_static_transforms_say_where_the_tags_are_on_body_and_board(tmp_path: Path) -> None:
    sent = images(ISAAC_TAGS, tag_on_body=ON_BODY, tag_on_board=ON_BOARD)
    where = static((isaac(3), "body_cube", inverse(ON_BODY)), (isaac(100), "body_surface", inverse(ON_BOARD)))
    assert_true(read(write_mcap(tmp_path / "a.mcap", [where, *sent]))[0])


def test_a_transform_may_lead_from_the_camera_to_the_board(tmp_path: Path) -> None:
    where = static(("body_surface", CAMERA, inverse(BOARD)))
    path = write_mcap(tmp_path / "a.mcap", [where, *images(ISAAC_TAGS)])
    assert_true(read(path, body_frame="tag36h11:3")[0])


def test_a_bundle_is_called_by_all_of_its_ids(tmp_path: Path) -> None:
    sent = []
    for place, one in enumerate(POSES):
        tags = seen(place)
        bundle = [((100,), tags[100,]), ((3,), tags[7,]), ((3, 4, 5), tags[3,])]
        sent.append(detections(APRILTAG_ROS, one.stamp_ns, bundle, NOETIC))
    assert_true(read(write_ros1(tmp_path / "a.bag", sent), body_frame="tag_3_4_5", board_frame="tag_100")[0])


def test_images_without_the_tag_are_a_gap_as_on_tf(tmp_path: Path) -> None:
    named, lost = {"body_frame": isaac(3), "board_frame": isaac(100)}, range(30, 35)
    items, _ = read(write_mcap(tmp_path / "a.mcap", images(ISAAC_TAGS, lost=lost)), **named)
    same, _ = read(write_mcap(tmp_path / "b.mcap", on_tf(isaac, lost)), **named)
    (rejected,) = (one for one in items if isinstance(one, Rejected))
    assert rejected.reasons[0].startswith("gap: found")
    assert [str(one) for one in items if isinstance(one, Problem)] == []
    for one, other in zip(motions(items), motions(same), strict=True):
        for values in ("stamps_ns", "positions", "orientations_wxyz"):
            np.testing.assert_array_equal(getattr(one, values), getattr(other, values))


def test_the_same_tags_on_tf_are_read_once(tmp_path: Path) -> None:
    sent = [one for both in zip(on_tf(isaac), images(ISAAC_TAGS), strict=True) for one in both]
    path = write_mcap(tmp_path / "a.mcap", sent)
    for topic in ("", "/tf", TOPIC):
        items, summary = read(path, topic=topic, body_frame=isaac(3), board_frame=isaac(100))
        assert_true(items)
        assert (summary.topic, summary.counts["poses"]) == (topic or "/tf", len(POSES))


def test_where_tf_lacks_the_body_the_topic_with_the_tags_is_named(tmp_path: Path) -> None:
    robot = [Sent("/tf", LOG_OFFSET_NS, transforms([FramePose(0, "base", "tool", IDENTITY)]))]
    path = write_mcap(tmp_path / "a.mcap", [*robot, *images(APRILTAG_ROS)])
    named = {"body_frame": "tag_3", "board_frame": "tag_100"}
    items, _ = read(path, **named)
    expected = "found base, tool, expected frames tag_3 and tag_100, or poses of tags from /tag_detections (--topic)"
    assert [str(one) for one in items] == [f"{path}: found no toss in 0 poses of /tf: {expected}"]
    assert_true(read(path, topic=TOPIC, **named)[0])


def test_with_a_tag_map_poses_of_tags_are_said_not_to_need_one(tmp_path: Path) -> None:
    path = write_mcap(tmp_path / "a.mcap", images(APRILTAG_ROS)[:5])
    (line,) = (str(one) for one in open_inputs([path], CONTACTNETS_CUBE, InputsConfig(PoseTopicConfig(tag_map=str(SHIPPED)))))
    assert line.endswith("poses of tags are read without a tag map")


def test_tags_that_are_not_the_body_s_are_listed(tmp_path: Path) -> None:
    path = write_mcap(tmp_path / "a.mcap", images(ISAAC_TAGS))
    (line,) = (str(one) for one in read(path)[0])
    seen_frames = "camera_optical, tag36h11:100, tag36h11:3, tag36h11:7"
    expected = "expected frames body_cube and body_surface (--body-frame, --board-frame)"
    assert line == f"{path}: found no toss in 0 poses of /tag_detections: found {seen_frames}, {expected}"


def test_an_id_that_is_seen_twice_in_an_image_gives_no_pose(tmp_path: Path) -> None:
    sent = images(ISAAC_TAGS)
    for place in range(30, 34):
        tags = seen(place)
        sent[place] = detections(ISAAC_TAGS, POSES[place].stamp_ns, [*tags.items(), ((3,), tags[7,])])
    items, _ = read(write_mcap(tmp_path / "a.mcap", sent), body_frame=isaac(3), board_frame=isaac(100))
    assert [type(one) for one in items] == [Rejected, Toss, Problem]
    assert "8 poses were left out" in str(items[2])
    assert "tags: found 2 called tag36h11:3, expected one" in str(items[2])


def test_a_type_of_that_name_without_poses_is_a_line(tmp_path: Path) -> None:
    named = "other_msgs/msg/AprilTagDetectionArray"
    JAZZY.register(get_types_from_msg("std_msgs/Header header", named))
    head = message(POSE_WITH_COVARIANCE, FramePose(1, CAMERA, "", IDENTITY)).header
    path = write_mcap(tmp_path / "a.mcap", [Sent(TOPIC, 1, JAZZY.types[named](head))])
    (line,) = (str(one) for one in open_inputs([path], CONTACTNETS_CUBE, InputsConfig()))
    assert f"found {TOPIC} ({named})" in line
    assert "of a type that is read: nav_msgs/msg/Odometry, " in line
    assert line.endswith(f"{TF}, {', '.join(DETECTION)}")
