"""The simulated world as a MuJoCo specification, built in code: a board, the body tossed onto it, and the body's free motion.

MuJoCo shares nothing with our own rollouts: its contacts are soft, it finds them between convex shapes, and it solves for
forces in another way. So it shows whether a result is one of physics or of our solver. The specification can be added to (an
arm, a camera) before it is compiled. MuJoCo's free joint has our conventions: position, quaternion wxyz, velocity in the
world's frame, angular velocity in the body's.
"""

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from contact_curation.contact.body import Body
from contact_curation.contact.time_step import STATE_SIZE, checked_states
from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array


@dataclass(frozen=True)
class WorldConfig:
    """How finely the world moves. The defaults hold for every world here: thrown by the arm, or replayed from a release.

    With MuJoCo's own time constant of 20 ms a cube sinks 6 to 10 mm into the board where it lands, further than any real one;
    with 6 ms it sinks 1 to 4 mm, and comes as near to the real tosses (`python -m benchmarks.speed.rollout`).

    Attributes:
        longest_step: frames are cut into equal steps of at most this [s].
        contact_time: time constant in which contacts push bodies apart [s]; MuJoCo takes no less than two steps.
    """

    longest_step: float = 0.001
    contact_time: float = 0.006

    def __post_init__(self) -> None:
        for name in ("longest_step", "contact_time"):
            if not (np.isfinite(getattr(self, name)) and getattr(self, name) > 0.0):
                raise InvalidValueError(name, getattr(self, name), "a positive number of seconds")

    def steps_in(self, frame_period: float) -> int:
        """Steps in a frame."""
        return int(np.ceil(frame_period / self.longest_step))


DEFAULT_WORLD = WorldConfig()

MUJOCO_DEFAULTS = WorldConfig(longest_step=0.0035, contact_time=0.02)
"""World of method.md 1.11: MuJoCo's default softness, with two steps a frame."""


def world_of(body: Body, step: float, contact_time: float = DEFAULT_WORLD.contact_time) -> mujoco.MjSpec:
    """A board, the plane z = 0, and a body that moves freely over it, everything else as MuJoCo has it by default.

    The friction cone is the elliptic one: for isotropic friction a disk, while the default pyramid lies inside of it and would
    make friction weaker in some directions than in others.

    Args:
        body: shape, inertia and friction; its name is the name of its body, its joint and its geom.
        step: time step [s].
        contact_time: see `WorldConfig`.
    """
    spec = mujoco.MjSpec()
    spec.option.timestep = step
    spec.option.gravity = [0.0, 0.0, -body.gravity]
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.worldbody.add_geom(name="board", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0.0, 0.0, 1.0])
    _add_body(spec, body, contact_time)
    return spec


def _add_body(spec: mujoco.MjSpec, body: Body, contact_time: float) -> None:
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
        solref=[contact_time, 1.0],
        priority=1,  # against the board and all else it is the body's friction that counts
    )


def free_motion(body: Body, release: ArrayLike, frames: int, frame_period: float, config: WorldConfig = DEFAULT_WORLD) -> Array:
    """Simulates the free motion of a body after its release, as a tracker without noise would measure it.

    Args:
        body: what is tossed.
        release: (13,) its state in SI units: position, orientation wxyz, velocity in the board's frame, angular velocity in
            the body's.
        frames: how many, the release included.
        frame_period: [s].
        config: how finely the world moves.

    Returns:
        States (frames, 13) in SI units, the release first; NaN from the frame on that MuJoCo calls unstable.

    Raises:
        InvalidValueError: a release that is not finite or of another shape, no frame, or a period that is not positive.
    """
    first = checked_states(np.asarray(release, dtype=float)[None])[0]
    if not np.isfinite(first).all():
        raise InvalidValueError("release", "a number that is not finite", "13 finite numbers")
    if frames < 1:
        raise InvalidValueError("frames", frames, "at least 1")
    if not (np.isfinite(frame_period) and frame_period > 0.0):
        raise InvalidValueError("frame_period", frame_period, "a positive number of seconds")
    steps = config.steps_in(frame_period)
    return _moved(world_of(body, frame_period / steps, config.contact_time).compile(), first, frames, steps)


def _moved(model: mujoco.MjModel, release: Array, frames: int, steps: int) -> Array:
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = release[:7], release[7:]
    states = np.full((frames, STATE_SIZE), np.nan)
    states[0] = release
    for frame in range(1, frames):
        mujoco.mj_step(model, data, steps)
        if data.warning.number.any():  # by default it has then started again from elsewhere
            break
        states[frame] = np.concatenate([data.qpos, data.qvel])
    return states
