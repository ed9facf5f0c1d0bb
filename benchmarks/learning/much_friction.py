"""How far the friction that is learned is from the truth, by how much there is and how it is described.

Slab, irregular body and cube of `benchmarks.learning.coverage` are thrown in the model's own rigid world and in MuJoCo, and
seen by a tracker with the noise of ContactNets' rig. Models learn from random tosses as `train` does, to the optimum from a
random initialisation. The friction is described as 0.3 or 0.5, whatever it is, or as it is: if it is described as more than
`MODERATE_FRICTION`, what seems to slip counts less, and velocities are plain differences. Medians over bodies and seeds, with
the least and the most.

    python -m benchmarks.learning.much_friction [--frictions 0.25 0.4 0.6 0.9] [--rates 100 148 250] [--seeds 3] [--tosses 16]
        [--save ROWS.jsonl]

With --save rows are kept, and those that are there already are not made again.
"""

import argparse
import itertools
import sys
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import torch

from benchmarks._saved_rows import Row, SavedRows
from benchmarks.learning.coverage import SLAB, STONE, World, contacts, fitted
from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.learning.evaluation.evaluation import shape_errors
from contact_curation.motion.transitions import transitions_of

BODIES = {"slab": SLAB, "stone": STONE, "cube": CONTACTNETS_CUBE}
WORLDS = {"rigid": None, "2 ms": contacts(2.0, 1.0), "4 ms, bouncing": contacts(4.0, 0.4)}
DESCRIBED = {"as 0.3": 0.3, "as 0.5": 0.5, "as it is": None}


def row_of(key: Row) -> Row:
    """Errors of one fit."""
    true = replace(BODIES[key["body"]], friction=key["friction"])
    tosses = World(true, WORLDS[key["world"]], 1.0 / key["hz"]).tosses(key["tosses"], 1000 * key["seed"])
    body = replace(true, friction=DESCRIBED[key["described"]] or true.friction)
    shape = shape_errors(fitted(body, transitions_of(tosses, body.length_scale), key["seed"], False))
    assert shape is not None
    return {"error": shape.friction / true.friction - 1.0, "vertices_mm": shape.vertex_rms_mm}


def print_table(rows: Sequence[Row]) -> None:
    """Errors of the friction [%], a line for each world, rate and friction."""
    print(f"{'world':16} {'Hz':>4} {'friction':>8}  " + "".join(f"{arm:>26}" for arm in DESCRIBED))
    for world, hz, friction in dict.fromkeys((row["world"], row["hz"], row["friction"]) for row in rows):
        cells = list[str]()
        for arm in DESCRIBED:
            own = [
                row
                for row in rows
                if (row["world"], row["hz"], row["friction"], row["described"]) == (world, hz, friction, arm)
            ]
            errors = 100.0 * np.array([row["error"] for row in own])
            cells.append(f"{np.median(errors):+.0f} ({errors.min():+.0f} to {errors.max():+.0f})")
        print(f"{world:16} {hz:4} {friction:8}  " + "".join(f"{cell:>26}" for cell in cells))


def main() -> int:
    """Runs the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--frictions", nargs="+", type=float, default=[0.25, 0.4, 0.6, 0.9])
    parser.add_argument("--rates", nargs="+", type=int, default=[100, 148, 250], help="of the camera [Hz]")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--tosses", type=int, default=16)
    parser.add_argument("--save", type=Path)
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    saved, rows = SavedRows(arguments.save), list[Row]()
    chosen = (range(arguments.seeds), arguments.rates, WORLDS, arguments.frictions, BODIES, DESCRIBED)
    for seed, hz, world, friction, body, arm in itertools.product(*chosen):
        key: Row = {"world": world, "hz": hz, "friction": friction, "body": body, "described": arm, "seed": seed}
        key["tosses"] = arguments.tosses
        rows.append(saved.one(key, partial(row_of, key)))
    print_table(rows)
    return 0


if __name__ == "__main__":
    sys.exit(main())
