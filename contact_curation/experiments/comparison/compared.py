"""One cell of the comparison: a rule selects tosses of a body, a polytope learns from them, and two engines predict the rest.

A seed draws the third of the tosses that judges, and theta_0; both are the same for all rules. A rule selects three times, at
theta_0 and at what was learned from its last two sets, as in `cell_run`; those that do not depend on theta once. The model is a
polytope with one set of vertices and learned noise of impacts, fitted to the optimum.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

from contact_curation.contact.models.polytope import PolytopeModel
from contact_curation.errors import InvalidValueError, UnknownNameError
from contact_curation.experiments.bodies import BODIES, BOUNCING, bench_of
from contact_curation.experiments.cell import Planned
from contact_curation.experiments.cell_run import FIT, ONE_THREAD, Bench, Row
from contact_curation.experiments.comparison.baselines import BASELINES, Weights
from contact_curation.experiments.counterfactuals.refitted import origin_of
from contact_curation.experiments.engines import judged_by_engines
from contact_curation.experiments.rules import RULES
from contact_curation.information.pool import pool_of
from contact_curation.information.ranker import rank_particles
from contact_curation.information.record import TossInformation
from contact_curation.learning.fits.held_fit import fit_held
from contact_curation.learning.training.curated import selected_transitions, toss_scorer
from contact_curation.learning.training.reranking import EXACT_SELECTIONS
from contact_curation.motion.toss import Toss

ONCE = ("strata", "k-medoids")
"""Baselines that do not depend on theta."""

ALL = "all"


@dataclass(frozen=True)
class Compared(Planned):
    """One training.

    Attributes:
        body: one of `bodies.BODIES`.
        rule: one of `rules.RULES` or of `baselines.BASELINES`.
        size: how many tosses; all of them for the rule `all`.
        seed: see the module.
    """

    body: str
    rule: str
    size: int
    seed: int

    def __post_init__(self) -> None:
        for name, accepted in (("body", BODIES), ("rule", [*RULES, *BASELINES])):
            if getattr(self, name) not in accepted:
                raise UnknownNameError(name, getattr(self, name), accepted)


@lru_cache(maxsize=1)
def _bench(body: str, seed: int) -> Bench:
    """Cells come body by body and seed by seed."""
    return bench_of(body, seed)


def compared_row(cell: Compared) -> Row:
    """The cell's row: for each judge and error the values of all judging tosses, joined by blanks; NaN where not finite.

    Raises:
        ContactCurationError: the body's tosses are not there, or are too few.
    """
    bench = _bench(cell.body, cell.seed)
    if cell.size > len(bench.training):
        raise InvalidValueError("--sizes", cell.size, f"at most {len(bench.training)}, the training tosses of {cell.body}")
    start = origin_of(bench, cell.seed, cell.body in BOUNCING)
    chosen = _selected(cell, bench, start)
    model = _fitted(start, None, bench, chosen)
    return {**judged_by_engines(model, bench), "selected": " ".join(chosen)}


def _selected(cell: Compared, bench: Bench, start: PolytopeModel) -> Weights:
    if cell.rule == ALL:
        return {toss.toss_id: 1.0 for toss in bench.training}
    once = cell.rule in ONCE or (cell.rule in RULES and not RULES[cell.rule].reranked)
    model, chosen = start, _chosen(cell, start, bench.training)
    for _ in range(0 if once else EXACT_SELECTIONS - 1):
        model = _fitted(model, None if model is start else start, bench, chosen)
        before, chosen = chosen, _chosen(cell, model, bench.training)
        if chosen == before:
            break
    return chosen


def _chosen(cell: Compared, model: PolytopeModel, tosses: Sequence[Toss]) -> Weights:
    """What the rule selects at a model's theta."""
    rule = RULES[cell.rule] if cell.rule in RULES else RULES["herding"]  # whose scores the baselines read
    scores = toss_scorer(replace(rule.scoring(), loss=ONE_THREAD), rule.criterion)(model, tosses)
    pool = pool_of(one for one in scores if isinstance(one, TossInformation))
    if cell.rule in BASELINES:
        return BASELINES[cell.rule](pool, tosses, cell.size, cell.seed)
    return dict.fromkeys(sorted(rank_particles([pool], rule.ranking(cell.size, cell.seed)).selected_ids), 1.0)


def _fitted(model: PolytopeModel, origin: PolytopeModel | None, bench: Bench, chosen: Weights) -> PolytopeModel:
    data = selected_transitions(bench.training, tuple(chosen), bench.body.length_scale)
    return fit_held(model, data, FIT, origin, [chosen[name] for name in data.toss_ids]).model
