"""The rendered camera: MuJoCo's own projection, and render -> detect -> pose, which holds all conventions together."""

import sys
from collections.abc import Iterator
from dataclasses import replace

import mujoco
import numpy as np
import pytest

from contact_curation.contact.body import CONTACTNETS_CUBE as CUBE
from contact_curation.contact.body import Body
from contact_curation.errors import InvalidValueError, MissingDependencyError
from contact_curation.geometry import quaternions
from contact_curation.geometry.poses import Pose
from contact_curation.geometry.quaternions import Array
from contact_curation.geometry.tag_rig import rig_of
from contact_curation.geometry.tags import CornerOrder, TagAxes, in_our_axes, in_our_order
from contact_curation.motion.tags.pose import DetectedTag, TagPose, TagPoseConfig, on_board, tag_pose
from contact_curation.simulation.camera.camera import CAMERA, CameraConfig, CameraView, add_camera, egl_context
from contact_curation.simulation.camera.tag_detection import Detection, DetectorConfig, TagDetector
from contact_curation.simulation.camera.tag_textures import tag_library
from contact_curation.simulation.world import world_of
from test.tag_scene import BOARD, RIG

SMALL = CameraConfig(width=800, height=600)
POSES = [
    Pose(np.array([0.0, 0.0, 0.0524]), quaternions.IDENTITY),
    Pose(np.array([0.1, 0.05, 0.2]), quaternions.normalized([0.8, 0.3, -0.4, 0.2])),
    Pose(np.array([-0.2, -0.1, 0.25]), quaternions.normalized([0.1, 0.7, 0.3, -0.6])),
]


@pytest.fixture(scope="module")
def view() -> Iterator[CameraView]:
    with CameraView(CUBE, RIG, SMALL) as made:
        yield made


@pytest.fixture(scope="module")
def detector() -> TagDetector:
    return TagDetector(DetectorConfig(decimate=1.0))


def as_detected(found: tuple[Detection, ...]) -> list[DetectedTag]:
    return [DetectedTag(one.tag_id, one.corners, one.hamming) for one in found]


def pose_error(found: Pose, true: Pose) -> tuple[float, float]:
    """[m], [deg]"""
    turn = quaternions.angle_between(found.orientation_wxyz, true.orientation_wxyz)
    return float(np.linalg.norm(found.position - true.position)), float(np.degrees(turn))


def in_camera(points: Array, config: CameraConfig) -> Array:
    return np.asarray(quaternions.rotate(quaternions.conjugate(config.pose.orientation_wxyz), points - config.pose.position))


def test_pixels_are_those_of_mujocos_own_projection() -> None:
    spec = world_of(CUBE, 1e-3)
    add_camera(spec, SMALL)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    scene = mujoco.MjvScene(model, maxgeom=10)
    camera = mujoco.MjvCamera()
    camera.type, camera.fixedcamid = mujoco.mjtCamera.mjCAMERA_FIXED, model.camera(CAMERA).id
    mujoco.mjv_updateScene(model, data, mujoco.MjvOption(), None, camera, mujoco.mjtCatBit.mjCAT_ALL, scene)
    eye = scene.camera[0]
    assert eye.frustum_center == 0.0
    points = np.random.default_rng(0).uniform(-0.3, 0.3, (20, 3))
    forward, up = np.array(eye.forward), np.array(eye.up)
    offset = points - 0.5 * (np.array(eye.pos) + np.array(scene.camera[1].pos))  # of two eyes
    depths = offset @ forward
    top = eye.frustum_near / eye.frustum_top  # of a frustum as high as it is near
    across = offset @ np.cross(forward, up) / depths * top * SMALL.height / 2 + SMALL.width / 2 - 0.5
    down = -offset @ up / depths * top * SMALL.height / 2 + SMALL.height / 2 - 0.5
    ours = SMALL.pinhole.project(in_camera(points, SMALL))
    np.testing.assert_allclose(ours, np.column_stack([across, down]), atol=0.01)  # a scene is in single precision


@pytest.mark.parametrize("true", POSES, ids=["at rest", "in the air", "upside down"])
def test_rendered_tags_are_where_they_are_projected_and_give_the_pose(
    view: CameraView, detector: TagDetector, true: Pose
) -> None:
    found = detector.detect(view.image(true, np.random.default_rng(0)))
    assert len(found) >= 5
    off = {
        one.tag_id: np.abs(in_our_order(one.corners, CornerOrder.APRILTAG) - _projected(true, one.tag_id)).max()
        for one in found
    }
    assert sum(error > 0.5 for error in off.values()) <= 1, off  # the body may cover the rim of a tag of the board
    assert all(error < 0.5 for tag_id, error in off.items() if tag_id in RIG.body.ids), off
    body, board = (tag_pose(as_detected(found), tags, SMALL.pinhole, TagPoseConfig()) for tags in (RIG.body, BOARD))
    assert isinstance(body, TagPose)
    assert isinstance(board, TagPose)
    metres, degrees = pose_error(on_board(body, board).pose, true)
    assert metres < 1e-3
    assert degrees < 0.2
    metres, degrees = pose_error(board.pose, SMALL.pose.inverse())
    assert metres < 1e-3
    assert degrees < 0.1


def test_corners_on_fitted_lines_are_off_by_less_than_half_of_what_the_library_leaves(view: CameraView) -> None:
    errors = []
    for refine in (True, False):
        looked_at = TagDetector(DetectorConfig(decimate=1.0, refine_corners=refine))
        found = [(one, true) for true in POSES for one in looked_at.detect(view.image(true, np.random.default_rng(0)))]
        off = [
            in_our_order(one.corners, CornerOrder.APRILTAG) - _projected(true, one.tag_id)
            for one, true in found
            if one.tag_id in RIG.body.ids
        ]
        errors.append(float(np.median(np.abs(off))))
    assert errors[0] < 0.5 * errors[1]


def test_the_librarys_own_pose_looks_into_the_tag_and_becomes_ours(view: CameraView) -> None:
    true = POSES[1]
    (fx, fy), (cx, cy) = SMALL.pinhole.focal, SMALL.pinhole.middle
    intrinsics = (fx, fy, cx + 0.5, cy + 0.5)
    found = tag_library().detector.detect(view.image(true), True, intrinsics, RIG.body.tags[0].edge)
    mine = [one for one in found if one.tag_id in RIG.body.ids]
    assert mine
    best = max(mine, key=lambda one: one.decision_margin)
    matrix = np.asarray(best.pose_R, dtype=float)
    wxyz = np.zeros(4)
    mujoco.mju_mat2Quat(wxyz, matrix.ravel())
    into = Pose(np.ravel(best.pose_t), wxyz)
    tag = RIG.body.tag(best.tag_id)
    expected = SMALL.pose.inverse().compose(true.compose(tag.pose))
    metres, degrees = pose_error(in_our_axes(into, TagAxes.INTO), expected)
    assert metres < 0.02
    assert degrees < 6.0
    assert pose_error(into, expected)[1] > 90.0


def test_the_same_seed_gives_the_same_image_and_noise_is_as_wanted(view: CameraView) -> None:
    clean = view.image(POSES[0])
    noisy = view.image(POSES[0], np.random.default_rng(3))
    np.testing.assert_array_equal(noisy, view.image(POSES[0], np.random.default_rng(3)))
    grey = (clean > 60) & (clean < 200)
    assert np.std(noisy[grey].astype(float) - clean[grey]) == pytest.approx(SMALL.grey_noise, rel=0.1)


def test_tags_on_the_far_side_are_not_seen(view: CameraView, detector: TagDetector) -> None:
    """At rest the camera looks at the top and at the face towards it; the other sides are turned away or edge on."""
    ids = {one.tag_id for one in detector.detect(view.image(POSES[0])) if one.tag_id in RIG.body.ids}
    facing = {
        tag.tag_id
        for tag in RIG.body.tags
        if (SMALL.pose.position - tag.pose.position - POSES[0].position)
        @ quaternions.rotate(tag.pose.orientation_wxyz, [0.0, 0.0, 1.0])
        > 0.1
    }
    assert ids == facing
    assert len(ids) == 2


def test_any_convex_body_can_be_seen(detector: TagDetector) -> None:
    vertices = 0.1 * np.vstack([np.eye(3), -np.eye(3)])
    octahedron = Body("octahedron", vertices, 0.3, np.full(3, 3e-4), 0.3, 0.1)
    rig = rig_of(octahedron.polytope, "body_octahedron", "body_surface")
    assert len(rig.body.tags) == 8
    assert rig.board is not None
    true = Pose(np.array([0.0, 0.0, 0.15]), quaternions.normalized([0.9, 0.1, 0.2, 0.1]))
    close = replace(SMALL, position=(0.0, -0.5, 0.55))
    with CameraView(octahedron, rig, close) as view:
        found = as_detected(detector.detect(view.image(true, np.random.default_rng(0))))
    pose = tag_pose(found, rig.body, close.pinhole, TagPoseConfig())
    assert isinstance(pose, TagPose)
    assert len(pose.tag_ids) >= 2
    metres, degrees = pose_error(close.pose.compose(pose.pose), true)
    assert metres < 2e-3
    assert degrees < 0.5


def test_tags_that_are_given_in_another_frame_than_the_centre_of_mass_are_seen_at_the_same_places(view: CameraView) -> None:
    beside = replace(CUBE, center_of_mass=np.array([0.02, -0.01, 0.03]))
    with CameraView(beside, rig_of(beside.tracked_polytope, "body_cube", "body_surface"), SMALL) as other:
        np.testing.assert_array_equal(other.image(POSES[1]), view.image(POSES[1]))


@pytest.mark.parametrize(
    ("missing", "package"), [("mujoco.egl", "libegl1"), ("device", "libgl1-mesa-dri")], ids=["no EGL", "no driver"]
)
def test_without_egl_the_package_to_install_is_named_in_one_line(
    monkeypatch: pytest.MonkeyPatch, missing: str, package: str
) -> None:
    if missing == "device":
        import mujoco.egl

        def refuse(*_: int) -> None:
            raise ImportError("Cannot initialize a EGL device display.")

        monkeypatch.setattr(mujoco.egl, "GLContext", refuse)
    else:
        monkeypatch.setitem(sys.modules, missing, None)
    with pytest.raises(MissingDependencyError) as caught:
        egl_context(64, 64)
    assert package in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "wrong",
    [
        {"target": (0.0, -0.8, 0.0)},
        {"vertical_view": 4.0},
        {"width": 0},
        {"grey_noise": -1.0},
        {"position": (np.nan, 0.0, 1.0)},
    ],
    ids=str,
)
def test_a_camera_that_cannot_be_is_refused(wrong: dict[str, object]) -> None:
    with pytest.raises(InvalidValueError):
        replace(CameraConfig(), **wrong)  # type: ignore[arg-type]


@pytest.mark.parametrize(("name", "value"), [("decimate", 0.5), ("blur", -1.0), ("blur", np.inf), ("threads", 0)])
def test_a_detector_that_cannot_be_is_refused(name: str, value: float) -> None:
    with pytest.raises(InvalidValueError, match=f"detector.{name}: found {value}, expected a number of at least"):
        DetectorConfig(**{name: value})  # type: ignore[arg-type]


def _projected(pose: Pose, tag_id: int) -> Array:
    """Corners (4, 2) [px] of a tag of the board, or of the body at a pose."""
    if tag_id in BOARD.ids:
        return SMALL.pinhole.project(in_camera(BOARD.tag(tag_id).corners, SMALL))
    on_body = quaternions.rotate(pose.orientation_wxyz, RIG.body.tag(tag_id).corners)
    return SMALL.pinhole.project(in_camera(pose.position + on_body, SMALL))


@pytest.mark.parametrize("height", [1, 2, 3, 4, 15, 16, 17])
def test_an_image_that_is_too_small_for_a_tag_has_none(height: int) -> None:
    for width in (1, 3, 15, 16, 640):
        assert TagDetector().detect(np.zeros((height, width), dtype=np.uint8)) == ()
