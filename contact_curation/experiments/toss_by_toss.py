"""A polytope that learns from tosses as they come: from a random initialisation on, a round of training after each of them.

In the exact protocol a round is the optimum of all tosses so far, so that only these count and not their order; in the budgeted
one it goes on from where the last one ended.
"""

from collections.abc import Sequence
from dataclasses import replace

from contact_curation.contact.models.polytope import PolytopeModel
from contact_curation.learning.training.protocols import TrainingConfig
from contact_curation.learning.training.training import Training
from contact_curation.motion.toss import Toss
from contact_curation.motion.transitions import transitions_of

FIRST_ROUND = 2
"""Tosses of the first round, as the trainer's."""


class RoundsLearner:
    """One that learns.

    Args:
        start: random initialisation; it is changed.
        config: of a round.
        steps: of a round; an exact one takes as many as it needs.
        seed: of the shuffles.
    """

    def __init__(self, start: PolytopeModel, config: TrainingConfig, steps: int, seed: int) -> None:
        self._model, self._steps, self._seed = start, steps, seed
        self._config = replace(config, steps=steps, evaluation_steps=steps)
        self._training: Training | None = None

    @property
    def model(self) -> PolytopeModel:
        """What it has learned; before that, what it began with."""
        return self._model

    def learn(self, tosses: Sequence[Toss]) -> bool:
        """Makes a round on all tosses so far; False when these are too few."""
        if len(tosses) < FIRST_ROUND:
            return False
        data = transitions_of(tosses, self._model.body.length_scale)
        if self._training is None:
            self._training = Training(self._model, data, None, self._config, self._seed)
        else:
            self._training.replace_data(data, fresh_budget=True)
        self._training.advance(self._steps)
        self._model = self._model.with_tensors(self._training.trained().tensors())
        return True
