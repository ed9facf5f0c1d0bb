"""The simulated world as a MuJoCo specification, built in code: a board, and the body that is tossed onto it.

MuJoCo shares nothing with our own rollouts: its contacts are soft, it finds them between convex shapes, and it solves for
forces in another way. So it tells whether a result is one of physics or of our solver. The specification can be added to (an
arm, a camera) before it is compiled.
"""

from dataclasses import dataclass

import mujoco
import numpy as np

from contact_curation.contact.body import Body
from contact_curation.errors import InvalidValueError


@dataclass(frozen=True)
class WorldConfig:
    """How finely the world moves. The defaults hold for every world here: thrown by the arm, or replayed from a release.

    With MuJoCo's own time constant of 20 ms a cube sinks 6 to 10 mm into the board where it lands, further than any real one;
    with 6 ms it sinks 1 to 4 mm, and comes as near to the real tosses (`python -m benchmarks.rollout`).

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
"""As METHOD 1.11 had it: MuJoCo's own softness, at two steps a frame."""


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
