"""Messages of a camera and of its tag detector."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from apriltag_msgs.msg import AprilTagDetection, AprilTagDetectionArray
from apriltag_msgs.msg import Point as PixelPoint
from sensor_msgs.msg import CameraInfo
from sensor_msgs.msg import Image as ImageMessage

from contact_curation.geometry.pinhole import Pinhole
from contact_curation.nodes.messages.headers import Stamped, header_message
from contact_curation.simulation.camera.tag_detection import Detection
from contact_curation.simulation.camera.tag_textures import Image

FAMILY_NAME = "36h11"
"""Name of the tag family in the messages of apriltag_ros."""


def camera_info_message(stamped: Stamped, camera: Pinhole) -> CameraInfo:
    """The intrinsics of a camera without distortion, whose images count as rectified."""
    projection = np.column_stack([camera.matrix, np.zeros(3)])
    return CameraInfo(
        header=header_message(stamped),
        width=camera.width,
        height=camera.height,
        distortion_model="plumb_bob",
        d=[0.0] * 5,
        k=camera.matrix.ravel(),
        r=np.eye(3).ravel(),
        p=projection.ravel(),
    )


def detections_message(stamped: Stamped, detections: Sequence[Detection]) -> AprilTagDetectionArray:
    """All tags of an image."""
    return AprilTagDetectionArray(header=header_message(stamped), detections=[_detection(one) for one in detections])


def image_message(stamped: Stamped, image: Image) -> ImageMessage:
    """A grey image."""
    height, width = image.shape
    return ImageMessage(
        header=header_message(stamped), height=height, width=width, encoding="mono8", step=width, data=image.tobytes()
    )


def _detection(one: Detection) -> Any:
    return AprilTagDetection(
        family=FAMILY_NAME,
        id=one.tag_id,
        hamming=one.hamming,
        decision_margin=one.margin,
        centre=_point(one.centre),
        corners=[_point(corner) for corner in one.corners],
        homography=one.homography.ravel(),
    )


def _point(pixel: Any) -> PixelPoint:
    return PixelPoint(x=float(pixel[0]), y=float(pixel[1]))
