"""What tosses teach about a model while it is being trained."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

from contact_curation.contact.model import Model
from contact_curation.contact.model_kind import ModelKind
from contact_curation.contact.polytope_model import PolytopeModel
from contact_curation.errors import InvalidValueError
from contact_curation.information.record import TossInformation
from contact_curation.information.scoring import NotScored, Scorer, ScoringConfig
from contact_curation.learning.reranking import TossScorer
from contact_curation.motion.toss import Toss


def toss_scorer(kind: ModelKind, config: ScoringConfig) -> TossScorer:
    """The scorer of a model's kind; the model itself says which form its theta has.

    Raises:
        InvalidValueError: tosses cannot be scored with such a model.
    """
    if kind is not ModelKind.POLYTOPE:
        raise InvalidValueError("model to rank tosses with", kind.value, ModelKind.POLYTOPE.value)
    return partial(_polytope_scores, config)


def _polytope_scores(config: ScoringConfig, model: Model, tosses: Sequence[Toss]) -> tuple[TossInformation | NotScored, ...]:
    if not isinstance(model, PolytopeModel):
        raise InvalidValueError("model to rank tosses with", model.kind.value, ModelKind.POLYTOPE.value)
    return Scorer(model.geometry(), model.body, replace(config, form=model.form)).score(tosses)
