"""Ways to keep informative tosses without keeping those that came out alike (docs/rule.md), by cross-validation below 400.

A polytope learns to the optimum from what each keeps of four fifths of the training tosses, selected three times as re-ranked
rules do, and is judged by the last fifth; a seed is a fifth and an initialisation. The tosses are found through
CONTACTNETS_DATA and are corrected by their rig calibration.

    python -m benchmarks.selection.candidate_rules [--candidates NAME ...] [--sizes 8 16 32] [--seeds 10] [--jobs N]
                                         [--out FILE.jsonl] [--table FILE.csv]

random, longest, log-det, representative   as in docs/explanation/criteria.md, to compare with
half-random       half of them by log-det, the others at random
leverage-drawn    drawn with chances as their leverages, and weighted so that the sum stands for the pool's
expected          by log-det of the predicted information of a release, over executions of it, whatever its outcome
by-block          a third each by what they tell of the gaps' vertices, of friction's vertices, and of friction
particles         representative over four thetas, learned from as many initialisations
*-trimmed         learned without the 2 % of the transitions that are explained worst; *-trimmed-less: the 0.5 %
"""

import argparse
import csv
import json
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
import torch
from scipy.stats import rankdata

from benchmarks.selection.rules import Row, finished_rows, fold_bench, foreseen_motions, print_summaries, recorded_bench, traits
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.models.polytope import PolytopeModel
from contact_curation.design.predicted_information import DEFAULT_PREDICTION, Particle, information_of_executions
from contact_curation.experiments.cell import Cell
from contact_curation.experiments.cell_run import FIT, ONE_THREAD, Bench, judged, pool_of_cell
from contact_curation.geometry.quaternions import Array
from contact_curation.information.pool import pool_of
from contact_curation.information.ranker import RankingConfig, rank, rank_particles
from contact_curation.information.record import ParameterBlock, TossInformation
from contact_curation.information.scoring import ScoringConfig
from contact_curation.information.subspace import pool_subspace
from contact_curation.learning.fits.exact_fit import optimum
from contact_curation.learning.fits.held_fit import fit_held
from contact_curation.learning.training.curated import selected_transitions, toss_scorer
from contact_curation.learning.training.reranking import EXACT_SELECTIONS
from contact_curation.motion.calibration import calibration_of
from contact_curation.motion.toss import Toss

SIZES = (8, 16, 32)
PARTICLES = 4
TRIMMED = {
    "random-trimmed": 0.02,
    "log-det-trimmed": 0.02,
    "representative-trimmed": 0.02,
    "representative-trimmed-less": 0.005,
}
"""Share of the transitions that training leaves out."""
MEASURES = ("rotation", "vertices_from_all", "position", "penetration", "friction_from_all", "friction")
FIELDS = ("rule", "size")
BASELINES = ("random", "longest", "representative")
BLOCKS = (("vertices_normal",), ("vertices_tangent",), ("friction",))
"""Of which each tells a third."""


@dataclass(frozen=True)
class Trial:
    """One training."""

    rule: str
    size: int
    seed: int

    @property
    def key(self) -> str:
        """The same for equal ones only."""
        return json.dumps(asdict(self))

    @property
    def fields(self) -> Mapping[str, str | int]:
        """What its row begins with."""
        return asdict(self)


@dataclass(frozen=True, eq=False)
class Choice:
    """The selection from a pool.

    Attributes:
        ids: of tosses.
        weights: how often each counts, by its id; once each if there are none.
    """

    ids: tuple[str, ...]
    weights: Mapping[str, float] | None = None


@dataclass(frozen=True, eq=False)
class Situation:
    """What a candidate knows.

    Attributes:
        models: at what was learned so far, one of each initialisation.
        tosses: of the pool.
        trial: how many are to be selected, and the seed of what is random.
    """

    models: tuple[PolytopeModel, ...]
    tosses: tuple[Toss, ...]
    trial: Trial

    def infos(self, model: PolytopeModel, criterion: str = "log-det") -> list[TossInformation]:
        """What a criterion needs to know of all tosses at one of the models: their Gauss-Newton information, if anything."""
        scores = toss_scorer(replace(ScoringConfig(), loss=ONE_THREAD), criterion)(model, self.tosses)
        return [one for one in scores if isinstance(one, TossInformation)]

    def rng(self) -> np.random.Generator:
        """The same whenever it is asked."""
        return np.random.default_rng([self.trial.seed, self.trial.size, 7])


type Chooser = Callable[[Situation], Choice]


def by_criterion(criterion: str, situation: Situation) -> Choice:
    """As the package ranks."""
    config = _ranking(criterion, situation.trial.size, situation.trial.seed)
    return Choice(rank_particles([pool_of(situation.infos(one, criterion)) for one in situation.models], config).selected_ids)


def half_random(situation: Situation) -> Choice:
    """A share of random picks."""
    first = _by_log_det(situation.infos(situation.models[0]), situation.trial.size // 2)
    others = sorted({toss.toss_id for toss in situation.tosses} - set(first))
    drawn = situation.rng().permutation(others)[: situation.trial.size - len(first)]
    return Choice((*first, *map(str, drawn)))


def leverage_drawn(situation: Situation) -> Choice:
    """Systematic sampling: a toss drawn with the chance pi counts k / K / pi times (Horvitz and Thompson 1952)."""
    pool = pool_of(situation.infos(situation.models[0]))
    size, rng = situation.trial.size, situation.rng()
    chances = _inclusion(pool.traces_in(pool_subspace(pool).whitening), size)
    order = rng.permutation(len(pool))
    edges = np.concatenate([[0.0], np.cumsum(chances[order])])
    drawn = order[np.flatnonzero(np.diff(np.floor(edges - rng.random() + 1e-12)))]
    return Choice(tuple(pool.ids[k] for k in drawn), {pool.ids[k]: size / len(pool) / float(chances[k]) for k in drawn})


def by_expected(situation: Situation) -> Choice:
    """Log-det of the information that the model expects, at the release alone."""
    model, tosses = situation.models[0], situation.tosses
    particle = Particle(model.geometry(), model.body, ONE_THREAD)
    motions = foreseen_motions(particle, tosses)
    fishers = information_of_executions(particle, motions, DEFAULT_PREDICTION.executions).fishers.mean(axis=1)
    told = {toss.toss_id: fisher for toss, fisher in zip(tosses, fishers, strict=True)}
    infos = [_with_fisher(info, told[info.toss_id]) for info in situation.infos(model)]
    return Choice(_by_log_det(infos, situation.trial.size))


def by_block(situation: Situation) -> Choice:
    """So many by each block alone, none twice."""
    infos, chosen = situation.infos(situation.models[0]), list[str]()
    shares = np.diff(np.round(np.linspace(0, situation.trial.size, len(BLOCKS) + 1)).astype(int))
    for names, share in zip(BLOCKS, shares, strict=True):
        left = [_of_blocks(info, names) for info in infos if info.toss_id not in chosen]
        chosen += _by_log_det(left, int(share))
    return Choice(tuple(chosen))


CANDIDATES: dict[str, Chooser] = {
    "random": partial(by_criterion, "random"),
    "longest": partial(by_criterion, "longest"),
    "log-det": partial(by_criterion, "log-det"),
    "representative": partial(by_criterion, "representative"),
    "half-random": half_random,
    "leverage-drawn": leverage_drawn,
    "expected": by_expected,
    "by-block": by_block,
    "particles": partial(by_criterion, "representative"),
    "random-trimmed": partial(by_criterion, "random"),
    "log-det-trimmed": partial(by_criterion, "log-det"),
    "representative-trimmed": partial(by_criterion, "representative"),
    "representative-trimmed-less": partial(by_criterion, "representative"),
}


def main() -> int:
    """Prints a table of each measure, and what kind of tosses each rule keeps."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--candidates", nargs="+", default=list(CANDIDATES), choices=CANDIDATES)
    parser.add_argument("--sizes", nargs="+", type=int, default=list(SIZES))
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--out", type=Path, help="file of the finished trainings; one that exists is gone on with")
    parser.add_argument("--table", type=Path, help="file of the same as CSV")
    parser.add_argument("--jobs", type=int, default=1)
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    bench = recorded_bench()
    if bench is None:
        return 0
    bench = bench.on(calibration_of(bench.training, bench.body.polytope))
    trials = [
        Trial(name, size, seed) for seed in range(arguments.seeds) for size in arguments.sizes for name in arguments.candidates
    ]
    work = partial(run_trial, bench.training, bench.reference)
    values = traits(bench)
    rows = with_places(finished_rows(trials, work, arguments.out, arguments.jobs), bench.training, values)
    print_summaries(rows, FIELDS, (*MEASURES, *values), BASELINES)
    if arguments.table:
        write_table(rows, (*MEASURES, *values), arguments.table)
    return 0


def run_trial(tosses: tuple[Toss, ...], reference: ContactGeometry, trial: Trial) -> Row:
    """A trial's row."""
    torch.set_num_threads(1)
    bench = fold_bench(tosses, reference, trial.seed)
    pool = pool_of_cell(Cell("random", trial.size, trial.seed), bench).tosses
    choice = chosen_by(trial, bench, pool)
    start, data = bench.initial_polytope(trial.seed), selected_transitions(pool, choice.ids, bench.body.length_scale)
    if trial.rule in TRIMMED:
        model = optimum(start, data, ONE_THREAD, TRIMMED[trial.rule]).model
    else:
        model = fit_held(start, data, FIT, weights=_weights(choice, data.toss_ids)).model
    return {**judged(model, bench), "count": len(choice.ids), "selected": " ".join(choice.ids)}


def chosen_by(trial: Trial, bench: Bench, pool: tuple[Toss, ...]) -> Choice:
    """What is selected last, each time at the fit to the set before."""
    count = PARTICLES if trial.rule == "particles" else 1
    starts = tuple(bench.initial_polytope(trial.seed + 1000 * number) for number in range(count))
    models, choose = starts, CANDIDATES[trial.rule]
    choice = choose(Situation(models, pool, trial))
    for number in range(EXACT_SELECTIONS - 1):
        data = selected_transitions(pool, choice.ids, bench.body.length_scale)
        weights = _weights(choice, data.toss_ids)
        pairs = zip(models, starts, strict=True)
        models = tuple(fit_held(one, data, FIT, start if number else None, weights).model for one, start in pairs)
        before, choice = choice, choose(Situation(models, pool, trial))
        if set(choice.ids) == set(before.ids):
            break
    return choice


def with_places(rows: Sequence[Row], tosses: Sequence[Toss], values: Mapping[str, Array]) -> list[Row]:
    """With where the selected tosses stand among all by each trait, from 0, the least, to 1, the most; means over them."""
    ids = [toss.toss_id for toss in tosses]
    places = {trait: dict(zip(ids, (rankdata(found) - 1.0) / (len(ids) - 1.0), strict=True)) for trait, found in values.items()}
    return [
        {**row, **{trait: float(np.mean([place[one] for one in row["selected"].split()])) for trait, place in places.items()}}
        for row in rows
    ]


def write_table(rows: Sequence[Row], measures: Sequence[str], path: Path) -> None:
    """A line a training, to six digits."""
    names = (*FIELDS, "seed", *measures)
    with path.open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(names)
        for row in rows:
            writer.writerow([f"{row[name]:.6g}" if isinstance(row[name], float) else row[name] for name in names])


def _ranking(criterion: str, size: int, seed: int = 0) -> RankingConfig:
    return RankingConfig(criterion, size, seed, certificate_steps=0)


def _by_log_det(infos: Sequence[TossInformation], size: int) -> tuple[str, ...]:
    return rank(infos, _ranking("log-det", size)).selected_ids


def _inclusion(sizes: Array, count: int) -> Array:
    """(K,) chances that go as `sizes` and sum to `count`, none over 1."""
    certain = np.zeros(len(sizes), dtype=bool)
    while True:
        chances = np.where(certain, 1.0, (count - certain.sum()) * sizes / sizes[~certain].sum())
        if (chances <= 1.0).all():
            return np.asarray(chances)
        certain |= chances > 1.0


def _with_fisher(info: TossInformation, fisher: Array) -> TossInformation:
    values, vectors = np.linalg.eigh(fisher)
    factor = np.sqrt(values.clip(min=0.0))[:, None] * vectors.T
    traces = np.array([np.trace(fisher[block.start : block.stop, block.start : block.stop]) for block in info.blocks])
    return replace(info, factor=factor, block_traces=traces)


def _of_blocks(info: TossInformation, names: Sequence[str]) -> TossInformation:
    """What it tells of some blocks, all else known."""
    places = [place for place, block in enumerate(info.blocks) if block.name in names]
    columns = np.concatenate([np.arange(info.blocks[place].start, info.blocks[place].stop) for place in places])
    widths = [info.blocks[place].stop - info.blocks[place].start for place in places]
    edges = np.concatenate([[0], np.cumsum(widths)])
    blocks = tuple(
        ParameterBlock(info.blocks[place].name, int(first), int(last))
        for place, first, last in zip(places, edges[:-1], edges[1:], strict=True)
    )
    return replace(
        info,
        blocks=blocks,
        block_traces=info.block_traces[places],
        score_sum=info.score_sum[columns],
        factor=np.ascontiguousarray(info.factor[:, columns]),
        tilt_axes=np.zeros((0, 3)),
    )


def _weights(choice: Choice, ids: Sequence[str]) -> Array | None:
    return None if choice.weights is None else np.array([choice.weights[one] for one in ids])


if __name__ == "__main__":
    sys.exit(main())
