"""sim_camera tells of a true pose what a tracker, or a camera with a detector, would."""

import math
import time
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from apriltag_msgs.msg import AprilTagDetectionArray
from nav_msgs.msg import Odometry
from rclpy.publisher import Publisher
from sensor_msgs.msg import CameraInfo, Image
from tf2_msgs.msg import TFMessage

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.geometry import quaternions
from contact_curation.geometry.poses import Pose
from contact_curation.motion.body_tracker import BodyPose, BodyTracker, TrackerConfig
from contact_curation.nodes.messages.headers import Stamped
from contact_curation.nodes.messages.toss import toss_of
from contact_curation.nodes.messages.tracked import odometry_message
from contact_curation.nodes.ros.qos import profile
from contact_curation.storage.inputs.pose_messages import ODOMETRY, measured_pose, measured_transforms
from contact_curation.storage.inputs.pose_source import PoseTopicConfig
from test.graph.parts.graph import Graph, until
from test.simulated import RIG_NOISE
from test.storage.test_tag_map_file import SHIPPED
from test.tagged_tosses import tagged_tosses

LONG = 90.0
TRUTH = profile(2000, reliable=True, latched=False)


def ground_truth(graph: Graph) -> Publisher:
    publisher = graph.listener.node.create_publisher(Odometry, "/ground_truth", TRUTH)
    until(publisher.get_subscription_count, LONG, "a subscriber of the ground truth")
    return publisher


def tell(publisher: Publisher, frames: Sequence[tuple[int, Pose]]) -> None:
    for stamp_ns, pose in frames:
        publisher.publish(odometry_message(Stamped(stamp_ns, "body_surface"), "body_cube", pose, (0.0, 0.0)))


def frames_of(count: int) -> list[tuple[int, Pose]]:
    return [(one.stamp_ns, one.true) for one in tagged_tosses(1)[:count]]


def on_board(heard: list[Any], static: list[Any]) -> dict[int, Pose]:
    """What a tracker makes of the Odometry and the board's transform, by stamp."""
    tracker = BodyTracker(TrackerConfig("body_cube", "body_surface"))
    measured = [one for message in static for one in measured_transforms(message, static=True)]
    measured += [measured_pose(ODOMETRY, message, "body_cube") for message in heard]
    events = [event for one in measured for event in tracker.push(one)]
    return {
        event.stamp_ns: Pose(np.array(event.pose.position), np.array(event.pose.orientation_wxyz))
        for event in events
        if isinstance(event, BodyPose)
    }


def test_poses_are_told_as_tagslam_does_with_the_noise_of_the_rig(graph: Graph) -> None:
    heard = graph.listener.listen(Odometry, "/tagslam/odom/body_cube", 2000)
    static = graph.listener.listen(TFMessage, "/tf_static")
    graph.start("sim_camera", seed=3)
    frames = frames_of(90)
    tell(ground_truth(graph), frames)
    graph.until(lambda: len(heard) == len(frames) and static, LONG, "the poses")
    assert {message.header.frame_id for message in heard} == {"map"}
    assert {message.child_frame_id for message in heard} == {"body_cube"}
    assert np.asarray(heard[0].pose.covariance).reshape(6, 6).diagonal().min() > 0.0
    found = on_board(heard, static)
    errors = np.array([found[stamp_ns].position - pose.position for stamp_ns, pose in frames])
    assert errors.std() == pytest.approx(RIG_NOISE.position, rel=0.2)
    turns = [
        float(quaternions.angle_between(found[stamp_ns].orientation_wxyz, pose.orientation_wxyz)) for stamp_ns, pose in frames
    ]
    assert np.sqrt(np.mean(np.square(turns)) / 3.0) == pytest.approx(RIG_NOISE.orientation, rel=0.2)


@pytest.mark.slow
def test_losses_leave_frames_out_and_a_delay_holds_poses_back_until_the_end(graph: Graph) -> None:
    heard = graph.listener.listen(Odometry, "/tagslam/odom/body_cube", 2000)
    parameters: dict[str, Any] = {"noise.latency": 0.05, "noise.dropout_rate": 0.1, "noise.dropout_frames": 2.0, "seed": 1}
    graph.start("sim_camera", **parameters)
    frames = frames_of(90)
    publisher = ground_truth(graph)
    tell(publisher, frames[:5])
    graph.until(lambda: len(heard) >= 4, LONG, "what waits, when no more frames come")
    tell(publisher, frames[5:])
    last = frames[-1][0]
    graph.until(lambda: heard[-1].header.stamp.nanosec == last % 10**9, LONG, "the last frame")
    assert 50 < len(heard) < len(frames)


@pytest.mark.slow
def test_a_bad_ground_truth_is_left_out_and_counted(graph: Graph) -> None:
    heard = graph.listener.listen(Odometry, "/tagslam/odom/body_cube", 2000)
    node = graph.start("sim_camera")
    publisher = ground_truth(graph)
    message = odometry_message(Stamped(1, "body_surface"), "body_cube", Pose.identity(), (0.0, 0.0))
    message.pose.pose.position.x = math.nan
    publisher.publish(message)
    tell(publisher, frames_of(1))
    graph.until(lambda: heard, LONG, "the sound frame")
    assert len(heard) == 1
    assert "expected finite numbers" in node.log()


@pytest.mark.slow
def test_a_pose_ingest_that_is_killed_in_mid_throw_hears_from_the_camera_what_it_missed(graph: Graph) -> None:
    """Beside one that was left in peace, under the same name of the source."""
    ingest: dict[str, Any] = {"topic": "/tagslam/odom/body_cube", "source": "camera"}
    calm, killed = graph.tosses("/calm/toss"), graph.tosses("/toss")
    rejected = graph.rejected()
    graph.start("sim_camera", seed=4)
    graph.start("pose_ingest", {"__ns": "/calm", "tf": "/tf", "tf_static": "/tf_static"}, "calm", **ingest)
    first = graph.start("pose_ingest", **ingest)
    frames = [(one.stamp_ns, one.true) for one in tagged_tosses(3)]
    middle = len(frames) // 2
    truth = ground_truth(graph)
    graph.until(lambda: graph.listener.node.count_subscribers("/tagslam/odom/body_cube") == 2, LONG, "two of pose_ingest")
    for frame in frames[:middle]:
        tell(truth, [frame])
        time.sleep(0.003)
    graph.until(lambda: len(killed) >= 1, LONG, "the first toss")
    first.kill()
    tell(truth, frames[middle : middle + 40])
    graph.start("pose_ingest", **ingest)
    for frame in frames[middle + 40 :]:
        tell(truth, [frame])
        time.sleep(0.003)
    graph.until(lambda: len(calm) == 3 and len({one.toss_id for one in killed}) == 3, LONG, "the tosses")
    assert not rejected
    expected = {one.toss_id: toss_of(one).digest() for one in calm}
    assert {one.toss_id: toss_of(one).digest() for one in killed} == expected


@pytest.mark.slow
def test_tags_are_rendered_and_detected_and_give_the_true_pose_with_the_frames_stamp(graph: Graph) -> None:
    heard = graph.listener.listen(AprilTagDetectionArray, "/detections", 2000)
    infos, images = graph.listener.listen(CameraInfo, "/camera_info"), graph.listener.listen(Image, "/image", 5)
    parameters: dict[str, Any] = {
        "mode": "rendered",
        "camera.width": 800,
        "camera.height": 600,
        "detector.decimate": 1.0,
        "images": True,
    }
    graph.start("sim_camera", **parameters)
    frames = frames_of(3)
    tell(ground_truth(graph), frames)
    graph.until(lambda: len(heard) == 3 and infos, LONG, "the detections")
    reader = PoseTopicConfig(tag_map=str(SHIPPED)).detections("cube")
    assert reader is not None
    reader.calibrated(infos[-1])
    tracker = BodyTracker(PoseTopicConfig(tag_map=str(SHIPPED)).tracker(CONTACTNETS_CUBE, "body_surface"))
    events = [event for message in heard for one in reader.detected(message) for event in tracker.push(one)]
    assert [event.stamp_ns for event in events if isinstance(event, BodyPose)] == [stamp_ns for stamp_ns, _ in frames]
    for event, (_, true) in zip(events, frames):
        assert isinstance(event, BodyPose)
        np.testing.assert_allclose(event.pose.position, true.position, atol=1e-3)
        assert np.degrees(quaternions.angle_between(np.array(event.pose.orientation_wxyz), true.orientation_wxyz)) < 0.5
    graph.until(lambda: len(images) == 3, LONG, "the images")
    assert (images[0].width, images[0].height, images[0].encoding) == (800, 600, "mono8")
    assert images[0].header.stamp == heard[0].header.stamp


def test_a_parameter_that_cannot_be_ends_the_node_with_one_line(graph: Graph) -> None:
    node = graph.start("sim_camera", mode="imagined")
    assert node.wait(LONG) == 1
    assert "one of poses, rendered" in node.log()
    assert "Traceback" not in node.log()
