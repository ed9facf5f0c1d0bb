"""How the variance of a transition's residuals grows with the impact in it.

    sigma^2(r) = sigma_0^2 v(r),      v(r) = 1 + a (r - 1)^p  where r > 1, else 1

r is the normal impulse of one time step that the model predicts from the measured state, relative to the impulse that carries
the body at rest, m g dt. It is the predicted impulse, not the one that explains the next state best: the latter contains the
residual which it is to weigh, so that impacts harder than the model says would count less than those that are softer.

Hard impacts have residuals hundreds of times those of a body at rest or sliding, in squares: the model knows neither their
restitution nor the filter of the tracker, which spreads them over frames. Counted with one variance, a few in a hundred of
the transitions make half of the loss (docs/results.md). a and p are learned by likelihood (`learning.fits.learned_noise`).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array

STEPS_PER_OCTAVE = 2
"""Variances are rounded to so many steps in a factor of two, so that transitions of one variance are summed together."""

LARGEST_GROWTH, LEAST_POWER, LARGEST_POWER = 1e4, 0.5, 4.0
"""Beyond these no data determine a and p."""


@dataclass(frozen=True)
class ImpulseNoise:
    """The variance of residuals by impulse, relative to the variance without an impact.

    Attributes:
        growth: a, at least 0; 0 for one variance of all transitions.
        power: p.
    """

    growth: float = 1.3
    power: float = 1.7

    def __post_init__(self) -> None:
        for name, least, most in (("growth", 0.0, LARGEST_GROWTH), ("power", LEAST_POWER, LARGEST_POWER)):
            if not least <= getattr(self, name) <= most:
                raise InvalidValueError(f"impulse noise {name}", getattr(self, name), f"a number from {least:g} to {most:g}")

    def variances(self, impulses: ArrayLike) -> Array:
        """(N,) v(r), rounded, of relative impulses (N,); 1 where the impulse is not finite."""
        exact = self.exact_variances(np.nan_to_num(np.asarray(impulses, dtype=float), nan=0.0, posinf=0.0))
        return np.asarray(np.exp2(np.round(STEPS_PER_OCTAVE * np.log2(exact)) / STEPS_PER_OCTAVE))

    def exact_variances(self, impulses: Array) -> Array:
        """(N,) v(r), not rounded, of finite impulses."""
        return np.asarray(1.0 + self.growth * np.maximum(impulses - 1.0, 0.0) ** self.power)
