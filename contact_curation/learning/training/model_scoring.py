"""What tosses teach about a model while it is being trained."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from itertools import batched

import numpy as np

from contact_curation.contact.models.deep import DeepModel
from contact_curation.contact.models.deepvertex import DeepvertexModel
from contact_curation.contact.models.end_to_end import EndToEndModel
from contact_curation.contact.models.model import Model
from contact_curation.contact.models.polytope import PolytopeModel
from contact_curation.errors import InvalidValueError
from contact_curation.information.network.scoring import NetworkScorer
from contact_curation.information.ranker import moved_by_theta
from contact_curation.information.record import ParameterBlock, TossInformation
from contact_curation.information.scoring import NotScored, Scorer, ScoringConfig
from contact_curation.learning.training.reranking import TossScorer
from contact_curation.motion.toss import Toss

BATCH = 64
"""Tosses scored in one call."""


def toss_scorer(config: ScoringConfig, criterion: str) -> TossScorer:
    """What a criterion needs to know of tosses; the model itself says what it is and which form its theta has."""
    return partial(_scored, config) if moved_by_theta(criterion) else _unscored


def _scored(config: ScoringConfig, model: Model, tosses: Sequence[Toss]) -> tuple[TossInformation | NotScored, ...]:
    scorer = _scorer(config, model)
    return tuple(one for batch in batched(tosses, BATCH) for one in scorer.score(batch))


def _scorer(config: ScoringConfig, model: Model) -> Scorer | NetworkScorer:
    if isinstance(model, PolytopeModel):
        return Scorer(model.geometry(), model.body, replace(config, form=model.form))
    if isinstance(model, DeepModel | DeepvertexModel | EndToEndModel):
        return NetworkScorer(model, config)
    raise InvalidValueError("model to rank tosses with", type(model).__name__, "one of the four models")


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
