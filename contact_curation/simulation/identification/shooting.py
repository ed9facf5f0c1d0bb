"""How far MuJoCo's motions are from the measured ones: multiple shooting over windows of some frames.

Each window begins at a measured state, as the tracker gives it, so that errors do not grow over a whole toss, in which a small
change of an impact decides on which face the body ends. A residual is the error of a position, or of a turn times the body's
characteristic length, in units of its standard deviation by the tracker's noise: velocities are differences of poses, so that

    r_k = (x_k - measured_k) / (s sqrt(1 + k^2 + (1 + k)^2))        k frames after the window's beginning, s the tracker's noise
"""

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from mujoco import rollout

from contact_curation.contact.body import Body
from contact_curation.contact.time_step import STATE_SIZE
from contact_curation.geometry import quaternions
from contact_curation.geometry.quaternions import Array
from contact_curation.motion.pose_noise import RIG_NOISE
from contact_curation.motion.toss import Toss
from contact_curation.motion.transitions import periods_of, states_of
from contact_curation.simulation.identification.box import IdentifiedBox
from contact_curation.simulation.world import DEFAULT_WORLD, WorldConfig, world_of

FRAMES = 20
"""Of a window."""

WORST = 1e4
"""A residual that is not finite, or larger, counts as this."""


@dataclass(frozen=True, eq=False)
class Windows:
    """W windows of F + 1 frames of tosses of one body; made by `of`.

    Attributes:
        body: whose mass, inertia and gravity count.
        measured: (W, F + 1, 13) states in SI units, the beginnings first.
        seen: (W, F + 1) which of these were measured.
        frame_period: between frames [s].
        world: longest time step.
    """

    body: Body
    measured: Array
    seen: Array
    frame_period: float
    world: WorldConfig = DEFAULT_WORLD

    @staticmethod
    def of(body: Body, tosses: Sequence[Toss], frames: int = FRAMES) -> "Windows":
        """Windows of at most so many frames, one after another; 0 for one window per toss."""
        pieces = [piece for toss in tosses for piece in _pieces(toss, frames or toss.frames)]
        longest = max(int(places[-1]) for places, _ in pieces)
        measured, seen = np.zeros((len(pieces), longest + 1, STATE_SIZE)), np.zeros((len(pieces), longest + 1), dtype=bool)
        for number, (places, states) in enumerate(pieces):
            measured[number, places], seen[number, places] = states, True
        return Windows(body, measured, seen, tosses[0].frame_period)

    def residuals(self, box: IdentifiedBox) -> Array:
        """(R,) residuals of a box's motions."""
        moved = self._moved(box)
        offsets = moved[..., :3] - self.measured[:, 1:, :3]
        turns = quaternions.multiply(quaternions.conjugate(self.measured[:, 1:, 3:7]), moved[..., 3:7])
        errors = np.concatenate([offsets, self.body.length_scale * quaternions.log(turns)], axis=-1)[self.seen[:, 1:]]
        scaled = np.nan_to_num(errors / self._deviations[:, None], nan=WORST)
        return np.asarray(np.clip(scaled, -WORST, WORST)).ravel()

    def misfit(self, box: IdentifiedBox) -> float:
        """The sum of sqrt(1 + r^2) - 1: squares where residuals are small, moduli where they are not."""
        return float((np.sqrt(1.0 + np.square(self.residuals(box))) - 1.0).sum())

    @property
    def _deviations(self) -> Array:
        after = np.broadcast_to(np.arange(1, self.seen.shape[1]), self.seen[:, 1:].shape)[self.seen[:, 1:]]
        return np.asarray(RIG_NOISE * np.sqrt(1.0 + after**2 + (1.0 + after) ** 2))

    def _moved(self, box: IdentifiedBox) -> Array:
        """(W, F, 13) states of a box that begins where the windows do."""
        steps = self.world.steps_in(self.frame_period)
        model = world_of(box.of(self.body), self.frame_period / steps, box.contact_time, box.damping_ratio).compile()
        begun = np.concatenate([np.zeros((len(self.measured), 1)), self.measured[:, 0]], axis=1)  # a state begins with the time
        states, _ = rollout.rollout(model, mujoco.MjData(model), begun, nstep=steps * (self.seen.shape[1] - 1))
        return np.asarray(states[:, steps - 1 :: steps, 1:])


def _pieces(toss: Toss, frames: int) -> list[tuple[Array, Array]]:
    """Of each window the frames (T,) since its beginning that were measured, and their states (T, 13)."""
    states, places = states_of(toss, 1.0), periods_of(toss)
    pieces, first = [], 0
    while first < len(places) - 1:
        last = max(int(np.searchsorted(places, places[first] + frames, side="right")) - 1, first + 1)
        pieces.append((places[first : last + 1] - places[first], states[first : last + 1]))
        first = last
    return [piece for piece in pieces if piece[0][-1] <= frames]
