"""CMA-ES (Hansen 2016; package `cmaes`) on the residuals of `shooting`, by the robust sum that `by_sysid` ends with."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from cmaes import CMA  # type: ignore[import-untyped]  # its wheel has no py.typed

from contact_curation.contact.body import Body
from contact_curation.geometry.quaternions import Array
from contact_curation.motion.toss import Toss
from contact_curation.simulation.identification.box import NAMES, Identified, IdentifiedBox, bounds_of
from contact_curation.simulation.identification.shooting import Windows

INSIDE = 1e-6
"""How far the mean of the first generation is from the bounds, at least."""


@dataclass(frozen=True)
class CmaesConfig:
    """Its settings.

    Attributes:
        spread: standard deviation of the first generation, of logarithms.
        generations: at most; of as many candidates as the package takes for six parameters.
        seed: of its draws.
    """

    spread: float = 0.15
    generations: int = 80
    seed: int = 0


def by_cmaes(body: Body, tosses: Sequence[Toss], start: IdentifiedBox, config: CmaesConfig) -> Identified:
    """Identifies a box by an evolution strategy from a start; it gives no intervals.

    Raises:
        InvalidValueError: the body is no box.
    """
    windows, (low, high) = Windows.of(body, tosses), bounds_of(body)
    best, least, evaluations = np.clip(start.vector, low + INSIDE, high - INSIDE), np.inf, 0
    strategy = CMA(best, config.spread, bounds=np.stack([low, high], axis=1), seed=config.seed)
    for _ in range(config.generations):
        asked: list[Array] = [strategy.ask() for _ in range(strategy.population_size)]
        values = [windows.misfit(IdentifiedBox.of_vector(vector)) for vector in asked]
        evaluations += len(values)
        if min(values) < least:
            least, best = min(values), asked[int(np.argmin(values))]
        strategy.tell(list(zip(asked, values, strict=True)))
        if strategy.should_stop():
            break
    return Identified(IdentifiedBox.of_vector(best), np.full(len(NAMES), np.nan), evaluations)
