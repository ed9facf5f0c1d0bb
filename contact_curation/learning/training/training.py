"""Training of a model on tosses: gradient steps, evaluations, early stop; the only thing in learning that remembers.

A step takes the next batch of transitions, leaves out those whose impulses carry no certificate, and goes down

    mean over the batch of bounded(L) + w_r R + w_h h^2        (method.md 1.2, 2.1; learning/training/objective.py)

In the exact protocol a single step goes all the way to the optimum instead (learning/fits/exact_fit.py).

The same arguments give the same numbers bit for bit, however the steps are cut into calls of `advance`; so does a training that
was stored and resumed (learning/checkpoints/checkpoint.py).
"""

from dataclasses import replace

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from contact_curation.contact.body import Body
from contact_curation.contact.models.model import Model, Rows
from contact_curation.contact.models.polytope import PolytopeModel
from contact_curation.contact.models.registry import model_class
from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array
from contact_curation.information.impacts import as_described
from contact_curation.learning.evaluation.misfit import displaced_in_words
from contact_curation.learning.fits.exact_fit import optimum, theta_0
from contact_curation.learning.training.data import Batches, checked, digest_of, rows_of, transition_name
from contact_curation.learning.training.objective import (
    bounded,
    ground_excess,
    height_parameters,
    mean_loss,
    not_finite,
    not_finite_gradient,
)
from contact_curation.learning.training.optimizer import Optimizer, SingleSteps
from contact_curation.learning.training.progress import (
    Counters,
    EarlyStop,
    Evaluated,
    Progress,
    TrainingMemory,
    TrainingState,
)
from contact_curation.learning.training.protocols import TrainingConfig
from contact_curation.motion.transitions import Transitions


class Training:
    """A model that learns from transitions.

    Args:
        model: changed in place from here on.
        data: what it learns from.
        held_out: what it never learns from; their loss is watched.
        config: the protocol.
        seed: of the shuffles.

    Raises:
        InvalidValueError: no transitions or bad ones (`data.checked`), an early stop and nothing held out, or an exact
            protocol for another model than a polytope in the physical form.
    """

    def __init__(
        self, model: Model, data: Transitions, held_out: Transitions | None, config: TrainingConfig, seed: int
    ) -> None:
        if config.patience is not None and held_out is None:
            raise InvalidValueError(
                "held-out transitions", "none", "some (--held-out), since the protocol stops early on their loss"
            )
        self.model = model.bouncing() if config.restitution and isinstance(model, PolytopeModel) else model
        self.config = config
        self.held_out = None if held_out is None else self._described(checked(held_out))
        self.counters = Counters()
        self.early_stop = EarlyStop()
        self.history: tuple[Evaluated, ...] = ()
        self.best_tensors: dict[str, Array] | None = None
        self._origin = theta_0(self.model) if config.exact else None
        self.optimizer = Optimizer(self.model, config)
        self._heights = height_parameters(self.model)
        self._generator = np.random.default_rng(seed)
        self._take(data)

    @staticmethod
    def resumed(
        model: Model, data: Transitions, held_out: Transitions | None, config: TrainingConfig, memory: TrainingMemory
    ) -> "Training":
        """Goes on where another training was; with other data, as after `replace_data`.

        Other held-out transitions make the losses so far no measure: the best so far is forgotten.

        Raises:
            InvalidValueError: as for a new one, or a memory that does not fit the model or its data.
        """
        training = Training(model, data, held_out, config, seed=0)
        training.counters, training.history = memory.counters, memory.history
        training.optimizer.restore(memory.moments)
        if training._origin is not None and memory.origin is not None:
            training._origin = theta_0(training.model.with_tensors(memory.origin))
        if training._held_out_digest == memory.held_out:
            training.early_stop, training.best_tensors = memory.early_stop, memory.best_tensors
        unmerged = len(training._data.dt) < len(memory.order) == len(data.dt)  # an order as earlier versions had it
        if digest_of(training._data) == memory.data and not unmerged:
            training._batches.restore(memory.order, memory.batches)
        else:
            training._generator.bit_generator.state = memory.batches["generator"]
            training._take(data)
        return training

    @property
    def data(self) -> Transitions:
        """What it learns from now."""
        return self._data

    @property
    def memory(self) -> TrainingMemory:
        """What `resumed` needs."""
        return TrainingMemory(
            counters=self.counters,
            early_stop=self.early_stop,
            history=self.history,
            best_tensors=self.best_tensors,
            moments=self.optimizer.moments(),
            order=self._batches.order,
            batches=self._batches.state(),
            data=digest_of(self._data),
            held_out=self._held_out_digest,
            origin=None if self._origin is None else self._origin.tensors(),
        )

    @property
    def _held_out_digest(self) -> str:
        return "" if self.held_out is None else digest_of(self.held_out)

    @property
    def progress(self) -> Progress:
        """How far it is."""
        now, last = self.counters, self.history[-1] if self.history else Evaluated(0, 0, np.nan, np.nan)
        return Progress(
            gradient_steps=now.gradient_steps,
            epochs=now.epochs,
            training_loss=now.loss_sum / now.loss_count if now.loss_count else last.training_loss,
            held_out_loss=last.held_out_loss,
            best_held_out_loss=self.early_stop.best if np.isfinite(self.early_stop.best) else np.nan,
            not_solved=now.not_solved,
            state=now.state,
            reason=now.reason,
        )

    def advance(self, steps: int) -> Progress:
        """Takes up to `steps` gradient steps, with the evaluations that fall due; fewer when the training ends before."""
        if steps < 1:
            raise InvalidValueError("steps", steps, "at least 1")
        last = self.counters.gradient_steps + steps
        with np.errstate(all="ignore"):  # what is not finite is named, not warned of
            while self.counters.state is TrainingState.RUNNING and self.counters.gradient_steps < last:
                if self._origin is not None:
                    self._fit(self._origin)
                elif self._single is None or not self._take_single(self._single, last - self.counters.gradient_steps):
                    self._step()
        return self.progress

    @property
    def steps_of_epoch(self) -> int:
        """Gradient steps to the end of the epoch that the next one is of."""
        return self._batches.left

    def replace_data(self, data: Transitions, fresh_budget: bool = False) -> None:
        """Learns from other transitions from here on, in a new epoch.

        Args:
            data: the selected set as it is now.
            fresh_budget: whether steps, epochs, patience and the schedule start over, and the optimizer forgets; a
                training that had ended goes on. Without it only the data change.

        Raises:
            InvalidValueError: as for a new one; then nothing has changed.
        """
        checked(data)
        if not fresh_budget:
            self._take(data)
            return
        now = self.counters
        self.counters = replace(
            now, first_step=now.gradient_steps, first_epoch=now.epochs, state=TrainingState.RUNNING, reason=""
        )
        self.early_stop = replace(self.early_stop, waited=0)
        self.optimizer = Optimizer(self.model, self.config)
        self._take(data)

    @property
    def at_optimum(self) -> bool:
        """Whether it has ended at the optimum of its data."""
        return self.config.exact and self.counters.state is TrainingState.CONVERGED

    def displaced(self) -> str:
        """How far corners of an optimum are from where they were known to be, if too far for chance; else empty."""
        known_to, learned, scale = self.config.shape_known_to, self.model.geometry(), self.model.body.length_scale
        if known_to is None or learned is None or self._origin is None or not self.at_optimum:
            return ""
        return displaced_in_words(scale * self._origin.geometry().vertices_normal, scale * learned.vertices_normal, known_to)

    def trained(self) -> Model:
        """A copy of what counts as the result: the best by held-out loss where training stops early, else the last."""
        return self.model.with_tensors(self.model.tensors() if self.best_tensors is None else self.best_tensors)

    def _take(self, data: Transitions) -> None:
        self._data = self._described(checked(data))
        bounces = self._origin is not None and self._origin.geometry().restitution is not None
        self._seen = data if bounces else None
        self._batches = Batches(len(self._data.dt), self.config.batch, self._generator)
        self._single = SingleSteps.of(self.model, self._data, self.config, self.optimizer)

    def _described(self, data: Transitions) -> Transitions:
        return as_described(data, self.model.geometry(), self.model.body)

    def _step(self) -> None:
        """One gradient step, and what is due after it."""
        chosen = self._batches.take()
        rows = rows_of(self._data).take(chosen)
        batch = self.model.batch_loss(rows, self.config.loss)
        values, solved = batch.losses.detach().numpy(), batch.solved.numpy()  # for one row ten times as fast as torch
        failure = self._nonfinite(values, solved, rows, chosen)
        if failure:
            self._end(TrainingState.FAILED, failure)
            return
        count = int(np.count_nonzero(solved))
        if count and not self._descend(batch.losses if count == len(solved) else batch.losses[batch.solved], batch.regularizer):
            worst = not_finite_gradient(self.model, rows, self.config.loss)
            self._end(TrainingState.FAILED, f"{self._name(int(chosen[worst]))}: its gradient is not finite")
            return
        self._count(1, self.counters.loss_sum + float(values.sum(where=solved)), count, len(solved) - count)

    def _take_single(self, single: SingleSteps, limit: int) -> int:
        """Steps of a transition each, to the next evaluation at most, and what is due after them; how many."""
        now, config = self.counters, self.config
        step = now.gradient_steps - now.first_step
        if config.steps is not None:
            limit = min(limit, config.steps - step)
        if config.evaluation_steps is not None:
            limit = min(limit, config.evaluation_steps - step % config.evaluation_steps)
        taken, loss_sum = single.take(self._batches.ahead(limit), step, now.loss_sum)
        if taken:
            self._batches.skip(taken)
            self._count(taken, loss_sum, taken, 0)
        return taken

    def _count(self, steps: int, loss_sum: float, solved: int, not_solved: int) -> None:
        """Steps were taken, of one epoch."""
        now = self.counters
        self.counters = replace(
            now,
            gradient_steps=now.gradient_steps + steps,
            epochs=now.epochs + self._batches.at_epoch_end,
            not_solved=now.not_solved + not_solved,
            loss_sum=loss_sum,
            loss_count=now.loss_count + solved,
        )
        self._after_step()

    def _fit(self, origin: PolytopeModel) -> None:
        """All the way to the optimum. Its steps count as gradient steps, each over all data."""
        rows = rows_of(self._data)
        with torch.no_grad():
            batch = self.model.batch_loss(rows, self.config.loss)
        failure = self._nonfinite(batch.losses.numpy(), batch.solved.numpy(), rows, np.arange(len(rows.dt)))
        config = self.config
        shape = config.shape_of(origin.body)
        found = None if failure else optimum(
            origin, self._data, config.loss, config.trimmed, config.starts, self._seen, shape
        )  # fmt: skip
        if found is None or not found.finite:
            self._end(TrainingState.FAILED, failure or "the sum that the fit minimises is not finite")
            return
        self.model.load_state_dict(found.model.state_dict())
        mean, now = mean_loss(self.model, rows, self.config.loss), self.counters
        count = len(rows.dt) - mean.not_solved
        self.counters = replace(
            now,
            gradient_steps=now.gradient_steps + found.steps,
            epochs=now.epochs + found.steps,
            not_solved=now.not_solved + mean.not_solved,
            loss_sum=count * mean.loss if count else 0.0,
            loss_count=count,
        )
        self._evaluate()
        if self.counters.state is TrainingState.RUNNING:
            self._end(TrainingState.CONVERGED, f"the optimum was reached in {found.steps} Gauss-Newton steps")

    def _descend(self, losses: Tensor, regularizer: Tensor) -> bool:
        """Whether the gradient was finite, so that the step was taken."""
        config = self.config
        objective = bounded(losses, config.influence).mean() + config.regularizer * regularizer
        if config.ground and self._heights:
            objective = objective + config.ground * ground_excess(self._heights)
        return self.optimizer.minimize(objective, self.counters.gradient_steps - self.counters.first_step)

    def _nonfinite(self, values: Array, solved: NDArray[np.bool_], rows: Rows, chosen: NDArray[np.int64]) -> str:
        """One line about the first transition of a batch whose loss is not finite, or nothing."""
        wrong = ~np.isfinite(values)
        if not wrong.any():
            return ""
        unsolved = np.flatnonzero(~solved)
        wrong[unsolved] = not_finite(self.model, rows.take(unsolved)).numpy()
        return f"{self._name(int(chosen[np.argmax(wrong)]))}: its loss is not finite" if wrong.any() else ""

    def _after_step(self) -> None:
        now, config = self.counters, self.config
        steps, epochs = now.gradient_steps - now.first_step, now.epochs - now.first_epoch
        spent = (config.steps is not None and steps >= config.steps) or (config.epochs is not None and epochs >= config.epochs)
        every = config.evaluation_steps
        if spent or (self._batches.at_epoch_end if every is None else steps % every == 0):
            self._evaluate()
        if spent and self.counters.state is TrainingState.RUNNING:
            self._end(TrainingState.SPENT, f"the budget of {steps} gradient steps in {epochs} epochs is used up")

    def _evaluate(self) -> None:
        now = self.counters
        if not now.loss_count:
            self._end(TrainingState.FAILED, f"no transition was solved up to gradient step {now.gradient_steps}")
            return
        held_out = np.nan if self.held_out is None else mean_loss(self.model, rows_of(self.held_out), self.config.loss).loss
        self.history += (Evaluated(now.gradient_steps, now.epochs, now.loss_sum / now.loss_count, held_out),)
        self.counters = replace(now, loss_sum=0.0, loss_count=0)
        self.early_stop = self.early_stop.after(held_out)
        if self.config.patience is None:
            return
        if not self.early_stop.waited:
            self.best_tensors = self.model.tensors()
        if self.early_stop.waited >= self.config.patience.evaluations(len(self._data.toss_ids)):
            self._end(TrainingState.CONVERGED, f"the held-out loss has not fallen for {self.early_stop.waited} evaluations")

    def _end(self, state: TrainingState, reason: str) -> None:
        self.counters = replace(self.counters, state=state, reason=reason)

    def _name(self, row: int) -> str:
        return transition_name(self._data, row)


def new_training(
    model: str, body: Body, data: Transitions, held_out: Transitions | None, config: TrainingConfig, seed: int
) -> Training:
    """A training of a model by its name, from its random initialisation; a seed gives one model and one order of the data."""
    noise, shuffles = np.random.SeedSequence(seed).generate_state(2)
    start = model_class(model).initial(body, config.form, rows_of(checked(data)), np.random.default_rng(noise))
    return Training(start, data, held_out, config, int(shuffles))
