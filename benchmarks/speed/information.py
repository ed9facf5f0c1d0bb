"""Ranks and streams made-up tosses: how long each criterion takes, and how near the streams come to greedy selection.

A toss is a handful of impacts out of two hundred kinds, of very different strengths, in 57 parameters and 24 rows, as in
method.md 2.3. Times are the best of some repetitions of the whole call, from a list of tosses to a ranking, by the clock and by
the processor, which a busy machine disturbs less. NumPy's own threads count in the latter; OPENBLAS_NUM_THREADS=1 leaves one.

    python -m benchmarks.speed.information [--json] [--tosses K ...] [--top K] [--repeats N]
"""

import argparse
import json
import os
import sys
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from functools import partial

import numpy as np

from contact_curation.information.criteria.exchanges import SwapStreaming
from contact_curation.information.criteria.trace import TraceHeap
from contact_curation.information.pool import pool_of
from contact_curation.information.prior import log_det_prior
from contact_curation.information.ranker import RankingConfig, criterion_names, rank
from contact_curation.information.record import ParameterBlock, TossInformation
from contact_curation.information.streaming import Selector

PARAMETERS, ROWS, KINDS = 57, 24, 200
SEED = 0
PRIOR = 1e-3
SMALL_POOL = 2000
"""Repetitions end here: a pool this large is ranked once."""


@dataclass(frozen=True)
class Timing:
    """One call over all tosses; the value is the log-det of the selected set over the one of greedy selection, if known."""

    what: str
    tosses: int
    seconds: float
    cpu_seconds: float
    relative_log_det: float | None = None


def main() -> int:
    """Prints a table, or JSON."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--json", action="store_true", help="print JSON instead of a table")
    parser.add_argument("--tosses", type=int, nargs="+", default=[570, 57_000], help="sizes of the pools (default 570 57000)")
    parser.add_argument("--top", type=int, default=32, help="how many tosses to keep (default 32)")
    parser.add_argument(
        "--repeats", type=int, default=5, help=f"repetitions for pools of up to {SMALL_POOL} tosses (default 5)"
    )
    arguments = parser.parse_args()
    timings = [row for count in arguments.tosses for row in measured(count, arguments.top, arguments.repeats)]
    if arguments.json:
        threads = os.environ.get("OPENBLAS_NUM_THREADS")
        print(json.dumps({"top": arguments.top, "blas_threads": threads, "timings": [asdict(t) for t in timings]}, indent=2))
    else:
        print_table(timings, arguments.top)
    return 0


def made_up(count: int) -> list[TossInformation]:
    """Tosses whose factors share one array, so that a large pool fits into memory once."""
    rng = np.random.default_rng(SEED)
    kinds = rng.standard_normal((KINDS, PARAMETERS)) * np.exp(rng.normal(0.0, 1.5, PARAMETERS))
    factors = kinds[rng.integers(0, KINDS, (count, ROWS))]  # (K, R, P)
    factors *= np.exp(rng.normal(0.0, 2.0, (count, ROWS, 1)) + rng.normal(0.0, 0.7, (count, 1, 1)))
    durations = rng.uniform(0.5, 3.0, count)
    blocks = (ParameterBlock("all", 0, PARAMETERS),)
    return [
        TossInformation(
            toss_id=f"toss-{k:06d}",
            body="cube",
            model="polytope",
            parameters_version="made-up",
            estimator="empirical",
            influence_bound=np.inf,
            blocks=blocks,
            transitions=100,
            not_scored=0,
            duration=float(durations[k]),
            mean_loss=0.0,
            block_traces=np.array([np.square(factors[k]).sum()]),
            score_sum=factors[k].sum(axis=0),
            factor=factors[k],
            centroid=np.zeros(3),
        )
        for k in range(count)
    ]


def measured(count: int, top: int, repeats: int) -> list[Timing]:
    """Every criterion and every stream over one pool."""
    infos = made_up(count)
    repeats = max(1, repeats) if count <= SMALL_POOL else 1
    rows = [Timing(name, count, *best_times(partial(rank, infos, c), repeats)) for name, c in rankings(top).items()]
    prior = log_det_prior(pool_of(infos), PRIOR)
    greedy = sum(entry.marginal_gain for entry in rank(infos, RankingConfig("log-det", top=top, prior=PRIOR)).entries[:top])
    rows.append(Timing("stream: heap (trace)", count, *best_times(partial(streamed, TraceHeap(top), infos), 1)))
    selector = SwapStreaming(prior, top)
    times = best_times(partial(streamed, selector, infos), 1)
    rows.append(Timing("stream: exchanges (log-det)", count, *times, selector.value / greedy))
    return rows


def rankings(top: int) -> dict[str, RankingConfig]:
    """What is timed, by name."""
    plain = {criterion: RankingConfig(criterion, top=top, prior=PRIOR) for criterion in criterion_names()}
    loose = RankingConfig("log-det", top=top, prior=PRIOR, certificate_steps=0)
    return plain | {"log-det, loose certificate": loose}


def best_times(call: Callable[[], object], repeats: int) -> tuple[float, float]:
    """The best of some repetitions, by the clock and by the processor [s]."""
    best = (np.inf, np.inf)
    for _ in range(repeats):
        clock, processor = time.perf_counter(), time.process_time()
        call()
        best = (min(best[0], time.perf_counter() - clock), min(best[1], time.process_time() - processor))
    return best


def streamed(selector: Selector, infos: list[TossInformation]) -> None:
    """Offers all tosses."""
    for info in infos:
        selector.offer(info)


def print_table(timings: list[Timing], top: int) -> None:
    """For people."""
    print(f"keeping {top}, {PARAMETERS} parameters, {ROWS} rows\n")
    print(f"{'what':34}  tosses    seconds      cpu s  us per toss  log-det / greedy's")
    for row in timings:
        value = "" if row.relative_log_det is None else f"{row.relative_log_det:18.3f}"
        times = f"{row.seconds:9.4f}  {row.cpu_seconds:9.4f}  {1e6 * row.seconds / row.tosses:11.1f}"
        print(f"{row.what:34}  {row.tosses:6d}  {times}  {value}")


if __name__ == "__main__":
    sys.exit(main())
