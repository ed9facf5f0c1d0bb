"""What other weights of the loss change of fits: impulses in units of the one that carries the body at rest for a frame.

In the published loss, gaps and slip count by squared impulses. Their share follows mass, gravity, length scale and frame
period, and the noise of a sticking contact's slip, which counts as slip, makes friction too low. In the arm `at rest` all
impulses are divided by m g dt, gaps and penetration have weights of their own, and dissipation counts inversely to the variance
of the slip's noise. It has the published weights times GAPS, PENETRATION and SLIP for ContactNets' cube and rig.

    python -m benchmarks.learning.loss_weights [--bodies cube slab wedge irregular square] [--sizes 8 16] [--save ROWS.jsonl]

For each seed a third of the tosses judges (experiments/bodies.py), in two engines. Rows that are in the file already are not
made again.
"""

import sys
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from benchmarks._saved_rows import Row
from benchmarks.learning.mass_centre import compare, errors_of, print_table
from benchmarks.learning.sliding_friction import BOUNCING, PLAIN, fitted
from contact_curation.contact.body import CONTACTNETS_CUBE, Body
from contact_curation.contact.loss_config import OF_IMPULSES, LossConfig, counted_mass
from contact_curation.experiments.bodies import BOUNCING as BODIES_THAT_BOUNCE
from contact_curation.experiments.bodies import SQUARE_INGEST, bench_of
from contact_curation.experiments.cell_run import ONE_THREAD

GAPS, PENETRATION, SLIP = 2.0, 4.0, 0.25
RIG_PERIOD = 1.0 / 148.0
"""[s] Of a frame of ContactNets' rig."""

ARMS = ("published", "at rest")
NOISE = {"square": SQUARE_INGEST.segmenter.tracker_noise or 1.0}
"""Of the tracker, as a multiple of that of ContactNets' rig; 1 for the others."""


def at_rest(body: Body, frame_period: float, noise: float) -> LossConfig:
    """Weights for impulses in units of the one at rest, and for a tracker with so many times the noise of ContactNets' rig."""
    cube = CONTACTNETS_CUBE
    shares = cube.mass * cube.scaled_gravity * RIG_PERIOD / (body.mass * body.scaled_gravity * frame_period)
    counted = (body.mass / counted_mass(body.mass)) ** 2  # takes back what the rigid form does to a light or heavy body
    factors = dict.fromkeys(OF_IMPULSES, counted * shares**2 * GAPS)
    factors["dissipation"] *= SLIP / GAPS * (frame_period / RIG_PERIOD / noise) ** 2
    factors["penetration"] = PENETRATION
    return replace(ONE_THREAD, **{name: factor * getattr(ONE_THREAD, name) for name, factor in factors.items()})


def rows_of(name: str, sizes: Sequence[int], seed: int) -> list[Row]:
    """Of a seed: fits of each size in both arms."""
    bench = bench_of(name, seed)
    order = np.random.default_rng([seed, 7]).permutation(len(bench.training))
    losses = ONE_THREAD, at_rest(bench.body, bench.training[0].frame_period, NOISE.get(name, 1.0))
    rows: list[Row] = []
    for size in sizes:
        tosses = [bench.training[place] for place in order[:size]]
        for arm, loss in zip(ARMS, losses, strict=True):
            model = fitted(bench, tosses, seed, BOUNCING if name in BODIES_THAT_BOUNCE else PLAIN, loss)
            rows.append({"body": name, "size": size, "seed": seed, "arm": arm, **errors_of(model, bench, np.zeros(3))})
    return rows


if __name__ == "__main__":
    bodies = ["cube", "slab", "wedge", "irregular", "square"]
    sys.exit(compare(rows_of, partial(print_table, arms=ARMS), bodies, [8, 16]))
