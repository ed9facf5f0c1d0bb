"""Fits a polytope to few tosses: parameters without information stay at their initial values.

    sum_t L + w_h N h^2 + sigma^2 (theta - theta_0)^T A0 (theta - theta_0)        N transitions, h the ground's height

theta_0 is the random initialisation and A0 the spread that it was drawn with (method.md 1.1), so that the last term knows
no more than whoever drew it; sigma^2 is the residuals' variance (docs/explanation/learning.md). The ground is known: level,
and near the board's zero as in our training protocol. A ground that may lean does so along the flight, to stand for what
the model lacks, and then all tosses together predict positions worse than a few do (docs/results.md). The same sum for
every rule that is compared.

In the rigid form L is divided by the relative variance that its noise gives a transition. The noise is learned where a fit
has arrived, and the fit renewed with it from there, a few times: the weights are constant in each fit, as in iteratively
re-weighted least squares, since otherwise theta could lower the sum by predicting harder impacts.

From a random initialisation the sum has false bottoms, most of all with few tosses: one vertex takes the impulses of
another, which leaves. With a stronger last term they are gone, so it is fitted first with sigma^2 = 1, and from there with
the true one (method.md 2.4 has no such problem to solve: gradient descent with small steps goes round most of them, and
never arrives).
"""

from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from contact_curation.contact.evaluation import Estimator, transition_weights
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.loss_config import DEFAULT_LOSS, LossConfig
from contact_curation.contact.models.polytope import INITIAL_NOISE, PolytopeModel
from contact_curation.contact.parameter_form import Form
from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array
from contact_curation.learning.fits.damped_descent import DescentLimits, Iterate, descend
from contact_curation.learning.fits.learned_noise import noise_of_model
from contact_curation.learning.fits.polytope_fit import checked_weights
from contact_curation.learning.fits.polytope_sums import physical_difference, polytope_sums
from contact_curation.motion.transitions import Transitions


@dataclass(frozen=True)
class HeldFitConfig:
    """Configuration of a fit.

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
        renewals: how often the noise of the rigid form is learned and the fit renewed; with 0 all residuals have one variance.
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
    renewals: int = 2

    def __post_init__(self) -> None:
        if not self.noise or min(self.noise) <= 0.0:
            raise InvalidValueError("noise of the fits", self.noise, "at least one, each positive")
        if self.renewals < 0:
            raise InvalidValueError("renewals of the fit", self.renewals, "at least 0")


class HeldFit(NamedTuple):
    """Result of a fit.

    Attributes:
        model: in the physical form, or in the rigid one with the noise that was learned.
        objective: the sum above.
        steps: of all fits, taken or not.
    """

    model: PolytopeModel
    objective: float
    steps: int


def fit_held(
    start: PolytopeModel,
    data: Transitions,
    config: HeldFitConfig | None = None,
    origin: PolytopeModel | None = None,
    weights: ArrayLike | None = None,
) -> HeldFit:
    """The optimum next to a model.

    Args:
        start: where to begin; it is not changed.
        data: at least one toss.
        config: how.
        origin: theta_0, with the pivot of `start`; by default `start` itself. With another one only the last of the fits is
            made, since `start` is one that was fitted before.
        weights: (K,) how often each toss counts, at least 0; once each by default.

    Raises:
        InvalidValueError: weights that do not fit.
    """
    config = config or HeldFitConfig()
    counts = checked_weights(weights, len(data.toss_ids))
    model, steps = start, 0
    stages = config.noise if origin is None else config.noise[-1:]
    for number, noise in enumerate(stages):
        last = number == len(stages) - 1
        tolerance = config.tolerance if last else config.early_tolerance
        damping = config.damping[0 if number == 0 and origin is None else 1]
        held = HeldSum(data, counts, config, (origin or start).geometry(), noise, np.ones(len(data.dt)))
        limits = DescentLimits(tolerance, config.steps, damping, config.largest_damping)
        found = descend(model, held.iterate, limits)
        model, steps = found.iterate.model, steps + found.steps
    for _ in range(config.renewals if model.form is Form.RIGID else 0):
        model = model.with_noise(noise_of_model(model, data, config.loss))
        weights_now = transition_weights(model.geometry(), model.body, data.before, data.dt)
        held = replace(held, weights=np.ones(len(data.dt)) if weights_now is None else weights_now)
        found = descend(model, held.iterate, limits)
        model, steps = found.iterate.model, steps + found.steps
    return HeldFit(model, found.iterate.objective, steps)


@dataclass(frozen=True, eq=False)
class HeldSum:
    """The sum above, of one fit.

    Attributes:
        data: K tosses.
        counts: (K,) how often each counts.
        config: how it is held.
        origin: theta_0.
        noise: sigma^2.
        weights: (N,) of the transitions' losses, as in `polytope_sums`.
    """

    data: Transitions
    counts: Array
    config: HeldFitConfig
    origin: ContactGeometry
    noise: float
    weights: Array | None = None

    def iterate(self, model: PolytopeModel) -> Iterate:
        """The sum at a model."""
        geometry = model.geometry()
        sums = polytope_sums(model, self.data, Estimator.GAUSS_NEWTON, self.config.loss, self.weights)
        away = physical_difference(geometry, self.origin)
        holds = np.full(away.size, self.noise / self.config.spread**2)
        holds[-3:-1] = self.noise / self.config.tilt**2
        ground = self.config.ground * float(self.counts @ np.diff(self.data.starts))
        score = (self.counts[:, None] * sums.scores).sum(axis=0) - holds * away
        information = (self.counts[:, None, None] * sums.fishers).sum(axis=0) + np.diag(holds)
        score[-1] -= ground * geometry.height
        information[-1, -1] += ground
        objective = float((self.counts * sums.losses).sum() + holds @ away**2 + ground * geometry.height**2)
        return Iterate(model, objective, score, information)
