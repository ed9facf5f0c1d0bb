"""Fits a polytope to few tosses with a prior: parameters without information stay at their initial values.

Minimised is the sum over N transitions

    sum_t L_t + w_h N h^2 + sigma^2 (theta - theta_0)^T A0 (theta - theta_0)        h the ground's height

The last term is the prior. theta_0 is the random initialisation, and A0 the inverse variance of the distribution that it was
drawn from (method.md 1.1); the true parameters are not used. sigma^2 is the variance of the residuals
(docs/explanation/learning.md). The ground is held level and near the board's zero. A ground that may tilt does so along the
flight, to compensate for what the model lacks; a fit to all tosses then predicts positions worse than a fit to a few
(docs/results.md). The sum is the same for every selection rule that is compared.

In the rigid form each L_t is divided by the relative variance of its transition (contact/impulse_noise.py). This noise is
learned from the residuals of a fit, and the fit is repeated with it, `renewals` times. The weights are constant within each
fit, as in iteratively re-weighted least squares; otherwise theta could lower the sum by predicting harder impacts. sigma^2 is
then the variance of transitions without an impact: it falls by as much as the weights lower the mean loss.

A restitution is learned by the fits before, and held in those with weights: impacts alone tell of it, and the weights discount
them by what the model does not explain. With weights it ended at 0.06 for a body whose impacts leave with 0.41 of their speed,
without at 0.43 (docs/results.md, "Bodies that bounce"). No step moves it beyond its bounds 0 and 1. Its prior may be what first
impacts show (`restitution_spread`; exact_fit.py).

From a random initialisation the sum has local minima, most of all with few tosses: one vertex takes over the impulses of
another, which then drifts away from the body. A stronger prior removes them. So the first fit has sigma^2 = 1, and the next
starts from its result with the actual sigma^2. (Training with small gradient steps, method.md 2.4, passes most of these
minima, but does not converge.)
"""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from contact_curation.contact.evaluation import Estimator, transition_weights
from contact_curation.contact.geometry_parameters import INITIAL_NOISE, RESTITUTION_SPREAD, ContactGeometry
from contact_curation.contact.loss_config import DEFAULT_LOSS, LossConfig
from contact_curation.contact.models.polytope import PolytopeModel
from contact_curation.contact.models.rows import Rows
from contact_curation.contact.parameter_form import Form
from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array
from contact_curation.learning.evaluation.evaluation import transition_losses
from contact_curation.learning.fits.damped_descent import DescentLimits, Iterate, descend
from contact_curation.learning.fits.learned_noise import noise_of_model
from contact_curation.learning.fits.polytope_fit import checked_weights
from contact_curation.learning.fits.polytope_sums import (
    RESTITUTION_PLACE,
    fixed_restitution,
    physical_difference,
    polytope_sums,
)
from contact_curation.motion.transitions import Transitions


@dataclass(frozen=True)
class HeldFitConfig:
    """Configuration of a fit.

    Attributes:
        loss: weights and solver of the loss L.
        noise: sigma^2 of each of the successive fits.
        spread: standard deviation of the initialisation [characteristic lengths; for friction a share of it].
        shape: the same of the vertices, where they are known better [characteristic lengths]; None for `spread`.
        tilt: standard deviation of the ground's tilt [rad].
        ground: weight w_h of the ground's height, as in `protocols.budgeted`.
        tolerance: the last fit has converged when a step lowers the sum by less than this share.
        early_tolerance: the same for the fits before it.
        steps: largest number of steps of each fit, accepted or not.
        damping: damping of the first step of the first fit, and of the first step of later fits.
        largest_damping: as in `DescentLimits`.
        renewals: how often the noise of the rigid form is learned and the fit repeated; with 0 all residuals have one variance.
        restitution_spread: standard deviation of what is known of a restitution beforehand.
        restitution_held: whether a restitution stays as it is at the start.
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
    restitution_spread: float = RESTITUTION_SPREAD
    restitution_held: bool = False
    shape: float | None = None

    def __post_init__(self) -> None:
        if not self.noise or min(self.noise) <= 0.0:
            raise InvalidValueError("noise of the fits", self.noise, "at least one, each positive")
        if self.renewals < 0:
            raise InvalidValueError("renewals of the fit", self.renewals, "at least 0")


class HeldFit(NamedTuple):
    """Result of a fit.

    Attributes:
        model: fitted model in the physical form, or in the rigid form with the noise that was learned.
        objective: value of the sum.
        steps: number of steps of all fits, accepted or not.
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
    """Finds the minimum of the sum from a starting model.

    Args:
        start: model at which the descent starts; it is not changed.
        data: transitions of at least one toss.
        config: configuration of the fit.
        origin: theta_0, with the pivot of `start`; by default `start` itself. If it is given, `start` is taken for the result
            of an earlier fit, and only the last of the successive fits is made.
        weights: (K,) how often each toss counts, at least 0; once each by default.

    Raises:
        InvalidValueError: `weights` have the wrong shape, a negative value, or none above 0.
    """
    config = config or HeldFitConfig()
    counts = checked_weights(weights, len(data.toss_ids))
    model, steps = start, 0
    stages = config.noise if origin is None else config.noise[-1:]
    for number, noise in enumerate(stages):
        last = number == len(stages) - 1
        tolerance = config.tolerance if last else config.early_tolerance
        damping = config.damping[0 if number == 0 and origin is None else 1]
        held = HeldSum(
            data, counts, config, (origin or start).geometry(), noise, np.ones(len(data.dt)), config.restitution_held
        )
        limits = DescentLimits(tolerance, config.steps, damping, config.largest_damping)
        found = descend(model, held.iterate, limits)
        model, steps = found.iterate.model, steps + found.steps
    for _ in range(config.renewals if model.form is Form.RIGID else 0):
        model = model.with_noise(noise_of_model(model, data, config.loss))
        held = weighted_sum(model, data, counts, config, (origin or start).geometry())
        found = descend(model, held.iterate, limits)
        model, steps = found.iterate.model, steps + found.steps
    return HeldFit(model, found.iterate.objective, steps)


def weighted_sum(
    model: PolytopeModel, data: Transitions, counts: Array, config: HeldFitConfig, origin: ContactGeometry
) -> "HeldSum":
    """The sum that a fit in the rigid form minimises last, with the weights that follow from a model's noise.

    Args:
        model: with a noise.
        data: transitions of K tosses.
        counts: (K,) how often each toss counts.
        config: of the fit.
        origin: theta_0.
    """
    weights = transition_weights(model.geometry(), model.body, data.before, data.dt)
    weights = np.ones(len(data.dt)) if weights is None else weights
    noise = config.noise[-1] * _share(model, data, config.loss, weights)
    return HeldSum(data, counts, config, origin, noise, weights, restitution_held=True)


def _share(model: PolytopeModel, data: Transitions, loss: LossConfig, weights: Array) -> float:
    """The weighted mean loss over the mean loss, of the solved transitions."""
    losses, solved = transition_losses(model, Rows(data.before, data.after, data.dt), loss)
    return float((weights * losses)[solved].sum() / losses[solved].sum())


@dataclass(frozen=True, eq=False)
class HeldSum:
    """The sum that one fit minimises (see the module's docstring).

    Attributes:
        data: N transitions of K tosses.
        counts: (K,) how often each toss counts.
        config: strength of the prior and of the ground's terms.
        origin: theta_0.
        noise: sigma^2.
        weights: (N,) weights of the transitions' losses, as in `polytope_sums`.
        restitution_held: whether steps leave the restitution as it is.
    """

    data: Transitions
    counts: Array
    config: HeldFitConfig
    origin: ContactGeometry
    noise: float
    weights: Array | None = None
    restitution_held: bool = False

    def iterate(self, model: PolytopeModel) -> Iterate:
        """Evaluates the sum and its derivatives at a model."""
        sums = polytope_sums(model, self.data, Estimator.GAUSS_NEWTON, self.config.loss, self.weights)
        scores = (self.counts[:, None] * sums.scores).sum(axis=0)
        objective, score = self.held(model, float((self.counts * sums.losses).sum()), scores)
        information = (self.counts[:, None, None] * sums.fishers).sum(axis=0) + np.diag(self._holds(score.size))
        information[-1, -1] += self._ground
        place = fixed_restitution(model, score, self.restitution_held)
        if place is not None:
            score[place] = information[place] = information[:, place] = 0.0
            information[place, place] = 1.0
        return Iterate(model, objective, score, information)

    def held(self, model: PolytopeModel, loss: float, score: Array) -> tuple[float, Array]:
        """The sum and minus half its gradient (P,), from those of the losses alone."""
        geometry = model.geometry()
        away = physical_difference(geometry, self.origin)
        holds = self._holds(away.size)
        slope = score - holds * away
        slope[-1] -= self._ground * geometry.height
        return float(loss + holds @ away**2 + self._ground * geometry.height**2), slope

    def curvature(self, parameters: int) -> Array:
        """(P,) what the prior and the ground's terms add to the diagonal of half the Hessian."""
        holds = self._holds(parameters)
        holds[-1] += self._ground
        return holds

    def _holds(self, parameters: int) -> Array:
        """(P,) sigma^2 A0, whose diagonal is all there is."""
        config = self.config
        holds = np.full(parameters, self.noise / (config.shape or config.spread) ** 2)
        holds[-4], holds[-3:-1], holds[-1] = (self.noise / each**2 for each in (config.spread, config.tilt, config.spread))
        if self.origin.restitution is not None:
            holds[RESTITUTION_PLACE] = self.noise / config.restitution_spread**2
        return holds

    @property
    def _ground(self) -> float:
        return self.config.ground * float(self.counts @ np.diff(self.data.starts))
