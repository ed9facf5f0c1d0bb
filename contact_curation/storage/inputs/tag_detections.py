"""Computes poses of the body and of the board in the camera from tag detections, separately for each image.

An image without tags of the body gives a bad pose with the reason, and so a gap; nothing is interpolated. Images that come
before the first CameraInfo of their camera wait for it, so that the order in which the topics arrive makes no difference.
"""

from collections import deque
from collections.abc import Iterable, Mapping, Sequence
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
from contact_curation.storage.inputs.pose_messages import Measured, frame_name, stamp_ns_of

DETECTIONS = "apriltag_msgs/msg/AprilTagDetectionArray"
CAMERA_INFO = "sensor_msgs/msg/CameraInfo"

FAMILY_NAMES = {"", "36h11", FAMILY}
"""Names of the tag family in messages; apriltag_msgs permits an empty one."""

MOST_IDS = 8
"""Ids, and families, that a line lists."""

LEAST_BASELINE = 1e-5
"""Distance of the cameras of a stereo pair from which it counts [m]; what is less is a calibration's rounding."""

MOST_WAITING = 4096
"""Largest number of images that wait for the first CameraInfo."""

PATIENCE_NS = 2_000_000_000
"""By their stamps, for which images wait for the CameraInfo of their camera where those of others came."""


class TagDetections:
    """Reads the detections of one topic.

    Args:
        rig: tags of the body and of the board.
        config: requirements on a pose.
        rectified: whether tags were detected in rectified images, so that P of CameraInfo holds; otherwise K and D hold.
        any_frame: whether a CameraInfo of another frame than the detections' holds for them, too.
    """

    def __init__(self, rig: TagRig, config: TagPoseConfig, *, rectified: bool, any_frame: bool = False) -> None:
        self.rig = rig
        self._config = config
        self._rectified = rectified
        self._any_frame = any_frame
        self._cameras: dict[str, Pinhole] = {}
        self._waiting = deque[Any]()
        self._without_camera: set[str] = set()

    def calibrated(self, message: Any) -> tuple[Measured, ...]:
        """Takes a CameraInfo; returns the poses of images that waited for the first one of their camera."""
        frame = self.rig.body.frame
        try:
            if self._rectified and self.rig.board is None:
                _check_first_of_pair(message)
            self._cameras[_frame_of(message)] = pinhole_of(message, rectified=self._rectified)
        except InvalidValueError as error:
            return (BadPose(stamp_ns_of(message.header), frame, f"camera: {error}", "camera"),)
        return self._ready()

    def detected(self, message: Any) -> tuple[Measured, ...]:
        """The poses in an AprilTagDetectionArray, the board's first, after those of images that waited before it."""
        if len(self._waiting) >= MOST_WAITING:
            why = f"camera: found no CameraInfo for {MOST_WAITING} images, expected one"
            return (BadPose(stamp_ns_of(message.header), self.rig.body.frame, why, "camera"),)
        self._waiting.append(message)
        return self._ready()

    def ended(self) -> tuple[Measured, ...]:
        """The poses of images that wait at the end of a recording for a CameraInfo that does not come."""
        return self._ready(ended=True)

    def _ready(self, *, ended: bool = False) -> tuple[Measured, ...]:
        """The poses of images that wait for nothing any more, in their order."""
        poses: list[Measured] = []
        while self._waiting:
            first, frame = self._waiting[0], _frame_of(self._waiting[0])
            camera = of_frame(self._cameras, frame, any_frame=self._any_frame)
            if camera is None and frame not in self._without_camera:
                waited_ns = abs(stamp_ns_of(self._waiting[-1].header) - stamp_ns_of(first.header))  # a clock may be set back
                if not self._cameras or (waited_ns < PATIENCE_NS and not ended):
                    break
                self._without_camera.add(frame)
            poses += self._poses(self._waiting.popleft(), camera)
        return tuple(poses)

    def _poses(self, message: Any, camera: Pinhole | None) -> tuple[Measured, ...]:
        stamp_ns, parent, found = stamp_ns_of(message.header), _frame_of(message), detected_tags(message)
        if camera is None:
            there = ", ".join(f"'{name}'" for name in sorted(self._cameras)[:MOST_IDS])
            wanted = f"'{parent}', as of the detections: name its topic (poses.camera_info) if it is of this camera"
            why = f"camera: found CameraInfo of frame {there}, expected {wanted}"
            return (BadPose(stamp_ns, self.rig.body.frame, why, "camera"),)
        if why := _of_another_size(found, camera):
            return (BadPose(stamp_ns, self.rig.body.frame, why, "camera"),)
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


def of_frame[T](cameras: Mapping[str, T], frame: str, *, any_frame: bool) -> T | None:
    """What belongs to the camera with this frame; None where CameraInfo is of other cameras.

    Args:
        cameras: by the frames of CameraInfo.
        frame: of detections.
        any_frame: whether the only camera holds for every frame, as it does where one of the frames is empty.
    """
    is_only = len(cameras) == 1 and (any_frame or not frame or "" in cameras)
    return next(iter(cameras.values())) if is_only else cameras.get(frame)


def _of_another_size(found: Sequence[DetectedTag], camera: Pinhole) -> str:
    """Why the image is not that of the camera; empty where the middle of every tag is in it."""
    size = camera.width, camera.height
    for one in found:
        if one.corners.shape != (4, 2) or not np.isfinite(one.corners).all():
            continue
        middle = one.corners.mean(axis=0)
        if ((middle < 0.0) | (middle > size)).any():
            where = f"tag {one.tag_id} at {middle[0]:.0f}, {middle[1]:.0f} px"
            return f"camera: found {where}, expected it in {size[0]} x {size[1]} px of CameraInfo: is it that of the image?"
    return ""


def _frame_of(message: Any) -> str:
    return frame_name(str(message.header.frame_id))


def _check_first_of_pair(message: Any) -> None:
    """Refuses the second camera of a stereo pair: nobody says whether its frame is its own, or the first camera's as P has it.

    Raises:
        InvalidValueError: P has a baseline.
    """
    baseline = (float(message.p[3]), float(message.p[7]))  # times the focal length [m px]
    if max(map(abs, baseline)) > LEAST_BASELINE * abs(float(message.p[0])):
        wanted = (
            "0, 0, or tags of the board in the tag map, or `rectified` false where tags were detected in raw images: of the "
            "second camera of a stereo pair the frame is not certain"
        )
        raise InvalidValueError("Tx, Ty in P of CameraInfo", baseline, wanted)


def _part_of_the_sensor(message: Any) -> tuple[int, int, int, int]:
    """The first column and row of the image, and how many columns and rows of the sensor are one of it."""
    return (
        int(message.roi.x_offset),
        int(message.roi.y_offset),
        max(int(message.binning_x), 1),  # 0 is 1
        max(int(message.binning_y), 1),
    )


def tag_images(messages: Iterable[tuple[bool, Any]], every: int, *, any_frame: bool) -> list[TagImage]:
    """A sample of images: each `every`-th array of detections, with its camera as it was last said, or else first.

    Args:
        messages: in their order, each with whether it is a CameraInfo.
        every: 1 or more.
        any_frame: as of `TagDetections`.
    """
    infos: dict[str, list[tuple[Pinhole | None, Pinhole | None]]] = {}
    arrays: list[tuple[str, int, tuple[DetectedTag, ...]]] = []
    count = 0
    for is_info, message in messages:
        frame = _frame_of(message)
        if is_info:
            pair = _pinhole_or_none(message, rectified=False), _pinhole_or_none(message, rectified=True)
            infos.setdefault(frame, []).append(pair)
        else:
            said = of_frame(infos, frame, any_frame=any_frame) or ()
            arrays += [(frame, len(said), detected_tags(message))] if count % every == 0 else []
            count += 1
    return [
        TagImage(tags, *pairs[max(last - 1, 0)])
        for frame, last, tags in arrays
        if (pairs := of_frame(infos, frame, any_frame=any_frame))
    ]


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
