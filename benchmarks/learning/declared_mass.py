"""What the declared mass of a body changes of a fit, although it changes no motion.

Slip and gaps count by squared impulses in the loss, and velocities by the mass, so that the terms' shares follow the mass.
A body's tosses are fitted as they are, from random initial parameters, with the mass declared as factors of its own and the
inertia in proportion. A mass beyond the bounds of contact/loss_config.py counts as if it were the bound; with --unbounded it
counts itself. Medians over seeds, each with tosses of its own that judge, in two engines.

    python -m benchmarks.learning.declared_mass [--bodies cube slab irregular square] [--factors 0.02 0.25 1 4 40]
        [--seeds 3] [--tosses 16] [--unbounded]
"""

import argparse
import sys
from dataclasses import replace

import numpy as np
import torch

from benchmarks.learning.mass_centre import errors_of
from contact_curation.contact.loss_config import OF_IMPULSES, counted_mass
from contact_curation.experiments.bodies import BOUNCING, bench_of
from contact_curation.experiments.cell_run import FIT
from contact_curation.experiments.counterfactuals.refitted import origin_of
from contact_curation.learning.fits.held_fit import fit_held
from contact_curation.motion.transitions import transitions_of

MEASURES = ("friction", "vertices_mm", "rotation", "position", "mujoco_rotation", "mujoco_position")
JUDGES = 60
"""Tosses that judge a fit."""


def fitted(name: str, factor: float, tosses: int, seed: int, unbounded: bool) -> list[float]:
    """The `MEASURES` of one fit: friction, and errors of vertices [mm], rotation [deg] and position [% of the width]."""
    bench = bench_of(name, seed)
    body = replace(bench.body, mass=factor * bench.body.mass, inertia=factor * bench.body.inertia)
    data = transitions_of(bench.training[:tosses], body.length_scale)
    share = (body.mass / counted_mass(body.mass)) ** 2 if unbounded else 1.0
    loss = replace(FIT.loss, **{weight: share * getattr(FIT.loss, weight) for weight in OF_IMPULSES})
    model = fit_held(origin_of(replace(bench, body=body), seed, name in BOUNCING), data, replace(FIT, loss=loss)).model
    row = errors_of(model, replace(bench, held_out=bench.held_out[:JUDGES]), np.zeros(3))
    return [float(np.nanmean(row[measure])) for measure in MEASURES]


def main() -> int:
    """Prints a row of a table for each body and mass."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--bodies", nargs="+", default=["cube", "slab", "irregular", "square"])
    parser.add_argument("--factors", nargs="+", type=float, default=[0.02, 0.25, 1.0, 4.0, 40.0])
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--tosses", type=int, default=16)
    parser.add_argument("--unbounded", action="store_true")
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    print("| body | mass, kg | friction | vertices, mm | rotation ° | position, % | rotation °, MuJoCo | position, %, MuJoCo |")
    print("|---|---|---|---|---|---|---|---|")
    for name in arguments.bodies:
        mass = bench_of(name, 0).body.mass
        for factor in arguments.factors:
            found = [fitted(name, factor, arguments.tosses, seed, arguments.unbounded) for seed in range(arguments.seeds)]
            friction, *others = np.median(found, axis=0)
            print(f"| {name} | {factor * mass:.3g} | {friction:.3f} | {' | '.join(f'{x:.1f}' for x in others)} |", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
