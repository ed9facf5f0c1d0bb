"""What pushes against the arm, told from the torques that its model does not explain, and when it is too much.

With the measured speeds q', outside = M dq'/dt + bias - motors, averaged over a few milliseconds; the joints' friction is part
of it. An arm that feels too much of it has to give way; on its path it would push with all that its motors have. Residuals of
this kind, and what to do then: Haddadin, De Luca, Albu-Schaeffer, Robot Collisions: A Survey on Detection, Isolation, and
Identification, IEEE T-RO 33(6), 2017.
"""

from dataclasses import dataclass

import numpy as np

from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array


@dataclass(frozen=True)
class ReflexConfig:
    """When the arm gives way.

    Attributes:
        share: of a joint's torque limit that may come from outside; the joints' friction is at most a twentieth.
        time: that the torque is averaged over [s].
    """

    share: float = 0.1
    time: float = 0.005

    def __post_init__(self) -> None:
        for name in ("share", "time"):
            if not (np.isfinite(getattr(self, name)) and getattr(self, name) > 0.0):
                raise InvalidValueError(f"reflex.{name}", getattr(self, name), "a positive number")


class CollisionReflex:
    """Feels, step by step, what pushes against an arm.

    Args:
        limits: (J,) of its motors [N m].
        config: when it gives way.
    """

    def __init__(self, limits: Array, config: ReflexConfig) -> None:
        self._largest, self._config = config.share * limits, config
        self._outside = np.zeros_like(limits)

    def feels(self, outside: Array, step: float) -> bool:
        """Takes in the torque (J,) [N m] of a step [s]; whether it has become too much."""
        self._outside = self._outside + step / (self._config.time + step) * (outside - self._outside)
        return bool((np.abs(self._outside) > self._largest).any())

    def forget(self) -> None:
        """Begins anew."""
        self._outside = np.zeros_like(self._outside)
