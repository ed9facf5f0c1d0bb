"""Renders the world with its tags as seen by a camera that looks at the board, through EGL without a screen."""

from dataclasses import dataclass
from types import TracebackType
from typing import Any, Self

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from contact_curation.contact.body import Body
from contact_curation.errors import InvalidValueError, MissingDependencyError
from contact_curation.geometry import quaternions
from contact_curation.geometry.pinhole import Pinhole, pinhole_of_view
from contact_curation.geometry.poses import Pose
from contact_curation.geometry.tag_rig import TagRig
from contact_curation.geometry.tags import HALF_TURN_ABOUT_X
from contact_curation.simulation.camera.tag_textures import Image, add_tags
from contact_curation.simulation.world import world_of

CAMERA = "camera"

STEP = 1e-3
"""Time step [s] of the rendered world; MuJoCo needs one, although this world is never simulated."""

UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class CameraConfig:
    """Position of the camera in the board's frame, and properties of its images.

    Attributes:
        position: position of the pinhole [m].
        target: point that the camera looks at, in the middle of the image [m].
        vertical_view: angle of view, from the upper edge of the image to the lower [rad].
        width: width of the image [px].
        height: height of the image [px].
        samples: antialiasing samples per pixel, along its edges.
        grey_noise: standard deviation of each pixel's grey value, out of 255.
    """

    position: tuple[float, float, float] = (0.0, -0.8, 0.8)
    target: tuple[float, float, float] = (0.0, 0.0, 0.08)
    vertical_view: float = 0.80
    width: int = 1280
    height: int = 960
    samples: int = 4
    grey_noise: float = 2.0

    def __post_init__(self) -> None:
        ahead = np.subtract(self.target, self.position)
        if not (np.isfinite(ahead).all() and np.linalg.norm(np.cross(ahead, UP)) > 1e-6):
            raise InvalidValueError("camera", f"{self.position} looking at {self.target}", "another direction than up or down")
        if not 0.0 < self.vertical_view < np.pi:
            raise InvalidValueError("vertical_view", self.vertical_view, "an angle between 0 and pi")
        if not (self.width > 0 and self.height > 0 and self.samples >= 0 and self.grey_noise >= 0.0):
            found = (self.width, self.height, self.samples, self.grey_noise)
            raise InvalidValueError("width, height, samples, grey_noise", found, "positive sizes, the others 0 or more")

    @property
    def pose(self) -> Pose:
        """Pose of the camera in the board's frame: x to the right, y down, z forward."""
        forward = np.subtract(self.target, self.position)
        forward /= np.linalg.norm(forward)
        right = np.cross(forward, UP)
        right /= np.linalg.norm(right)
        axes = np.stack([right, np.cross(forward, right), forward], axis=1)
        return Pose(np.asarray(self.position), Rotation.from_matrix(axes).as_quat(scalar_first=True))

    @property
    def pinhole(self) -> Pinhole:
        return pinhole_of_view(self.width, self.height, self.vertical_view)


def add_camera(spec: mujoco.MjSpec, config: CameraConfig) -> None:
    """Adds the camera to a world. MuJoCo's cameras look along their -z axis, with y up."""
    turned = quaternions.multiply(config.pose.orientation_wxyz, HALF_TURN_ABOUT_X)
    spec.worldbody.add_camera(name=CAMERA, pos=config.position, quat=turned, fovy=np.degrees(config.vertical_view))
    spec.visual.global_.offwidth, spec.visual.global_.offheight = config.width, config.height
    spec.visual.quality.offsamples = config.samples


class CameraView:
    """Renders images of the body and the board.

    An OpenGL context belongs to the thread that made it current: make, use and close a view in one thread.

    Args:
        body: body that is tossed.
        rig: tags on the body and on the board.
        config: configuration of the camera.

    Raises:
        MissingDependencyError: EGL, or a driver for it, is not installed.
    """

    def __init__(self, body: Body, rig: TagRig, config: CameraConfig) -> None:
        self.config = config
        spec = world_of(body, STEP)
        add_tags(spec, rig.body.moved(-body.center_of_mass), body.name)
        if rig.board is not None:
            add_tags(spec, rig.board)
        add_camera(spec, config)
        _light(spec)
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        self._joint = self.model.jnt_qposadr[self.model.joint(body.name).id]
        self._context = egl_context(config.width, config.height)
        self._context.make_current()
        self._scene = mujoco.MjvScene(self.model, maxgeom=self.model.ngeom + 10)
        self._scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = False
        self._scene.flags[mujoco.mjtRndFlag.mjRND_REFLECTION] = False
        self._drawing = mujoco.MjrContext(self.model, mujoco.mjtFontScale.mjFONTSCALE_100)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self._drawing)
        self._camera = mujoco.MjvCamera()
        self._camera.type, self._camera.fixedcamid = mujoco.mjtCamera.mjCAMERA_FIXED, self.model.camera(CAMERA).id

    def image(self, pose: Pose, rng: np.random.Generator | None = None) -> Image:
        """Renders an image (height, width) of grey values.

        Args:
            pose: pose of the body in the board's frame.
            rng: random generator of the pixels' noise; None for no noise.
        """
        self.data.qpos[self._joint : self._joint + 7] = [*pose.position, *pose.orientation_wxyz]
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_camlight(self.model, self.data)
        option, everything = mujoco.MjvOption(), mujoco.mjtCatBit.mjCAT_ALL
        mujoco.mjv_updateScene(self.model, self.data, option, None, self._camera, everything, self._scene)
        area = mujoco.MjrRect(0, 0, self.config.width, self.config.height)
        colours = np.empty((self.config.height, self.config.width, 3), dtype=np.uint8)
        mujoco.mjr_render(area, self._scene, self._drawing)
        mujoco.mjr_readPixels(colours, None, area, self._drawing)
        grey = colours[::-1, :, 1]  # all colours are greys, and OpenGL's first row is the lowest
        return np.ascontiguousarray(grey) if rng is None else _noisy(grey, self.config.grey_noise, rng)

    def close(self) -> None:
        """Frees the OpenGL context."""
        self._drawing.free()
        self._context.free()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()


def egl_context(width: int, height: int) -> Any:
    """Makes an OpenGL context without a screen.

    Raises:
        MissingDependencyError: EGL, or a driver for it, is not installed.
    """
    try:
        from mujoco.egl import GLContext
    except (ImportError, AttributeError) as error:
        raise MissingDependencyError("libEGL", f"install the package libegl1 (Debian, Ubuntu); {error}") from error
    try:
        return GLContext(width, height)
    except (ImportError, RuntimeError) as error:
        raise MissingDependencyError("a driver for EGL", f"install libgl1-mesa-dri (Debian, Ubuntu); {error}") from error


def _noisy(grey: Image, deviation: float, rng: np.random.Generator) -> Image:
    noise = rng.standard_normal(grey.shape, dtype=np.float32)
    noise *= deviation
    noise += grey
    return np.asarray(np.clip(np.rint(noise, out=noise), 0, 255, out=noise), dtype=np.uint8)


def _light(spec: mujoco.MjSpec) -> None:
    """Sets even light, so that white is white on every face, and a grey board and body, so that tags have an edge."""
    spec.visual.headlight.ambient, spec.visual.headlight.diffuse = [0.7] * 3, [0.3] * 3
    spec.visual.headlight.specular = [0.0] * 3
    spec.visual.map.znear = 0.01
    for geom in spec.geoms:
        if not geom.name.startswith("tag "):
            geom.rgba = [0.5, 0.5, 0.5, 1.0]
