"""When the held-out loss has stopped falling."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class EarlyStop:
    """The lowest held-out loss so far, and how many evaluations in a row were not lower.

    Attributes:
        best: infinite before the first.
        waited: evaluations.
    """

    best: float = np.inf
    waited: int = 0

    def after(self, loss: float) -> "EarlyStop":
        """With one evaluation more; a loss that is NaN is no improvement."""
        return EarlyStop(loss, 0) if loss < self.best else EarlyStop(self.best, self.waited + 1)
