"""The scalar forms are the array forms."""

import numpy as np
import pytest

from contact_curation.geometry import quaternions, scalars
from contact_curation.geometry.poses import Pose
from contact_curation.geometry.scalars import ScalarPose, Vector


def random_pose(rng: np.random.Generator) -> ScalarPose:
    x, y, z = rng.normal(size=3).tolist()
    w, qx, qy, qz = quaternions.exp(rng.normal(size=3)).tolist()
    return ScalarPose((x, y, z), (w, qx, qy, qz))


def as_arrays(pose: ScalarPose) -> Pose:
    return Pose(np.array(pose.position), np.array(pose.orientation_wxyz))


def assert_same(found: ScalarPose, expected: Pose) -> None:
    np.testing.assert_allclose(found.position, expected.position, atol=1e-14)
    np.testing.assert_allclose(found.orientation_wxyz, expected.orientation_wxyz, atol=1e-14)


@pytest.mark.parametrize("seed", range(5))
def test_products_turns_and_poses_agree_with_the_array_forms(seed: int) -> None:
    rng = np.random.default_rng(seed)
    a, b = random_pose(rng), random_pose(rng)
    qa, qb, point = a.orientation_wxyz, b.orientation_wxyz, b.position
    np.testing.assert_allclose(scalars.multiply(qa, qb), quaternions.multiply(qa, qb), atol=1e-15)
    np.testing.assert_allclose(scalars.rotate(qa, point), quaternions.rotate(qa, point), atol=1e-14)
    np.testing.assert_allclose(scalars.third_row(qa), quaternions.to_matrix(qa)[2], atol=1e-15)
    assert_same(scalars.compose(a, b), as_arrays(a).compose(as_arrays(b)))
    assert_same(scalars.inverse(a), as_arrays(a).inverse())


def test_the_identity_composes_to_nothing() -> None:
    pose = random_pose(np.random.default_rng(3))
    assert scalars.compose(scalars.IDENTITY, pose) == pose


@pytest.mark.parametrize("share", [0.0, 0.25, 0.5, 1.0])
@pytest.mark.parametrize("flip", [1.0, -1.0])
def test_through_two_poses_it_goes_evenly_along_the_shorter_arc(share: float, flip: float) -> None:
    start = ScalarPose((0.0, 1.0, 2.0), (1.0, 0.0, 0.0, 0.0))
    w, x, y, z = (flip * quaternions.exp([0.0, 0.0, 1.2])).tolist()
    found = scalars.interpolated([3.0, 5.0], [start, ScalarPose((1.0, 1.0, 0.0), (w, x, y, z))], 3.0 + 2.0 * share)
    np.testing.assert_allclose(found.position, [share, 1.0, 2.0 - 2.0 * share])
    expected = quaternions.exp([0.0, 0.0, 1.2 * share])
    assert quaternions.angle_between(found.orientation_wxyz, expected) == pytest.approx(0.0, abs=1e-7)


def test_through_equal_poses_it_is_exactly_that_pose() -> None:
    pose = random_pose(np.random.default_rng(4))
    found = scalars.interpolated([0.0, 1.0, -0.7, 2.1], [pose] * 4, 0.3)
    assert found.position == pose.position
    np.testing.assert_allclose(found.orientation_wxyz, pose.orientation_wxyz, atol=1e-15)


def test_through_four_poses_it_is_the_cubic_and_a_turn_about_one_axis_likewise() -> None:
    def at(time: float) -> ScalarPose:
        w, x, y, z = quaternions.exp([0.0, 0.3 * time - 0.2 * time**3, 0.0]).tolist()
        return ScalarPose((time**3, 1.0 - time**2, 2.0), (w, x, y, z))

    times = [0.0, 1.0, -0.8, 1.5]
    found = scalars.interpolated(times, [at(time) for time in times], 0.4)
    assert_same(found, as_arrays(at(0.4)))


@pytest.mark.parametrize("turn", [(0.0, 0.0, 0.0), (1e-9, 0.0, 0.0), (0.3, -2.0, 1.0), (0.0, 3.0, 0.0)])
def test_rotation_vectors_are_those_of_quaternions(turn: Vector) -> None:
    rotation = scalars.rotation_by(turn)
    np.testing.assert_allclose(rotation, quaternions.exp(turn), atol=1e-15)
    w, x, y, z = rotation
    for either in (rotation, (-w, -x, -y, -z)):
        np.testing.assert_allclose(scalars.rotation_vector(either), turn, atol=1e-12)
