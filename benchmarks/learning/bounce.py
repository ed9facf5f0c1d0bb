"""Bodies that bounce: one set of vertices with a restitution that is learned, beside the same without it.

Fits of the rigid form to the optimum, each from the same initialisation: impacts that do not bounce, and a
restitution as a parameter of theta (method.md 1.2); each from the transitions as they are, and with impacts merged: a frame
period in which a body meets the board has a velocity that is neither the one before nor the one after, so that both of its
transitions are nobody's law. Merged, one transition leads over them, from a velocity before the impact to one after it.
Velocities are the filtered ones of the tosses, or plain differences of poses.

On the cube a random third of the tosses below 400 judges (CONTACTNETS_DATA), corrected by the rig calibration of the others;
fits begin at random shapes. With --planar FILE.npz the tosses are those of a square prism in a plane
(benchmarks.data.lost_frames) that the quality checks accept with twice the noise of ContactNets' rig; half of them learn and
half judge, and fits begin at the shape as described, for a plane says nothing of places across it. Errors without a model stand
above the table: a body that stays where it was released, and one that lies where it ends from the start. Told is the
restitution that `train` names where a rigid form is fitted without one.

    python -m benchmarks.learning.bounce [--planar FILE.npz] [--arms plain merged bounce bounce-merged rebounds differences
        motions] [--sizes 16 0] [--seeds 3] [--save ROWS.jsonl]
"""

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
import torch

from benchmarks._saved_rows import Row, SavedRows
from benchmarks.data.lost_frames import SQUARE, planar_tosses
from benchmarks.learning.impact_noise import bench_of
from contact_curation.contact.body import Body
from contact_curation.contact.geometry_parameters import INITIAL_NOISE, INITIAL_RESTITUTION, UPWARD
from contact_curation.contact.impulse_noise import ImpulseNoise
from contact_curation.contact.models.polytope import PolytopeModel, initial_geometry
from contact_curation.contact.parameter_form import Form
from contact_curation.experiments.cell_run import FIT, ONE_THREAD
from contact_curation.information.impacts import merged_impacts
from contact_curation.learning.evaluation.evaluation import EvaluationConfig, evaluate_model
from contact_curation.learning.evaluation.rebounds import rebound_of, rebounds
from contact_curation.learning.evaluation.without_model import plain_errors
from contact_curation.learning.fits.exact_fit import corrected_by_motions
from contact_curation.learning.fits.held_fit import fit_held
from contact_curation.learning.uncertainty.bounce import bounce_of
from contact_curation.motion.segmenter_config import SegmenterConfig
from contact_curation.motion.toss import Toss
from contact_curation.motion.transitions import by_differences, transitions_of

ARMS = {
    "two sets": (Form.PHYSICAL, False, False),
    "plain": (Form.RIGID, False, False),
    "merged": (Form.RIGID, False, True),
    "bounce": (Form.RIGID, True, False),
    "bounce-merged": (Form.RIGID, True, True),
    "rebounds": (Form.RIGID, True, True),
    "differences": (Form.RIGID, True, True),
    "motions": (Form.RIGID, True, True),
}
"""The form, whether a restitution is learned, and whether impacts are merged. By the last three its prior is what first impacts
show; velocities are plain differences by `differences`, and `motions` correct it, as in `train`."""

ALL = 0


@dataclass(frozen=True, eq=False)
class Tosses:
    """Tosses of a body that learn, and others that judge; fits begin at shapes that are drawn with this spread."""

    body: Body
    training: tuple[Toss, ...]
    held_out: tuple[Toss, ...]
    spread: float = INITIAL_NOISE


def fitted(arm: str, tosses: Sequence[Toss], body: Body, seed: int, spread: float) -> PolytopeModel:
    """The optimum of tosses."""
    form, bounces, merges = ARMS[arm]
    data = transitions_of(tosses, body.length_scale)
    seen = rebound_of(data, body) if arm in ("rebounds", "differences", "motions") else None
    successive = data
    data = by_differences(data) if arm == "differences" else data
    data = merged_impacts(data, body) if merges else data
    pivot = np.array([*data.before[:, :2].mean(axis=0), 0.0])
    drawn = initial_geometry(body, form, pivot, np.random.default_rng(seed), spread)
    friction = float(np.linalg.norm(drawn.tangents[0]))
    start = replace(drawn, normal=UPWARD, tangents=friction * np.eye(2, 3), height=0.0)
    if form is Form.RIGID:
        start = replace(start, noise=ImpulseNoise(), restitution=INITIAL_RESTITUTION if bounces else None)
    config = replace(FIT, renewals=3)
    if seen is not None:
        start, config = replace(start, restitution=seen.restitution), replace(config, restitution_spread=seen.error)
    origin = PolytopeModel(start, body, form)
    model = fit_held(origin, data, config).model
    return corrected_by_motions(model, origin, data, successive, config)[0].model if arm == "motions" else model


def run(arm: str, size: int, seed: int, tosses: Tosses) -> Row:
    """One cell."""
    pool = tosses.training
    chosen = range(len(pool)) if size == ALL else np.random.default_rng([seed, size]).choice(len(pool), size, replace=False)
    learned = [pool[place] for place in sorted(chosen)]
    model = fitted(arm, learned, tosses.body, seed, tosses.spread)
    found = evaluate_model(model, tosses.held_out, EvaluationConfig(loss=ONE_THREAD))
    finite, geometry = found.errors.finite, model.geometry()
    noise = geometry.noise or ImpulseNoise(0.0)
    assert found.shape is not None
    row = {name: float(getattr(found.errors, name)[finite].mean()) for name in ("position", "rotation", "penetration")}
    row |= {"vertices": found.shape.vertex_rms_mm, "friction": found.shape.friction, "not_finite": int((~finite).sum())}
    told = bounce_of(model, transitions_of(learned, tosses.body.length_scale), ONE_THREAD)
    row |= {"told": told.restitution if told else 0.0, "told_interval": told.interval if told else 0.0}
    row |= {"restitution": geometry.restitution or 0.0, "growth": noise.growth, "power": noise.power}
    measured, ours = (rebounds(states, found.starts, tosses.body) for states in (found.measured, found.predicted))
    plain = {f"{name}: {k}": v for name, each in plain_errors(found, tosses.body).items() for k, v in each._asdict().items()}
    return row | {"rebound": float(np.median(measured)), "predicted_rebound": float(np.median(ours)), **plain}


def print_table(rows: Sequence[Row]) -> None:
    """Medians over seeds."""
    fitted_numbers = ("vertices", "friction", "restitution", "told", "told_interval")
    shown = ("position", "rotation", *fitted_numbers, "rebound", "predicted_rebound")
    print(f"{'arm':16}{'size':>5}{'seeds':>6}" + "".join(f"{name:>18}" for name in shown))
    for arm, size in dict.fromkeys((row["arm"], row["size"]) for row in rows):
        own = [row for row in rows if (row["arm"], row["size"]) == (arm, size)]
        values = [np.median([row[name] for row in own]) for name in shown]
        print(f"{arm:16}{size or 'all':>5}{len(own):>6}" + "".join(f"{value:18.3f}" for value in values))


def main() -> int:
    """Runs the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--planar", type=Path, help="poses of a square prism; the cube's by default")
    parser.add_argument("--arms", nargs="+", choices=tuple(ARMS), default=list(ARMS))
    parser.add_argument("--sizes", nargs="+", type=int, default=[16, ALL])
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--save", type=Path)
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    if arguments.planar:
        found = planar_tosses(arguments.planar, SegmenterConfig(tracker_noise=2.0))
        tosses = Tosses(SQUARE, found[0::2], found[1::2], 0.0)
    else:
        bench = bench_of("third")
        if bench is None:
            return 0
        tosses = Tosses(bench.body, tuple(bench.training), tuple(bench.held_out))
    print(f"{len(tosses.training)} tosses learn, {len(tosses.held_out)} judge")
    saved, rows = SavedRows(arguments.save), list[Row]()
    for size in arguments.sizes:
        for seed in range(arguments.seeds if size != ALL else 1):
            for arm in arguments.arms:
                key: Row = {"body": tosses.body.name, "arm": arm, "size": size, "seed": seed}
                rows.append(saved.one(key, partial(run, arm, size, seed, tosses)))
    for name in sorted({key for key in rows[0] if ": " in key}):
        print(f"{name} {rows[0][name]:.1f}")
    print_table(rows)
    return 0


if __name__ == "__main__":
    sys.exit(main())
