"""Whether tosses bounce to which a model without restitution was fitted: the restitution that they would give it.

The exact fit goes on from the model's optimum with a restitution as one more parameter, over the same tosses with impacts
merged (information/impacts.py), and learns the noise of impacts once more. That takes about ten steps, because it begins near
its end. The restitution begins at 0, so that it rises only where tosses pull it. It rather ends too low than too high: begun at
0.2, it ended at 0.13 +- 0.11 for one of eleven sets of 12 tosses that do not bounce. A single Gauss-Newton step costs less, but
its interval is several times as wide: the merged transitions are not at their optimum there.

A fit may take something else for a bounce: rigid simulated tosses ended at 0.06 +- 0.04. So first impacts, which need no fit
(evaluation/rebounds.py), must show one, too, where frames are near enough to see any.

The interval is how far tosses disagree (the first term of two_way.py), since the question is whether other tosses of this kind
would ask for a restitution, too. It does not contain that slow and fast impacts may ask for different ones; the interval that
`evaluate` reports for a restitution that was learned does, and is wider.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from contact_curation.contact.evaluation import Estimator
from contact_curation.contact.loss_config import LossConfig
from contact_curation.contact.models.model import Model
from contact_curation.contact.models.polytope import PolytopeModel
from contact_curation.contact.parameter_form import Form, parameter_form
from contact_curation.information.impacts import as_described
from contact_curation.learning.evaluation.rebounds import rebound_of
from contact_curation.learning.fits.held_fit import HeldFitConfig, fit_held
from contact_curation.learning.fits.polytope_sums import polytope_sums
from contact_curation.learning.fits.refits import subset
from contact_curation.learning.uncertainty.parameters import KnownConfig, noise_variance, prior_of
from contact_curation.learning.uncertainty.two_way import interval_factor, two_way_covariance
from contact_curation.motion.transitions import Transitions

FEWEST, MOST = 4, 32
"""Tosses that an estimate needs, and as many as it takes at most, evenly out of all."""

NOTEWORTHY = 0.05
"""A restitution that is worth a word: the real cube's is 0.26, and lowers position errors by a tenth (docs/results.md)."""

CERTAIN = 2.0
"""Standard errors by which first impacts show a restitution."""

BY_TRAIN = "train --set training.restitution=true"
"""What to do, on the command line."""


class Bounce(NamedTuple):
    """A restitution and half its 95 % interval, from so many tosses, and whether first impacts show one or cannot be seen."""

    restitution: float
    interval: float
    tosses: int
    shown: bool = True

    @property
    def missing(self) -> bool:
        """Whether it is certainly above 0, large enough to matter, and shown by first impacts."""
        return self.shown and self.restitution > max(self.interval, NOTEWORTHY)

    def in_words(self, remedy: str = BY_TRAIN) -> str:
        """One line with what to do, where a restitution is missing; else empty."""
        if not self.missing:
            return ""
        found = f"their restitution is {self.restitution:.2f} +- {self.interval:.2f} (95 %, from {self.tosses} of them)"
        return f"the tosses bounce, and the model does not: {found}; learn it, too: {remedy}"


def bounce_of(model: Model, data: Transitions, loss: LossConfig) -> Bounce | None:
    """The restitution of tosses to which a model without one was fitted; None if that cannot be estimated.

    Args:
        model: at the optimum of the tosses.
        data: transitions between successive frames.
        loss: weights and solver of the loss.
    """
    count = len(data.toss_ids)
    if count < FEWEST or not isinstance(model, PolytopeModel) or model.form is not Form.RIGID:
        return None
    if model.geometry().restitution is not None:
        return None
    seen = rebound_of(data, model.body)
    data, _ = subset(data, np.linspace(0, count - 1, min(count, MOST)).astype(int))
    start = PolytopeModel(replace(model.geometry(), restitution=0.0), model.body, Form.RIGID)
    data = as_described(data, start.geometry(), model.body)
    found = fit_held(start, data, HeldFitConfig(loss=loss, renewals=1), origin=start).model
    sums = polytope_sums(found, data, Estimator.GAUSS_NEWTON, loss)
    prior = prior_of(found, KnownConfig(loss))
    covariance = two_way_covariance(sums, np.zeros((0, len(prior))), noise_variance(found, data, loss), prior)
    place = parameter_form(found.geometry(), found.form).names().index("restitution")
    tosses = len(data.toss_ids)
    half = interval_factor(tosses, tosses) * float(np.sqrt(covariance[place, place]))
    shown = seen is None or seen.restitution > CERTAIN * seen.error
    return Bounce(found.geometry().restitution or 0.0, half, tosses, shown)
