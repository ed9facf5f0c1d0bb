"""Poses from tags: exact corners, noise and what is said of it, flips, half hidden tags, distortion, and no pose at all."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from contact_curation.errors import InvalidValueError
from contact_curation.geometry import quaternions
from contact_curation.geometry.pinhole import Pinhole
from contact_curation.geometry.poses import Pose
from contact_curation.geometry.quaternions import Array
from contact_curation.geometry.tags import CornerOrder, Tag, TagMap
from contact_curation.motion.tags.pnp import CornerNoise, undistorted
from contact_curation.motion.tags.pose import DetectedTag, NoTagPose, TagPose, TagPoseConfig, on_board, tag_pose
from test.tag_scene import BOARD, CAMERA, RIG, scene, seen, shaken

CONFIG = TagPoseConfig()
PINHOLE = CAMERA.pinhole
NOISE = CONFIG.noise.deviation


def random_pose(rng: np.random.Generator) -> Pose:
    return Pose(rng.uniform([-0.2, -0.2, 0.05], [0.2, 0.2, 0.45]), quaternions.normalized(rng.standard_normal(4)))


def solved(detected: list[DetectedTag], tags: TagMap = RIG.body, config: TagPoseConfig = CONFIG) -> TagPose:
    found = tag_pose(detected, tags, PINHOLE, config)
    assert isinstance(found, TagPose), found
    return found


def refusal(detected: list[DetectedTag], tags: TagMap = RIG.body, config: TagPoseConfig = CONFIG) -> NoTagPose:
    found = tag_pose(detected, tags, PINHOLE, config)
    assert isinstance(found, NoTagPose), found
    return found


def error(found: Pose, true: Pose) -> Array:
    """Position [m] and turn [rad] from the left (6,)."""
    turn = quaternions.log(quaternions.multiply(found.orientation_wxyz, quaternions.conjugate(true.orientation_wxyz)))
    return np.concatenate([found.position - true.position, turn])


def facing(distance: float, tilt: float) -> tuple[TagMap, Pose]:
    """One tag in front of the camera, tilted about its x axis [rad]; the map, and the tag's pose in the camera."""
    turn = quaternions.exp([np.pi + tilt, 0.0, 0.0])
    return TagMap("tag", (Tag(0, Pose.identity(), 0.08),)), Pose(np.array([0.02, 0.01, distance]), turn)


@pytest.mark.parametrize("seed", range(8))
def test_exact_corners_give_the_exact_pose_of_the_body_on_the_board(seed: int) -> None:
    true = random_pose(np.random.default_rng(seed))
    found = scene(true)
    pose = on_board(solved(found), solved(found, BOARD)).pose
    np.testing.assert_allclose(error(pose, true), 0.0, atol=1e-6)


def test_the_covariance_is_that_of_the_errors() -> None:
    rng = np.random.default_rng(0)
    true = Pose(np.array([0.05, 0.02, 0.1]), quaternions.normalized([0.8, 0.3, -0.4, 0.2]))
    config = replace(CONFIG, noise=CornerNoise(NOISE, oblique=1e-3))  # white, as the noise here is
    found = [shaken(scene(true), NOISE, rng) for _ in range(150)]
    poses = [on_board(solved(one, config=config), solved(one, BOARD, config)) for one in found]
    errors = np.array([error(one.pose, true) for one in poses])
    squares = [off @ np.linalg.solve(one.covariance, off) for off, one in zip(errors, poses)]
    assert 5.0 < np.mean(squares) < 7.0  # chi squared of 6 degrees of freedom; the standard error is 0.3
    said = np.sqrt(np.mean([np.diag(one.covariance) for one in poses], axis=0))
    np.testing.assert_allclose(errors.std(axis=0), said, rtol=0.25)


def test_residuals_larger_than_expected_make_the_covariance_larger() -> None:
    rng, true = np.random.default_rng(1), random_pose(np.random.default_rng(1))
    quiet, loud = (solved(shaken(scene(true), size, rng)) for size in (NOISE, 3.0 * NOISE))
    assert loud.misfit > 2.0 * quiet.misfit
    assert np.trace(loud.covariance) > 2.0 * np.trace(quiet.covariance)


def test_several_tags_together_are_surer_than_each_alone() -> None:
    found = scene(Pose(np.array([0.0, 0.0, 0.1]), quaternions.exp([0.3, 0.2, 0.4])))
    mine = [one for one in found if one.tag_id in RIG.body.ids]
    assert len(mine) == 3
    joint = np.linalg.eigvalsh(solved(mine).covariance)[-1]
    assert all(joint < np.linalg.eigvalsh(solved([one]).covariance)[-1] for one in mine)


def test_a_tag_that_may_be_tilted_either_way_gives_no_pose() -> None:
    tags, pose = facing(3.0, 0.15)
    far = seen(tags, pose, Pose.identity())
    found = refusal(shaken(far, 0.3 * NOISE, np.random.default_rng(2)), tags)
    assert found.kind == "flip"
    assert "times the misfit" in found.why


def test_a_tag_seen_with_much_perspective_gives_the_right_one_of_the_two_poses() -> None:
    for tilt in (-0.5, 0.5):
        tags, pose = facing(0.4, tilt)
        found = solved(shaken(seen(tags, pose, Pose.identity()), NOISE, np.random.default_rng(3)), tags)
        assert np.abs(error(found.pose, pose)[3:]).max() < 0.02


@pytest.mark.parametrize("seed", range(8))
def test_a_tag_seen_from_the_front_has_two_poses_in_one_flat_valley_and_gives_none(seed: int) -> None:
    tags, pose = facing(2.0, 0.0)
    found = refusal(shaken(seen(tags, pose, Pose.identity()), NOISE, np.random.default_rng(seed)), tags)
    assert found.kind in ("unsure", "flip")


def test_a_pose_whose_turn_is_hardly_known_is_left_out() -> None:
    strict = replace(CONFIG, largest_turn_deviation=1e-5)
    assert refusal(scene(random_pose(np.random.default_rng(4))), config=strict).kind == "unsure"


def test_no_flip_passes_in_many_views_of_single_tags() -> None:
    rng = np.random.default_rng(5)
    given = 0
    for _ in range(150):
        tags, pose = facing(rng.uniform(0.8, 1.2), rng.uniform(-0.8, 0.8))
        found = tag_pose(shaken(seen(tags, pose, Pose.identity()), NOISE, rng), tags, PINHOLE, CONFIG)
        if isinstance(found, TagPose):
            given += 1
            assert np.linalg.norm(error(found.pose, pose)[3:]) < 0.1
    assert given > 75


def test_a_half_hidden_tag_with_its_corners_elsewhere_is_left_out() -> None:
    true = Pose(np.array([0.0, 0.0, 0.1]), quaternions.exp([0.3, 0.2, 0.4]))
    found = scene(true)
    wrong = next(place for place, one in enumerate(found) if one.tag_id in BOARD.ids)
    corners = found[wrong].corners.copy()
    corners[2] += [6.0, -4.0]
    found[wrong] = found[wrong]._replace(corners=corners)
    board = solved(found, BOARD)
    assert found[wrong].tag_id not in board.tag_ids
    np.testing.assert_allclose(error(on_board(solved(found), board).pose, true), 0.0, atol=1e-5)


def test_corners_that_fit_no_pose_give_none() -> None:
    found = [one for one in scene(random_pose(np.random.default_rng(6))) if one.tag_id in RIG.body.ids][:2]
    mirrored = [one._replace(corners=one.corners[::-1]) for one in found]
    assert refusal(mirrored).kind == "misfit"


def test_no_tag_too_few_tags_and_tags_of_others_are_lost() -> None:
    found = scene(random_pose(np.random.default_rng(7)))
    assert refusal([]).kind == "lost"
    assert "found 0, expected 1" in refusal([one for one in found if one.tag_id in BOARD.ids]).why
    assert refusal(found, config=replace(CONFIG, fewest_tags=4)).kind == "lost"


def test_a_tag_that_is_there_twice_or_was_hardly_read_is_left_out() -> None:
    found = [
        one for one in scene(Pose(np.array([0.0, 0.0, 0.1]), quaternions.exp([0.3, 0.2, 0.4]))) if one.tag_id in RIG.body.ids
    ]
    assert len(found) >= 2
    assert found[0].tag_id in solved(found).tag_ids
    assert found[0].tag_id not in solved([*found, found[0]]).tag_ids
    assert found[0].tag_id not in solved([found[0]._replace(hamming=2), *found[1:]]).tag_ids


@pytest.mark.parametrize(
    "corners",
    [
        np.full((4, 2), np.nan),
        np.full((4, 2), 1e300),
        np.full((4, 2), 5.0),
        np.zeros((3, 2)),
        np.array([[0.0, 0], [9, 9], [5, 5], [7, 7]]),
    ],
    ids=["nan", "huge", "one place", "three", "a line"],
)
def test_corners_that_cannot_be_are_no_tag(corners: Array) -> None:
    assert refusal([DetectedTag(0, corners)]).kind == "lost"


def test_any_four_pixels_give_a_pose_or_a_reason() -> None:
    rng = np.random.default_rng(9)
    for _ in range(200):
        tags = [DetectedTag(int(tag_id), rng.uniform(0.0, 900.0, (4, 2))) for tag_id in rng.choice(6, 2, replace=False)]
        found = tag_pose(tags, RIG.body, PINHOLE, CONFIG)
        assert isinstance(found, NoTagPose)


def test_opencvs_order_of_corners_gives_the_same_pose() -> None:
    true = random_pose(np.random.default_rng(10))
    turned = [one._replace(corners=one.corners[[1, 0, 3, 2]] - 0.5) for one in scene(true)]
    pose = solved(turned, config=replace(CONFIG, corner_order=CornerOrder.OPENCV_TURNED)).pose
    np.testing.assert_allclose(error(CAMERA.pose.compose(pose), true), 0.0, atol=1e-6)


@pytest.mark.parametrize(
    ("model", "coefficients"),
    [("plumb_bob", (-0.2, 0.05, 1e-3, -1e-3, 0.0)), ("equidistant", (0.05, -0.01, 0.0, 0.0))],
)
def test_distortion_is_undone(model: str, coefficients: tuple[float, ...]) -> None:
    import cv2

    true, pixels = random_pose(np.random.default_rng(11)), []
    camera = Pinhole(PINHOLE.width, PINHOLE.height, PINHOLE.focal, PINHOLE.middle, model, coefficients)
    straight = [one for one in scene(true) if one.tag_id in RIG.body.ids]
    for one in straight:
        rays = np.column_stack([(one.corners - 0.5 - PINHOLE.middle) / PINHOLE.focal, np.ones(4)])
        module = cv2.fisheye if model == "equidistant" else cv2
        zero = np.zeros((3, 1))
        projected, _ = module.projectPoints(rays[:, None], zero, zero, camera.matrix, np.array(coefficients))
        pixels.append(one._replace(corners=projected.reshape(4, 2) + 0.5))
    assert np.abs(pixels[0].corners - straight[0].corners).max() > 1.0
    found = tag_pose(pixels, RIG.body, camera, CONFIG)
    assert isinstance(found, TagPose)
    np.testing.assert_allclose(error(CAMERA.pose.compose(found.pose), true), 0.0, atol=2e-4)


@pytest.mark.parametrize("field", ["fewest_tags", "largest_misfit", "flip_angle", "flip_ratio", "largest_turn_deviation"])
def test_limits_that_cannot_be_are_refused(field: str) -> None:
    with pytest.raises(InvalidValueError, match=field):
        replace(CONFIG, **{field: 0})  # type: ignore[arg-type]
    with pytest.raises(InvalidValueError, match="deviation, oblique"):
        CornerNoise(deviation=0.0)


def test_the_covariance_on_the_board_follows_finite_differences() -> None:
    rng = np.random.default_rng(12)
    body, board = random_pose(rng), Pose(np.array([0.1, -0.3, 0.8]), quaternions.normalized(rng.standard_normal(4)))
    spreads = [np.diag(rng.uniform(1e-6, 1e-4, 6)) for _ in range(2)]
    made = [TagPose(pose, spread, (), 1.0) for pose, spread in zip((body, board), spreads)]
    here, step = on_board(*made).pose, 1e-6
    columns = []
    for which in range(2):
        for axis in range(6):
            off = step * np.eye(6)[axis]
            poses = [body, board]
            turned = quaternions.multiply(quaternions.exp(off[3:]), poses[which].orientation_wxyz)
            poses[which] = Pose(poses[which].position + off[:3], turned)
            moved = on_board(*(replace(one, pose=pose) for one, pose in zip(made, poses))).pose
            columns.append(error(moved, here) / step)
    slopes = np.array(columns).T  # (6, 12)
    expected = slopes[:, :6] @ spreads[0] @ slopes[:, :6].T + slopes[:, 6:] @ spreads[1] @ slopes[:, 6:].T
    np.testing.assert_allclose(on_board(*made).covariance, expected, atol=1e-9)


@pytest.mark.parametrize(
    ("model", "distortion"),
    [
        ("plumb_bob", (-0.35, 0.12, 0.0005, 0.0003, -0.018)),
        ("rational_polynomial", (0.45, -0.1, 1e-4, 1e-4, -0.005, 0.8, -0.02, -0.02)),
        ("equidistant", (0.05, 0.01, -0.01, 0.002)),
    ],
)
def test_the_distortion_of_a_wide_lens_is_undone_to_the_edge_of_the_image(model: str, distortion: tuple[float, ...]) -> None:
    camera = Pinhole(640, 480, (380.0, 380.0), (319.5, 239.5), model, distortion)
    across, down = np.meshgrid(np.linspace(-0.75, 0.75, 9), np.linspace(-0.55, 0.55, 7))
    rays = np.stack([across.ravel(), down.ravel(), np.ones(across.size)], axis=1)
    module = cv2.fisheye if model == "equidistant" else cv2
    seen, _ = module.projectPoints(rays[:, np.newaxis], np.zeros(3), np.zeros(3), camera.matrix, np.array(distortion))
    np.testing.assert_allclose(undistorted(seen[:, 0], camera), camera.project(rays), atol=1e-3)
