"""Training on the best k tosses of a pool, which are selected again as theta changes."""

from collections.abc import Sequence
from functools import partial
from itertools import batched

import numpy as np

from contact_curation.contact.models.model import Model
from contact_curation.information.network.model_scorer import scorer_of_model
from contact_curation.information.ranker import moved_by_theta
from contact_curation.information.record import ParameterBlock, TossInformation
from contact_curation.information.scoring import NotScored, ScoringConfig
from contact_curation.learning.training.progress import Progress, TrainingState
from contact_curation.learning.training.reranking import EXACT_SELECTIONS, Reranking, Selected, TossScorer
from contact_curation.learning.training.training import Training
from contact_curation.motion.toss import Toss
from contact_curation.motion.transitions import Transitions, transitions_of

BATCH = 64
"""Tosses scored in one call."""


class CuratedTraining:
    """A training and, where there is one, the selection that it learns from.

    Args:
        training: learns from the selected tosses of the last selection.
        pool: what is selected from.
        reranking: has made a selection; None for a training on tosses that stay.
        selections: all that were made until now.

    Attributes:
        training: as given.
        selections: those made since, too.
    """

    def __init__(
        self,
        training: Training,
        pool: Sequence[Toss] = (),
        reranking: Reranking | None = None,
        selections: Sequence[Selected] = (),
    ) -> None:
        self.training = training
        self.selections = tuple(selections)
        self._reranking = reranking
        self._pool = tuple(pool)

    def advance(self, steps: int) -> Progress:
        """Takes up to `steps` gradient steps; however they are cut into calls, the result is the same.

        Raises:
            InvalidValueError: no toss of the pool could be scored for a selection that was due.
        """
        if self._reranking is None:
            return self.training.advance(steps)
        progress = self.training.progress
        last = progress.gradient_steps + steps
        while progress.gradient_steps < last:
            quiet = self._reranking.quiet_steps(progress.gradient_steps, self.training.steps_of_epoch)
            progress = self.training.advance(min(quiet, last - progress.gradient_steps))
            running = progress.state is TrainingState.RUNNING
            if not running and not self._at_optimum(progress):
                break
            self._reselect(self._reranking, progress, running)
            progress = self.training.progress
            if progress.state is not TrainingState.RUNNING:  # it has found the same tosses at its optimum
                break
        return progress

    def _at_optimum(self, progress: Progress) -> bool:
        """Whether an exact training has ended and may select again there."""
        arrived = self.training.config.exact and progress.state is TrainingState.CONVERGED
        return arrived and len(self.selections) < EXACT_SELECTIONS

    def _reselect(self, reranking: Reranking, progress: Progress, running: bool) -> None:
        """What an occasion changes: a selection more, and other data where other tosses are selected."""
        before = reranking.selected
        select = reranking.consider if running else reranking.at_optimum
        selected = select(self.training.model, progress.gradient_steps, progress.epochs)
        if selected is None:
            return
        self.selections += (selected,)
        if before is None or set(selected.toss_ids) != set(before.toss_ids):
            length_scale = self.training.model.body.length_scale
            data = selected_transitions(self._pool, selected.toss_ids, length_scale)
            self.training.replace_data(data, fresh_budget=not running)


def selected_transitions(pool: Sequence[Toss], selected: Sequence[str], length_scale: float) -> Transitions:
    """The transitions of the selected tosses, in the order of the pool: equal sets, equal transitions."""
    wanted = set(selected)
    return transitions_of([toss for toss in pool if toss.toss_id in wanted], length_scale)


def toss_scorer(config: ScoringConfig, criterion: str) -> TossScorer:
    """The scorer that a criterion needs."""
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
            model=model.kind,
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
