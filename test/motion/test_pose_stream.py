"""A measurement that is no pose is kept apart with its reason, never repaired."""

from math import inf, nan

import pytest

from contact_curation.geometry.scalars import ScalarPose
from contact_curation.motion.pose_stream import BadPose, FramePose, checked_pose

GOOD = ((0.1, 0.2, 0.3), (0.5, 0.5, -0.5, 0.5))


def test_a_pose_comes_through_untouched() -> None:
    assert checked_pose(7, "map", "body", *GOOD) == FramePose(7, "map", "body", ScalarPose(*GOOD))
    assert checked_pose(7, "map", "body", *GOOD, static=True) == FramePose(7, "map", "body", ScalarPose(*GOOD), static=True)


@pytest.mark.parametrize("norm", [1.0009, 0.9991])
def test_a_norm_within_the_tolerance_is_not_normalised_away(norm: float) -> None:
    checked = checked_pose(7, "map", "body", GOOD[0], (norm, 0.0, 0.0, 0.0))
    assert isinstance(checked, FramePose)
    assert checked.pose.orientation_wxyz == (norm, 0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("position", "orientation", "why"),
    [
        ((nan, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), "pose: found (nan, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0), expected finite numbers"),
        ((0.0, 0.0, 0.0), (1.0, nan, 0.0, 0.0), "expected finite numbers"),
        ((0.0, inf, 0.0), (1.0, 0.0, 0.0, 0.0), "expected finite numbers"),
        ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0), "quaternion norm: found 0, expected 1 within 0.001"),
        ((0.0, 0.0, 0.0), (1.0011, 0.0, 0.0, 0.0), "quaternion norm: found 1.0011, expected 1 within 0.001"),
        ((0.0, -2e6, 0.0), (1.0, 0.0, 0.0, 0.0), "position: found (0.0, -2000000.0, 0.0), expected one within 1e+06 m"),
    ],
)
def test_what_is_no_pose_says_why(
    position: tuple[float, float, float], orientation: tuple[float, float, float, float], why: str
) -> None:
    checked = checked_pose(7, "map", "body", position, orientation)
    assert isinstance(checked, BadPose)
    assert (checked.stamp_ns, checked.child, checked.kind) == (7, "body", "pose")
    assert why in checked.why
