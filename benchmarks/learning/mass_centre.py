"""What the centre of mass by free flights changes of models and predictions, where a body is described as even.

For each seed a third of the tosses judges (experiments/bodies.py). The centre of mass comes from the flights of the tosses that
are learned from. A polytope is fitted to n of them as `train` does, and so is one whose body has its centre of mass there; the
body as described is judged likewise, with the centre by all that may be learned from. Two engines judge. All errors are those
of the origin of the poses, and of the orientation.

    python -m benchmarks.learning.mass_centre [--bodies cube square] [--sizes 4 8 16 0] [--seeds 10] [--save ROWS.jsonl]

Size 0 stands for all. With --save rows are kept, and those that are there already are not made again. The cube's and the
square's tosses are found through CONTACTNETS_DATA and SQUARE_DATA.
"""

import argparse
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import torch

from benchmarks._saved_rows import Row, SavedRows
from contact_curation.contact.body import Body
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.loss_config import LossConfig
from contact_curation.contact.models.polytope import PolytopeModel, initial_geometry
from contact_curation.contact.parameter_form import Form
from contact_curation.experiments.bodies import bench_of
from contact_curation.experiments.cell_run import ONE_THREAD, Bench
from contact_curation.geometry import quaternions
from contact_curation.geometry.quaternions import Array
from contact_curation.learning.evaluation.evaluation import EvaluationConfig, predicted_motions
from contact_curation.learning.evaluation.motion_errors import motion_errors
from contact_curation.learning.evaluation.shape_errors import matched_distances
from contact_curation.learning.fits.exact_fit import optimum, theta_0
from contact_curation.learning.training.protocols import USUAL_STARTS
from contact_curation.motion.calibration import RigCalibration
from contact_curation.motion.survey.falls import survey
from contact_curation.motion.survey.mass_centre import mass_centre
from contact_curation.motion.survey.series import series_of
from contact_curation.motion.toss import Toss
from contact_curation.motion.transitions import states_of, transitions_of
from contact_curation.simulation.world import free_motion

CONFIG = EvaluationConfig(loss=ONE_THREAD)
ALL = 0
ARMS = ("as described", "by flights")
MEASURES = ("position", "rotation", "mujoco_position", "mujoco_rotation", "vertices_mm", "friction")
RESAMPLES = 4000


def centre_of(tosses: Sequence[Toss]) -> Array | None:
    """(3,) by the flights of some tosses [m]; None where it cannot be told from the origin."""
    found = mass_centre(survey([series_of(toss) for toss in tosses]))
    return found.place if found is not None and found.is_elsewhere else None


def about(bench: Bench, centre: Array) -> Bench:
    """The same tosses and body about another centre of mass (3,) [m]."""
    body = replace(bench.body, vertices=bench.body.vertices - centre, center_of_mass=bench.body.center_of_mass + centre)
    x, y, z = centre.tolist()
    return replace(bench, body=body).on(RigCalibration(marker_offset=(x, y, z)))


def errors_of(model: PolytopeModel, bench: Bench, centre: Array) -> Row:
    """Errors of both engines (K,) at the origin that is seen from the centre of mass at -centre, and those of the shape."""
    ours = predicted_motions(model, bench.held_out, CONFIG)
    geometry, scale = model.geometry(), bench.body.length_scale
    moving = geometry.as_body(bench.body)
    units = np.array([scale] * 3 + [1.0] * 4 + [scale] * 3 + [1.0] * 3)
    tosses = [(toss, states_of(toss, 1.0)) for toss in bench.held_out]
    theirs = [free_motion(moving, seen[0], len(seen), toss.frame_period) / units for toss, seen in tosses]
    measured = [seen / units for _, seen in tosses]
    row: Row = {}
    for engine, states, seen, starts in (
        ("", ours.rolled.states, ours.measured, ours.rolled.starts),
        ("mujoco_", np.concatenate(theirs), np.concatenate(measured), np.cumsum([0, *map(len, measured)])),
    ):
        found = motion_errors(at_origin(states, centre / scale), at_origin(seen, centre / scale), starts, bench.body)
        row[f"{engine}position"], row[f"{engine}rotation"] = found.position.tolist(), found.rotation.tolist()
    off = matched_distances(geometry.vertices_normal, bench.body.scaled_vertices)
    return {**row, "vertices_mm": 1e3 * scale * float(np.sqrt(np.mean(off**2))), "friction": moving.friction}


def at_origin(states: Array, centre: Array) -> Array:
    """States (N, 13) with the positions of the origin from which the centre of mass is seen at `centre`."""
    moved = states.copy()
    moved[:, :3] -= quaternions.rotate(states[:, 3:7], np.broadcast_to(centre, (len(states), 3)))
    return moved


def fitted(bench: Bench, tosses: Sequence[Toss], seed: int, loss: LossConfig = ONE_THREAD) -> PolytopeModel:
    """The optimum of some tosses."""
    drawn = initial_geometry(bench.body, Form.RIGID, bench.pivot, np.random.default_rng(seed))
    start = theta_0(PolytopeModel(drawn, bench.body, Form.RIGID))
    return optimum(start, transitions_of(list(tosses), bench.body.length_scale), loss, 0.0, USUAL_STARTS).model


def as_described(body: Body) -> PolytopeModel:
    """The described body on a level board."""
    return PolytopeModel(ContactGeometry.of_body(body).rigid(), body, Form.RIGID)


def rows_of(name: str, sizes: Sequence[int], seed: int) -> list[Row]:
    """Of a seed: the described body, and fits."""
    bench = bench_of(name, seed)
    order = np.random.default_rng([seed, 7]).permutation(len(bench.training))
    rows: list[Row] = []
    for size in [None, *sizes]:
        places = order[: size or None]
        tosses = [bench.training[place] for place in places]
        found = centre_of(bench.training if size is None else tosses)
        for arm, centre in zip(ARMS, (np.zeros(3), np.zeros(3) if found is None else found), strict=True):
            moved = about(bench, centre) if centre.any() else bench
            model = (
                as_described(moved.body) if size is None else fitted(moved, [moved.training[place] for place in places], seed)
            )
            row = {"body": name, "size": -1 if size is None else size, "seed": seed, "arm": arm}
            rows.append({**row, "centre_mm": (1e3 * centre).tolist(), **errors_of(model, moved, centre)})
    return rows


def print_table(rows: Sequence[Row], arms: tuple[str, str]) -> None:
    """Means by arm, and the difference with its 95 % interval over seeds and judging tosses."""
    rng = np.random.default_rng(0)
    for name in dict.fromkeys(row["body"] for row in rows):
        for size in dict.fromkeys(row["size"] for row in rows if row["body"] == name):
            own = [row for row in rows if (row["body"], row["size"]) == (name, size)]
            said = {-1: "as described", ALL: "fit to all"}.get(size, f"fit to {size}")
            pairs = {arm: sorted((row for row in own if row["arm"] == arm), key=lambda row: row["seed"]) for arm in arms}
            print(f"{name}, {said}, {len(pairs[arms[0]])} seeds")
            for measure in MEASURES:
                before, after = ([np.atleast_1d(row[measure]) for row in pairs[arm]] for arm in arms)
                off = [np.asarray(two) - np.asarray(one) for one, two in zip(before, after, strict=True)]
                means = [
                    np.mean(
                        [np.nanmean(rng.choice(off[seed], len(off[seed]))) for seed in rng.integers(len(off), size=len(off))]
                    )
                    for _ in range(RESAMPLES)
                ]
                low, high = np.percentile(means, [2.5, 97.5])
                first, second = (np.mean([np.nanmean(one) for one in each]) for each in (before, after))
                print(f"  {measure:16} {first:8.3f} {second:8.3f} {second - first:+8.3f} ({low:+.3f} to {high:+.3f})")


def compare(
    make: Callable[[str, Sequence[int], int], list[Row]],
    show: Callable[[Sequence[Row]], None],
    bodies: list[str],
    sizes: list[int],
) -> int:
    """Runs a comparison as the command line says: rows of a body, sizes and a seed, and the table of all.

    Args:
        make: the rows.
        show: prints the table.
        bodies: by default.
        sizes: of the fits by default.
    """
    parser = argparse.ArgumentParser()
    parser.add_argument("--bodies", nargs="+", default=bodies)
    parser.add_argument("--sizes", nargs="+", type=int, default=sizes)
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--save", type=Path)
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    saved = SavedRows(arguments.save)
    for seed in range(arguments.seeds):
        for name in arguments.bodies:
            if any((row["body"], row["seed"]) == (name, seed) for row in saved.rows):
                continue
            saved.add(make(name, arguments.sizes, seed))
            print(f"{name}, seed {seed}", file=sys.stderr, flush=True)
    show(saved.rows)
    return 0


if __name__ == "__main__":
    sys.exit(compare(rows_of, partial(print_table, arms=ARMS), ["cube", "square"], [4, 8, 16, ALL]))
