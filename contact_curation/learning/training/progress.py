"""How far a training is, as a record and as one line of JSON."""

import json
import math
from dataclasses import asdict, dataclass
from enum import StrEnum


class TrainingState(StrEnum):
    """Whether a training goes on, and if not, why.

    RUNNING: there is more to do. CONVERGED: the held-out loss has stopped falling. SPENT: the budget of steps or epochs is used
    up. FAILED: a loss or a gradient was not finite; the parameters are those before it.
    """

    RUNNING = "running"
    CONVERGED = "converged"
    SPENT = "spent"
    FAILED = "failed"


@dataclass(frozen=True)
class Evaluated:
    """The losses at one moment of a training.

    Attributes:
        gradient_steps: taken until then.
        epochs: complete passes over the data until then.
        training_loss: mean over the transitions trained on since the evaluation before, influence unbounded; NaN if there
            were none.
        held_out_loss: mean over the held-out transitions; NaN without any.
    """

    gradient_steps: int
    epochs: int
    training_loss: float
    held_out_loss: float


@dataclass(frozen=True)
class Progress:
    """How far a training is.

    Attributes:
        gradient_steps: taken, over all data that it has had.
        epochs: complete passes over the data.
        training_loss: mean since the last evaluation, or at it when nothing was trained on since; NaN before the first step.
        held_out_loss: of the last evaluation; NaN before the first and without held-out data.
        best_held_out_loss: lowest of all evaluations; NaN likewise.
        not_solved: transitions left out of gradient steps because their impulses carry no certificate, counted each time.
        state: whether it goes on.
        reason: one line about why it does not; empty while it does.
    """

    gradient_steps: int
    epochs: int
    training_loss: float
    held_out_loss: float
    best_held_out_loss: float
    not_solved: int
    state: TrainingState
    reason: str

    def json_line(self) -> str:
        """One line of JSON without its line break; what is not finite is null."""
        return json.dumps({key: _json_number(value) for key, value in asdict(self).items()})


def _json_number(value: object) -> object:
    return None if isinstance(value, float) and not math.isfinite(value) else value
