"""Ranks ContactNets' real tosses at the true cube and at noisy ones: what the selected sets know, and how well that is proven.

The judge is the Gauss-Newton information at the true parameters, whitened so that an average toss is 1 in every direction
(method.md 2.3). Each design ranks with its own information; "both" averages two noisy initialisations (method.md 2.4). Streams
are compared with keeping the first k tosses that come. The tosses are found through CONTACTNETS_DATA.

    python -m benchmarks.selection.criteria [--json]
"""

import argparse
import json
import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass

import numpy as np

from benchmarks._data import contactnets_folder
from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.contact.evaluation import Estimator
from contact_curation.contact.geometry_parameters import INITIAL_NOISE, ContactGeometry
from contact_curation.contact.parameter_form import Form
from contact_curation.information.accumulated import Accumulated
from contact_curation.information.criteria.exchanges import SwapStreaming
from contact_curation.information.diagnostics import efficiency, smallest_sufficient_k
from contact_curation.information.pool import Indices, Pool, pool_of
from contact_curation.information.prior import log_det_prior
from contact_curation.information.ranker import RankingConfig, rank_particles
from contact_curation.information.record import TossInformation
from contact_curation.information.scoring import Scorer, ScoringConfig
from contact_curation.information.subspace import identifiable_subspace
from contact_curation.motion.toss import Toss
from contact_curation.storage.datasets.contactnets import read_contactnets

SIZES = (8, 16, 32)
SEEDS = range(20)
STREAMS = range(5)
EPSILONS = (0.5, 0.2, 0.1)


@dataclass(frozen=True)
class Design:
    """How one way of choosing does at one size."""

    criterion: str
    designed_at: str
    estimator: str
    size: int
    d_efficiency: float
    e_efficiency: float
    d_efficiency_per_frame: float
    certified: float | None


@dataclass(frozen=True)
class Streamed:
    """Log-det of a streamed set over that of the greedy set: lowest, mean and highest of some random orders."""

    selector: str
    estimator: str
    size: int
    lowest: float
    mean: float
    highest: float


@dataclass(frozen=True)
class Sufficient:
    """How many tosses of an order are within epsilon of the pool, by plain sums (method.md 1.9)."""

    criterion: str
    tosses: dict[float, int | None]


def main() -> int:
    """Prints tables, or JSON."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--json", action="store_true", help="print JSON instead of tables")
    arguments = parser.parse_args()
    folder = contactnets_folder()
    if folder is None:
        return 0
    pools = scored_pools([toss for toss in read_contactnets(folder) if isinstance(toss, Toss)])
    judge = pools["truth", Estimator.GAUSS_NEWTON]
    rows = designs(pools, judge)
    streamed = [row for estimator in Estimator for row in streams(pools["truth", estimator], estimator)]
    enough = [sufficient(judge, name) for name in ("trace", "leverage", "random")]
    if arguments.json:
        tables: dict[str, Sequence[Design | Streamed | Sufficient]] = {
            "designs": rows,
            "streams": streamed,
            "sufficient": enough,
        }
        print(json.dumps({name: [asdict(row) for row in table] for name, table in tables.items()}, indent=2))
    else:
        print_tables(rows, streamed, enough)
    return 0


def scored_pools(tosses: Sequence[Toss]) -> dict[tuple[str, Estimator], Pool]:
    """The tosses' information at the truth and at two noisy initialisations, by both estimators."""
    thetas = {"truth": ContactGeometry.of_body(CONTACTNETS_CUBE)} | {f"init{seed}": initialisation(seed) for seed in range(2)}
    pools = {}
    for name, theta in thetas.items():
        for estimator in Estimator:
            scorer = Scorer(theta, CONTACTNETS_CUBE, ScoringConfig(estimator, form=Form.CONTACTNETS))
            scored = [info for info in scorer.score(tosses) if isinstance(info, TossInformation)]
            pools[name, estimator] = pool_of(scored)
    return pools


def initialisation(seed: int) -> ContactGeometry:
    """The true cube with ContactNets' noise on everything."""
    rng, truth = np.random.default_rng(seed), ContactGeometry.of_body(CONTACTNETS_CUBE)
    return ContactGeometry(
        vertices_normal=truth.vertices_normal + INITIAL_NOISE * rng.standard_normal(truth.vertices_normal.shape),
        normal=truth.normal + INITIAL_NOISE * rng.standard_normal(3),
        vertices_tangent=truth.vertices_tangent + INITIAL_NOISE * rng.standard_normal(truth.vertices_tangent.shape),
        tangents=truth.tangents + INITIAL_NOISE * CONTACTNETS_CUBE.friction * rng.standard_normal((2, 3)),
    )


def designs(pools: Mapping[tuple[str, Estimator], Pool], judge: Pool) -> list[Design]:
    """All designs at all sizes; the random one is the mean over some seeds."""
    rows = []
    for size in SIZES:
        chances = [design([judge], judge, RankingConfig("random", top=size, seed=seed), "-", "-") for seed in SEEDS]
        means = {
            name: float(np.mean([getattr(row, name) for row in chances]))
            for name in ("d_efficiency", "e_efficiency", "d_efficiency_per_frame")
        }
        rows.append(Design("random", "-", "-", size, **means, certified=None))
        rows.append(design([judge], judge, RankingConfig("longest", top=size), "-", "-"))
        for estimator in Estimator:
            own = {name: [pools[name, estimator]] for name in ("init0", "init1", "truth")}
            own["both"] = [pools["init0", estimator], pools["init1", estimator]]
            for name, particles in own.items():
                for criterion in ("trace", "leverage", "orthogonal", "min-eig", "log-det"):
                    config = RankingConfig(criterion, top=size)
                    rows.append(design(particles, judge, config, name, estimator.value))
    return rows


def design(particles: Sequence[Pool], judge: Pool, config: RankingConfig, name: str, estimator: str) -> Design:
    """What the judge says of a ranking's selected set."""
    ranking = rank_particles(particles, config)
    subspace = identifiable_subspace(judge.fisher)
    per_toss = efficiency(judge, subspace, ranking.selected_ids)
    per_frame = efficiency(judge, subspace, ranking.selected_ids, per_transition=True)
    certified = ranking.certificate.subset if ranking.certificate else None
    efficiencies = (per_toss.determinant, per_toss.smallest, per_frame.determinant)
    return Design(config.criterion, name, estimator, config.top, *efficiencies, certified)


def streams(pool: Pool, estimator: Estimator) -> list[Streamed]:
    """Every way to keep k tosses of a stream, over random orders of the pool."""
    prior, rows = log_det_prior(pool, RankingConfig().prior), []
    orders = [np.random.default_rng(seed).permutation(len(pool)) for seed in STREAMS]
    nothing = Accumulated.prior_only(prior.coordinates)
    for size in SIZES:
        greedy = rank_particles([pool], RankingConfig("log-det", top=size))
        values = {"first k": [nothing.joined(pool.stacked(order[:size])).log_det for order in orders]}
        values["exchanges"] = [streamed_value(SwapStreaming(prior, size), pool, order) for order in orders]
        best = sum(entry.marginal_gain for entry in greedy.entries if entry.selected)
        for name, each in values.items():
            shares = np.array(each) / best
            rows.append(Streamed(name, estimator.value, size, float(shares.min()), float(shares.mean()), float(shares.max())))
    return rows


def streamed_value(selector: SwapStreaming, pool: Pool, order: Indices) -> float:
    """What the selector reaches when all tosses have come in this order."""
    for index in order:
        selector.offer(pool.infos[index])
    return selector.value


def sufficient(pool: Pool, criterion: str) -> Sufficient:
    """How many tosses of a ranking it takes."""
    subspace = identifiable_subspace(pool.fisher)
    order = rank_particles([pool], RankingConfig(criterion)).ids
    return Sufficient(criterion, {epsilon: smallest_sufficient_k(pool, subspace, order, epsilon) for epsilon in EPSILONS})


def print_tables(rows: Sequence[Design], streamed: Sequence[Streamed], enough: Sequence[Sufficient]) -> None:
    """For people."""
    print("D-efficiency (E-efficiency; per frame; certified) of the selected set\n")
    print(f"{'criterion':11} {'designed at':11} {'estimator':13} " + "".join(f"{f'k = {size}':27}" for size in SIZES))
    for name in dict.fromkeys((row.criterion, row.designed_at, row.estimator) for row in rows):
        cells = [row for row in rows if (row.criterion, row.designed_at, row.estimator) == name]
        print(f"{name[0]:11} {name[1]:11} {name[2]:13} " + "".join(f"{cell(row):27}" for row in cells))
    print("\nlog-det of a streamed set over greedy's: mean (lowest to highest) of", len(STREAMS), "random orders")
    for stream in streamed:
        spread = f"{stream.mean:.3f} ({stream.lowest:.3f} to {stream.highest:.3f})"
        print(f"{stream.selector:15} {stream.estimator:13} k = {stream.size:<3} {spread}")
    print("\ntosses that are within epsilon of the pool")
    for row in enough:
        print(f"{row.criterion:9} " + "  ".join(f"{epsilon}: {count}" for epsilon, count in row.tosses.items()))


def cell(row: Design) -> str:
    """One entry of the table."""
    certified = "" if row.certified is None else f"; {row.certified:.2f}"
    return f"{row.d_efficiency:.2f} ({row.e_efficiency:.3f}; {row.d_efficiency_per_frame:.2f}{certified})"


if __name__ == "__main__":
    sys.exit(main())
