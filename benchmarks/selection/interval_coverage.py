"""How often the 95 % intervals of docs/results.md hold the truth, where it is known.

python -m benchmarks.selection.interval_coverage [--worlds N] [--json]

Medians and means of few normal and log-normal values, and differences of rules over seeds and judging tosses: 300 tosses, of
which each of 10 seeds draws a third as judges. What a rule gains varies by seed, by toss, and by both; their deviations are
those of 8 selected tosses of the slab less 8 random ones, in points of position (4, 9 and 16). The truth is the gain over other
tosses and seeds. Beside expanded percentiles stand the plain ones, which the stored rows have.
"""

import argparse
import json
import sys
from collections.abc import Callable, Iterator

import numpy as np
from scipy.stats import t

from contact_curation.experiments.comparison.intervals import nested_interval, resampled_means
from contact_curation.geometry.quaternions import Array
from contact_curation.learning.evaluation.bootstrap import BootstrapConfig, spread

COUNTS = (6, 10, 20, 40)
DISTRIBUTIONS: dict[str, tuple[Callable[[np.random.Generator, int], Array], float]] = {
    "normal": (lambda rng, count: rng.standard_normal(count), 0.0),
    "log-normal": (lambda rng, count: rng.lognormal(-0.32, 0.8, count), 1.0),
}
"""Draws with this mean."""
SEEDS, TOSSES, DEVIATIONS = 10, 300, (4.0, 9.0, 16.0)
CONFIG = BootstrapConfig(resamples=1000)

type Held = dict[str, str | float]


def main(arguments: list[str]) -> int:
    """The command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--worlds", type=int, default=1000, help="drawn for each line (default 1000)")
    parser.add_argument("--json", action="store_true", help="print one JSON object a line and nothing else")
    options = parser.parse_args(arguments)
    for row in (*values_held(options.worlds), differences_held(options.worlds)):
        print(
            json.dumps(row) if options.json else "  ".join(f"{name} {_said(value)}" for name, value in row.items()), flush=True
        )
    return 0


def values_held(worlds: int) -> Iterator[Held]:
    """Of medians and means over values, one by one."""
    rng = np.random.default_rng(0)
    for name, (draw, mean) in DISTRIBUTIONS.items():
        median = mean if name == "normal" else float(np.exp(-0.32))
        for count in COUNTS:
            found = [spread(draw(rng, count), CONFIG) for _ in range(worlds)]
            yield {
                "values": name,
                "count": count,
                "median": float(np.mean([one.median.low <= median <= one.median.high for one in found])),
                "mean": float(np.mean([one.mean.low <= mean <= one.mean.high for one in found])),
            }


def differences_held(worlds: int) -> Held:
    """Of a rule's gain over seeds and judging tosses; its truth is 0."""
    rng, held = np.random.default_rng(1), np.zeros(3)
    by_seed, by_toss, by_both = DEVIATIONS
    for _ in range(worlds):
        tosses = by_toss * rng.standard_normal(TOSSES)
        each = [
            tosses[rng.permutation(TOSSES)[: TOSSES // 3]]
            + by_seed * rng.standard_normal()
            + by_both * rng.standard_normal(TOSSES // 3)
            for _ in range(SEEDS)
        ]
        wide = nested_interval(each, CONFIG)
        low, high = np.quantile(resampled_means(each, CONFIG), [0.025, 0.975])
        means = np.array([values.mean() for values in each])
        half = t.ppf(0.975, SEEDS - 1) * means.std(ddof=1) / np.sqrt(SEEDS)
        held += (wide.low <= 0.0 <= wide.high, low <= 0.0 <= high, abs(means.mean()) <= half)
    return {"seeds": SEEDS, **dict(zip(("expanded", "plain", "Student's t"), (held / worlds).tolist(), strict=True))}


def _said(value: str | float) -> str:
    return f"{100.0 * value:.1f} %" if isinstance(value, float) else str(value)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
