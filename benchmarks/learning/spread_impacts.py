"""What it would change if the frames beside an impact had its variance, too, over which filtered velocities spread it.

The variance of a transition's residuals grows with the impulse that the model predicts for it (contact/impulse_noise.py). The
tracker's velocities are medians of three differences, so that an impact also shows in the transitions before and after its own,
which may be predicted to be in the air. Here each transition has the largest impulse of itself and its neighbours, or its own.

    python -m benchmarks.learning.spread_impacts [--bodies cube slab irregular] [--sizes 8 16] [--seeds 10] [--save ROWS.jsonl]
    python -m benchmarks.learning.spread_impacts --worlds [--seeds 5]

Fits have the published weights of the loss. For each seed a third of the tosses judges (experiments/bodies.py). With
--worlds: errors of friction and vertices of fits to 16
tosses in the simulated worlds of `benchmarks.learning.coverage`. Rows that are in the file already are not made again.
"""

import argparse
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from unittest import mock

import numpy as np
import torch

from benchmarks._saved_rows import Row
from benchmarks.learning import coverage, mass_centre
from benchmarks.learning.mass_centre import compare, errors_of, print_table
from contact_curation.contact.impulse_noise import ImpulseNoise
from contact_curation.experiments.bodies import bench_of
from contact_curation.geometry.quaternions import Array
from contact_curation.motion.transitions import transitions_of

ARMS = ("without", "with")
EXACT = ImpulseNoise.exact_variances


@contextmanager
def spread(arm: str) -> Iterator[None]:
    """Gives neighbours of an impact its variance, in the second arm."""

    def variances(noise: ImpulseNoise, impulses: Array) -> Array:
        largest = np.maximum(impulses, np.maximum(np.append(impulses[1:], 0.0), np.append(0.0, impulses[:-1])))
        return EXACT(noise, largest)

    with mock.patch.object(ImpulseNoise, "exact_variances", variances if arm == ARMS[1] else EXACT):
        yield


def rows_of(name: str, sizes: Sequence[int], seed: int) -> list[Row]:
    """Of a seed: fits of each size in both arms."""
    bench = bench_of(name, seed)
    order = np.random.default_rng([seed, 7]).permutation(len(bench.training))
    rows: list[Row] = []
    for size in sizes:
        tosses = [bench.training[place] for place in order[:size]]
        for arm in ARMS:
            with spread(arm):
                model = mass_centre.fitted(bench, tosses, seed, coverage.PUBLISHED_LOSS)
                row = {"body": name, "size": size, "seed": seed, "arm": arm}
                rows.append({**row, **errors_of(model, bench, np.zeros(3))})
    return rows


def in_worlds(seeds: int) -> None:
    """Prints errors of frictions [%] and of vertices [mm], means over seeds, without and with."""
    torch.set_num_threads(1)
    for name, world in coverage.WORLDS.items():
        found: dict[str, list[tuple[float, float]]] = {arm: [] for arm in ARMS}
        for seed in range(seeds):
            data = transitions_of(world.tosses(coverage.LARGEST, 1000 * seed), world.body.length_scale)
            for arm in ARMS:
                with spread(arm):
                    geometry = coverage.fitted(world.body, data, seed, False, coverage.PUBLISHED_LOSS).geometry()
                friction = float(np.linalg.norm(geometry.tangents[0]))
                off = geometry.vertices_normal * world.body.length_scale - world.body.vertices
                found[arm].append((100.0 * (friction / world.body.friction - 1.0), 1e3 * float(np.abs(off).mean())))
        means = [np.mean(found[arm], axis=0) for arm in ARMS]
        shown = ", ".join(f"{arm} {one[0]:+.1f} %, {one[1]:.2f} mm" for arm, one in zip(ARMS, means, strict=True))
        print(f"{name:20} {shown}", flush=True)


if __name__ == "__main__":
    if "--worlds" in sys.argv:
        parser = argparse.ArgumentParser()
        parser.add_argument("--worlds", action="store_true")
        parser.add_argument("--seeds", type=int, default=5)
        in_worlds(parser.parse_args().seeds)
    else:
        sys.exit(compare(rows_of, partial(print_table, arms=ARMS), ["cube", "slab", "irregular"], [8, 16]))
