"""What a tracker makes of true poses: white noise, outliers, losses, and a delay.

The white noise has the size of the real tosses' second differences in the air: 0.022 mm and 0.024 degrees per axis (METHOD 3;
the tests hold it against them). The other faults are off by default: of the real rig only the kept tosses are known. Each
frame's noise hangs on the seed and the frame's stamp alone.
"""

from dataclasses import dataclass

import numpy as np

from contact_curation.errors import InvalidValueError
from contact_curation.geometry import quaternions
from contact_curation.geometry.poses import Pose
from contact_curation.geometry.quaternions import Array


@dataclass(frozen=True)
class TrackerNoiseConfig:
    """The faults of a tracker.

    Attributes:
        position: white noise per axis, standard deviation [m].
        turn: likewise [rad].
        spike_rate: share of the poses that are far off.
        spike_position: how far those are off per axis, standard deviation [m].
        spike_turn: likewise [rad].
        dropout_rate: share of the seen frames with which a loss of the tags begins.
        dropout_frames: how many frames a loss lasts, on average.
        latency: from a frame's stamp until its pose is told [s].
    """

    position: float = 2.2e-5
    turn: float = float(np.radians(0.024))
    spike_rate: float = 0.0
    spike_position: float = 0.02
    spike_turn: float = 0.3
    dropout_rate: float = 0.0
    dropout_frames: float = 3.0
    latency: float = 0.0

    def __post_init__(self) -> None:
        for name in ("position", "turn", "spike_position", "spike_turn", "latency"):
            if not (np.isfinite(getattr(self, name)) and getattr(self, name) >= 0.0):
                raise InvalidValueError(name, getattr(self, name), "0 or more")
        for name in ("spike_rate", "dropout_rate"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise InvalidValueError(name, getattr(self, name), "a share from 0 to 1")
        if not (np.isfinite(self.dropout_frames) and self.dropout_frames >= 1.0):
            raise InvalidValueError("dropout_frames", self.dropout_frames, "1 or more")


class TrackerNoise:
    """A tracker of one body; remembers only how long a loss goes on.

    Args:
        config: its faults.
        seed: of all that is random.
    """

    def __init__(self, config: TrackerNoiseConfig, seed: int) -> None:
        self.config = config
        self._seed = seed
        self._lost = 0

    def seen(self, stamp_ns: int, pose: Pose) -> Pose | None:
        """What the tracker makes of a frame; None where it has lost the body."""
        config, rng = self.config, np.random.default_rng([self._seed, stamp_ns])
        white, far = rng.standard_normal((2, 3)), rng.standard_normal((2, 3))
        begins, spikes = rng.random(2) < (config.dropout_rate, config.spike_rate)
        if self._lost == 0 and begins:
            self._lost = int(rng.geometric(1.0 / config.dropout_frames))
        if self._lost > 0:
            self._lost -= 1
            return None
        sizes = np.array([[config.position], [config.turn]])
        return _moved(pose, sizes * white + spikes * np.array([[config.spike_position], [config.spike_turn]]) * far)


def _moved(pose: Pose, off: Array) -> Pose:
    """The pose, off by (2, 3): metres on the board, and a turn about the body's axes."""
    return Pose(pose.position + off[0], quaternions.multiply(pose.orientation_wxyz, quaternions.exp(off[1])))
