"""Runs a cell and gives its row: draws and gates a pool, selects tosses, trains a model and evaluates it on held-out motion.

Every seed draws four fifths of the training tosses and one set of initial parameters, for all rules alike: rules are compared
by the differences that each seed makes. A model learns from the tosses that its rule selected, from the initial parameters on.
Parameters that were learned before the last selection only say at which theta tosses are scored.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from contact_curation.contact.body import Body
from contact_curation.contact.geometry_parameters import UPWARD, ContactGeometry
from contact_curation.contact.loss_config import DEFAULT_LOSS
from contact_curation.contact.models.model import Model
from contact_curation.contact.models.polytope import PolytopeModel, initial_geometry
from contact_curation.contact.models.registry import model_class
from contact_curation.contact.parameter_form import Form
from contact_curation.errors import ContactCurationError, InvalidValueError
from contact_curation.experiments.cell import ALL, Cell, Protocol
from contact_curation.experiments.faults import Fault, with_faults
from contact_curation.experiments.rules import RULES, Rule
from contact_curation.geometry.quaternions import Array
from contact_curation.information.pool import pool_of
from contact_curation.information.ranker import rank_particles
from contact_curation.information.record import TossInformation
from contact_curation.learning.evaluation.evaluation import MEASURES, EvaluationConfig, evaluate_model, predicted_motions
from contact_curation.learning.evaluation.motion_errors import MotionErrors
from contact_curation.learning.fits.held_fit import HeldFitConfig, fit_held
from contact_curation.learning.training.curated import CuratedTraining, selected_transitions, toss_scorer
from contact_curation.learning.training.data import rows_of
from contact_curation.learning.training.progress import TrainingState
from contact_curation.learning.training.protocols import TrainingConfig, budgeted, published
from contact_curation.learning.training.reranking import EXACT_SELECTIONS, Reranking, RerankingConfig, StalenessConfig
from contact_curation.learning.training.training import Training
from contact_curation.motion.calibration import RigCalibration, apply_calibration
from contact_curation.motion.gate_config import GateConfig
from contact_curation.motion.gates import inspect
from contact_curation.motion.toss import Toss
from contact_curation.motion.transitions import Transitions, transitions_of

ONE_THREAD = replace(DEFAULT_LOSS, threads=1)
"""Cells run side by side."""

FIT = HeldFitConfig(loss=ONE_THREAD)

JUDGES = 1.0 / 3.0
"""Share of the tosses that judges, where a seed divides them."""

DRAWN = 0.8
"""Share of the training tosses in a seed's pool."""

STALENESS = StalenessConfig()
"""When a set is selected again in the budgeted protocol: when these have moved."""

EPOCHS = 20
"""In the published one: after so many passes over it (method.md 1.7)."""

WATCHED = 32
"""Tosses of the pool whose loss ends a published training; no rule may keep them."""


class NoResultError(ContactCurationError):
    """A cell whose training failed."""

    def __init__(self, cell: Cell, reason: str) -> None:
        super().__init__(f"{cell.rule} {cell.size}, seed {cell.seed}: {reason}")


@dataclass(frozen=True, eq=False)
class Bench:
    """What all cells of an experiment share.

    Attributes:
        body: as described.
        training: tosses that may be selected; no duplicate of a held-out one.
        held_out: tosses that judge.
        gates: that a pool passes.
    """

    body: Body
    training: tuple[Toss, ...]
    held_out: tuple[Toss, ...]
    gates: GateConfig

    def on(self, rig: RigCalibration) -> "Bench":
        """The same tosses as a level rig with a true metre would have tracked them."""
        training, held_out = (tuple(apply_calibration(toss, rig) for toss in side) for side in (self.training, self.held_out))
        return replace(self, training=training, held_out=held_out)

    def divided(self, seed: int) -> "Bench":
        """The tosses for training alone, of which a third, drawn by a seed, judges what is learned from the others."""
        judging = np.random.default_rng([seed, 3]).permutation(len(self.training)) < JUDGES * len(self.training)
        pairs = list(zip(self.training, judging.tolist(), strict=True))
        training, held_out = (tuple(toss for toss, judge in pairs if judge == wanted) for wanted in (False, True))
        return replace(self, training=training, held_out=held_out)

    @cached_property
    def pivot(self) -> Array:
        """(3,) amid the training tosses; the ground tilts about it."""
        positions = np.concatenate([toss.positions for toss in self.training]) / self.body.length_scale
        return np.array([*positions[:, :2].mean(axis=0), 0.0])

    def initial_polytope(self, seed: int) -> PolytopeModel:
        """The published random initialisation of vertices and friction, over the ground as it is known."""
        drawn = initial_geometry(self.body, Form.PHYSICAL, self.pivot, np.random.default_rng(seed))
        friction = float(np.linalg.norm(drawn.tangents[0]))
        level = replace(drawn, normal=UPWARD, tangents=friction * np.eye(2, 3), height=0.0)
        return PolytopeModel(level, self.body, Form.PHYSICAL)

    @cached_property
    def reference(self) -> ContactGeometry:
        """The information of all training tosses together."""
        data = transitions_of(self.training, self.body.length_scale)
        return fit_held(self.initial_polytope(0), data, FIT).model.geometry()


class GatedPool(NamedTuple):
    """What a rule chooses from.

    Attributes:
        tosses: that are left.
        bad: ids of those that have a fault, before the gates.
        hits, false_alarms: share of the bad, and of the good ones, that the gates rejected; NaN of none.
    """

    tosses: tuple[Toss, ...]
    bad: frozenset[str]
    hits: float
    false_alarms: float


class Learned(NamedTuple):
    """What a cell's training gave: the ids that it learned from, and the model."""

    selected: tuple[str, ...]
    model: Model


type Row = dict[str, float | str]


def run_cell(cell: Cell, bench: Bench) -> Row:
    """The row of a cell.

    Raises:
        ContactCurationError: the pool is too small, or the training failed.
    """
    pool = pool_of_cell(cell, bench)
    if cell.size > len(pool.tosses):
        raise NoResultError(cell, f"found {len(pool.tosses)} tosses in the pool, expected at least {cell.size}")
    learned = _learn_exactly(cell, bench, pool.tosses) if cell.protocol == Protocol.EXACT else _learn(cell, bench, pool.tosses)
    selected = [toss for toss in pool.tosses if toss.toss_id in set(learned.selected)]
    return {
        **judged(learned.model, bench),
        "selected_seconds": float(np.mean([toss.duration for toss in selected])),
        "selected_frames": float(sum(toss.frames for toss in selected)),
        "selected_bad": float(np.mean([toss.toss_id in pool.bad for toss in selected])),
        "gate_hits": pool.hits,
        "gate_false_alarms": pool.false_alarms,
        "selected": " ".join(learned.selected),
    }


def pool_of_cell(cell: Cell, bench: Bench) -> GatedPool:
    """The tosses that a cell's rule chooses from."""
    draw = np.random.default_rng([cell.seed, 1])
    count = round(DRAWN * len(bench.training))
    drawn = [bench.training[place] for place in np.sort(draw.choice(len(bench.training), count, replace=False))]
    bad: frozenset[str] = frozenset()
    tosses: Sequence[Toss] = drawn
    if cell.fault:
        tosses, bad = with_faults(drawn, Fault(cell.fault), cell.share, cell.seed)
    if not cell.gated:
        return GatedPool(tuple(tosses), bad, np.nan, np.nan)
    passes = {toss.toss_id: not inspect(toss, bench.body, bench.gates) for toss in tosses}
    caught, spared = [not passes[name] for name in bad], [not ok for name, ok in passes.items() if name not in bad]
    shares = (float(np.mean(each)) if each else np.nan for each in (caught, spared))
    return GatedPool(tuple(toss for toss in tosses if passes[toss.toss_id]), bad, *shares)


def select(rule: Rule, model: Model, tosses: Sequence[Toss], size: int, seed: int) -> tuple[str, ...]:
    """Ids of what a rule keeps, scored at a model's theta."""
    scores = toss_scorer(replace(rule.scoring(), loss=ONE_THREAD), rule.criterion)(model, tosses)
    pool = pool_of(one for one in scores if isinstance(one, TossInformation))
    return rank_particles([pool], rule.ranking(size, seed)).selected_ids


def _learn_exactly(cell: Cell, bench: Bench, tosses: tuple[Toss, ...]) -> Learned:
    """To the optimum, from the initial parameters, of what was selected last."""
    selected = _selected_exactly(cell, bench, tosses)
    return Learned(selected, fit_held(bench.initial_polytope(cell.seed), _data(bench, tosses, selected), FIT).model)


def _selected_exactly(cell: Cell, bench: Bench, tosses: tuple[Toss, ...]) -> tuple[str, ...]:
    """Some rounds of selection, each at the polytope that was fitted to the last set."""
    start = bench.initial_polytope(cell.seed)
    model, rule = start, RULES[cell.rule]
    size = len(tosses) if cell.size == ALL else cell.size
    selected = select(rule, model, tosses, size, cell.seed)
    for _ in range(EXACT_SELECTIONS - 1 if rule.reranked else 0):
        model = fit_held(model, _data(bench, tosses, selected), FIT, None if model is start else start).model
        before, selected = selected, select(rule, model, tosses, size, cell.seed)
        if set(selected) == set(before):
            break
    return selected


def _learn(cell: Cell, bench: Bench, tosses: tuple[Toss, ...]) -> Learned:
    """Trains step by step and selects again on the way, as `train --top K` with `--rerank-when-stale` or `--rerank-every`."""
    kind, config = cell.model, _protocol(cell)
    watched, tosses = _watched(tosses) if config.patience else ((), tosses)
    noise, shuffles = np.random.SeedSequence(cell.seed).generate_state(2)
    everything = rows_of(transitions_of(bench.training, bench.body.length_scale))
    model = model_class(kind).initial(bench.body, config.form, everything, np.random.default_rng(noise))
    reranking, selected = _first_selection(cell, bench, tosses, model)
    held = transitions_of(watched, bench.body.length_scale) if watched else None
    training = Training(model, _data(bench, tosses, selected), held, config, int(shuffles))
    curated = CuratedTraining(training, tosses, reranking)
    progress = training.progress
    occasions = 0
    while progress.state is TrainingState.RUNNING:
        progress = curated.advance(STALENESS.steps)
        due = progress.epochs // EPOCHS if cell.protocol == Protocol.PUBLISHED else progress.gradient_steps // STALENESS.steps
        if RULES[cell.rule].redrawn and due > occasions and progress.state is TrainingState.RUNNING:
            occasions = due
            selected = select(RULES[cell.rule], model, tosses, len(selected), _draw(cell.seed, progress.gradient_steps))
            training.replace_data(_data(bench, tosses, selected))
    if progress.state is TrainingState.FAILED:
        raise NoResultError(cell, progress.reason)
    return Learned(curated.selections[-1].toss_ids if curated.selections else selected, training.trained())


def _draw(seed: int, gradient_steps: int) -> int:
    """Seed of the random set from a gradient step on."""
    return int(np.random.SeedSequence([seed, gradient_steps]).generate_state(1)[0])


def _first_selection(
    cell: Cell, bench: Bench, tosses: tuple[Toss, ...], model: Model
) -> tuple[Reranking | None, tuple[str, ...]]:
    """What selects again later, if anything does, and the ids of the first set."""
    rule = RULES[cell.rule]
    if rule.by_polytope:
        return None, _selected_exactly(cell, bench, tosses)
    size = len(tosses) if cell.size == ALL else cell.size
    again = {"epochs": EPOCHS} if cell.protocol == Protocol.PUBLISHED else {"staleness": STALENESS}
    ranking = RerankingConfig(rule.ranking(size, cell.seed), **(again if rule.reranked else {}))
    reranking = Reranking(tosses, toss_scorer(replace(rule.scoring(), loss=ONE_THREAD), rule.criterion), ranking)
    return reranking, reranking.select(model).toss_ids


def _watched(tosses: tuple[Toss, ...]) -> tuple[tuple[Toss, ...], tuple[Toss, ...]]:
    """Those whose loss ends a training, spread over the pool, and the others."""
    every = max(len(tosses) // WATCHED, 2)
    return tosses[::every], tuple(toss for place, toss in enumerate(tosses) if place % every)


def _protocol(cell: Cell) -> TrainingConfig:
    kind = cell.model
    if cell.protocol == Protocol.PUBLISHED:
        return replace(published(kind), loss=ONE_THREAD)
    return replace(budgeted(kind), steps=cell.steps, loss=ONE_THREAD, evaluation_steps=cell.steps)


def _data(bench: Bench, tosses: Sequence[Toss], selected: Sequence[str]) -> Transitions:
    return selected_transitions(tosses, selected, bench.body.length_scale)


def judged(model: Model, bench: Bench) -> Row:
    """Means and medians over held-out tosses; of a polytope also how far its shape and friction are off.

    Raises:
        InvalidValueError: nothing judges.
    """
    if not bench.held_out:
        raise InvalidValueError("held-out tosses", "none", "some to judge by")
    found = evaluate_model(model, bench.held_out, EvaluationConfig(loss=ONE_THREAD))
    row = motion_row(found.errors)
    geometry = model.geometry()
    if found.shape is None or geometry is None:
        return row
    rigid = motion_row(predicted_motions(model.with_shared_vertices(), bench.held_out, EvaluationConfig()).errors)
    reference = bench.reference
    away = geometry.vertices_normal - reference.vertices_normal
    friction = float(np.linalg.norm(reference.tangents[0]) / np.linalg.norm(reference.normal))
    shape: Row = {
        "vertices": found.shape.vertex_rms_mm,
        "vertices_from_all": 1e3 * bench.body.length_scale * float(np.sqrt(np.square(away).sum(axis=1).mean())),
        "friction": found.shape.friction,
        "friction_from_all": abs(found.shape.friction - friction),
    }
    return row | {f"rigid_{name}": value for name, value in rigid.items()} | shape


def motion_row(errors: MotionErrors) -> Row:
    """Means and medians over the motions that are finite, and how many are not."""
    row: Row = {"not_finite": float(np.count_nonzero(~errors.finite))}
    for name in MEASURES if errors.finite.any() else ():
        values = getattr(errors, name)[errors.finite]
        row |= {name: float(values.mean()), f"{name}_median": float(np.median(values))}
    return row
