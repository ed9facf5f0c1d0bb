"""A polytope that learns from tosses as they come, from a random initialisation on.

Exact: after every toss the optimum of all tosses so far (`experiment_fit`), from the initialisation, so that only the tosses
count and not their order. Budgeted: after every toss, from the second on, one round of the trainer's protocol, from where the
last one ended.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Protocol

from contact_curation.contact.polytope_model import PolytopeModel
from contact_curation.learning.experiment_fit import HeldFitConfig, fit_held
from contact_curation.learning.protocols import TrainingConfig
from contact_curation.learning.training import Training
from contact_curation.motion.toss import Toss
from contact_curation.motion.transitions import transitions_of

FIRST_ROUND = 2
"""Tosses of the first round, as the trainer's."""


class Learner(Protocol):
    """One that learns."""

    @property
    def model(self) -> PolytopeModel:
        """What it has learned; before that, what it began with."""

    def learn(self, tosses: Sequence[Toss]) -> bool:
        """Learns from all tosses so far; False when these are too few."""


class ExactLearner:
    """Fits anew.

    Args:
        start: random initialisation.
        config: of the fits.
    """

    def __init__(self, start: PolytopeModel, config: HeldFitConfig) -> None:
        self._start, self._config = start, config
        self._model = start

    @property
    def model(self) -> PolytopeModel:
        """The last optimum."""
        return self._model

    def learn(self, tosses: Sequence[Toss]) -> bool:
        """Goes to the optimum."""
        data = transitions_of(tosses, self._start.body.length_scale)
        self._model = fit_held(self._start, data, self._config).model
        return True


class BudgetedLearner:
    """Trains on.

    Args:
        start: random initialisation; it is changed.
        config: of a round.
        steps: of a round.
        seed: of the shuffles.
    """

    def __init__(self, start: PolytopeModel, config: TrainingConfig, steps: int, seed: int) -> None:
        self._model, self._steps, self._seed = start, steps, seed
        self._config = replace(config, steps=steps, evaluation_steps=steps)
        self._training: Training | None = None

    @property
    def model(self) -> PolytopeModel:
        """After the last round."""
        return self._model

    def learn(self, tosses: Sequence[Toss]) -> bool:
        """Makes a round."""
        if len(tosses) < FIRST_ROUND:
            return False
        data = transitions_of(tosses, self._model.body.length_scale)
        if self._training is None:
            self._training = Training(self._model, data, None, self._config, self._seed)
        else:
            self._training.replace_data(data, fresh_budget=True)
        self._training.advance(self._steps)
        trained = self._training.trained()
        assert isinstance(trained, PolytopeModel)
        self._model = trained
        return True
