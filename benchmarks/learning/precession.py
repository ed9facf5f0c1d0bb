"""What a spin that precesses in the air changes of predicted motions, of bodies whose moments of inertia differ.

ContactNets' dynamics have no gyroscopic term, which vanishes for a cube. For each seed a third of the tosses judges
(experiments/bodies.py); the body as described, and fits to n of the other tosses, with the term and without.

    python -m benchmarks.learning.precession [--bodies slab wedge irregular] [--sizes 8 16] [--seeds 10] [--save ROWS.jsonl]

Rows that are in the file already are not made again.
"""

import sys
from collections.abc import Sequence
from functools import partial
from unittest import mock

import numpy as np

from benchmarks._saved_rows import Row
from benchmarks.learning.mass_centre import as_described, compare, errors_of, fitted, print_table
from contact_curation.contact.body import Body
from contact_curation.experiments.bodies import bench_of
from contact_curation.experiments.cell_run import ONE_THREAD

ARMS = ("without", "with")


def rows_of(name: str, sizes: Sequence[int], seed: int) -> list[Row]:
    """Of a seed: the described body, and fits."""
    bench = bench_of(name, seed)
    order = np.random.default_rng([seed, 7]).permutation(len(bench.training))
    rows: list[Row] = []
    for size in [None, *sizes]:
        tosses = [bench.training[place] for place in order[: size or None]]
        for arm in ARMS:
            inertia = Body.gyroscopic_inertia if arm == "with" else property(lambda _: None)
            with mock.patch.object(Body, "gyroscopic_inertia", inertia):
                model = as_described(bench.body) if size is None else fitted(bench, tosses, seed, ONE_THREAD)
                row = {"body": name, "size": -1 if size is None else size, "seed": seed, "arm": arm}
                rows.append({**row, **errors_of(model, bench, np.zeros(3))})
    return rows


if __name__ == "__main__":
    sys.exit(compare(rows_of, partial(print_table, arms=ARMS), ["slab", "wedge", "irregular"], [8, 16]))
