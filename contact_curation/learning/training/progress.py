"""How far a training is, as a record and as a line of JSON, and all else that it needs to go on as if it had never stopped."""

import json
import math
from dataclasses import asdict, dataclass
from enum import StrEnum
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from contact_curation.geometry.quaternions import Array

if TYPE_CHECKING:
    from torch import Tensor


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


@dataclass(frozen=True)
class EarlyStop:
    """When the held-out loss has stopped falling: the lowest so far, and how many evaluations in a row were not lower.

    Attributes:
        best: infinite before the first.
        waited: evaluations.
    """

    best: float = np.inf
    waited: int = 0

    def after(self, loss: float) -> "EarlyStop":
        """With one evaluation more; a loss that is NaN is no improvement."""
        return EarlyStop(loss, 0) if loss < self.best else EarlyStop(self.best, self.waited + 1)


@dataclass(frozen=True)
class Counters:
    """Where a training is.

    Attributes:
        gradient_steps, epochs: over all data that it has had.
        first_step, first_epoch: where the present budget began.
        not_solved: transitions left out of gradient steps, counted each time.
        loss_sum, loss_count: of the transitions trained on since the last evaluation.
        state: whether it goes on.
        reason: why not.
    """

    gradient_steps: int = 0
    epochs: int = 0
    first_step: int = 0
    first_epoch: int = 0
    not_solved: int = 0
    loss_sum: float = 0.0
    loss_count: int = 0
    state: TrainingState = TrainingState.RUNNING
    reason: str = ""


@dataclass(frozen=True, eq=False)
class TrainingMemory:
    """The state of a training beside its model, data and protocol.

    Attributes:
        counters, early_stop, history: where it is.
        best_tensors: the model's at the lowest held-out loss; None where training does not stop early or was not evaluated yet.
        moments: of the optimizer.
        order: (N,) this epoch's order of the data.
        batches: the place in it, and the generator's state.
        data, held_out: digests; empty without held-out transitions.
        origin: the tensors of theta_0 in the exact protocol; None in the others.
    """

    counters: Counters
    early_stop: EarlyStop
    history: tuple[Evaluated, ...]
    best_tensors: dict[str, Array] | None
    moments: "dict[str, Tensor]"
    order: NDArray[np.int64]
    batches: dict[str, Any]
    data: str
    held_out: str
    origin: dict[str, Array] | None = None


def _json_number(value: object) -> object:
    return None if isinstance(value, float) and not math.isfinite(value) else value
