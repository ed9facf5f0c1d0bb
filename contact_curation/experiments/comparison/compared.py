"""One cell of the comparison: a rule selects tosses of a body, a polytope learns from them, and two engines predict the rest.

A seed draws the third of the tosses that judges, and theta_0; both are the same for all rules. A rule selects three times, at
theta_0 and at what was learned from its last two sets, as in `cell_run`; those that do not depend on theta once. Or all rules
select once, at the fit to all training tosses, where information is as right as it can be, and all fits start there: then rules
differ by their sets alone, not by where a descent ends. The model is a polytope with one set of vertices and learned noise of
impacts, fitted to the optimum; of a body that bounces with a restitution, as `train` learns it from one start.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from contact_curation.contact.models.polytope import PolytopeModel
from contact_curation.errors import InvalidValueError, UnknownNameError
from contact_curation.experiments.bodies import BODIES, BOUNCING, bench_of
from contact_curation.experiments.cell import Planned
from contact_curation.experiments.cell_run import FIT, ONE_THREAD, Bench, Row
from contact_curation.experiments.comparison.baselines import BASELINES, Weights
from contact_curation.experiments.comparison.datamodel import Datamodel, datamodel_of
from contact_curation.experiments.counterfactuals.refitted import origin_of
from contact_curation.experiments.engines import judged_by_engines
from contact_curation.experiments.rules import RULES, Rule
from contact_curation.information.impacts import as_described
from contact_curation.information.pool import Pool, pool_of
from contact_curation.information.ranker import moved_by_theta, rank_particles
from contact_curation.information.record import TossInformation
from contact_curation.learning.evaluation.rebounds import rebound_of
from contact_curation.learning.fits.exact_fit import with_rebound
from contact_curation.learning.fits.held_fit import fit_held
from contact_curation.learning.fits.refits import RefitConfig, RefitPool
from contact_curation.learning.training.curated import selected_transitions, toss_scorer
from contact_curation.learning.training.reranking import EXACT_SELECTIONS
from contact_curation.motion.toss import Toss
from contact_curation.motion.transitions import transitions_of

COUNTERFACTUAL = "counterfactual"
"""See `datamodel`; it is always made at the fit to all training tosses."""

ONCE = ("strata", "k-medoids")
"""Baselines that do not depend on theta."""

ALL = "all"


@dataclass(frozen=True)
class Compared(Planned):
    """One training.

    Attributes:
        body: one of `bodies.BODIES`.
        rule: one of `rules.RULES`, of `baselines.BASELINES`, or `COUNTERFACTUAL`.
        size: how many tosses; all of them for the rule `all`.
        seed: see the module.
        at_fit: whether it selects at the fit to all training tosses.
    """

    body: str
    rule: str
    size: int
    seed: int
    at_fit: bool = False

    def __post_init__(self) -> None:
        for name, accepted in (("body", BODIES), ("rule", [*RULES, *BASELINES, COUNTERFACTUAL])):
            if getattr(self, name) not in accepted:
                raise UnknownNameError(name, getattr(self, name), accepted)
        if self.size < 1:
            raise InvalidValueError("--sizes", self.size, "at least 1; rule all takes all tosses")


@lru_cache(maxsize=1)
def _bench(body: str, seed: int) -> Bench:
    """Cells come body by body and seed by seed."""
    return bench_of(body, seed)


@lru_cache(maxsize=1)
def _origin(body: str, seed: int) -> PolytopeModel:
    """Theta_0."""
    return origin_of(_bench(body, seed), seed, body in BOUNCING)


@lru_cache(maxsize=2)
def _start(body: str, seed: int, at_fit: bool) -> PolytopeModel:
    """Where rules select first and fits start: theta_0, or the fit to all training tosses."""
    bench, origin = _bench(body, seed), _origin(body, seed)
    return _fitted(origin, None, bench, _all(bench)) if at_fit else origin


def _all(bench: Bench) -> Weights:
    return {toss.toss_id: 1.0 for toss in bench.training}


def compared_row(cell: Compared) -> Row:
    """The cell's row: for each judge and error the values of all judging tosses, joined by blanks; NaN where not finite.

    Raises:
        ContactCurationError: the body's tosses are not there, or are too few.
    """
    bench = _bench(cell.body, cell.seed)
    if cell.size > len(bench.training):
        raise InvalidValueError("--sizes", cell.size, f"at most {len(bench.training)}, the training tosses of {cell.body}")
    start, origin = _start(cell.body, cell.seed, cell.at_fit), _origin(cell.body, cell.seed) if cell.at_fit else None
    chosen = _selected(cell, bench, start)
    model = _fitted(start, origin, bench, chosen)
    return {**judged_by_engines(model, bench), "selected": " ".join(chosen)}


def _selected(cell: Compared, bench: Bench, start: PolytopeModel) -> Weights:
    if cell.rule == ALL:
        return _all(bench)
    if cell.rule == COUNTERFACTUAL:
        places = _datamodel(cell.body, cell.seed).best(cell.size, np.random.default_rng([cell.seed, cell.size, 23]))
        return {bench.training[place].toss_id: 1.0 for place in places}
    once = cell.at_fit or cell.rule in ONCE or (cell.rule in RULES and not RULES[cell.rule].reranked)
    model, chosen = start, _chosen(cell, _first_pool(cell.body, cell.seed, cell.at_fit, _scored_as(cell)), bench.training)
    for _ in range(0 if once else EXACT_SELECTIONS - 1):
        model = _fitted(model, None if model is start else start, bench, chosen)
        before, chosen = chosen, _chosen(cell, _pool(model, bench.training, _scored_as(cell)), bench.training)
        if chosen == before:
            break
    return chosen


@lru_cache(maxsize=1)
def _datamodel(body: str, seed: int) -> Datamodel:
    """What foresees sets of the training tosses."""
    bench = _bench(body, seed)
    data = as_described(transitions_of(bench.training, bench.body.length_scale), _origin(body, seed).geometry(), bench.body)
    pool = RefitPool(data, _origin(body, seed), _start(body, seed, True), RefitConfig(FIT))
    return datamodel_of(pool, bench.training, seed)


def _scored_as(cell: Compared) -> Rule:
    """A rule that reads the same scores as the cell's; of all such rules the same."""
    rule = RULES.get(cell.rule, RULES["herding"])  # whose scores the baselines read
    return Rule("herding" if moved_by_theta(rule.criterion) else "random", rule.estimator)


def _pool(model: PolytopeModel, tosses: Sequence[Toss], rule: Rule) -> Pool:
    """The tosses as a rule reads them at a model's theta."""
    scores = toss_scorer(replace(rule.scoring(), loss=ONE_THREAD), rule.criterion)(model, tosses)
    return pool_of(one for one in scores if isinstance(one, TossInformation))


@lru_cache(maxsize=3)
def _first_pool(body: str, seed: int, at_fit: bool, rule: Rule) -> Pool:
    """The training tosses where rules select first, for all rules and sizes that read the same scores."""
    return _pool(_start(body, seed, at_fit), _bench(body, seed).training, rule)


def _chosen(cell: Compared, pool: Pool, tosses: Sequence[Toss]) -> Weights:
    """What the rule selects from a pool."""
    if cell.rule in BASELINES:
        return BASELINES[cell.rule](pool, tosses, cell.size, cell.seed)
    ranking = RULES[cell.rule].ranking(cell.size, cell.seed)
    return dict.fromkeys(sorted(rank_particles([pool], ranking).selected_ids), 1.0)


def _fitted(model: PolytopeModel, origin: PolytopeModel | None, bench: Bench, chosen: Weights) -> PolytopeModel:
    seen = selected_transitions(bench.training, tuple(chosen), bench.body.length_scale)
    bounces = model.geometry().restitution is not None
    prior, fit = with_rebound(origin or model, FIT, rebound_of(seen, bench.body) if bounces else None)
    data, weights = as_described(seen, model.geometry(), bench.body), [chosen[name] for name in seen.toss_ids]
    return (fit_held(model, data, fit, prior, weights) if origin else fit_held(prior, data, fit, None, weights)).model
