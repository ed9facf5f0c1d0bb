"""Computes poses of the body and of the board in the camera from tag detections, separately for each image.

An image without tags of the body gives a bad pose with the reason, and so a gap; nothing is interpolated. Images that come
before the first CameraInfo wait for it, so that the order in which the two topics arrive makes no difference.
"""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import islice
from typing import Any

import numpy as np

from contact_curation.errors import InvalidValueError
from contact_curation.geometry.pinhole import Pinhole
from contact_curation.geometry.tag_rig import TagRig
from contact_curation.geometry.tags import FAMILY, TagMap
from contact_curation.motion.pose_stream import BadPose, checked_pose
from contact_curation.motion.tags.fit import TagImage
from contact_curation.motion.tags.pose import DetectedTag, NoTagPose, TagPoseConfig, tag_pose
from contact_curation.storage.inputs.pose_messages import Measured, stamp_ns_of

DETECTIONS = "apriltag_msgs/msg/AprilTagDetectionArray"
CAMERA_INFO = "sensor_msgs/msg/CameraInfo"

FAMILY_NAMES = {"", "36h11", FAMILY}
"""Names of the tag family in messages; apriltag_msgs permits an empty one."""

MOST_IDS = 8
"""Ids, and families, that a line lists."""

MOST_WAITING = 4096
"""Largest number of images that wait for the first CameraInfo."""


class TagDetections:
    """Reads the detections of one camera.

    Args:
        rig: tags of the body and of the board.
        config: requirements on a pose.
        rectified: whether tags were detected in rectified images, so that P of CameraInfo holds; otherwise K and D hold.
    """

    def __init__(self, rig: TagRig, config: TagPoseConfig, *, rectified: bool) -> None:
        self.rig = rig
        self._config = config
        self._rectified = rectified
        self._camera: Pinhole | None = None
        self._waiting: list[Any] = []

    def calibrated(self, message: Any) -> tuple[Measured, ...]:
        """Takes a CameraInfo; returns the poses of images that waited for the first one."""
        frame = self.rig.body.frame
        try:
            self._camera = pinhole_of(message, rectified=self._rectified)
        except InvalidValueError as error:
            return (BadPose(stamp_ns_of(message.header), frame, f"camera: {error}", "camera"),)
        waiting, self._waiting = self._waiting, []
        return tuple(measured for one in waiting for measured in self.detected(one))

    def detected(self, message: Any) -> tuple[Measured, ...]:
        """The poses in an AprilTagDetectionArray, the board's first; none before the first CameraInfo."""
        if self._camera is not None:
            return self._poses(message, self._camera)
        if len(self._waiting) < MOST_WAITING:
            self._waiting.append(message)
            return ()
        why = f"camera: found no CameraInfo for {MOST_WAITING} images, expected one"
        return (BadPose(stamp_ns_of(message.header), self.rig.body.frame, why, "camera"),)

    def _poses(self, message: Any, camera: Pinhole) -> tuple[Measured, ...]:
        stamp_ns, parent = stamp_ns_of(message.header), str(message.header.frame_id).lstrip("/")
        found = detected_tags(message)
        maps = [self.rig.body] if self.rig.board is None else [self.rig.board, self.rig.body]
        poses = (self._pose(stamp_ns, parent, found, one, camera) for one in maps)
        return tuple(
            replace(one, why=f"{one.why}; in the image: {_in_words(message)}")
            if isinstance(one, BadPose) and one.kind == "lost"
            else one
            for one in poses
        )

    def _pose(self, stamp_ns: int, parent: str, found: Sequence[DetectedTag], tags: TagMap, camera: Pinhole) -> Measured:
        result = tag_pose(found, tags, camera, self._config)
        if isinstance(result, NoTagPose):
            return BadPose(stamp_ns, tags.frame, result.why, result.kind)
        pose = result.pose
        return checked_pose(stamp_ns, parent, tags.frame, pose.position.tolist(), pose.orientation_wxyz.tolist())


def pinhole_of(message: Any, *, rectified: bool) -> Pinhole:
    """Reads the camera from a CameraInfo, for the image that its region of interest and its binning leave.

    Intrinsics hold for the full resolution (sensor_msgs): the region's corner is subtracted, and binning divides.

    Raises:
        InvalidValueError: the camera is not calibrated, or its distortion model is unknown.
    """
    x, y, across, down = _part_of_the_sensor(message)
    width, height = int(message.width) // across, int(message.height) // down
    if rectified:
        fx, _, cx, _, _, fy, cy, *_ = (float(number) for number in message.p)
        model, distortion = "", tuple[float, ...]()
        if fx == 0.0 and message.k[0] > 0.0:
            wanted = "that of rectified images, or `rectified` false, if tags were detected in raw ones"
            raise InvalidValueError("P of CameraInfo", "zeros, though the camera is calibrated (K)", wanted)
    else:
        fx, _, cx, _, fy, cy, *_ = (float(number) for number in message.k)
        model, distortion = str(message.distortion_model), tuple(float(number) for number in message.d)
    return Pinhole(width, height, (fx / across, fy / down), ((cx - x) / across, (cy - y) / down), model, distortion)


def _part_of_the_sensor(message: Any) -> tuple[int, int, int, int]:
    """The first column and row of the image, and how many columns and rows of the sensor are one of it."""
    return (
        int(message.roi.x_offset),
        int(message.roi.y_offset),
        max(int(message.binning_x), 1),  # 0 is 1
        max(int(message.binning_y), 1),
    )


def tag_images(messages: Iterable[tuple[bool, Any]], every: int) -> list[TagImage]:
    """A sample of images: each `every`-th array of detections, with the camera that was last said, or else the first.

    Args:
        messages: in their order, each with whether it is a CameraInfo.
        every: 1 or more.
    """
    infos: list[tuple[Pinhole | None, Pinhole | None]] = []
    arrays: list[tuple[int, tuple[DetectedTag, ...]]] = []
    count = 0
    for is_info, message in messages:
        if is_info:
            infos.append((_pinhole_or_none(message, rectified=False), _pinhole_or_none(message, rectified=True)))
        else:
            arrays += [(len(infos), detected_tags(message))] if count % every == 0 else []
            count += 1
    return [TagImage(tags, *infos[max(said - 1, 0)]) for said, tags in arrays] if infos else []


def _pinhole_or_none(message: Any, *, rectified: bool) -> Pinhole | None:
    try:
        return pinhole_of(message, rectified=rectified)
    except InvalidValueError:
        return None


def detected_tags(message: Any) -> tuple[DetectedTag, ...]:
    """The tags of our family in an AprilTagDetectionArray."""
    return tuple(_detected(one) for one in message.detections if str(one.family) in FAMILY_NAMES)


def _in_words(message: Any) -> str:
    """Families and ids of the tags in an image."""
    ids: dict[str, list[int]] = {}
    for one in message.detections:
        ids.setdefault(str(one.family) or FAMILY, []).append(int(one.id))
    lists = (
        f"{family} {', '.join(map(str, sorted(of)[:MOST_IDS]))}{' ...' if len(of) > MOST_IDS else ''}"
        for family, of in ids.items()
    )
    return "; ".join(islice(lists, MOST_IDS)) or "none"


def _detected(one: Any) -> DetectedTag:
    corners = np.array([[float(corner.x), float(corner.y)] for corner in one.corners])
    return DetectedTag(int(one.id), corners, int(one.hamming))
