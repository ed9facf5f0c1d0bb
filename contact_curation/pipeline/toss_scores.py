"""The information of each toss about theta, as arrays with names and units."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from contact_curation.geometry.numbers import read_only
from contact_curation.geometry.quaternions import Array
from contact_curation.information.network.model_scorer import TossScorer
from contact_curation.information.record import ParameterBlock, Rows, TossInformation
from contact_curation.information.scoring import Scorer
from contact_curation.motion.toss import Toss
from contact_curation.pipeline.scoring import BATCH

LENGTH = "characteristic length"
UNITS = {"vertices_normal": LENGTH, "vertices_tangent": LENGTH, "height": LENGTH, "tilt": "rad", "friction": "logarithm"}
"""Of the parameters in a block; other blocks have none."""


@dataclass(frozen=True, eq=False)
class TossScores:
    """The information of K tosses about P parameters.

    Attributes:
        toss_ids: K ids.
        parameter_names: P names, such as ``vertices_normal[2][0]``.
        parameter_units: P units: a characteristic length is the body's `length_scale`; empty for a number without unit.
        scores: (K, P) the gradient of the log-likelihood by each parameter, summed over the toss's transitions, per unit of the
            parameter; NaN for a toss that was not scored.
        factors: K arrays (R, P), float32: W with F = W^T W the toss's Fisher matrix; (0, P) for a toss that was not scored.
        losses: K arrays (N,), the loss of each scored transition, in characteristic units.
        not_scored: by id, why a toss has no score.
        version: digest of theta.
        warnings: what was left out of the recordings, and what was assumed, one line each.
    """

    toss_ids: tuple[str, ...]
    parameter_names: tuple[str, ...]
    parameter_units: tuple[str, ...]
    scores: Array
    factors: tuple[Rows, ...]
    losses: tuple[Array, ...]
    not_scored: Mapping[str, str]
    version: str
    warnings: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "scores", read_only(self.scores))
        for name in ("factors", "losses"):
            object.__setattr__(self, name, tuple(map(read_only, getattr(self, name))))

    @property
    def traces(self) -> Array:
        """(K,) trace of each toss's Fisher matrix, as far as its factor holds it."""
        return np.array([float(np.square(np.asarray(factor, dtype=float)).sum()) for factor in self.factors])

    def __len__(self) -> int:
        return len(self.toss_ids)

    def __repr__(self) -> str:
        return f"<scores of {len(self)} tosses by {len(self.parameter_names)} parameters>"


def toss_scores(scorer: TossScorer, tosses: Sequence[Toss]) -> TossScores:
    """Scores tosses.

    Args:
        scorer: at a theta.
        tosses: K, perhaps none.

    Raises:
        InvalidValueError: a toss of another body.
    """
    batches = [tosses[first : first + BATCH] for first in range(0, len(tosses), BATCH)]
    found = [one for batch in batches for one in scorer.score(batch)]
    size = scorer.blocks[-1].stop
    empty = np.zeros((0, size), dtype=np.float32)
    known = [one if isinstance(one, TossInformation) else None for one in found]
    return TossScores(
        toss_ids=tuple(toss.toss_id for toss in tosses),
        parameter_names=_names(scorer),
        parameter_units=tuple(UNITS.get(block.name, "") for block in scorer.blocks for _ in range(block.stop - block.start)),
        scores=np.array([one.score_sum if one else np.full(size, np.nan) for one in known]).reshape(-1, size),
        factors=tuple(one.factor if one else empty for one in known),
        losses=tuple(loss for batch in batches for loss in scorer.losses(batch)),
        not_scored={one.toss_id: one.reason for one in found if not isinstance(one, TossInformation)},
        version=scorer.version,
    )


def _names(scorer: TossScorer) -> tuple[str, ...]:
    if isinstance(scorer, Scorer):
        return scorer.form.names()
    return tuple(name for block in scorer.blocks for name in _names_in(block))


def _names_in(block: ParameterBlock) -> Iterator[str]:
    return (f"{block.name}[{k}]" for k in range(block.stop - block.start))
