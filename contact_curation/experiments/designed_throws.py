"""The paper's third figure: what is learned from designed throws and from random ones, throw by throw (method.md 1.10, 5).

The simulated arm throws the body as described, a tracker with the real rig's noise looks on, and its poses become tosses by the
same rules and gates as anywhere. After each throw a learner that began at random learns from all tosses so far, and after some
of them it is judged by the held-out tosses, which nobody threw here.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.models.polytope import PolytopeModel
from contact_curation.contact.models.registry import DEFAULT_MODEL
from contact_curation.contact.parameter_form import Form
from contact_curation.design.designer import Designer, DesignerConfig
from contact_curation.design.planner import Planner
from contact_curation.design.releases import ReleasePrior, fitted_prior, raw_prior
from contact_curation.design.throw import Throw
from contact_curation.errors import InvalidValueError
from contact_curation.experiments.cell import Protocol
from contact_curation.experiments.cell_run import ONE_THREAD, Bench, Row, motion_row
from contact_curation.experiments.throw_choice import Choice, Chooser, DesignedThrows, ExplorationThrows, RandomThrows
from contact_curation.experiments.throws import RANDOM, RAW, ThrowsCell
from contact_curation.geometry.quaternions import Array
from contact_curation.learning.evaluation.evaluation import EvaluationConfig, predicted_motions, shape_errors
from contact_curation.learning.training.protocols import ROUND_TRIMMED, TrainingConfig, budgeted, exact
from contact_curation.learning.training.training import Training
from contact_curation.motion.toss import Toss
from contact_curation.motion.transitions import states_of, transitions_of
from contact_curation.simulation.arm.rig import ArmRig

DEFAULT_DESIGN = DesignerConfig(loss=ONE_THREAD)

FIRST_ROUND = 2
"""Tosses of the first round, as the trainer's."""


class RoundsLearner:
    """A polytope that learns from tosses as they come, from a random initialisation: a round of training after each of them.

    In the exact protocol a round is the optimum of all tosses so far, so that only these count and not their order; in the
    budgeted one it goes on from where the last one ended.

    Args:
        start: random initialisation; it is changed.
        config: of a round.
        steps: of a round; an exact one takes as many as it needs.
        seed: of the shuffles.
    """

    def __init__(self, start: PolytopeModel, config: TrainingConfig, steps: int, seed: int) -> None:
        self._model, self._steps, self._seed = start, steps, seed
        self._config = replace(config, steps=steps, evaluation_steps=steps)
        self._training: Training | None = None

    @property
    def model(self) -> PolytopeModel:
        """What it has learned; before that, what it began with."""
        return self._model

    def learn(self, tosses: Sequence[Toss]) -> bool:
        """Makes a round on all tosses so far; False when these are too few."""
        if len(tosses) < FIRST_ROUND:
            return False
        data = transitions_of(tosses, self._model.body.length_scale)
        if self._training is None:
            self._training = Training(self._model, data, None, self._config, self._seed)
        else:
            self._training.replace_data(data, fresh_budget=True)
        self._training.advance(self._steps)
        self._model = self._model.with_tensors(self._training.trained().tensors())
        return True


def throws_rows(cell: ThrowsCell, bench: Bench, config: DesignerConfig = DEFAULT_DESIGN) -> tuple[Row, ...]:
    """A row per throw: how it was chosen, the information of its toss, and, after some, how well held-out motion is predicted.

    Args:
        cell: which.
        bench: the real tosses: priors are fitted to the releases of those for training, the held-out ones judge.
        config: of the designer.

    Raises:
        ContactCurationError: too few tosses, or an arm that finds nothing to throw.
    """
    if not bench.held_out:
        raise InvalidValueError("held-out tosses", "none", "some to judge by")
    rig, learner = ArmRig(bench.body, cell.seed), _learner(cell, bench)
    chooser = _chooser(cell, bench, rig, config, learner.model.geometry())
    tosses: list[Toss] = []
    rows = []
    for number in range(1, cell.judged[-1] + 1):
        row = _thrown(number, chooser, rig, learner, tosses)
        rows.append({**row, **(judged(learner.model, bench) if number in cell.judged else {})})
    return tuple(rows)


def _thrown(number: int, chooser: Chooser, rig: ArmRig, learner: RoundsLearner, tosses: list[Toss]) -> Row:
    """One throw; its toss, if it made one, is added and learned from."""
    choice = chooser.choose(number)
    seen = rig.throw(choice.throw)
    chooser.thrown(seen.commanded, seen.executed)
    row = _told(number, choice)
    if seen.toss is None:
        return row | {"toss": 0.0}
    realised = chooser.came(seen.toss)
    tosses.append(seen.toss)
    if learner.learn(tosses):
        chooser.learned(learner.model.geometry(), tosses)
    row |= {"toss": 1.0, "seconds": seen.toss.duration}
    return row if realised is None else row | {"planned": realised.planned, "realised": realised.realised}


def _told(number: int, choice: Choice) -> Row:
    return {"throws": float(number), "designed": float(not choice.reason), "reason": choice.reason}


def judged(model: PolytopeModel, bench: Bench) -> Row:
    """Means and medians over held-out tosses, and how far shape and friction are from the body that was thrown."""
    row = motion_row(predicted_motions(model, bench.held_out, EvaluationConfig()).errors)
    rigid = motion_row(predicted_motions(model.with_shared_vertices(), bench.held_out, EvaluationConfig()).errors)
    row |= {f"rigid_{name}": value for name, value in rigid.items()}
    shape = shape_errors(model)
    assert shape is not None
    off = abs(shape.friction_error)
    return row | {"vertices": shape.vertex_rms_mm, "friction": shape.friction, "friction_from_described": off}


def _learner(cell: ThrowsCell, bench: Bench) -> RoundsLearner:
    """One round after each throw, as the node trainer's."""
    config = replace(exact(ROUND_TRIMMED), form=Form.PHYSICAL) if cell.protocol == Protocol.EXACT else budgeted(DEFAULT_MODEL)
    return RoundsLearner(bench.initial_polytope(cell.seed), replace(config, loss=ONE_THREAD), max(cell.steps, 1), cell.seed)


def _chooser(cell: ThrowsCell, bench: Bench, rig: ArmRig, config: DesignerConfig, geometry: ContactGeometry) -> Chooser:
    releases = np.array([states_of(toss, 1.0)[0] for toss in bench.training])
    if cell.rule in (RANDOM, RAW):
        return RandomThrows(_random_throws(cell, rig, config, releases))
    designer = Designer(bench.body, config, fitted_prior(releases), rig.feasibility)
    return DesignedThrows(designer, geometry, cell.seed) if cell.rule == "designed" else ExplorationThrows(designer, cell.seed)


def _random_throws(cell: ThrowsCell, rig: ArmRig, config: DesignerConfig, releases: Array) -> list[Throw]:
    prior: ReleasePrior = raw_prior(releases) if cell.rule == RAW else fitted_prior(releases)
    designer = Designer(rig.body, config, prior)
    planner: Planner = designer.planner(designer.particle(ContactGeometry.of_body(rig.body)))
    return rig.random_throws(planner, cell.judged[-1], cell.seed, cell.rule)
