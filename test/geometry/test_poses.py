"""Poses compose, invert, and refuse what is no pose."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from contact_curation.errors import InvalidValueError
from contact_curation.geometry import quaternions
from contact_curation.geometry.poses import Pose
from contact_curation.geometry.quaternions import Array


@st.composite
def poses(draw: st.DrawFn) -> Pose:
    numbers = draw(arrays(float, 6, elements=st.floats(-5.0, 5.0)))
    return Pose(numbers[:3], quaternions.exp(numbers[3:]))


def applied(pose: Pose, point: Array) -> Array:
    return np.asarray(quaternions.rotate(pose.orientation_wxyz, point) + pose.position)


@given(poses(), poses(), arrays(float, 3, elements=st.floats(-5.0, 5.0)))
def test_composing_is_applying_one_after_the_other(parent: Pose, child: Pose, point: Array) -> None:
    np.testing.assert_allclose(applied(parent.compose(child), point), applied(parent, applied(child, point)), atol=1e-10)


@given(poses())
def test_a_pose_composed_with_its_inverse_is_the_identity(pose: Pose) -> None:
    for product in (pose.compose(pose.inverse()), pose.inverse().compose(pose)):
        np.testing.assert_allclose(product.position, np.zeros(3), atol=1e-12)
        assert quaternions.angle_between(product.orientation_wxyz, quaternions.IDENTITY) < 1e-7


@given(poses(), poses(), poses())
def test_composing_is_associative(a: Pose, b: Pose, c: Pose) -> None:
    left, right = a.compose(b).compose(c), a.compose(b.compose(c))
    np.testing.assert_allclose(left.position, right.position, atol=1e-11)
    np.testing.assert_allclose(left.orientation_wxyz, right.orientation_wxyz, atol=1e-12)


def test_the_identity_changes_nothing() -> None:
    pose = Pose(np.array([1.0, 2.0, 3.0]), quaternions.exp([0.1, 0.2, 0.3]))
    np.testing.assert_array_equal(Pose.identity().compose(pose).position, pose.position)
    np.testing.assert_allclose(pose.compose(Pose.identity()).orientation_wxyz, pose.orientation_wxyz, atol=1e-15)


@pytest.mark.parametrize(("off", "accepted"), [(0.9e-3, True), (1.1e-3, False), (-0.9e-3, True), (-1.1e-3, False)])
def test_a_quaternion_far_from_unit_norm_is_refused(off: float, accepted: bool) -> None:
    orientation = (1.0 + off) * quaternions.exp([0.3, 0.2, 0.1])
    if accepted:
        assert np.linalg.norm(Pose(np.zeros(3), orientation).orientation_wxyz) == pytest.approx(1.0, abs=1e-15)
    else:
        with pytest.raises(InvalidValueError, match=r"quaternion norm: found .*expected 1 within 0\.001"):
            Pose(np.zeros(3), orientation)


@pytest.mark.parametrize(
    ("position", "orientation"),
    [([np.nan, 0, 0], [1, 0, 0, 0]), ([0, 0, 0], [np.inf, 0, 0, 0]), ([0, 0], [1, 0, 0, 0]), ([0, 0, 0], [1, 0, 0])],
)
def test_what_is_not_finite_or_has_the_wrong_shape_is_refused(position: list[float], orientation: list[float]) -> None:
    with pytest.raises(InvalidValueError, match="pose: found"):
        Pose(np.array(position, dtype=float), np.array(orientation, dtype=float))
