"""pose_ingest takes detections of tags as they come, and cuts the tosses that `rank` cuts out of them in a bag."""

from pathlib import Path

import numpy as np
import pytest
from apriltag_msgs.msg import AprilTagDetectionArray
from rclpy.publisher import Publisher
from sensor_msgs.msg import CameraInfo

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.motion.toss import Rejected, Toss
from contact_curation.nodes.messages.camera import camera_info_message, detections_message
from contact_curation.nodes.messages.headers import Stamped
from contact_curation.nodes.messages.toss import toss_of
from contact_curation.nodes.ros.qos import latched, profile
from contact_curation.simulation.camera.tag_detection import Detection
from contact_curation.storage.inputs.inputs import InputsConfig, open_inputs
from contact_curation.storage.inputs.pose_source import PoseTopicConfig
from test.graph.parts.graph import Graph, until
from test.storage.tag_recordings import write_detections
from test.storage.test_tag_map_file import SHIPPED
from test.tag_scene import CAMERA
from test.tagged_tosses import TaggedImage, tagged_tosses, without_tags

LONG = 90.0
WITH_MAP = InputsConfig(poses=PoseTopicConfig(tag_map=str(SHIPPED)))


def publish(detections: Publisher, images: list[TaggedImage]) -> None:
    for image in images:
        found = [Detection(one.tag_id, 0, 80.0, one.corners.mean(axis=0), one.corners, np.zeros((3, 3))) for one in image.tags]
        detections.publish(detections_message(Stamped(image.stamp_ns, "camera"), found))


@pytest.mark.slow
def test_detections_that_are_published_and_those_in_a_bag_give_the_same_tosses(graph: Graph, tmp_path: Path) -> None:
    images = without_tags(tagged_tosses(3), 30, 34)
    bag = write_detections(tmp_path / "a.mcap", images)
    offline = list(open_inputs([bag], CONTACTNETS_CUBE, WITH_MAP))
    expected = [one for one in offline if isinstance(one, Toss)]
    gone = [one.toss.toss_id for one in offline if isinstance(one, Rejected)]
    assert (len(expected), len(gone)) == (2, 1)

    tosses, rejected, diagnostics = graph.tosses(), graph.rejected(), graph.diagnostics()
    graph.start("pose_ingest", tag_map=SHIPPED)
    node = graph.listener.node
    detections = node.create_publisher(AprilTagDetectionArray, "/detections", latched(2000))
    camera = node.create_publisher(CameraInfo, "/camera_info", profile(5, reliable=False, latched=False))
    until(lambda: detections.get_subscription_count() and camera.get_subscription_count(), LONG, "a subscriber")
    publish(detections, images[:50])  # before the camera is known: they wait
    camera.publish(camera_info_message(Stamped(0, "camera"), CAMERA.pinhole))
    publish(detections, images[50:])

    graph.until(lambda: len(tosses) >= 2 and rejected, LONG, "the tosses")
    assert [toss.toss_id for toss in tosses] == [toss.toss_id for toss in expected]
    assert [toss_of(toss).digest() for toss in tosses] == [toss.digest() for toss in expected]
    assert [one.toss_id for one in rejected] == gone
    graph.until(lambda: "bad_lost" in str(diagnostics), LONG, "the count of lost tags")


@pytest.mark.slow
def test_a_restarted_node_needs_no_second_camera_info_of_a_latched_camera(graph: Graph) -> None:
    images = list(tagged_tosses(2))
    tosses = graph.tosses()
    node = graph.listener.node
    detections = node.create_publisher(AprilTagDetectionArray, "/detections", latched(2000))
    camera = node.create_publisher(CameraInfo, "/camera_info", latched(1))
    camera.publish(camera_info_message(Stamped(0, "camera"), CAMERA.pinhole))
    first = graph.start("pose_ingest", tag_map=SHIPPED)
    half = len(images) * 3 // 4
    publish(detections, images[:half])
    graph.until(lambda: tosses, LONG, "the first toss")
    first.kill()
    graph.start("pose_ingest", tag_map=SHIPPED)
    publish(detections, images[half:])
    graph.until(lambda: len({toss.toss_id for toss in tosses}) == 2, LONG, "the second toss")


def test_a_tag_map_without_the_body_ends_the_node_with_one_line(graph: Graph, tmp_path: Path) -> None:
    path = tmp_path / "tags.yaml"
    path.write_text("frames: {body_wedge: [{id: 1, edge: 0.1, position: [0, 0, 0]}]}")
    node = graph.start("pose_ingest", tag_map=path)
    assert node.wait(LONG) == 1
    assert "expected some of body_cube" in node.log()
    assert "Traceback" not in node.log()
