"""Fisher sums of a toss whose last transitions come later, so that the others are summed while they are waited for.

The kernel adds transitions, one after the other, to what was summed before: the sums have the bits of `fisher_sums`.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from contact_curation.contact.body import Body
from contact_curation.contact.evaluation import Estimator, FisherSums, added_sums, checked_transitions, estimator_weight
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.loss_config import LossConfig
from contact_curation.geometry.quaternions import Array


@dataclass(frozen=True, eq=False)
class PartialSums:
    """Sums over the transitions of one toss so far.

    Attributes:
        geometry, body, estimator, influence_bound, config: as in `fisher_sums`.
        runs: by weight, the Fisher matrix (1, Q, Q) and the score sum (1, Q) of the transitions of that weight, without it.
        parts: what was found for the transitions of each call of `added`, in order.
    """

    geometry: ContactGeometry
    body: Body
    estimator: Estimator
    influence_bound: float
    config: LossConfig
    runs: Mapping[float, tuple[Array, Array]] = field(default_factory=dict)
    parts: tuple[FisherSums, ...] = ()

    def added(self, before: Array, after: Array, dt: Array, weights: Array) -> "PartialSums":
        """The sums with the next N transitions, of these weights (N,); the others as in `fisher_sums`."""
        first, second, periods = checked_transitions(self.geometry, before, after, dt)
        runs, size = dict(self.runs), self.geometry.kernel_size
        count, nothing = len(dt), (np.zeros((1, size, size)), np.zeros((1, size)))
        part = FisherSums(*nothing, np.empty(count), np.empty(count), np.empty(count, np.int32))
        for weight in np.unique(weights).tolist():
            own = weights == weight
            earlier = runs.get(weight, nothing)
            rows = first[own], second[own], periods[own]
            sums = added_sums(self.geometry, self.body, *rows, *earlier, self.estimator, self.influence_bound, self.config)
            runs[weight] = sums.fishers, sums.score_sums
            for name in ("losses", "residuals", "status"):
                getattr(part, name)[own] = getattr(sums, name)
        return PartialSums(
            self.geometry, self.body, self.estimator, self.influence_bound, self.config, runs, (*self.parts, part)
        )

    def total(self) -> FisherSums:
        """The sums of the toss, as `fisher_sums` gives them."""
        size = self.geometry.kernel_size
        fishers, score_sums = np.zeros((1, size, size)), np.zeros((1, size))
        for weight, (fisher, score_sum) in sorted(self.runs.items()):
            fishers += estimator_weight(self.estimator, weight) * fisher
            score_sums += weight * score_sum
        found = (np.concatenate([getattr(part, name) for part in self.parts]) for name in ("losses", "residuals", "status"))
        return FisherSums(fishers, score_sums, *found)
