"""Simulates a tracker: adds white noise, outliers, losses of tracking and a delay to true poses.

The white noise has the size of the real tosses' second differences in the air: 0.022 mm and 0.024 degrees per axis (method.md
3; a test compares the two). The other faults are off by default, because only accepted tosses of ContactNets' rig are public.
The noise of a frame depends only on the seed, the throw and the frame's place in it. So the same throw always has the same
noise, also after the tracker was restarted.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from contact_curation.design.throw import throw_seed
from contact_curation.errors import InvalidValueError
from contact_curation.geometry import quaternions
from contact_curation.geometry.poses import Pose
from contact_curation.geometry.quaternions import Array
from contact_curation.motion.pose_noise import RIG_NOISE
from contact_curation.motion.toss import NANOSECONDS

BLOCK = 1024
"""Number of frames whose losses are drawn together."""

PLACES = 16
"""Noise is drawn per this fraction of a frame period, so that rounding of a stamp by a nanosecond has no effect."""

LONGEST_MEAN = 128.0
"""Largest mean length of a loss [frames]; nearly every loss then ends within the block after its own, as the code assumes."""


@dataclass(frozen=True)
class TrackerNoiseConfig:
    """Noise and faults of a simulated tracker.

    Attributes:
        position: standard deviation of the white noise of positions, per axis [m].
        turn: standard deviation of the white noise of orientations, per axis [rad].
        spike_rate: share of the poses that are outliers.
        spike_position: standard deviation of an outlier's position error, per axis [m].
        spike_turn: standard deviation of an outlier's orientation error, per axis [rad].
        dropout_rate: probability that tracking is lost at a frame.
        dropout_frames: mean number of frames that a loss of tracking lasts.
        frame_period: time between the frames that these rates refer to [s].
        latency: time from a frame's stamp until its pose is published [s].
        spoilt_throw: name of one throw that is tracked badly; empty for none.
        spoilt_rate: share of that throw's poses that are outliers.
    """

    position: float = RIG_NOISE
    turn: float = float(np.radians(0.024))
    spike_rate: float = 0.0
    spike_position: float = 0.02
    spike_turn: float = 0.3
    dropout_rate: float = 0.0
    dropout_frames: float = 3.0
    frame_period: float = 1.0 / 148.0
    latency: float = 0.0
    spoilt_throw: str = ""
    spoilt_rate: float = 0.05

    def __post_init__(self) -> None:
        for name in ("position", "turn", "spike_position", "spike_turn", "latency"):
            if not (np.isfinite(getattr(self, name)) and getattr(self, name) >= 0.0):
                raise InvalidValueError(name, getattr(self, name), "0 or more")
        for name in ("spike_rate", "dropout_rate", "spoilt_rate"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise InvalidValueError(name, getattr(self, name), "a share from 0 to 1")
        if not 1.0 <= self.dropout_frames <= LONGEST_MEAN:
            raise InvalidValueError("dropout_frames", self.dropout_frames, f"1 to {LONGEST_MEAN:g}")
        if not (np.isfinite(self.frame_period) and round(self.frame_period * NANOSECONDS) > 0):
            raise InvalidValueError("frame_period", self.frame_period, "a nanosecond or more")


class TrackerNoise:
    """A simulated tracker of one body.

    Args:
        config: its noise and faults.
        seed: random seed.
    """

    def __init__(self, config: TrackerNoiseConfig, seed: int) -> None:
        self.config = config
        self._seed = seed
        self._period_ns = round(config.frame_period * NANOSECONDS)
        self._losses_of = lru_cache(maxsize=2)(self._losses) if config.dropout_rate else None

    def seen(self, time_ns: int, pose: Pose, throw_id: str = "") -> Pose | None:
        """The measured pose of a frame; None while tracking is lost.

        Args:
            time_ns: time since the throw began [ns]; the frame's stamp if no throw is known.
            pose: true pose.
            throw_id: name of the throw; empty if no throw is known.
        """
        throw = throw_seed(throw_id)
        if self._lost(throw, time_ns):
            return None
        config, place = self.config, (PLACES * time_ns + self._period_ns // 2) // self._period_ns
        rng = np.random.default_rng([self._seed, throw, place])
        white, far = rng.standard_normal((2, 3)), rng.standard_normal((2, 3))
        spoilt = bool(throw_id) and throw_id == config.spoilt_throw
        spikes = rng.random() < (config.spoilt_rate if spoilt else config.spike_rate)
        sizes = np.array([[config.position], [config.turn]])
        return _moved(pose, sizes * white + spikes * np.array([[config.spike_position], [config.spike_turn]]) * far)

    def _lost(self, throw: int, time_ns: int) -> bool:
        if self._losses_of is None:
            return False
        block, frame = divmod((time_ns + self._period_ns // 2) // self._period_ns, BLOCK)
        of_this, of_before = self._losses_of(throw, block), self._losses_of(throw, block - 1) if block > 0 else None
        return bool(of_this[frame] or (of_before is not None and of_before[BLOCK + frame]))

    def _losses(self, throw: int, block: int) -> NDArray[np.bool_]:
        """The frames (2 BLOCK,) of a block and the next one that are lost because of losses which began in this block."""
        rng = np.random.default_rng([self._seed, throw, block, BLOCK])
        begins = rng.random(BLOCK) < self.config.dropout_rate
        lengths = rng.geometric(1.0 / self.config.dropout_frames, BLOCK)
        lost = np.zeros(2 * BLOCK, dtype=bool)
        for frame in np.flatnonzero(begins):
            if not lost[frame]:
                lost[frame : frame + lengths[frame]] = True
        return lost


def _moved(pose: Pose, off: Array) -> Pose:
    """Adds errors (2, 3) to a pose: displacement in the board's frame [m], rotation vector about the body's axes [rad]."""
    return Pose(pose.position + off[0], quaternions.multiply(pose.orientation_wxyz, quaternions.exp(off[1])))
