"""The paper's third figure: what is learned from designed throws and from random ones, throw by throw (method.md 1.10, 5).

The simulated arm throws the body as described, a tracker with the noise of ContactNets' looks on, and its poses become tosses
by the same rules and gates as anywhere. A learner that began at random learns from all tosses so far. After some throws it is
judged by real tosses, which nobody threw here, and by random throws in the world that its tosses come from.
"""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from contact_curation.contact.body import Body
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.models.polytope import PolytopeModel
from contact_curation.contact.models.registry import DEFAULT_MODEL
from contact_curation.design.designer import Designer, DesignerConfig
from contact_curation.design.execution_noise import ExecutionNoise, NoiseConfig
from contact_curation.design.planner import Planner
from contact_curation.design.releases import ReleasePrior, fitted_prior, raw_prior
from contact_curation.design.throw import Throw, throw_of_state
from contact_curation.errors import InvalidValueError
from contact_curation.experiments.cell import Protocol
from contact_curation.experiments.cell_run import ONE_THREAD, Bench, Row, motion_row
from contact_curation.experiments.counterfactuals.refitted import origin_of
from contact_curation.experiments.thrown.cell import DESIGNED, FIRM, RANDOM, RAW, WORLDS, ThrowsCell
from contact_curation.experiments.thrown.choice import Choice, Chooser, DesignedThrows, ExplorationThrows, RandomThrows
from contact_curation.experiments.thrown.landing import Thrower, successes
from contact_curation.geometry.quaternions import Array
from contact_curation.learning.evaluation.evaluation import EvaluationConfig, predicted_motions, shape_errors
from contact_curation.learning.training.protocols import ROUND_TRIMMED, TrainingConfig, budgeted, exact
from contact_curation.learning.training.training import Training
from contact_curation.motion.toss import Toss
from contact_curation.motion.transitions import states_of, transitions_of
from contact_curation.simulation.arm.rig import ArmRig
from contact_curation.simulation.thrown_toss import ThrownTossConfig, thrown_toss
from contact_curation.simulation.world import DEFAULT_WORLD, WorldConfig

DEFAULT_DESIGN = DesignerConfig(loss=ONE_THREAD)

FIRST_ROUND = 2
"""Tosses of the first round, as the trainer's."""

STEP_SHARE = 0.1
"""Longest step of MuJoCo, as a share of the time constant times the damping ratio."""

JUDGING, JUDGING_MOTIONS, LONGEST = 192, 64, 2.5
"""Random releases that are drawn to judge, those whose motions are predicted, and their longest motion [s]."""

LANDED, TASKS = (8, 12, 24, 48), 24
"""Numbers of throws after which tasks are done, and how many tasks."""

ARM_ERRORS = NoiseConfig(position=0.0008, turn=0.002, speed=0.0, velocity=0.003, spin=0.014)
"""Root mean squares of the simulated arm's errors over 24 random throws of the cube."""


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
        trained = self._training.trained()
        assert isinstance(trained, PolytopeModel)
        self._model = trained
        return True


def throws_rows(cell: ThrowsCell, bench: Bench, config: DesignerConfig = DEFAULT_DESIGN) -> tuple[Row, ...]:
    """A row per throw: how it was chosen, the information of its toss, and, after some, how well motion is predicted.

    Args:
        cell: which.
        bench: the real tosses for training. A third of them, drawn by the seed, judges, beside random throws in the cell's
            world; the prior of releases is fitted to the others.
        config: of the designer.

    Raises:
        ContactCurationError: too few tosses, or an arm that finds nothing to throw.
    """
    bench = bench.divided(cell.seed)
    rig, learner = ArmRig(bench.body, cell.seed, world=world_of_cell(cell)), _learner(cell, bench)
    releases = np.array([states_of(toss, 1.0)[0] for toss in bench.training])
    chooser = _chooser(cell, rig, config, releases, learner.model.geometry())
    judge = _Judge(bench, _safe_releases(bench, config, releases, cell.seed), cell)
    tosses: list[Toss] = []
    rows = []
    for number in range(1, cell.judged[-1] + 1):
        learns = number in cell.judged or cell.rule == DESIGNED or cell.protocol == Protocol.BUDGETED
        row = _thrown(number, chooser, rig, learner if learns else None, tosses)
        rows.append({**row, **(judge.row(learner.model, number) if number in cell.judged else {})})
    return tuple(rows)


def world_of_cell(cell: ThrowsCell) -> WorldConfig:
    """The contacts of a cell's world, with steps that are short enough for them."""
    seconds, damping = WORLDS[cell.world]
    longest = min(DEFAULT_WORLD.longest_step, STEP_SHARE * damping * seconds)
    return DEFAULT_WORLD if cell.world == FIRM else WorldConfig(longest, seconds, damping)


def _thrown(number: int, chooser: Chooser, rig: ArmRig, learner: RoundsLearner | None, tosses: list[Toss]) -> Row:
    """One throw; its toss, if it made one, is added and learned from."""
    choice = chooser.choose(number)
    seen = rig.throw(choice.throw)
    chooser.thrown(seen.commanded, seen.executed)
    row = _told(number, choice)
    if seen.toss is not None:
        realised = chooser.came(seen.toss)
        tosses.append(seen.toss)
        row |= {"toss": 1.0, "seconds": seen.toss.duration}
        row |= {} if realised is None else {"planned": realised.planned, "realised": realised.realised}
    if learner is not None and learner.learn(tosses):
        chooser.learned(learner.model.geometry(), tosses)
    return row


def _told(number: int, choice: Choice) -> Row:
    return {"throws": float(number), "designed": float(not choice.reason), "reason": choice.reason, "toss": 0.0}


@dataclass(frozen=True, eq=False)
class _Judge:
    """Judges models by real tosses, by motions in a cell's world, by the body that was thrown, and by a task.

    Attributes:
        bench: with the real tosses that judge.
        releases: (R, 13) random ones that may be thrown, in SI units.
        cell: its world and seed.
    """

    bench: Bench
    releases: Array
    cell: ThrowsCell

    def row(self, model: PolytopeModel, number: int) -> Row:
        """After so many throws."""
        row = judged(model, self.bench)
        there = predicted_motions(model, self._motions, EvaluationConfig(loss=ONE_THREAD)).errors
        row |= {f"world_{name}": value for name, value in motion_row(there).items()}
        if number in LANDED:
            row["landed"] = successes(model.geometry(), self._thrower, TASKS, self.cell.seed)
        return row

    @cached_property
    def _config(self) -> ThrownTossConfig:
        return ThrownTossConfig(longest=LONGEST, world=world_of_cell(self.cell))

    @cached_property
    def _motions(self) -> list[Toss]:
        """True motions of the first throws that come to rest."""
        found = []
        for number, release in enumerate(self.releases[:JUDGING_MOTIONS]):
            with suppress(InvalidValueError):  # no rest
                throw = throw_of_state(f"judging-{number}", self.bench.body.name, release)
                found.append(thrown_toss(self.bench.body, throw, self._config))
        return found

    @cached_property
    def _thrower(self) -> Thrower:
        return Thrower(self.bench.body, self.releases, ExecutionNoise.expected(ARM_ERRORS), self._config)


def judged(model: PolytopeModel, bench: Bench) -> Row:
    """Means and medians over held-out tosses, and how far shape and friction are from the body that was thrown."""
    row = motion_row(predicted_motions(model, bench.held_out, EvaluationConfig(loss=ONE_THREAD)).errors)
    shape = shape_errors(model)
    assert shape is not None
    off = abs(shape.friction_error)
    return row | {"vertices": shape.vertex_rms_mm, "friction": shape.friction, "friction_from_described": off}


def _learner(cell: ThrowsCell, bench: Bench) -> RoundsLearner:
    """One round after each throw, as the node trainer's."""
    exactly = cell.protocol == Protocol.EXACT
    config = replace(exact(ROUND_TRIMMED), restitution=cell.restitution) if exactly else budgeted(DEFAULT_MODEL)
    start = origin_of(bench, cell.seed, False) if exactly else bench.initial_polytope(cell.seed)
    return RoundsLearner(start, replace(config, loss=ONE_THREAD), max(cell.steps, 1), cell.seed)


def _chooser(cell: ThrowsCell, rig: ArmRig, config: DesignerConfig, releases: Array, geometry: ContactGeometry) -> Chooser:
    if cell.rule in (RANDOM, RAW):
        return RandomThrows(_random_throws(cell.rule, cell.judged[-1], cell.seed, rig, config, releases))
    designer = Designer(rig.body, config, fitted_prior(releases), rig.feasibility)
    return DesignedThrows(designer, geometry, cell.seed) if cell.rule == DESIGNED else ExplorationThrows(designer, cell.seed)


def _random_throws(rule: str, count: int, seed: int, rig: ArmRig, config: DesignerConfig, releases: Array) -> list[Throw]:
    prior: ReleasePrior = raw_prior(releases) if rule == RAW else fitted_prior(releases)
    return rig.random_throws(_planner(rig.body, config, prior), count, seed, rule)


def _safe_releases(bench: Bench, config: DesignerConfig, releases: Array, seed: int) -> Array:
    """(JUDGING, 13) releases as people make them; nobody learns from them."""
    planner = _planner(bench.body, config, fitted_prior(releases))
    drawn = planner.evaluator.draw_safe(planner.prior, JUDGING, np.random.default_rng([seed, 17]))
    return drawn.states(planner.config.candidates.placement)


def _planner(body: Body, config: DesignerConfig, prior: ReleasePrior) -> Planner:
    """At the body as described."""
    designer = Designer(body, config, prior)
    return designer.planner(designer.particle(ContactGeometry.of_body(body)))
