"""A body's motion from its release on, in the simulated world.

MuJoCo's free joint has our conventions: position, quaternion wxyz, velocity in the world's frame, angular velocity in the
body's.
"""

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from contact_curation.contact.body import Body
from contact_curation.contact.time_step import STATE_SIZE, checked_states
from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array
from contact_curation.simulation.world import DEFAULT_WORLD, WorldConfig, world_of


def free_motion(body: Body, release: ArrayLike, frames: int, frame_period: float, config: WorldConfig = DEFAULT_WORLD) -> Array:
    """What a tracker without noise would see of a toss.

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
