"""How a model is trained: ContactNets' published protocol, and ours with a budget of gradient steps.

See method.md 1.12, appendix A.

Published: one transition a step, AdamW at a small constant rate, epochs until the held-out loss has not fallen for
int(500 / total) + 12 of them, where total = 2 * training tosses, since half of ContactNets' tosses were for training.
Budgeted: steps of 128 transitions at a large rate that falls to zero along a cosine, the influence of large losses bounded. A
longer selection of tosses gets no more steps than a short one.
Exact: no such steps, but a polytope's optimum at once (learning/fits/exact_fit.py).
"""

import math
from dataclasses import dataclass, field, replace
from enum import StrEnum

from contact_curation.configs import check_not_negative, check_positive, set_whole_numbers
from contact_curation.contact.body import Body
from contact_curation.contact.loss_config import DEFAULT_LOSS, LossConfig
from contact_curation.contact.models.defaults import ModelDefaults
from contact_curation.contact.models.registry import model_class
from contact_curation.contact.parameter_form import Form
from contact_curation.errors import InvalidValueError
from contact_curation.learning.training.objective import InfluenceBound, InfluenceShape

PUBLISHED_REGULARIZER = 0.3
"""Weight of the regulariser that keeps theta's scale in place (method.md 1.2)."""

PUBLISHED_EPOCHS = 500
"""At most so many, as in method.md 1.13."""


class Schedule(StrEnum):
    """What the learning rate does: stay, or fall to zero over the budget like half a cosine."""

    CONSTANT = "constant"
    COSINE = "cosine"


@dataclass(frozen=True)
class AdamWConfig:
    """AdamW for one group of parameters.

    Attributes:
        learning_rate: initial learning rate.
        weight_decay: decoupled weight decay.
    """

    learning_rate: float
    weight_decay: float = 0.0

    def __post_init__(self) -> None:
        check_positive(self, ("learning_rate",))
        check_not_negative(self, ("weight_decay",))


@dataclass(frozen=True)
class Patience:
    """How many evaluations in a row may bring no lower held-out loss: more for few tosses, which make short epochs.

    Attributes:
        least: evaluations.
        tosses: a further int(tosses / (2 * training tosses)) evaluations.
    """

    least: int = 12
    tosses: int = 500

    def __post_init__(self) -> None:
        for name, smallest in (("least", 1), ("tosses", 0)):
            if getattr(self, name) < smallest:
                raise InvalidValueError(f"patience.{name}", getattr(self, name), f"at least {smallest}")

    def evaluations(self, training_tosses: int) -> int:
        """For this many tosses."""
        return int(self.tosses / (2 * training_tosses)) + self.least


@dataclass(frozen=True)
class TrainingConfig:
    """How a model is trained.

    Attributes:
        form: of the polytope in the model, where there is one that is trained.
        batch: transitions of a gradient step at most.
        polytope: optimizer of the polytope's parameters.
        network: optimizer of the networks' parameters.
        schedule: of both learning rates.
        steps: budget of gradient steps; None for no limit.
        epochs: at most so many passes over the data; None for no limit.
        evaluation_steps: gradient steps between two evaluations; None for an evaluation after each epoch.
        patience: when to stop early; None for never. Without it, too, the last parameters count as the result, not the best.
        regularizer: weight of the model's own, that keeps theta's scale in place.
        ground: weight of the squared height of the ground, where one is learned (learning/training/objective.py).
        influence: bound on the influence of large losses.
        loss: weights, cone and solver.
        exact: whether a polytope's optimum is taken at once; then form, loss, `trimmed`, `starts`, `restitution` and
            `shape_known_to` are all of this that counts.
        trimmed: share of the transitions that an exact fit leaves out, those that it explains worst.
        starts: how many starts an exact fit has, of which the lowest minimum counts (learning/fits/exact_fit.py).
        restitution: whether an exact fit in the rigid form learns one.
        shape_known_to: how exactly the corners of the body, or of the initial parameters, are known: their standard deviation
            [m]. An exact fit then begins there. None for the published initialisation.
    """

    form: Form
    batch: int
    polytope: AdamWConfig
    network: AdamWConfig
    schedule: Schedule
    steps: int | None
    epochs: int | None
    evaluation_steps: int | None
    patience: Patience | None
    regularizer: float = PUBLISHED_REGULARIZER
    ground: float = 0.0
    influence: InfluenceBound = field(default_factory=InfluenceBound)
    loss: LossConfig = DEFAULT_LOSS
    exact: bool = False
    trimmed: float = 0.0
    starts: int = 1
    restitution: bool = False
    shape_known_to: float | None = None

    def __post_init__(self) -> None:
        counts = ("batch", "steps", "epochs", "evaluation_steps", "starts")
        set_whole_numbers(self, [name for name in counts if getattr(self, name) is not None], 1)
        if self.steps is None and self.epochs is None:
            raise InvalidValueError("steps and epochs", "neither", "a limit on one of them")
        if self.schedule is Schedule.COSINE and self.steps is None:
            raise InvalidValueError("steps", "none", "a number of them, along which the cosine falls")
        check_not_negative(self, ("regularizer", "ground"))
        if not 0.0 <= self.trimmed < 1.0:
            raise InvalidValueError("trimmed", self.trimmed, "a share from 0 on, less than 1")
        if self.restitution and not (self.exact and self.form is Form.RIGID):
            raise InvalidValueError("restitution", "true", "false, or the exact protocol in the form rigid")
        if self.shape_known_to is not None:
            check_positive(self, ("shape_known_to",), unit="of metres")
            if not self.exact:
                raise InvalidValueError("shape_known_to", self.shape_known_to, "none, or the exact protocol")

    def shape_of(self, body: Body) -> float | None:
        """`shape_known_to` in the body's units of length.

        Raises:
            InvalidValueError: it is no length of a part of the body.
        """
        if self.shape_known_to is None:
            return None
        if self.shape_known_to >= body.length_scale:
            expected = f"metres, less than the body's length scale of {body.length_scale:.3g}"
            raise InvalidValueError("shape_known_to", self.shape_known_to, expected)
        return self.shape_known_to / body.length_scale

    def rate(self, step: int) -> float:
        """Share of the learning rates that gradient step number `step` of the budget, from 0 on, is taken with."""
        if self.schedule is Schedule.CONSTANT or self.steps is None:
            return 1.0
        return 0.5 * (1.0 + math.cos(math.pi * min(step / self.steps, 1.0)))


def published(model: str) -> TrainingConfig:
    """ContactNets' protocol for a model by its name (method.md 1.12)."""
    usual = model_class(model).defaults
    adamw = AdamWConfig(usual.published_rate, usual.published_decay)
    return TrainingConfig(
        form=Form.CONTACTNETS,
        batch=1,
        polytope=adamw,
        network=adamw,
        schedule=Schedule.CONSTANT,
        steps=None,
        epochs=PUBLISHED_EPOCHS,
        evaluation_steps=None,
        patience=Patience(),
    )


def budgeted(model: str) -> TrainingConfig:
    """Our protocol for a model by its name (method.md 2.1, appendix A)."""
    return _budgeted(model_class(model).defaults)


def _budgeted(usual: ModelDefaults) -> TrainingConfig:
    return TrainingConfig(
        form=Form.PHYSICAL,
        batch=usual.batch,
        polytope=AdamWConfig(3e-2),
        network=AdamWConfig(usual.network_rate, 1e-2),
        schedule=Schedule.COSINE,
        steps=usual.steps,
        epochs=None,
        evaluation_steps=100,
        patience=None,
        ground=2.4,
        influence=InfluenceBound(0.95, 20.0, 1.0, InfluenceShape.GEMAN) if usual.bounds_influence else InfluenceBound(),
    )


ROUND_TRIMMED = 0.005
"""Share that rounds leave out by default, which learn from designed throws, too (docs/explanation/learning.md)."""


USUAL_STARTS = 4
"""Of the fits of `train` and of rounds: bodies that are no boxes have false minima (docs/explanation/learning.md)."""


def exact(trimmed: float = 0.0, starts: int = 1) -> TrainingConfig:
    """The protocol that takes a polytope's optimum at once.

    Args:
        trimmed: share of the transitions to leave out.
        starts: how many, of which the lowest minimum counts.
    """
    return replace(_budgeted(ModelDefaults()), form=Form.RIGID, exact=True, trimmed=trimmed, starts=starts)
