"""Evaluates a model on tosses: rolls each out from its first measured state and compares it with the measured motion.

Nothing is dropped in silence: a motion that is not finite is named and has no errors, a transition whose impulses carry no
certificate has no loss and is counted, and so is a step of the rollout that reached the iteration limit.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray

from contact_curation.contact.loss_config import DEFAULT_LOSS, LossConfig
from contact_curation.contact.models.model import Model, Rows
from contact_curation.contact.rollout import Rollout
from contact_curation.contact.time_step import DEFAULT_LIMITS, StepStatus, SweepLimits
from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array
from contact_curation.information.impacts import as_described
from contact_curation.learning.evaluation.bootstrap import BootstrapConfig, Spread, paired_spread, spread
from contact_curation.learning.evaluation.motion_errors import MotionErrors, motion_errors
from contact_curation.learning.evaluation.shape_errors import ShapeErrors
from contact_curation.learning.evaluation.shape_errors import shape_errors as shape_errors
from contact_curation.motion.toss import Toss
from contact_curation.motion.transitions import (
    Transitions,
    nearest_frames,
    periods_of,
    states_of,
    transitions_of,
    usual_period,
)

PIECE = 1024
"""Transitions whose loss is taken at a time, so that networks need little memory."""

MEASURES = ("position", "rotation", "penetration")

ROUNDING = 1e-6
"""Frame periods by which even steps may differ from whole ones."""


@dataclass(frozen=True)
class EvaluationConfig:
    """How a model is evaluated.

    Attributes:
        loss: weights and solver of the loss.
        sweeps: when a step of a rollout stops.
        bootstrap: of the intervals.
        threads: how many trajectories are rolled out at once.
    """

    loss: LossConfig = DEFAULT_LOSS
    sweeps: SweepLimits = DEFAULT_LIMITS
    bootstrap: BootstrapConfig = field(default_factory=BootstrapConfig)
    threads: int = 1


@dataclass(frozen=True, eq=False)
class ModelEvaluation:
    """Evaluation of a model on K tosses.

    Attributes:
        toss_ids: K ids.
        errors: of the motions, NaN where one is not finite.
        losses: (K,) mean loss of a toss's solved transitions, NaN where there is none.
        mean_loss: of all solved transitions together; NaN where there is none.
        transitions: how many there are.
        not_solved: how many of them the solver could not certify.
        sweeps_exhausted: steps of the rollouts that reached the iteration limit.
        steps: of the rollouts.
        starts: (K + 1,) toss k owns frames starts[k]:starts[k + 1] of what follows.
        measured: (N, 13) states [characteristic lengths].
        predicted: (N, 13) states, NaN from where a motion is not finite.
        shape: None where the model has no shape of its own.
    """

    toss_ids: tuple[str, ...]
    errors: MotionErrors
    losses: Array
    mean_loss: float
    transitions: int
    not_solved: int
    sweeps_exhausted: int
    steps: int
    starts: NDArray[np.int64]
    measured: Array
    predicted: Array
    shape: ShapeErrors | None

    @property
    def not_finite(self) -> tuple[str, ...]:
        """Ids of the tosses whose predicted motion is not finite."""
        return tuple(name for name, finite in zip(self.toss_ids, self.errors.finite, strict=True) if not finite)

    def frames(self, toss: int) -> tuple[Array, Array]:
        """Measured and predicted states (T, 13) of one toss."""
        rows = slice(int(self.starts[toss]), int(self.starts[toss + 1]))
        return self.measured[rows], self.predicted[rows]


class PredictedMotions(NamedTuple):
    """Motions from the first measured state of each of K tosses on.

    Attributes:
        rolled: what a model predicts; K trajectories.
        measured: (N, 13) states [characteristic lengths], rows as of `rolled`.
        errors: of one against the other.
    """

    rolled: Rollout
    measured: Array
    errors: MotionErrors


def predicted_motions(model: Model, tosses: Sequence[Toss], config: EvaluationConfig) -> PredictedMotions:
    """Rolls a model out along every toss; arguments and errors as of `evaluate_model`."""
    for toss in tosses:
        if toss.body != model.body.name:
            raise InvalidValueError(f"body of toss {toss.toss_id}", toss.body, model.body.name)
    states = [states_of(toss, model.body.length_scale) for toss in tosses]
    return _predicted(model, states, [periods_of(toss) for toss in tosses], [toss.frame_period for toss in tosses], config)


def motions_of(model: Model, data: Transitions, config: EvaluationConfig) -> PredictedMotions:
    """Rolls a model out along every toss of transitions between successive frames."""
    spans = [slice(*each) for each in pairwise(data.starts.tolist())]
    states = [np.concatenate([data.before[span], data.after[span][-1:]]) for span in spans]
    periods = [_period_of(data.dt[span]) for span in spans]
    frames = [nearest_frames(data.dt[span], period) for span, period in zip(spans, periods, strict=True)]
    return _predicted(model, states, frames, periods, config)


def _period_of(steps: Array) -> float:
    """The shortest of steps between frames if all are multiples of it, as even ones are; else what uneven ones come to [s]."""
    shortest = float(steps.min())
    multiples = steps / shortest
    return shortest if np.abs(multiples - np.rint(multiples)).max() < ROUNDING else usual_period(steps)


def _predicted(
    model: Model, states: list[Array], frames: list[NDArray[np.int64]], periods: list[float], config: EvaluationConfig
) -> PredictedMotions:
    """Along K tosses, of states (T, 13) at so many frame periods (T,) from the first, of so long each [s]."""
    counts = np.array([each[-1] + 1 for each in frames])
    first = np.stack([each[0] for each in states])
    rolled = model.roll_out(first, counts, np.array(periods), config.sweeps, config.threads)
    if any((np.diff(each) != 1).any() for each in frames):
        rolled = _seen(rolled, frames)
    measured = np.concatenate(states)
    return PredictedMotions(rolled, measured, motion_errors(rolled.states, measured, rolled.starts, model.body))


def _seen(rolled: Rollout, frames: Sequence[NDArray[np.int64]]) -> Rollout:
    """Those rows of K trajectories that are `frames` (T,) of each: a recording lacks some, or has two near one of them."""
    rows = np.concatenate([start + each for start, each in zip(rolled.starts[:-1], frames, strict=True)])
    starts = np.concatenate([[0], np.cumsum([len(each) for each in frames])])
    return Rollout(starts, rolled.states[rows], rolled.status[rows], rolled.residual[rows], None)


def evaluate_model(model: Model, tosses: Sequence[Toss], config: EvaluationConfig) -> ModelEvaluation:
    """Rolls a model out along every toss, and takes its loss.

    Args:
        model: any; its body says what penetrates, and how wide it is.
        tosses: at least one.
        config: how.

    Raises:
        InvalidValueError: no toss, or one of another body.
    """
    motions = predicted_motions(model, tosses, config)
    rows = as_described(transitions_of(tosses, model.body.length_scale), model.geometry(), model.body)
    rolled = motions.rolled
    losses, solved = transition_losses(model, Rows(rows.before, rows.after, rows.dt), config.loss)
    return ModelEvaluation(
        toss_ids=rows.toss_ids,
        errors=motions.errors,
        losses=_means(losses, solved, rows.starts),
        mean_loss=float(losses[solved].mean()) if solved.any() else np.nan,
        transitions=len(losses),
        not_solved=int(np.count_nonzero(~solved)),
        sweeps_exhausted=int(np.count_nonzero(rolled.status == StepStatus.SWEEPS_EXHAUSTED)),
        steps=len(rolled.states) - len(tosses),
        starts=rolled.starts,
        measured=motions.measured,
        predicted=rolled.states,
        shape=shape_errors(model),
    )


def transition_losses(model: Model, rows: Rows, config: LossConfig) -> tuple[Array, NDArray[np.bool_]]:
    """Losses (N,), NaN where they are not certified, and (N,) whether they are."""
    pieces = [rows.take(slice(first, first + PIECE)) for first in range(0, len(rows.dt), PIECE)]
    with torch.no_grad():
        batches = [model.batch_loss(piece, config) for piece in pieces]
    losses, solved = (torch.cat([getattr(batch, name) for batch in batches]).cpu().numpy() for name in ("losses", "solved"))
    return losses, solved


class Summary(NamedTuple):
    """Median and mean over tosses of what `MEASURES` names, of the finite motions; None where there are none."""

    position: Spread | None
    rotation: Spread | None
    penetration: Spread | None


def summary(evaluation: ModelEvaluation, config: BootstrapConfig, without: Collection[str] = ()) -> Summary:
    """Medians and means of a model's errors, without some tosses."""
    taken = evaluation.errors.finite & np.array([name not in without for name in evaluation.toss_ids])
    if not taken.any():
        return Summary(None, None, None)
    return Summary(*(spread(getattr(evaluation.errors, name)[taken], config) for name in MEASURES))


def comparison(ours: ModelEvaluation, theirs: ModelEvaluation, config: BootstrapConfig) -> Summary:
    """The differences ours - theirs over the tosses whose motions are finite for both.

    Raises:
        InvalidValueError: the evaluations are of different tosses.
    """
    if ours.toss_ids != theirs.toss_ids:
        raise InvalidValueError("tosses", f"{len(ours.toss_ids)} and {len(theirs.toss_ids)}", "the same tosses for both models")
    both = ours.errors.finite & theirs.errors.finite
    if not both.any():
        return Summary(None, None, None)
    return Summary(
        *(paired_spread(getattr(ours.errors, name)[both], getattr(theirs.errors, name)[both], config) for name in MEASURES)
    )


def _means(losses: Array, solved: NDArray[np.bool_], starts: NDArray[np.int64]) -> Array:
    sums = np.add.reduceat(np.where(solved, losses, 0.0), starts[:-1])
    counts = np.add.reduceat(solved.astype(float), starts[:-1])
    return np.where(counts > 0.0, sums / np.maximum(counts, 1.0), np.nan)
