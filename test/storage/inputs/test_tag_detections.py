"""Detections become poses of board and body; lost tags are gaps; CameraInfo may come late; topics are found."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.errors import InvalidValueError, MissingTopicError, UnreadableInputError
from contact_curation.geometry import quaternions
from contact_curation.geometry.poses import Pose
from contact_curation.geometry.tag_rig import TagRig
from contact_curation.motion.body_tracker import BodyPose, BodyTracker
from contact_curation.motion.pose_stream import BadPose, FramePose
from contact_curation.motion.tags.pose import TagPoseConfig
from contact_curation.storage.inputs.pose_messages import ODOMETRY, TF
from contact_curation.storage.inputs.pose_source import PoseSource, PoseTopicConfig, TypedTopic, find_pose_source
from contact_curation.storage.inputs.tag_detections import (
    CAMERA_INFO,
    DETECTIONS,
    MOST_WAITING,
    PATIENCE_NS,
    TagDetections,
    pinhole_of,
)
from test.storage.test_tag_map_file import SHIPPED
from test.tag_scene import BOARD, CAMERA, RIG, array_message, info_message, scene

TRUE = Pose(np.array([0.05, 0.02, 0.15]), quaternions.normalized([0.8, 0.3, -0.4, 0.2]))
WITH_MAP = PoseTopicConfig(tag_map=str(SHIPPED))


def reader(*, ready: bool = True, rig: TagRig = RIG) -> TagDetections:
    made = TagDetections(rig, TagPoseConfig(), rectified=True)
    if ready:
        assert made.calibrated(info_message()) == ()
    return made


def topics(types: dict[str, str]) -> list[TypedTopic]:
    return [TypedTopic(name, kind) for name, kind in types.items()]


def found_in(types: dict[str, str], config: PoseTopicConfig = WITH_MAP) -> PoseSource:
    return find_pose_source("a.mcap", topics(types), "cube", config)


def test_an_image_gives_the_board_and_the_body_in_the_camera_and_so_the_body_on_the_board() -> None:
    board, body = reader().detected(array_message(17, scene(TRUE)))
    assert isinstance(board, FramePose)
    assert isinstance(body, FramePose)
    assert (board.child, body.child, board.parent, body.parent) == ("body_surface", "body_cube", "camera", "camera")
    np.testing.assert_allclose(board.pose.position, CAMERA.pose.inverse().position, atol=1e-6)
    tracker = BodyTracker(WITH_MAP.tracker(CONTACTNETS_CUBE, "body_surface"))
    events = [event for one in (board, body) for event in tracker.push(one)]
    (event,) = events
    assert isinstance(event, BodyPose)
    assert event.stamp_ns == 17
    np.testing.assert_allclose(event.pose.position, TRUE.position, atol=1e-6)
    assert quaternions.angle_between(np.array(event.pose.orientation_wxyz), TRUE.orientation_wxyz) < 1e-5


def test_an_empty_array_says_that_the_tags_are_lost() -> None:
    board, body = reader().detected(array_message(17, []))
    assert isinstance(board, BadPose)
    assert isinstance(body, BadPose)
    assert (body.stamp_ns, body.child, body.kind) == (17, "body_cube", "lost")


def test_a_hidden_body_is_a_gap_while_the_board_is_still_seen() -> None:
    board, body = reader().detected(array_message(17, [one for one in scene(TRUE) if one.tag_id in BOARD.ids]))
    assert isinstance(board, FramePose)
    assert isinstance(body, BadPose)


def test_a_rig_without_tags_on_the_board_gives_the_body_in_the_camera() -> None:
    (body,) = reader(rig=TagRig(RIG.body)).detected(array_message(17, scene(TRUE)))
    assert isinstance(body, FramePose)
    assert body.parent == "camera"


def test_images_wait_for_the_first_camera_info_and_give_what_they_would_have() -> None:
    early, late = reader(ready=False), reader()
    messages = [array_message(stamp, scene(TRUE)) for stamp in (1, 2, 3)]
    assert [early.detected(message) for message in messages] == [(), (), ()]
    assert early.calibrated(info_message()) == tuple(one for message in messages for one in late.detected(message))
    assert early.calibrated(info_message()) == ()


@pytest.mark.parametrize("other_first", [False, True])
def test_images_wait_for_their_own_camera_where_that_of_another_one_comes_first(*, other_first: bool) -> None:
    early, late, other = reader(ready=False), reader(), info_message()
    other.header.frame_id = "other"
    messages = [array_message(stamp, scene(TRUE)) for stamp in (1, 2, 3)]
    if other_first:
        assert early.calibrated(other) == ()
    assert [early.detected(message) for message in messages] == [(), (), ()]
    assert early.calibrated(other) == ()
    assert early.calibrated(info_message()) == tuple(one for message in messages for one in late.detected(message))
    assert early.detected(messages[0]) == late.detected(messages[0])


def test_where_the_clock_is_set_back_an_image_that_waits_for_a_camera_keeps_no_others_back() -> None:
    early, late = reader(), reader()
    message = array_message(1, scene(TRUE))
    assert early.detected(array_message(10 * PATIENCE_NS, scene(TRUE), "other")) == ()
    bad, *poses = early.detected(message)
    assert isinstance(bad, BadPose)
    assert tuple(poses) == late.detected(message)


def test_images_that_wait_for_a_camera_at_the_end_of_a_recording_keep_no_others_back() -> None:
    early, late = reader(), reader()
    assert early.detected(array_message(1, scene(TRUE), "other")) == ()
    assert early.detected(array_message(2, scene(TRUE))) == ()
    bad, *poses = early.ended()
    assert isinstance(bad, BadPose)
    assert tuple(poses) == late.detected(array_message(2, scene(TRUE)))
    assert early.ended() == ()


def test_without_any_camera_info_images_are_given_up_after_a_while() -> None:
    waiting = reader(ready=False)
    for stamp in range(MOST_WAITING):
        assert waiting.detected(array_message(stamp, [])) == ()
    (bad,) = waiting.detected(array_message(MOST_WAITING, []))
    assert isinstance(bad, BadPose)
    assert bad.kind == "camera"


def test_tags_of_another_family_are_not_ours() -> None:
    message = array_message(1, scene(TRUE))
    for one in message.detections:
        one.family = "tag25h9"
    assert all(isinstance(one, BadPose) for one in reader().detected(message))


def test_a_camera_that_is_not_calibrated_is_said_and_waited_for() -> None:
    waiting = reader(ready=False)
    message = info_message()
    message.p = np.zeros(12)
    (bad,) = waiting.calibrated(message)
    assert isinstance(bad, BadPose)
    assert bad.kind == "camera"
    assert "calibrated" in bad.why
    assert waiting.detected(array_message(1, scene(TRUE))) == ()


def test_raw_images_take_k_and_d_and_rectified_ones_p() -> None:
    message: Any = SimpleNamespace(
        width=640, height=480, distortion_model="plumb_bob", d=[0.1, 0, 0, 0, 0],
        k=[500.0, 0, 320, 0, 510, 240, 0, 0, 1], p=[450.0, 0, 310, 0, 0, 460, 230, 0, 0, 0, 1, 0],
        binning_x=0, binning_y=1, roi=SimpleNamespace(x_offset=0, y_offset=0),
    )  # fmt: skip
    raw, rectified = pinhole_of(message, rectified=False), pinhole_of(message, rectified=True)
    assert (raw.focal, raw.middle, raw.distorted) == ((500.0, 510.0), (320.0, 240.0), True)
    assert (rectified.focal, rectified.middle, rectified.distorted) == ((450.0, 460.0), (310.0, 230.0), False)
    message.distortion_model = "strange"
    with pytest.raises(InvalidValueError, match="distortion"):
        pinhole_of(message, rectified=False)


@pytest.mark.parametrize("rectified", [True, False])
def test_a_region_of_the_sensor_and_binned_pixels_change_no_pose(rectified: bool) -> None:
    tags = scene(TRUE)
    message = info_message()
    message.k = CAMERA.pinhole.matrix.ravel()
    message.roi, message.binning_x, message.binning_y = SimpleNamespace(x_offset=100, y_offset=60), 2, 4
    small = [one._replace(corners=(one.corners - [100.5, 60.5]) / [2.0, 4.0] + 0.5) for one in tags]
    whole, part = reader(), TagDetections(RIG, TagPoseConfig(), rectified=rectified)
    assert part.calibrated(message) == ()
    pairs = zip(whole.detected(array_message(1, tags)), part.detected(array_message(1, small)), strict=True)
    for expected, found in pairs:
        assert isinstance(expected, FramePose)
        assert isinstance(found, FramePose)
        np.testing.assert_allclose(found.pose.position, expected.pose.position, atol=1e-6)


def test_a_calibrated_camera_without_a_projection_is_told_of_raw_images() -> None:
    message = info_message()
    message.k, message.p = CAMERA.pinhole.matrix.ravel(), np.zeros(12)
    with pytest.raises(InvalidValueError, match="`rectified` false, if tags were detected in raw ones"):
        pinhole_of(message, rectified=True)


def test_each_frame_has_its_camera_and_detections_of_another_frame_have_none() -> None:
    two, other = reader(), info_message(replace(CAMERA.pinhole, focal=(100.0, 100.0)))
    other.header.frame_id = "/other"
    assert two.calibrated(other) == ()
    expected = reader().detected(array_message(1, scene(TRUE)))
    assert two.detected(array_message(1, scene(TRUE))) == expected
    assert two.detected(array_message(1, scene(TRUE), "other")) != expected
    assert two.detected(array_message(1, scene(TRUE), "third")) == ()  # its camera may be said yet
    bad, *others = two.detected(array_message(1 + PATIENCE_NS, scene(TRUE), "third"))
    assert len(others) == 1
    assert len(two.detected(array_message(2 + PATIENCE_NS, scene(TRUE), "third"))) == 1  # and is not waited for again
    assert isinstance(bad, BadPose)
    assert (bad.kind, bad.child) == ("camera", "body_cube")
    assert "found CameraInfo of frame 'camera', 'other', expected 'third'" in bad.why


@pytest.mark.parametrize("frames", [("", "camera"), ("camera", ""), ("named", "camera")])
def test_the_only_camera_holds_where_a_frame_is_empty_or_its_topic_is_named(frames: tuple[str, str]) -> None:
    config = replace(WITH_MAP, camera_info="/left/camera_info" if "named" in frames else "")
    detections = config.detections("cube")
    assert detections is not None
    info, said = info_message(), frames[0]
    info.header.frame_id = said
    assert detections.calibrated(info) == ()
    assert all(isinstance(one, FramePose) for one in detections.detected(array_message(1, scene(TRUE), frames[1])))


def test_a_tag_beside_the_image_that_camera_info_is_of_is_a_wrong_camera() -> None:
    half = reader(ready=False)
    assert half.calibrated(info_message(replace(CAMERA.pinhole, width=640, height=480))) == ()
    (bad,) = half.detected(array_message(1, scene(TRUE)))
    assert isinstance(bad, BadPose)
    assert bad.kind == "camera"
    assert "in 640 x 480 px of CameraInfo: is it that of the image?" in bad.why


def test_a_second_camera_of_a_stereo_pair_needs_the_board_in_its_images() -> None:
    info, message = info_message(), array_message(1, scene(TRUE))
    info.p[3] = -120.0
    with_board, without = reader(ready=False), reader(ready=False, rig=TagRig(RIG.body))
    assert with_board.calibrated(info) == ()
    assert with_board.detected(message) == reader().detected(message)
    (bad,) = without.calibrated(info)
    assert isinstance(bad, BadPose)
    assert "Tx, Ty in P of CameraInfo: found (-120.0, 0.0), expected 0, 0" in bad.why
    assert "`rectified` false" in bad.why
    info.p[3], info.p[7] = 1e-17, -3e-14  # as a calibration rounds
    assert reader(ready=False, rig=TagRig(RIG.body)).calibrated(info) == ()


def test_with_a_tag_map_detections_and_their_camera_are_found_beside_poses() -> None:
    others = {"/tagslam/odom/body_cube": ODOMETRY, "/tf_static": TF}
    source = found_in({"/detections": DETECTIONS, "/camera_info": CAMERA_INFO, **others})
    assert source.body.name == "/detections"
    assert source.topics == ("/detections", "/camera_info", "/tf_static")
    assert source.board_frame == "body_surface"


def test_of_several_cameras_the_one_beside_the_detections_is_taken() -> None:
    types = {"/left/camera_info": CAMERA_INFO, "/right/camera_info": CAMERA_INFO, "/right/detections": DETECTIONS}
    source = found_in(types)
    assert source.camera == TypedTopic("/right/camera_info", CAMERA_INFO)
    named = found_in(types, PoseTopicConfig(tag_map=str(SHIPPED), camera_info="left/camera_info"))
    assert named.camera == TypedTopic("/left/camera_info", CAMERA_INFO)


@pytest.mark.parametrize(
    "types",
    [
        {"/detections": DETECTIONS},
        {"/camera_info": CAMERA_INFO},
        {"/a/detections": DETECTIONS, "/b/detections": DETECTIONS, "/camera_info": CAMERA_INFO},
    ],
    ids=["no camera", "no detections", "two detectors"],
)
def test_what_cannot_be_read_with_a_tag_map_is_said_with_what_there_is(types: dict[str, str]) -> None:
    with pytest.raises(MissingTopicError, match="as there is a tag map"):
        found_in(types)


def test_without_a_tag_map_detections_are_no_poses() -> None:
    with pytest.raises(MissingTopicError):
        found_in({"/detections": DETECTIONS, "/camera_info": CAMERA_INFO}, PoseTopicConfig())
    assert PoseTopicConfig().detections("cube") is None


def test_the_tag_map_is_read_for_the_body_and_limits_jumps() -> None:
    made = WITH_MAP.detections("cube")
    assert made is not None
    assert made.rig.body.ids == RIG.body.ids
    assert WITH_MAP.tracker(CONTACTNETS_CUBE, "body_surface").largest_spin == WITH_MAP.largest_spin
    assert np.isinf(PoseTopicConfig().tracker(CONTACTNETS_CUBE, "body_surface").largest_spin)
    with pytest.raises(UnreadableInputError, match="body_wedge"):
        WITH_MAP.detections("wedge")
