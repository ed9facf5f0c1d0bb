"""The two modes of `sim_camera`: a tracker's poses, or tags in rendered images."""

from collections import deque
from typing import Any, NamedTuple, Protocol

import numpy as np
from apriltag_msgs.msg import AprilTagDetectionArray
from nav_msgs.msg import Odometry
from sensor_msgs.msg import CameraInfo
from sensor_msgs.msg import Image as ImageMessage
from tf2_msgs.msg import TFMessage

from contact_curation.contact.body import Body
from contact_curation.design.throw import throw_seed
from contact_curation.geometry.poses import Pose
from contact_curation.geometry.quaternions import IDENTITY
from contact_curation.geometry.tag_rig import TagRig
from contact_curation.motion.toss import NANOSECONDS
from contact_curation.nodes.messages.camera import camera_info_message, detections_message, image_message
from contact_curation.nodes.messages.headers import Stamped
from contact_curation.nodes.messages.tracked import odometry_message, static_transform_message
from contact_curation.nodes.ros.node_main import StageNode
from contact_curation.nodes.ros.qos import latched
from contact_curation.simulation.camera.camera import CameraConfig, CameraView
from contact_curation.simulation.camera.tag_detection import DetectorConfig, TagDetector
from contact_curation.simulation.tracker_noise import TrackerNoise, TrackerNoiseConfig
from contact_curation.storage.datasets.tagslam_bag import TagslamRig

IMAGE_DEPTH = 5

CAMERA_FRAME = "camera"


class TrueFrame(NamedTuple):
    """The true pose of the body.

    Attributes:
        stamp_ns: simulated time [ns].
        pose: pose of the body in the board's frame.
        throw_id: name of the throw that the frame belongs to; empty if none is known.
        begun_ns: stamp of that throw's beginning [ns]; 0 if none is known.
    """

    stamp_ns: int
    pose: Pose
    throw_id: str = ""
    begun_ns: int = 0

    @property
    def since_ns(self) -> int:
        """Time since the throw began [ns]."""
        return self.stamp_ns - self.begun_ns


class Sight(Protocol):
    """A mode of the camera: it publishes what it observes of the body; all calls are on one thread."""

    def see(self, true: TrueFrame) -> None:
        """Publishes the measurement of a frame, at once or after the latency."""

    def rest(self) -> None:
        """Publishes the measurements that still wait for their latency, because no further frames come."""

    def close(self) -> None:
        """Frees its resources."""


class TrackedPoses:
    """Publishes poses as TagSLAM does, with a tracker's noise and faults; the board has a pose in the map.

    Args:
        node: node that publishes.
        body: body whose tracked frame the poses are of.
        rig: names of frames, pose of the board in the map, standard deviations.
        noise: noise and faults of the tracker.
        seed: random seed of the noise.
        history: number of poses that late subscribers receive.
    """

    def __init__(
        self, node: StageNode, body: Body, rig: TagslamRig, noise: TrackerNoiseConfig, seed: int, *, history: int
    ) -> None:
        self._noise = TrackerNoise(noise, seed)
        self._latency_ns = round(noise.latency * NANOSECONDS)
        self._rig = rig
        self._body_frame = f"body_{body.name}"
        self._board = Pose(np.array(rig.board.position), np.array(rig.board.orientation_wxyz))
        self._tracked = Pose(-body.center_of_mass, IDENTITY) if body.center_of_mass.any() else None
        self._waiting: deque[tuple[int, Any]] = deque()
        self._poses = node.create_publisher(Odometry, f"tagslam/odom/{self._body_frame}", latched(history))
        self._static = node.create_publisher(TFMessage, "tf_static", latched(1))
        self._static.publish(static_transform_message(Stamped(0, rig.map_frame), rig.board_frame, self._board))

    def see(self, true: TrueFrame) -> None:
        tracked = true.pose.compose(self._tracked) if self._tracked else true.pose
        pose = self._noise.seen(true.since_ns, tracked, true.throw_id)
        if pose is not None:
            stamped, deviations = Stamped(true.stamp_ns, self._rig.map_frame), self._deviations
            message = odometry_message(stamped, self._body_frame, self._board.compose(pose), deviations)
            self._waiting.append((true.stamp_ns, message))
        while self._waiting and not 0 <= true.stamp_ns - self._waiting[0][0] < self._latency_ns:  # a clock may jump back
            self._poses.publish(self._waiting.popleft()[1])

    def rest(self) -> None:
        while self._waiting:
            self._poses.publish(self._waiting.popleft()[1])

    def close(self) -> None:
        self.rest()

    @property
    def _deviations(self) -> tuple[float, float]:
        return self._rig.position_deviation, self._rig.turn_deviation


class RenderedTags:
    """Renders the camera's image and publishes the tags that are detected in it.

    The view is made at the first frame, because an OpenGL context belongs to one thread.

    Args:
        node: node that publishes.
        body: body that is tossed.
        rig: tags on the body and on the board.
        camera: configuration of the camera.
        detector: detector of the tags.
        seed: random seed of the pixels' noise.
        history: number of images whose detections late subscribers receive.
        images: publish the images too.
    """

    def __init__(
        self,
        node: StageNode,
        body: Body,
        rig: TagRig,
        camera: CameraConfig,
        detector: DetectorConfig,
        seed: int,
        *,
        history: int,
        images: bool,
    ) -> None:
        self._scene = body, rig, camera
        self._seed = seed
        self._view: CameraView | None = None
        self._detector = TagDetector(detector)
        self._detections = node.create_publisher(AprilTagDetectionArray, "detections", latched(history))
        self._camera_info = node.create_publisher(CameraInfo, "camera_info", latched(1))
        self._images = node.create_publisher(ImageMessage, "image", latched(IMAGE_DEPTH)) if images else None

    def see(self, true: TrueFrame) -> None:
        self._view = self._view or CameraView(*self._scene)
        image = self._view.image(true.pose, np.random.default_rng([self._seed, throw_seed(true.throw_id), true.since_ns]))
        stamped = Stamped(true.stamp_ns, CAMERA_FRAME)
        self._camera_info.publish(camera_info_message(stamped, self._view.config.pinhole))
        self._detections.publish(detections_message(stamped, self._detector.detect(image)))
        if self._images is not None:
            self._images.publish(image_message(stamped, image))

    def rest(self) -> None:
        """Does nothing: every frame is published at once."""

    def close(self) -> None:
        if self._view is not None:
            self._view.close()
