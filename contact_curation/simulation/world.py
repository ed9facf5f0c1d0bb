"""The simulated world as a MuJoCo specification, built in code: a board, the body tossed onto it, and the body's free motion.

MuJoCo shares no code with our own rollouts: its contacts are soft, its collision detection works on convex shapes, and it
computes forces in another way. So it shows whether a result comes from physics or from our solver. An arm or a camera can be
added to the specification before it is compiled. MuJoCo's free joint has our conventions: position, quaternion wxyz, velocity
in the world's frame, angular velocity in the body's frame.
"""

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from contact_curation.configs import check_positive
from contact_curation.contact.body import CONTACTNETS_CUBE, Body
from contact_curation.contact.time_step import STATE_SIZE, checked_states
from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array
from contact_curation.motion.scales import size_of

STEPS_IN_CONTACT = 6
"""Time steps in the time constant of contacts."""


@dataclass(frozen=True)
class WorldConfig:
    """Time step and contact softness. The defaults are those of bodies as large as ContactNets' cube, or larger.

    With MuJoCo's default time constant of 20 ms a cube sinks 6 to 10 mm into the board at an impact, deeper than real cubes do.
    With 6 ms it sinks 1 to 4 mm, and predicts the real tosses as well (`python -m benchmarks.speed.rollout`).

    Attributes:
        longest_step: largest time step [s]; a frame is divided into equal steps.
        contact_time: time constant of contacts [s]; at least two steps, to which MuJoCo raises it.
        damping_ratio: of contacts; a cube that falls on a face leaves with 0.12 of its speed at 1, 0.3 at 0.4, 0.5 at 0.2.
    """

    longest_step: float = 0.001
    contact_time: float = 0.006
    damping_ratio: float = 1.0

    def __post_init__(self) -> None:
        check_positive(self, ("longest_step", "contact_time"), unit="of seconds")
        check_positive(self, ("damping_ratio",))

    @classmethod
    def of_body(cls, body: Body) -> "WorldConfig":
        """In which a body sinks no deeper for its size than the cube: a small one has shorter contacts, and steps."""
        contact_time = cls.contact_time * min(1.0, size_of(body.vertices) / size_of(CONTACTNETS_CUBE.vertices))
        return cls(min(cls.longest_step, contact_time / STEPS_IN_CONTACT), contact_time)

    def steps_in(self, frame_period: float) -> int:
        """Number of steps in a frame of `frame_period` [s]."""
        return int(np.ceil(frame_period / self.longest_step))


DEFAULT_WORLD = WorldConfig()

MUJOCO_DEFAULTS = WorldConfig(longest_step=0.0035, contact_time=0.02)
"""World of method.md 1.11: MuJoCo's default softness, with two steps a frame."""


def world_of(body: Body, step: float, contact_time: float | None = None, damping_ratio: float = 1.0) -> mujoco.MjSpec:
    """Builds a world with a board (the plane z = 0) and a free body, with MuJoCo's defaults for everything else.

    The friction cone is elliptic. MuJoCo's default pyramid lies inside it and makes friction weaker in some directions.

    Args:
        body: shape, inertia and friction; its name is given to its body, joint and geom in MuJoCo.
        step: time step [s].
        contact_time, damping_ratio: of contacts, see `WorldConfig`; None for that of the body.
    """
    if contact_time is None:
        contact_time = WorldConfig.of_body(body).contact_time
    spec = mujoco.MjSpec()
    spec.option.timestep = step
    spec.option.gravity = [0.0, 0.0, -body.gravity]
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.worldbody.add_geom(name="board", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0.0, 0.0, 1.0])
    _add_body(spec, body, [contact_time, damping_ratio])
    return spec


def _add_body(spec: mujoco.MjSpec, body: Body, contact: list[float]) -> None:
    xx, xy, xz, _, yy, yz, _, _, zz = body.inertia.ravel()
    moving = spec.worldbody.add_body(
        name=body.name, mass=body.mass, ipos=[0.0, 0.0, 0.0], fullinertia=[xx, yy, zz, xy, xz, yz], explicitinertial=True
    )
    moving.add_freejoint(name=body.name)
    spec.add_mesh(name=body.name, uservert=body.vertices.ravel())
    moving.add_geom(
        name=body.name,
        type=mujoco.mjtGeom.mjGEOM_MESH,
        meshname=body.name,
        friction=[body.friction, 0.0, 0.0],
        solref=contact,
        priority=1,  # the body's friction counts in every contact
    )


def free_motion(body: Body, release: ArrayLike, frames: int, frame_period: float, config: WorldConfig = DEFAULT_WORLD) -> Array:
    """Simulates the free motion of a body after its release, as a tracker without noise would measure it.

    Args:
        body: what is tossed.
        release: (13,) its state in SI units: position, orientation wxyz, velocity in the board's frame, angular velocity in
            the body's.
        frames: number of frames, including the release.
        frame_period: time between frames [s].
        config: time step and contact softness.

    Returns:
        States (frames, 13) in SI units, the release first; NaN from the frame on at which MuJoCo becomes unstable.

    Raises:
        InvalidValueError: `release` is not finite or has another shape, `frames` is below 1, or `frame_period` is not positive.
    """
    first = checked_states(np.asarray(release, dtype=float)[None])[0]
    if not np.isfinite(first).all():
        raise InvalidValueError("release", "a number that is not finite", "13 finite numbers")
    if frames < 1:
        raise InvalidValueError("frames", frames, "at least 1")
    if not (np.isfinite(frame_period) and frame_period > 0.0):
        raise InvalidValueError("frame_period", frame_period, "a positive number of seconds")
    steps = config.steps_in(frame_period)
    model = world_of(body, frame_period / steps, config.contact_time, config.damping_ratio).compile()
    return _moved(model, first, frames, steps)


def _moved(model: mujoco.MjModel, release: Array, frames: int, steps: int) -> Array:
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = release[:7], release[7:]
    states = np.full((frames, STATE_SIZE), np.nan)
    states[0] = release
    for frame in range(1, frames):
        mujoco.mj_step(model, data, steps)
        if data.warning.number.any():  # MuJoCo resets an unstable state by default
            break
        states[frame] = np.concatenate([data.qpos, data.qvel])
    return states
