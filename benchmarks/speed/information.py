"""Ranks and streams made-up tosses: how long each criterion takes, and how near the streams come to greedy selection.

A toss is a handful of impacts out of two hundred kinds, of very different strengths, in 57 parameters and 24 rows, as in
method.md 2.3. Times are the best of some repetitions of the whole call, from a list of tosses to a ranking, by the clock and by
the processor, which a busy machine disturbs less. NumPy's own threads count in the latter; OPENBLAS_NUM_THREADS=1 leaves one.

`representative` looks at a part of a large pool in each step. What that loses is measured in small pools, where a step looks at
as small a part: the expected error of the selected set over that of the set that is selected when each step looks at all.

Streams of `representative` are compared with the selection that looks at all tosses in each step, in three orders.

    python -m benchmarks.speed.information [--json] [--tosses K ...] [--top K] [--repeats N]
        [--only NAME ...]
"""

import argparse
import json
import os
import resource
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial

import numpy as np

from contact_curation.geometry.quaternions import Array
from contact_curation.information.criteria.exchanges import SwapStreaming
from contact_curation.information.criteria.representative import select_representative, swap_costs
from contact_curation.information.criteria.representative_streaming import RepresentativeStreaming
from contact_curation.information.criteria.set_search import LARGEST_WHOLE
from contact_curation.information.criteria.trace import TraceHeap
from contact_curation.information.pool import pool_of
from contact_curation.information.prior import log_det_prior
from contact_curation.information.ranker import RankingConfig, criterion_names, rank
from contact_curation.information.record import ParameterBlock, TossInformation
from contact_curation.information.streaming import Selector
from contact_curation.information.subspace import pool_subspace
from contact_curation.storage.stores.factor_spool import FactorSpool

PARAMETERS, ROWS, KINDS = 57, 24, 200
BLOCKS = (ParameterBlock("all", 0, PARAMETERS),)
SEED = 0
PRIOR = 1e-3
IN_PARTS = 57_000
"""Of a pool of so many `LARGEST_WHOLE` are as large a part as is looked at in the small pools."""

STREAMS = "streams"
"""What --only calls them."""

COMPARED = 20_000
"""Of so many tosses every one is looked at in each step of the selection that a stream is compared with."""

SMALL_POOL = 2000
"""Repetitions end here: a pool this large is ranked once."""


@dataclass(frozen=True)
class Timing:
    """One call over all tosses.

    Attributes:
        what: is done.
        tosses: how many.
        seconds: by the clock.
        cpu_seconds: by the processor.
        megabytes: most memory of the process until then.
        relative_log_det: of the selected set, over the one of greedy selection, if known.
        relative_error: expected error of the selected set, over the one of looking at all tosses in each step, if known.
    """

    what: str
    tosses: int
    seconds: float
    cpu_seconds: float
    megabytes: float
    relative_log_det: float | None = None
    relative_error: float | None = None


def main() -> int:
    """Prints a table, or JSON."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--json", action="store_true", help="print JSON instead of a table")
    parser.add_argument("--tosses", type=int, nargs="+", default=[570, 57_000], help="sizes of the pools (default 570 57000)")
    parser.add_argument("--top", type=int, default=32, help="how many tosses to keep (default 32)")
    parser.add_argument(
        "--repeats", type=int, default=5, help=f"repetitions for pools of up to {SMALL_POOL} tosses (default 5)"
    )
    parser.add_argument("--only", nargs="+", metavar="NAME", help=f"criteria to rank by, or {STREAMS} (default: all)")
    arguments = parser.parse_args()
    measure = partial(measured, top=arguments.top, repeats=arguments.repeats, only=arguments.only)
    timings = [row for count in sorted(arguments.tosses) for row in measure(count)]
    if arguments.json:
        threads = os.environ.get("OPENBLAS_NUM_THREADS")
        print(json.dumps({"top": arguments.top, "blas_threads": threads, "timings": [asdict(t) for t in timings]}, indent=2))
    else:
        print_table(timings, arguments.top)
    return 0


def made_up(count: int, spool: FactorSpool) -> list[TossInformation]:
    """Tosses whose factors are on disk, as those of `rank`."""
    rng = np.random.default_rng(SEED)
    kinds = rng.standard_normal((KINDS, PARAMETERS)) * np.exp(rng.normal(0.0, 1.5, PARAMETERS))
    return [spool.with_factor_on_disk(_made_up_toss(number, kinds, rng)) for number in range(count)]


def _made_up_toss(number: int, kinds: Array, rng: np.random.Generator) -> TossInformation:
    factor = kinds[rng.integers(0, KINDS, ROWS)]  # (R, P)
    factor *= np.exp(rng.normal(0.0, 2.0, (ROWS, 1)) + rng.normal(0.0, 0.7))
    return TossInformation(
        toss_id=f"toss-{number:06d}",
        body="cube",
        model="polytope",
        parameters_version="made-up",
        estimator="empirical",
        influence_bound=np.inf,
        blocks=BLOCKS,
        transitions=100,
        not_scored=0,
        duration=float(rng.uniform(0.5, 3.0)),
        mean_loss=0.0,
        block_traces=np.array([np.square(factor).sum()]),
        score_sum=factor.sum(axis=0),
        factor=factor.astype(np.float32),
        centroid=np.zeros(3),
    )


def measured(count: int, top: int, repeats: int, only: Sequence[str] | None) -> list[Timing]:
    """Every criterion and every stream over one pool, or the criteria that are named."""
    with FactorSpool() as spool:
        return ranked(made_up(count, spool), top, repeats, only)


def ranked(infos: list[TossInformation], top: int, repeats: int, only: Sequence[str] | None) -> list[Timing]:
    """The same, over some tosses."""
    count = len(infos)
    repeats = max(1, repeats) if count <= SMALL_POOL else 1
    wanted = {name: config for name, config in rankings(top).items() if only is None or name in only}
    rows = [timed(name, count, partial(rank, infos, config), repeats) for name, config in wanted.items()]
    if count <= SMALL_POOL and "representative" in wanted:
        rows.append(seen_in_parts(infos, top, repeats))
    return rows + (streams(infos, top) if only is None or STREAMS in only else [])


def seen_in_parts(infos: list[TossInformation], top: int, repeats: int) -> Timing:
    """`representative` with a part of the tosses looked at in each step, as in a pool of `IN_PARTS`."""
    pool = pool_of(infos)
    coordinates = [pool_subspace(pool).per_mean_toss(len(pool))]
    most = max(len(pool) * LARGEST_WHOLE // IN_PARTS, 2 * top)
    sets = [select_representative([pool], coordinates, top, PRIOR, each).order[:top].tolist() for each in (len(pool), most)]
    whole, parts = (swap_costs([pool], coordinates, selected, PRIOR).error for selected in sets)
    call = partial(select_representative, [pool], coordinates, top, PRIOR, most)
    return replace(timed(f"representative, {most} a step", len(pool), call, repeats), relative_error=parts / whole)


def streams(infos: list[TossInformation], top: int) -> list[Timing]:
    """The streams."""
    prior = log_det_prior(pool_of(infos), PRIOR)
    greedy = sum(entry.marginal_gain for entry in rank(infos, RankingConfig("log-det", top=top, prior=PRIOR)).entries[:top])
    heap = timed("stream: heap (trace)", len(infos), partial(streamed, TraceHeap(top), infos), 1)
    selector = SwapStreaming(prior, top)
    exchanges = timed("stream: exchanges (log-det)", len(infos), partial(streamed, selector, infos), 1)
    return [heap, replace(exchanges, relative_log_det=selector.value / greedy), *streams_of_the_default(infos, top)]


def streams_of_the_default(infos: list[TossInformation], top: int) -> list[Timing]:
    """`representative`, as tosses were made, which is at random, and by their trace."""
    pool = pool_of(infos)
    coordinates = [pool_subspace(pool).per_mean_toss(len(pool))]
    exact = select_representative([pool], coordinates, top, PRIOR, COMPARED).order[:top].tolist()
    by_trace = sorted(infos, key=lambda info: info.trace)
    rows = []
    for name, order in {"random": infos, "growing": by_trace, "shrinking": by_trace[::-1]}.items():
        selector = RepresentativeStreaming(pool.pivot, top, PRIOR)
        row = timed(f"stream: representative, {name}", len(infos), partial(streamed, selector, order), 1)
        selected = pool.indices_of(info.toss_id for info in selector.selected).tolist()
        streamed_error, whole = (swap_costs([pool], coordinates, each, PRIOR).error for each in (selected, exact))
        rows.append(replace(row, relative_error=streamed_error / whole))
    return rows


def rankings(top: int) -> dict[str, RankingConfig]:
    """What is timed, by name."""
    plain = {criterion: RankingConfig(criterion, top=top, prior=PRIOR) for criterion in criterion_names()}
    loose = RankingConfig("log-det", top=top, prior=PRIOR, certificate_steps=0)
    return plain | {"log-det, loose certificate": loose}


def timed(what: str, tosses: int, call: Callable[[], object], repeats: int) -> Timing:
    """The best of some repetitions, by the clock and by the processor."""
    best = (np.inf, np.inf)
    for _ in range(repeats):
        clock, processor = time.perf_counter(), time.process_time()
        call()
        best = (min(best[0], time.perf_counter() - clock), min(best[1], time.process_time() - processor))
    return Timing(what, tosses, *best, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0)


def streamed(selector: Selector, infos: list[TossInformation]) -> None:
    """Offers all tosses."""
    for info in infos:
        selector.offer(info)


def print_table(timings: list[Timing], top: int) -> None:
    """For people."""
    print(f"keeping {top}, {PARAMETERS} parameters, {ROWS} rows\n")
    print(f"{'what':34}  tosses    seconds      cpu s  us per toss      MB  log-det / greedy's  error / of all")
    for row in timings:
        log_det = "" if row.relative_log_det is None else f"{row.relative_log_det:.3f}"
        error = "" if row.relative_error is None else f"{row.relative_error:.3f}"
        times = f"{row.seconds:9.4f}  {row.cpu_seconds:9.4f}  {1e6 * row.seconds / row.tosses:11.1f}  {row.megabytes:6.0f}"
        print(f"{row.what:34}  {row.tosses:6d}  {times}  {log_det:>18}  {error:>14}".rstrip())


if __name__ == "__main__":
    sys.exit(main())
