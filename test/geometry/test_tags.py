"""Tags: corners by hand, other conventions, and what no tag map is. Rendered tags hold all of it together: test/sim."""

import numpy as np
import pytest

from contact_curation.errors import InvalidValueError
from contact_curation.geometry import quaternions
from contact_curation.geometry.poses import Pose
from contact_curation.geometry.tags import CORNERS, CornerOrder, Tag, TagAxes, TagMap, in_our_axes, in_our_order

UPRIGHT = Pose(np.array([0.1, 0.2, 0.3]), quaternions.exp([0.5 * np.pi, 0.0, 0.0]))
"""A tag on a wall: its y is up, its z is the wall's outward normal -y."""

LOWER_LEFT, LOWER_RIGHT, UPPER_RIGHT, UPPER_LEFT = [0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]
"""Of a tag seen upright in an image, whose y axis points down."""


def test_corners_go_round_from_the_lower_left_as_the_reader_sees_them() -> None:
    corners = TagMap("wall", (Tag(7, UPRIGHT, 0.2),)).tag(7).corners
    expected = [[0.0, 0.2, 0.2], [0.2, 0.2, 0.2], [0.2, 0.2, 0.4], [0.0, 0.2, 0.4]]
    np.testing.assert_allclose(corners, expected, atol=1e-12)
    normal = np.cross(corners[1] - corners[0], corners[3] - corners[0])
    np.testing.assert_allclose(normal / np.linalg.norm(normal), [0.0, -1.0, 0.0], atol=1e-12)


@pytest.mark.parametrize(
    ("order", "listed"),
    [
        (CornerOrder.APRILTAG, [LOWER_LEFT, LOWER_RIGHT, UPPER_RIGHT, UPPER_LEFT]),
        (CornerOrder.OPENCV, [UPPER_LEFT, UPPER_RIGHT, LOWER_RIGHT, LOWER_LEFT]),
        (CornerOrder.OPENCV_TURNED, [LOWER_RIGHT, LOWER_LEFT, UPPER_LEFT, UPPER_RIGHT]),
    ],
)
def test_every_order_of_corners_becomes_ours(order: CornerOrder, listed: list[list[float]]) -> None:
    first_pixel = 0.5 if order is CornerOrder.APRILTAG else 0.0
    expected = np.array([LOWER_LEFT, LOWER_RIGHT, UPPER_RIGHT, UPPER_LEFT]) - first_pixel
    np.testing.assert_array_equal(in_our_order([listed], order), [expected])


def test_a_frame_that_looks_into_the_tag_is_turned_by_half_a_turn_about_x() -> None:
    into = in_our_axes(UPRIGHT, TagAxes.INTO)
    expected = quaternions.to_matrix(UPRIGHT.orientation_wxyz) @ np.diag([1.0, -1.0, -1.0])
    np.testing.assert_allclose(quaternions.to_matrix(into.orientation_wxyz), expected, atol=1e-12)
    np.testing.assert_array_equal(into.position, UPRIGHT.position)
    assert in_our_axes(UPRIGHT, TagAxes.OUT) is UPRIGHT


def test_both_frames_have_the_same_corners() -> None:
    into = CORNERS * np.array([1.0, -1.0, 1.0])  # lower is where y is greater
    given = Pose(UPRIGHT.position, quaternions.multiply(UPRIGHT.orientation_wxyz, [0.0, 1.0, 0.0, 0.0]))
    by_hand = given.position + quaternions.rotate(given.orientation_wxyz, 0.2 * into)
    np.testing.assert_allclose(Tag(0, in_our_axes(given, TagAxes.INTO), 0.2).corners, by_hand, atol=1e-12)


@pytest.mark.parametrize("tag_id", [-1, 587, 1.0, True])
def test_an_id_that_the_family_does_not_have_is_refused(tag_id: int) -> None:
    with pytest.raises(InvalidValueError, match="from 0 to 586"):
        Tag(tag_id, UPRIGHT, 0.1)


@pytest.mark.parametrize("edge", [0.0, -0.1, float("nan"), float("inf")])
def test_an_edge_that_is_no_length_is_refused(edge: float) -> None:
    with pytest.raises(InvalidValueError, match="edge of tag 3"):
        Tag(3, UPRIGHT, edge)


def test_a_map_without_a_frame_without_tags_or_with_an_id_twice_is_refused() -> None:
    tag = Tag(3, UPRIGHT, 0.1)
    with pytest.raises(InvalidValueError, match="name of a frame"):
        TagMap("", (tag,))
    with pytest.raises(InvalidValueError, match="at least one"):
        TagMap("body", ())
    with pytest.raises(InvalidValueError, match=r"\[3\] more than once"):
        TagMap("body", (tag, tag))


def test_a_tag_that_is_not_in_the_map_is_named_with_those_that_are() -> None:
    with pytest.raises(InvalidValueError, match=r"found 4, expected one of \[3\]"):
        TagMap("body", (Tag(3, UPRIGHT, 0.1),)).tag(4)


def test_tags_seen_from_another_origin_keep_their_turn_and_size() -> None:
    tags = TagMap("body_cube", (Tag(3, Pose(np.array([0.1, 0.2, 0.3]), np.array([0.8, 0.6, 0.0, 0.0])), 0.05),))
    (moved,) = tags.moved(np.array([0.01, 0.0, -0.3])).tags
    np.testing.assert_allclose(moved.pose.position, [0.11, 0.2, 0.0], atol=1e-15)
    np.testing.assert_allclose(moved.pose.orientation_wxyz, [0.8, 0.6, 0.0, 0.0])
    assert (moved.tag_id, moved.edge) == (3, 0.05)
    assert tags.moved(np.zeros(3)) is tags
