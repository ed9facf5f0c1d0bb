"""What a training remembers: where it is, and all else that it needs to go on as if it had never stopped."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from torch import Tensor

from contact_curation.geometry.quaternions import Array
from contact_curation.learning.training.early_stop import EarlyStop
from contact_curation.learning.training.progress import Evaluated, TrainingState


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
    """All that a training remembers beside its model, its data and its protocol.

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
    moments: dict[str, Tensor]
    order: NDArray[np.int64]
    batches: dict[str, Any]
    data: str
    held_out: str
    origin: dict[str, Array] | None = None
