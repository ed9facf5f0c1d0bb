"""A camera of the test's own that sees tags: corners by projection, without an image; tags that face away are not seen."""

from collections.abc import Sequence
from types import SimpleNamespace

import numpy as np

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.geometry import quaternions
from contact_curation.geometry.pinhole import Pinhole
from contact_curation.geometry.poses import Pose
from contact_curation.geometry.tag_rig import TagRig, rig_of
from contact_curation.geometry.tags import CORNERS, Tag, TagMap
from contact_curation.motion.tags.pose import DetectedTag
from contact_curation.motion.toss import NANOSECONDS
from contact_curation.simulation.camera.camera import CameraConfig

CAMERA = CameraConfig()
RIG = rig_of(CONTACTNETS_CUBE.polytope, "body_cube", "body_surface")
BOARD: TagMap = RIG.board if RIG.board is not None else RIG.body

LEAST_VIEW = 0.25
"""Sine of the angle under which a tag is still read."""

FIRST_PIXEL = 0.5
"""Where the AprilTag library has the middle of the first pixel."""


def seen(
    tags: TagMap, pose: Pose, camera: Pose = CAMERA.pose, pinhole: Pinhole = CAMERA.pinhole, least_view: float = LEAST_VIEW
) -> list[DetectedTag]:
    """The tags of a thing at `pose` that face the camera, as the AprilTag library would give them without any error."""
    return [
        DetectedTag(tag.tag_id, corners)
        for tag in tags.tags
        if (corners := _corners(tag, pose, camera, pinhole, least_view)) is not None
    ]


def scene(pose: Pose, noise: float = 0.0, rng: np.random.Generator | None = None, rig: TagRig = RIG) -> list[DetectedTag]:
    """Body and board, each corner off by white noise [px]."""
    found = seen(rig.body, pose) + ([] if rig.board is None else seen(rig.board, Pose.identity()))
    return found if rng is None else shaken(found, noise, rng)


def shaken(found: Sequence[DetectedTag], noise: float, rng: np.random.Generator) -> list[DetectedTag]:
    return [one._replace(corners=one.corners + noise * rng.standard_normal((4, 2))) for one in found]


def array_message(stamp_ns: int, found: Sequence[DetectedTag], frame: str = "camera") -> SimpleNamespace:
    """An AprilTagDetectionArray, whoever decoded it."""
    stamp = SimpleNamespace(sec=stamp_ns // NANOSECONDS, nanosec=stamp_ns % NANOSECONDS)
    detections = [
        SimpleNamespace(
            family="36h11",
            id=one.tag_id,
            hamming=one.hamming,
            corners=[SimpleNamespace(x=x, y=y) for x, y in one.corners.tolist()],
        )
        for one in found
    ]
    return SimpleNamespace(header=SimpleNamespace(stamp=stamp, frame_id=frame), detections=detections)


def info_message(pinhole: Pinhole = CAMERA.pinhole) -> SimpleNamespace:
    """A CameraInfo, whoever decoded it; its K is none, for the images are rectified."""
    stamp = SimpleNamespace(sec=0, nanosec=0)
    projection = np.column_stack([pinhole.matrix, np.zeros(3)]).ravel()
    return SimpleNamespace(
        header=SimpleNamespace(stamp=stamp, frame_id="camera"),
        width=pinhole.width,
        height=pinhole.height,
        distortion_model="plumb_bob",
        d=[0.0] * 5,
        k=np.zeros(9),
        p=projection,
        binning_x=0,
        binning_y=0,
        roi=SimpleNamespace(x_offset=0, y_offset=0),
    )


def _corners(
    tag: Tag, pose: Pose, camera: Pose, pinhole: Pinhole, least_view: float
) -> np.ndarray[tuple[int, int], np.dtype[np.float64]] | None:
    placed = camera.inverse().compose(pose.compose(tag.pose))
    outward = quaternions.rotate(placed.orientation_wxyz, [0.0, 0.0, 1.0])
    if -placed.position @ outward < least_view * np.linalg.norm(placed.position):
        return None
    points = placed.position + quaternions.rotate(placed.orientation_wxyz, tag.edge * CORNERS)
    pixels = pinhole.project(points)
    inside = (pixels > 0.0).all() and (pixels < [pinhole.width, pinhole.height]).all()
    return pixels + FIRST_PIXEL if inside else None
