"""A polytope fitted to few tosses: what is not measured stays where it began, and no vertex runs away.

    sum_t L + w_h N h^2 + sigma^2 (theta - theta_0)^T A0 (theta - theta_0)        N transitions, h the ground's height

theta_0 is the random initialisation and A0 the spread that it was drawn with (METHOD 1.1), so that the last term knows no more
than whoever drew it; sigma^2 is the residuals' variance (docs/learning.md). The ground is known: level, and near the board's
zero as in our training protocol. A ground that may lean does so along the flight, to stand for what the model lacks, and then
all tosses together predict positions worse than a few do (docs/results.md). The same sum for every rule that is compared.

From a random initialisation the sum has false bottoms, most of all with few tosses: one vertex takes the impulses of another,
which leaves. With a stronger last term they are gone, so it is fitted first with sigma^2 = 1, and from there with the true one
(METHOD 2.4 has no such problem to solve: gradient descent with small steps goes round most of them, and never arrives).
"""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from contact_curation.contact.evaluation import Estimator
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.loss_config import DEFAULT_LOSS, LossConfig
from contact_curation.contact.polytope_model import INITIAL_NOISE, PolytopeModel
from contact_curation.errors import InvalidValueError
from contact_curation.learning.damped_descent import DescentLimits, Place, descend
from contact_curation.learning.polytope_sums import physical_difference, polytope_sums
from contact_curation.motion.transitions import Transitions


@dataclass(frozen=True)
class HeldFitConfig:
    """How a fit goes.

    Attributes:
        loss: what is minimised.
        noise: sigma^2, one fit after the other.
        spread: standard deviation of the initialisation [characteristic lengths, share of friction].
        tilt: of the ground's tilt [rad].
        ground: w_h, as in `protocols.budgeted`.
        tolerance: relative decrease by a step that counts as arrival, of the last fit.
        early_tolerance: of those before.
        steps: of each fit at most, taken or not.
        damping: of the first step, and of the first step of later fits.
        largest_damping: as in `FitConfig`.
    """

    loss: LossConfig = field(default_factory=lambda: DEFAULT_LOSS)
    noise: tuple[float, ...] = (1.0, 0.06)
    spread: float = INITIAL_NOISE
    tilt: float = 1e-4
    ground: float = 2.4
    tolerance: float = 1e-5
    early_tolerance: float = 1e-3
    steps: int = 60
    damping: tuple[float, float] = (1.0, 0.1)
    largest_damping: float = 1e6

    def __post_init__(self) -> None:
        if not self.noise or min(self.noise) <= 0.0:
            raise InvalidValueError("noise of the fits", self.noise, "at least one, each positive")


class HeldFit(NamedTuple):
    """Where a fit ended.

    Attributes:
        model: in the physical form.
        objective: the sum above.
        steps: of all fits, taken or not.
    """

    model: PolytopeModel
    objective: float
    steps: int


def fit_held(
    start: PolytopeModel, data: Transitions, config: HeldFitConfig | None = None, origin: PolytopeModel | None = None
) -> HeldFit:
    """The optimum next to a model.

    Args:
        start: where to begin; it is not changed.
        data: at least one toss.
        config: how.
        origin: theta_0, with the pivot of `start`; by default `start` itself. With another one only the last of the fits is
            made, since `start` is one that was fitted before.
    """
    config = config or HeldFitConfig()
    model, steps = start, 0
    stages = config.noise if origin is None else config.noise[-1:]
    for number, noise in enumerate(stages):
        last = number == len(stages) - 1
        tolerance = config.tolerance if last else config.early_tolerance
        damping = config.damping[0 if number == 0 and origin is None else 1]
        found = _fit(model, data, config, (origin or start).geometry(), noise, tolerance, damping)
        model, steps = found.model, steps + found.steps
    return HeldFit(model, found.objective, steps)


def _fit(
    model: PolytopeModel,
    data: Transitions,
    config: HeldFitConfig,
    origin: ContactGeometry,
    noise: float,
    tolerance: float,
    damping: float,
) -> HeldFit:
    limits = DescentLimits(tolerance, config.steps, damping, config.largest_damping)
    found = descend(model, lambda here: _place(here, data, config, origin, noise), limits)
    return HeldFit(found.place.model, found.place.objective, found.steps)


def _place(model: PolytopeModel, data: Transitions, config: HeldFitConfig, origin: ContactGeometry, noise: float) -> Place:
    geometry = model.geometry()
    sums = polytope_sums(model, data, Estimator.GAUSS_NEWTON, config.loss)
    away = physical_difference(geometry, origin)
    holds = np.full(away.size, noise / config.spread**2)
    holds[-3:-1] = noise / config.tilt**2
    ground = config.ground * len(data.dt)
    score, information = sums.scores.sum(axis=0) - holds * away, sums.fishers.sum(axis=0) + np.diag(holds)
    score[-1] -= ground * geometry.height
    information[-1, -1] += ground
    objective = float(sums.losses.sum() + holds @ away**2 + ground * geometry.height**2)
    return Place(model, objective, score, information)
