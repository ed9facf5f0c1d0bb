"""AprilTags on a body or a board, and the conventions of other libraries for corners and frames.

Our tag frame is that of apriltag_ros and TagSLAM: origin in the middle of the tag, x to the right and y up as one reads it, z
out of it towards the reader. Corners are in the order of the AprilTag library and apriltag_msgs: lower left, lower right, upper
right, upper left, which is counter-clockwise for the reader. A tag's edge is that of its black square, without the white rim.
Pixels are OpenCV's and ROS': the middle of the first one is (0, 0); the AprilTag library has it at (0.5, 0.5).
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from enum import Enum
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from contact_curation.errors import InvalidValueError
from contact_curation.geometry import quaternions
from contact_curation.geometry.poses import Pose
from contact_curation.geometry.quaternions import Array

FAMILY = "tag36h11"
LARGEST_ID = 586
"""36h11 has 587 tags."""

BLACK_CELLS = 8
"""Cells along the black edge of a tag of 36h11."""

CELLS = 10
"""Cells along the edge with the white rim that a detector needs."""

CORNERS: Array = np.array([[-0.5, -0.5, 0.0], [0.5, -0.5, 0.0], [0.5, 0.5, 0.0], [-0.5, 0.5, 0.0]])
"""(4, 3) corners in the tag's frame, in edges."""

HALF_TURN_ABOUT_X: Array = np.array([0.0, 1.0, 0.0, 0.0])


class TagAxes(Enum):
    """The frame of a tag in which its pose is given.

    `OUT`: x right, y up, z out of the tag (apriltag_ros, TagSLAM). `INTO`: x right, y down, z into it (the AprilTag library's
    own pose estimation, pupil-apriltags, isaac_ros_apriltag); diag(1, -1, -1) between them.
    """

    OUT = "out"
    INTO = "into"


class CornerOrder(Enum):
    """The order in which a detector lists corners, and its first pixel.

    `APRILTAG`: as above. `OPENCV`: OpenCV's aruco, clockwise from the upper left. `OPENCV_TURNED`: likewise, by versions
    of OpenCV that hold the tags of this family upside down (measured: 4.14 and 5.0).
    """

    APRILTAG = "apriltag"
    OPENCV = "opencv"
    OPENCV_TURNED = "opencv-turned"


_PLACES = {
    CornerOrder.APRILTAG: [0, 1, 2, 3],
    CornerOrder.OPENCV: [3, 2, 1, 0],
    CornerOrder.OPENCV_TURNED: [1, 0, 3, 2],
}
"""Where another order has our corners."""


_MIDDLE_OF_FIRST_PIXEL = {CornerOrder.APRILTAG: 0.5, CornerOrder.OPENCV: 0.0, CornerOrder.OPENCV_TURNED: 0.0}


def in_our_order(corners: ArrayLike, order: CornerOrder) -> Array:
    """A detector's corners (..., 4, 2) [px] in the order of this module, the middle of the first pixel at (0, 0)."""
    return np.asarray(np.asarray(corners, dtype=float)[..., _PLACES[order], :]) - _MIDDLE_OF_FIRST_PIXEL[order]


def in_our_axes(pose: Pose, axes: TagAxes) -> Pose:
    """A tag's pose, given for a frame of these axes, of the frame of this module."""
    if axes is TagAxes.OUT:
        return pose
    return Pose(pose.position, quaternions.multiply(pose.orientation_wxyz, HALF_TURN_ABOUT_X))


@dataclass(frozen=True, eq=False)
class Tag:
    """One tag of family 36h11.

    Attributes:
        tag_id: 0 to 586.
        pose: pose of the tag's frame in that of the body or board [m].
        edge: edge of its black square [m].
    """

    tag_id: int
    pose: Pose
    edge: float

    def __post_init__(self) -> None:
        if type(self.tag_id) is not int or not 0 <= self.tag_id <= LARGEST_ID:
            raise InvalidValueError("tag id", repr(self.tag_id), f"a whole number from 0 to {LARGEST_ID}")
        if not (np.isfinite(self.edge) and self.edge > 0.0):
            raise InvalidValueError(f"edge of tag {self.tag_id}", self.edge, "a positive length [m]")

    @cached_property
    def corners(self) -> Array:
        """(4, 3) in the frame of the body or board [m]."""
        return self.pose.position + quaternions.rotate(self.pose.orientation_wxyz, self.edge * CORNERS)


@dataclass(frozen=True, eq=False)
class TagMap:
    """The tags of one rigid thing.

    Attributes:
        frame: frame of the body or the board.
        tags: no id twice.
    """

    frame: str
    tags: tuple[Tag, ...]

    def __post_init__(self) -> None:
        if not self.frame:
            raise InvalidValueError("frame of a tag map", repr(self.frame), "the name of a frame")
        if not self.tags:
            raise InvalidValueError(f"tags of {self.frame}", "none", "at least one")
        check_no_id_twice(self.tags, self.frame)

    def moved(self, by: Array) -> "TagMap":
        """The same tags as seen from a frame with the same axes, in which this one is at `by` (3,) [m]."""
        if not by.any():
            return self
        tags = (replace(tag, pose=replace(tag.pose, position=tag.pose.position + by)) for tag in self.tags)
        return TagMap(self.frame, tuple(tags))

    @property
    def ids(self) -> tuple[int, ...]:
        """Ids of the tags, in the order of the map."""
        return tuple(tag.tag_id for tag in self.tags)

    def tag(self, tag_id: int) -> Tag:
        """The tag of an id.

        Raises:
            InvalidValueError: there is none.
        """
        found = next((tag for tag in self.tags if tag.tag_id == tag_id), None)
        if found is None:
            raise InvalidValueError(f"tag of {self.frame}", tag_id, f"one of {list(self.ids)}")
        return found


def check_no_id_twice(tags: Iterable[Tag], where: str) -> None:
    """Refuses tags of which two have the same id.

    Raises:
        InvalidValueError: an id is there twice.
    """
    ids = [tag.tag_id for tag in tags]
    twice = sorted({tag_id for tag_id in ids if ids.count(tag_id) > 1})
    if twice:
        raise InvalidValueError(f"tags of {where}", f"ids {twice} more than once", "every id once")
