"""What the balanced weights of the loss change of fits, against the published ones.

In the published loss, gaps and slip count by squared impulses. Their share follows mass, gravity and length scale, and the
noise of a sticking contact's slip, which counts as slip, makes friction too low. The balanced weights are those of
`LossConfig.for_theta`, as `train` has them.

    python -m benchmarks.learning.loss_weights [--bodies cube slab wedge irregular square] [--sizes 8 16] [--save ROWS.jsonl]

For each seed a third of the tosses judges (experiments/bodies.py), in two engines. Rows that are in the file already are not
made again.
"""

import sys
from collections.abc import Sequence
from functools import partial

import numpy as np

from benchmarks._saved_rows import Row
from benchmarks.learning.coverage import PUBLISHED_LOSS
from benchmarks.learning.mass_centre import compare, errors_of, print_table
from benchmarks.learning.sliding_friction import BOUNCING, PLAIN, fitted
from contact_curation.experiments.bodies import BOUNCING as BODIES_THAT_BOUNCE
from contact_curation.experiments.bodies import bench_of
from contact_curation.experiments.cell_run import ONE_THREAD

LOSSES = {"published": PUBLISHED_LOSS, "balanced": ONE_THREAD}
ARMS = ("published", "balanced")


def rows_of(name: str, sizes: Sequence[int], seed: int) -> list[Row]:
    """Of a seed: fits of each size in both arms."""
    bench = bench_of(name, seed)
    order = np.random.default_rng([seed, 7]).permutation(len(bench.training))
    rows: list[Row] = []
    for size in sizes:
        tosses = [bench.training[place] for place in order[:size]]
        for arm, loss in LOSSES.items():
            model = fitted(bench, tosses, seed, BOUNCING if name in BODIES_THAT_BOUNCE else PLAIN, loss)
            rows.append({"body": name, "size": size, "seed": seed, "arm": arm, **errors_of(model, bench, np.zeros(3))})
    return rows


if __name__ == "__main__":
    bodies = ["cube", "slab", "wedge", "irregular", "square"]
    sys.exit(compare(rows_of, partial(print_table, arms=ARMS), bodies, [8, 16]))
