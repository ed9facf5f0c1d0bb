"""What tosses teach about a model while it is being trained."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from contact_curation.contact.model import Model
from contact_curation.contact.model_kind import ModelKind
from contact_curation.contact.polytope_model import PolytopeModel
from contact_curation.errors import InvalidValueError
from contact_curation.information.record import ParameterBlock, TossInformation
from contact_curation.information.scoring import NotScored, Scorer, ScoringConfig
from contact_curation.learning.reranking import THETA_FREE, TossScorer
from contact_curation.motion.toss import Toss


def toss_scorer(kind: ModelKind, config: ScoringConfig, criterion: str) -> TossScorer:
    """The scorer that a criterion needs for a kind of model; the model itself says which form its theta has.

    Raises:
        InvalidValueError: tosses cannot be scored with such a model.
    """
    if criterion in THETA_FREE:
        return _unscored
    if kind is not ModelKind.POLYTOPE:
        accepted = f"{ModelKind.POLYTOPE.value}; {' and '.join(THETA_FREE)} go with all models"
        raise InvalidValueError(f"model for criterion {criterion}", kind.value, accepted)
    return partial(_polytope_scores, config)


def _polytope_scores(config: ScoringConfig, model: Model, tosses: Sequence[Toss]) -> tuple[TossInformation | NotScored, ...]:
    if not isinstance(model, PolytopeModel):
        raise InvalidValueError("model to rank tosses with", model.kind.value, ModelKind.POLYTOPE.value)
    return Scorer(model.geometry(), model.body, replace(config, form=model.form)).score(tosses)


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
