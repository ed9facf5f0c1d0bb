"""Trains a model on the training tosses: configuration, run, and the trained model."""

import os
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from math import isnan, nan
from pathlib import Path
from typing import Self

import numpy as np

from contact_curation.configs import set_whole_numbers
from contact_curation.contact.body import Body
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.models.model import Model
from contact_curation.contact.models.polytope import PolytopeModel
from contact_curation.contact.models.registry import model_class, model_entry
from contact_curation.contact.parameter_form import Form
from contact_curation.errors import ContactCurationError, InvalidValueError, UnknownNameError
from contact_curation.geometry.quaternions import Array
from contact_curation.information.scoring import ScoringConfig
from contact_curation.learning.checkpoints.stored_model import notes_of_bytes
from contact_curation.learning.evaluation.misfit import slides_apart_in_words, sliding_of, sticking_in_words
from contact_curation.learning.training.curated import CuratedTraining
from contact_curation.learning.training.data import rows_of
from contact_curation.learning.training.objective import mean_loss
from contact_curation.learning.training.plan import TrainingPlan, begin, resume, stored
from contact_curation.learning.training.progress import Progress, TrainingState
from contact_curation.learning.training.protocols import USUAL_STARTS, TrainingConfig, budgeted, exact, published
from contact_curation.learning.training.reranking import RerankingConfig
from contact_curation.learning.uncertainty.bounce import Bounce, bounce_of
from contact_curation.learning.uncertainty.more_throws import MoreThrows, after_training
from contact_curation.motion.calibration import NO_CORRECTION, RigCalibration
from contact_curation.pipeline.division import DivisionConfig, LearningTosses
from contact_curation.pipeline.learned_model import LearnedModel, model_of_checkpoint
from contact_curation.pipeline.reading import settings_of
from contact_curation.storage.parameters_file import Parameters, read_theta
from contact_curation.version import __version__


def _exact(kind: str) -> TrainingConfig:
    form = Form.RIGID if model_class(kind).has_exact_fit(Form.RIGID) else Form.PHYSICAL
    return replace(exact(starts=USUAL_STARTS), form=form)


PROTOCOLS: dict[str, Callable[[str], TrainingConfig]] = {
    "budgeted": budgeted,
    "published": published,
    "exact": _exact,
}
"""budgeted: so many steps in batches; published: ContactNets', until the held-out loss stops falling; exact: a polytope's
optimum at once."""

AUTO = "auto"
"""The protocol by default: exact where a model has an optimum, else budgeted."""

BEFORE = "held-out loss before"
"""The note that says it."""


class TrainingFailedError(ContactCurationError):
    """A loss or a gradient was not finite."""

    def __init__(self, progress: Progress, checkpoint: Path | None = None) -> None:
        kept = f"; {checkpoint} holds the parameters before it" if checkpoint else ""
        where = f"after {progress.gradient_steps} gradient steps: {progress.reason}"
        super().__init__(f"the training failed {where}{kept}; try smaller learning rates")


@dataclass(frozen=True, eq=False)
class TrainConfig:
    """The configuration of a training.

    Attributes:
        kind: of the model.
        body: the object.
        protocol: of the training.
        division: which tosses it learns from.
        selection: the best of them; None for all.
        scoring: how tosses are scored for it.
        start: to begin with; None for the published initialisation.
        seed: of everything random.
        rig: how the tosses were calibrated.
        learned_before: ids of the tosses that the model to begin with learned from.
    """

    kind: str
    body: Body
    protocol: TrainingConfig
    division: DivisionConfig = field(default_factory=DivisionConfig)
    selection: RerankingConfig | None = None
    scoring: ScoringConfig = field(default_factory=ScoringConfig)
    start: Model | Parameters | None = None
    seed: int = 0
    rig: RigCalibration = NO_CORRECTION
    learned_before: frozenset[str] = frozenset()

    def __post_init__(self) -> None:
        set_whole_numbers(self, ("seed",))

    def plan(self, tosses: LearningTosses) -> TrainingPlan:
        """The plan of a training on these tosses.

        Raises:
            InvalidValueError: `protocol.shape_known_to` is no length of a part of the body.
        """
        start = self.start
        self.protocol.shape_of(self.body)
        if isinstance(start, Parameters):
            start = _polytope(start, self.protocol.form, tosses)
        return TrainingPlan(
            kind=self.kind,
            body=self.body,
            protocol=self.protocol,
            tosses=tosses.training,
            held_out=tosses.held_out,
            seed=self.seed,
            start=start,
            selection=self.selection,
            scoring=self.scoring,
        )


def protocol_named(name: str, kind: str, form: Form | None = None, by_steps: bool = False) -> str:
    """A protocol's name; in place of `auto` the one that it stands for.

    Args:
        name: a protocol, or `auto`.
        kind: of the model.
        form: of a polytope's theta; None for the usual one.
        by_steps: whether something was asked for that only gradient steps have.

    Raises:
        UnknownNameError: there is no such protocol.
    """
    if name not in (AUTO, *PROTOCOLS):
        raise UnknownNameError("protocol", name, (AUTO, *PROTOCOLS))
    if name != AUTO:
        return name
    return "exact" if model_class(kind).has_exact_fit(form or Form.RIGID) and not by_steps else "budgeted"


def start_of(given: LearnedModel | Path | None, kind: str, body: Body) -> Model | Parameters | None:
    """The initial parameters of a training: those of a model, or of its file.

    Raises:
        ContactCurationError: the file holds no such model.
    """
    if given is None:
        return None
    name, theta = (given.name, given.model) if isinstance(given, LearnedModel) else (given, read_theta(given, body))
    if not isinstance(theta, Model) and not model_entry(kind).is_geometry:
        raise InvalidValueError("model to start from", f"{name}, a polytope", f"a checkpoint of a {kind} model")
    if isinstance(theta, Model) and theta.kind != kind:
        raise InvalidValueError(f"model of {name}", theta.kind, f"{kind}, which is to be trained")
    return theta


class TrainingRun:
    """A training under way; the result is the same bytes however often it is stored and resumed.

    Args:
        plan: what decides it.
        curated: where it is.
        loss_before: held-out loss before the first step; NaN if nothing is held out.
        config: of the training.
    """

    def __init__(self, plan: TrainingPlan, curated: CuratedTraining, loss_before: float, config: TrainConfig) -> None:
        self.plan, self.curated, self.loss_before = plan, curated, loss_before
        self._notes = {
            BEFORE: repr(loss_before),
            "package version": __version__,
            "training ids": "\n".join(toss.toss_id for toss in plan.tosses),
            "held-out ids": "\n".join(toss.toss_id for toss in plan.held_out),
            "rig": settings_of(config.rig),
        }
        if config.learned_before:
            self._notes["earlier ids"] = "\n".join(sorted(config.learned_before))

    @classmethod
    def begun(cls, config: TrainConfig, tosses: LearningTosses) -> Self:
        """Before its first step.

        Raises:
            InvalidValueError: nothing to learn from, or nothing held out where the protocol needs it.
        """
        plan = config.plan(tosses)
        curated = begin(plan)
        held_out = curated.training.held_out
        before = nan if held_out is None else mean_loss(curated.training.model, rows_of(held_out), plan.protocol.loss).loss
        return cls(plan, curated, before, config)

    @classmethod
    def resumed(cls, config: TrainConfig, tosses: LearningTosses, data: bytes, source: Path) -> Self:
        """Where the training in the bytes of a checkpoint was; errors as of `learning.training.plan.resume`."""
        plan = config.plan(tosses)
        curated = resume(plan, data, source)
        return cls(plan, curated, float(notes_of_bytes(data, source).get(BEFORE, "nan")), config)

    @property
    def progress(self) -> Progress:
        """How far it is."""
        return self.curated.training.progress

    @property
    def running(self) -> bool:
        """Whether it goes on."""
        return self.progress.state is TrainingState.RUNNING

    @property
    def loss_after(self) -> float:
        """Held-out loss of the result: the best one where the protocol stops early, else the last."""
        return self.progress.held_out_loss if self.plan.protocol.patience is None else self.progress.best_held_out_loss

    def advance(self) -> str:
        """Takes one gradient step, or selects again; returns a note on how it goes."""
        done = self.curated.advance(1)
        held_out = "" if isnan(done.held_out_loss) else f", held out {done.held_out_loss:.4g}"
        return f"loss {done.training_loss:.4g}{held_out}"

    def checkpoint(self) -> bytes:
        """All of it, to be resumed or to take the model from."""
        return stored(self.plan, self.curated, self._notes)

    def check(self, checkpoint: Path | None = None) -> None:
        """Refuses a training that failed.

        Raises:
            TrainingFailedError: a loss or a gradient was not finite.
        """
        if self.progress.state is TrainingState.FAILED:
            raise TrainingFailedError(self.progress, checkpoint)

    def bounce(self) -> Bounce | None:
        """The restitution of the tosses, where the model was fitted to its optimum without one."""
        training = self.curated.training
        return bounce_of(training.trained(), training.data, self.plan.protocol.loss) if training.at_optimum else None

    def sticking(self) -> str:
        """What contacts that seldom slide say against the friction of an optimum; empty for nothing."""
        if not self.curated.training.at_optimum:
            return ""
        model = self.curated.training.trained()
        slid = sliding_of(self.plan.tosses, model.body)
        return sticking_in_words(self.curated.training.data, model.geometry(), model.body, slid)

    def doubts(self) -> tuple[str, ...]:
        """Corners that are learned far from where they are known to be, and tosses that slide otherwise: a line for each."""
        training = self.curated.training
        return tuple(filter(None, (training.displaced(), slides_apart_in_words(sliding_of(self.plan.tosses, self.plan.body)))))

    def more_throws(self) -> MoreThrows | None:
        """How far as many throws again would change predicted motions, of the held-out tosses if there are any."""
        judges = self.plan.held_out or self.plan.tosses
        return after_training(self.curated.training, judges, self.plan.seed, threads=os.cpu_count() or 1)

    def model(self) -> LearnedModel:
        """The model as it is now."""
        return model_of_checkpoint(self.checkpoint(), f"{self.plan.kind} trained here")


def _polytope(start: Parameters, form: Form, tosses: LearningTosses) -> PolytopeModel:
    """The same ground about a pivot amid the data, where the physical form's tilt and height keep apart."""
    geometry = start.geometry
    if form is not Form.CONTACTNETS:
        middle = np.concatenate([toss.positions for toss in tosses.training]).mean(axis=0) / start.body.length_scale
        pivot = np.array([*middle[:2], 0.0])
        geometry = _about(geometry, pivot)
    return PolytopeModel(geometry.rigid() if form is Form.RIGID else geometry, start.body, form)


def _about(geometry: ContactGeometry, pivot: Array) -> ContactGeometry:
    return replace(geometry, pivot=pivot, height=geometry.height + float(geometry.normal @ (geometry.pivot - pivot)))
