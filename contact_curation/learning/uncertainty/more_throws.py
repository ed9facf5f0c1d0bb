"""How far k more throws like those that a polytope was fitted to would change its predicted motions: a rule when to stop.

The fit to n + k tosses differs from that to n of them by as much as the tosses disagree. Of nested fits

    cov(theta_{n+k} - theta_n) = C_n - C_{n+k} = C_n k / (n + k)        C_n proportional to 1 / n

with C_n the sandwich over tosses. It contains the misfit in so far as it differs from toss to toss:

    C_n = sum_i (d_i - d)(d_i - d)^T        d_i = (H - H_i / 2)^-1 s_i,  d their mean

The half is, to first order in H_i, that of Bell and McCaffrey (2002): without it the sandwich says too little of few tosses,
and the jackknife (the whole H_i) too much. H and s are those of the sum that the fit minimises last (fits/held_fit.py), with
its weights, prior and hold of the ground; d_i is how far toss i pulls theta. What slow and hard impacts disagree about is left
out, because more tosses do not change it.

Thetas are drawn about the fit with that covariance and the tails of Student's t for n tosses, and further away by the factor
`WIDER`, which a benchmark measured (docs/explanation/learning.md): a refit also learns the noise of impacts again, and may end
in another minimum. Such a refit may be further away than any draw, so about nine in ten stay below the 95 % quantile of draws.
Known tosses are rolled out with each theta, and compared with the motions by the fit, in the averages of an evaluation: over
frames and tosses.

If the prior rather than the tosses determines a parameter, such as a vertex that never touched the ground, nothing is known
about its change. Then only the parameter is named.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from contact_curation.contact.evaluation import Estimator
from contact_curation.contact.models.model import Model
from contact_curation.contact.models.polytope import PolytopeModel
from contact_curation.contact.parameter_form import Form, parameter_form
from contact_curation.geometry.quaternions import Array
from contact_curation.learning.evaluation.bootstrap import BootstrapConfig
from contact_curation.learning.evaluation.evaluation import EvaluationConfig, predicted_motions
from contact_curation.learning.evaluation.motion_errors import motion_errors
from contact_curation.learning.fits.held_fit import HeldFitConfig, weighted_sum
from contact_curation.learning.fits.polytope_sums import moved, polytope_sums
from contact_curation.learning.training.training import Training
from contact_curation.motion.toss import Toss
from contact_curation.motion.transitions import Transitions

FEWEST, ROLLED_OUT = 4, 32
"""Tosses that an estimate needs, and as many as are rolled out at most, evenly out of all."""

DRAWS = 32
"""Of theta."""

WIDER = 1.7
"""Changes by refits over those by the covariance, as motions show them."""

USUAL, NEARLY_ALL = 0.5, 0.95
"""Quantiles over draws; of the refits that a benchmark measured about 9 in 10 stayed below the second."""

BY_PRIOR = 0.5
"""Share of the prior in what is known of a parameter, from which on the tosses do not determine it."""


class MoreThrows(NamedTuple):
    """The change of predicted motions by more throws.

    Attributes:
        throws: so many more.
        position, rotation: mean change over frames and tosses [% of the body's width; degrees], median over draws; None if the
            tosses do not determine all parameters.
        position_95, rotation_95: what it is less than in 95 of 100 draws; of refits fewer stay below it.
        not_determined: parameters that the tosses do not determine.
    """

    throws: int
    position: float | None
    rotation: float | None
    position_95: float | None
    rotation_95: float | None
    not_determined: tuple[str, ...]

    def in_words(self) -> str:
        """One line."""
        if self.not_determined:
            names = ", ".join(self.not_determined)
            line = f"what more throws like these would change is not known: they do not determine {names}"
            return line + "; if the described corners are exact, say so (shape_known_to)" * ("vertex" in names)
        usual = f"{self.position:.1f} % of the width and {self.rotation:.1f} degrees"
        most = f"{self.position_95:.1f} % and {self.rotation_95:.1f} degrees"
        change = f"{self.throws} more throws like these change predicted motions by {usual}"
        return f"{change} (in about 9 of 10 cases by less than {most})"


def more_throws(
    model: Model, fitted: Transitions, tosses: Sequence[Toss], config: EvaluationConfig, throws: int | None = None
) -> MoreThrows | None:
    """The change by more throws; None if that cannot be estimated.

    Args:
        model: at the optimum of `fitted`.
        fitted: what it was fitted to, as theta describes it (`information.impacts.as_described`).
        tosses: at least one, whose motions are predicted.
        config: of the fit's loss, the rollouts, and the seed of the draws.
        throws: how many more, at least 1; None for as many again.
    """
    count = len(fitted.toss_ids)
    if count < FEWEST or not isinstance(model, PolytopeModel) or model.form is not Form.RIGID:
        return None
    throws = count if throws is None else throws
    pulls, unknown = toss_pulls(model, fitted, HeldFitConfig(loss=config.loss))
    if unknown:
        return MoreThrows(throws, None, None, None, None, unknown)
    rng = np.random.default_rng(config.bootstrap.seed)
    tails = np.sqrt((count - 1) / rng.chisquare(count - 1, (DRAWS, 1)))
    draws = WIDER * tails * rng.standard_normal((DRAWS, count))
    steps = np.sqrt(throws / (count + throws)) * draws @ pulls
    places = np.linspace(0, len(tosses) - 1, min(len(tosses), ROLLED_OUT)).astype(int)
    rolled_out = [tosses[place] for place in places]
    changes = [motion_change(model, moved(model, step), rolled_out, config) for step in steps]
    usual, most = np.quantile(changes, (USUAL, NEARLY_ALL), axis=0, method="higher").tolist()
    return MoreThrows(throws, usual[0], usual[1], most[0], most[1], ())


def after_training(training: Training, tosses: Sequence[Toss], seed: int, threads: int = 1) -> MoreThrows | None:
    """The change by as many throws again; None of a training that did not end at an optimum, or that knew the shape.

    How far the estimate holds where the shape was known was not measured.

    Args:
        training: that ended.
        tosses: at least one, whose motions are predicted.
        seed: of the draws.
        threads: how many motions are predicted at once.
    """
    if not training.at_optimum or training.config.shape_known_to is not None:
        return None
    config = EvaluationConfig(training.config.loss, bootstrap=BootstrapConfig(seed=seed), threads=threads)
    return more_throws(training.trained(), training.data, tosses, config)


def toss_pulls(model: PolytopeModel, data: Transitions, config: HeldFitConfig) -> tuple[Array, tuple[str, ...]]:
    """Pulls (n, P) of n tosses, whose sum of squares is C_n, and the names of what the tosses do not determine.

    Args:
        model: at the optimum of `data`, in the rigid form.
        data: transitions of n tosses, at least 2.
        config: of the fit.
    """
    geometry, count = model.geometry(), len(data.toss_ids)
    held = weighted_sum(model, data, np.ones(count), config, geometry)
    sums = polytope_sums(model, data, Estimator.GAUSS_NEWTON, config.loss, held.weights)
    curvature = held.curvature(sums.scores.shape[1])
    whole = sums.fishers.sum(axis=0) + np.diag(curvature)
    ground = config.ground * np.diff(data.starts)  # (n,) a toss holds the ground by its own transitions
    scores, own = sums.scores.copy(), sums.fishers.copy()
    scores[:, -1] -= ground * geometry.height
    own[:, -1, -1] += ground
    pulls = np.linalg.solve(whole - 0.5 * own, scores[:, :, None])[:, :, 0]
    by_prior = curvature * np.diagonal(np.linalg.inv(whole)) > BY_PRIOR
    names = [name for name, unknown in zip(parameter_form(geometry, Form.RIGID).names(), by_prior, strict=True) if unknown]
    return pulls - pulls.mean(axis=0), _in_words(names)


def _in_words(names: Sequence[str]) -> tuple[str, ...]:
    """Vertices and friction by name; the ground is held on purpose."""
    vertices = dict.fromkeys(f"vertex {name.split('[')[1].rstrip(']')}" for name in names if name.startswith("vertices"))
    return (*vertices, *(name for name in names if name == "friction"))


def motion_change(one: Model, other: Model, tosses: Sequence[Toss], config: EvaluationConfig) -> tuple[float, float]:
    """Mean distance [% of the width] and angle [deg] of two models' predicted motions of tosses; infinite if none is finite."""
    first, second = (predicted_motions(model, tosses, config).rolled for model in (one, other))
    found = motion_errors(second.states, first.states, first.starts, one.body)
    if not found.finite.any():
        return np.inf, np.inf
    return float(found.position[found.finite].mean()), float(found.rotation[found.finite].mean())
