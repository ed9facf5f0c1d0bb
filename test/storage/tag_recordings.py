"""Recordings of detections as apriltag_ros makes them: an array per image and the camera's CameraInfo."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from contact_curation.motion.tags.pose import DetectedTag
from contact_curation.storage.bags.writer import BagWriter
from contact_curation.storage.inputs.tag_detections import CAMERA_INFO, DETECTIONS
from test.tag_scene import CAMERA
from test.tagged_tosses import TaggedImage

VENDORED = Path(__file__).resolve().parents[2] / "msg_defs" / "vendored" / "apriltag_msgs" / "msg"
STORE = get_typestore(Stores.ROS2_JAZZY)
for _definition in sorted(VENDORED.glob("*.msg")):
    STORE.register(get_types_from_msg(_definition.read_text(), f"apriltag_msgs/msg/{_definition.stem}"))


def write_detections(path: Path, images: Sequence[TaggedImage], *, info_after: int = 0, calibrated: bool = True) -> Path:
    """A bag with `/detections` and, after so many images, `/camera_info`."""
    with BagWriter(path, STORE) as bag:
        for place, image in enumerate(images):
            if place == info_after:
                bag.write("/camera_info", _camera_info(image.stamp_ns, calibrated), image.stamp_ns)
            bag.write("/detections", _array(image), image.stamp_ns)
    return path


def _array(image: TaggedImage) -> Any:
    detections = [_detection(one) for one in image.tags]
    return STORE.types[DETECTIONS](header=_header(image.stamp_ns), detections=detections)


def _detection(one: DetectedTag) -> Any:
    point = STORE.types["apriltag_msgs/msg/Point"]
    return STORE.types["apriltag_msgs/msg/AprilTagDetection"](
        family="36h11",
        id=one.tag_id,
        hamming=one.hamming,
        goodness=0.0,
        decision_margin=80.0,
        centre=point(*one.corners.mean(axis=0).tolist()),
        corners=[point(x, y) for x, y in one.corners.tolist()],
        homography=np.zeros(9),
    )


def _camera_info(stamp_ns: int, calibrated: bool) -> Any:
    pinhole = CAMERA.pinhole
    matrix = pinhole.matrix if calibrated else np.zeros((3, 3))
    region = STORE.types["sensor_msgs/msg/RegionOfInterest"](0, 0, 0, 0, False)
    return STORE.types[CAMERA_INFO](
        header=_header(stamp_ns),
        height=pinhole.height,
        width=pinhole.width,
        distortion_model="plumb_bob",
        d=np.zeros(5),
        k=matrix.ravel(),
        r=np.eye(3).ravel(),
        p=np.column_stack([matrix, np.zeros(3)]).ravel(),
        binning_x=0,
        binning_y=0,
        roi=region,
    )


def _header(stamp_ns: int) -> Any:
    stamp = STORE.types["builtin_interfaces/msg/Time"](*divmod(stamp_ns, 10**9))
    return STORE.types["std_msgs/msg/Header"](stamp, "camera")
