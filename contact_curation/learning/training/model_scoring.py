"""What tosses teach about a model while it is being trained."""

from collections.abc import Sequence
from functools import partial
from itertools import batched

import numpy as np

from contact_curation.contact.models.model import Model
from contact_curation.information.network.model_scorer import scorer_of_model
from contact_curation.information.ranker import moved_by_theta
from contact_curation.information.record import ParameterBlock, TossInformation
from contact_curation.information.scoring import NotScored, ScoringConfig
from contact_curation.learning.training.reranking import TossScorer
from contact_curation.motion.toss import Toss

BATCH = 64
"""Tosses scored in one call."""


def toss_scorer(config: ScoringConfig, criterion: str) -> TossScorer:
    """What a criterion needs to know of tosses; the model itself says what it is and which form its theta has."""
    return partial(_scored, config) if moved_by_theta(criterion) else _unscored


def _scored(config: ScoringConfig, model: Model, tosses: Sequence[Toss]) -> tuple[TossInformation | NotScored, ...]:
    scorer = scorer_of_model(model, config)
    return tuple(one for batch in batched(tosses, BATCH) for one in scorer.score(batch))


def _unscored(model: Model, tosses: Sequence[Toss]) -> tuple[TossInformation, ...]:
    """Ids and durations, for criteria that ask for nothing else: no information about the one parameter that there is."""
    return tuple(
        TossInformation(
            toss_id=toss.toss_id,
            body=toss.body,
            model=model.kind.value,
            parameters_version="none",
            estimator="none",
            influence_bound=np.inf,
            blocks=(ParameterBlock("none", 0, 1),),
            transitions=toss.frames - 1,
            not_scored=0,
            duration=toss.duration,
            mean_loss=np.nan,
            block_traces=np.zeros(1),
            score_sum=np.zeros(1),
            factor=np.zeros((0, 1)),
            centroid=np.zeros(3),
        )
        for toss in tosses
    )
