"""Why informative tosses say too little of friction, and which rule mends it: on tosses below 400 alone, by cross-validation.

`rig` says what the tosses tell of the rig that tracked them, and what a fit to all of them is worth before and after they are
corrected by it; everything below is done with tosses that are. `why` fits all training tosses, and then asks of sets of them
which friction they would say, all else held: of the four quarters by duration, by how much farther they slid than the fit
expects of their release, by what it expects, and by spin; and of what each rule keeps at that fit.
`ground` says how that fit predicts the motion of the same tosses, beside one whose ground may lean and one with friction
acting at the vertices of the gaps. `search` trains on what rules keep of four fifths of the training tosses and judges by the
last fifth; a seed is a fifth and an initialisation. The tosses are found through CONTACTNETS_DATA.

    python -m benchmarks.selection.rules          the first three
    python -m benchmarks.selection.rules rig
    python -m benchmarks.selection.rules why
    python -m benchmarks.selection.rules ground
    python -m benchmarks.selection.rules search [--rules random longest log-det representative] [--sizes 8 16 32] [--seeds 10]
                                      [--faults] [--share 0.05] [--out cells.jsonl] [--jobs N]
"""

import argparse
import json
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import torch

from benchmarks._data import contactnets_folder, training_and_held_out
from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.contact.evaluation import Estimator
from contact_curation.contact.geometry_parameters import INITIAL_NOISE, ContactGeometry
from contact_curation.contact.models.polytope import PolytopeModel
from contact_curation.contact.parameter_form import Form
from contact_curation.design.execution_noise import ExecutionNoise, balanced_draws
from contact_curation.design.predicted_information import DEFAULT_PREDICTION, Motions, Particle, predicted_motions
from contact_curation.experiments.cell import Cell
from contact_curation.experiments.cell_run import FIT, ONE_THREAD, Bench, run_cell, select
from contact_curation.experiments.faults import Fault
from contact_curation.experiments.rules import BASELINES, RULES
from contact_curation.experiments.summary import summarised
from contact_curation.geometry.quaternions import Array
from contact_curation.information.pool import Indices
from contact_curation.learning.evaluation.bootstrap import BootstrapConfig, Interval
from contact_curation.learning.evaluation.evaluation import EvaluationConfig, evaluate_model
from contact_curation.learning.fits.held_fit import fit_held
from contact_curation.learning.fits.polytope_sums import polytope_sums
from contact_curation.motion.calibration import NO_CORRECTION, RESTING_SPEED, RESTING_SPIN, RigMeasurements, measurements_of
from contact_curation.motion.gate_config import GateConfig
from contact_curation.motion.gates import footing
from contact_curation.motion.toss import Toss
from contact_curation.motion.transitions import states_of, transitions_of

DESCRIBED = ContactGeometry.of_body(CONTACTNETS_CUBE).vertices_normal
FOLDS = 5
MEASURES = (
    "rotation",
    "rotation_median",
    "vertices",
    "vertices_from_all",
    "position",
    "position_median",
    "penetration",
    "friction",
    "friction_from_all",
    "selected_bad",
)
FIELDS = ("rule", "size", "fault", "share")

type Row = dict[str, Any]


QUESTIONS = ("rig", "why", "ground")
"""What is answered by default."""

FRICTION = -4
"""Place of the logarithm of friction in the physical form, before tilt and height."""


class Keyed(Protocol):
    """What a row is of."""

    @property
    def key(self) -> str:
        """The same for equal ones only."""

    @property
    def fields(self) -> Mapping[str, Any]:
        """What its row begins with."""


def main() -> int:
    """Prints tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("what", nargs="?", choices=(*QUESTIONS, "search"), help=f"by default {', '.join(QUESTIONS)}")
    parser.add_argument("--rules", nargs="+", default=["random", "longest", "log-det", "representative"], choices=RULES)
    parser.add_argument("--sizes", nargs="+", type=int, default=[8, 16, 32])
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--faults", action="store_true", help="also with bad tosses in the pool, gates on")
    parser.add_argument("--share", type=float, default=0.05, help="of them (default 0.05)")
    parser.add_argument("--out", type=Path, help="file of the finished cells; one that exists is gone on with")
    parser.add_argument("--jobs", type=int, default=1)
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    recorded = recorded_bench()
    if recorded is None:
        return 0
    evidence = measurements_of(recorded.training, recorded.body.polytope)
    bench = recorded.on(evidence.calibration())
    asked = [arguments.what] if arguments.what else QUESTIONS
    if "rig" in asked:
        print_rig(recorded, evidence)
    if "why" in asked:
        print_why(bench)
    if "ground" in asked:
        print_ground(bench)
    if "search" in asked:
        print_summaries(search(arguments, bench.training), FIELDS, MEASURES, BASELINES)
    return 0


def recorded_bench() -> Bench | None:
    """The tosses to learn from, as recorded, and none that judge; None, and a line on stderr, where there are none."""
    folder = contactnets_folder()
    return None if folder is None else Bench(CONTACTNETS_CUBE, training_and_held_out(folder).training, (), GateConfig())


def print_rig(bench: Bench, evidence: RigMeasurements) -> None:
    """Lean, metre and rest of the tosses as recorded, and fits to them and to what is corrected."""
    rig, at_rest, falls = evidence.calibration(), evidence.rests.sum(), evidence.falls.sum()
    print(f"{at_rest} tosses at rest: the board leans by {np.degrees(rig.tilt):.2f} degrees, normal {np.round(rig.normal, 4)}")
    print(f"{falls} tosses in the air: lengths are to be multiplied with {rig.scale:.4f}")
    rigs = {
        "as recorded": NO_CORRECTION,
        "levelled": replace(rig, scale=1.0),
        "lengthened": replace(rig, normal=NO_CORRECTION.normal),
        "corrected": rig,
    }
    columns = f"{'position %':>12}{'rotation':>10}"
    print(f"\n{'':14}{'rest, mm':>10}{'fit, mm':>12}{columns}{'described:':>14}{columns}")
    for name, by in rigs.items():
        mended = bench.on(by)
        rests = [
            corners
            for toss in mended.training
            if (corners := footing(toss, bench.body.polytope, RESTING_SPEED, RESTING_SPIN)) is not None
        ]
        height = 1e3 * float(np.mean([corners[:, 2].mean() for corners in rests]))
        off = 1e3 * bench.body.length_scale * np.linalg.norm(mended.reference.vertices_normal - DESCRIBED, axis=1)
        fitted, described = (_errors(mended, geometry) for geometry in (mended.reference, ContactGeometry.of_body(bench.body)))
        print(
            f"{name:14}{height:10.2f}{np.sqrt(np.square(off).mean()):12.2f}{fitted[0]:12.2f}{fitted[1]:10.2f}"
            f"{described[0]:26.2f}{described[1]:10.2f}"
        )


def _errors(bench: Bench, geometry: ContactGeometry) -> tuple[float, float]:
    """Mean position [%] and rotation [deg] errors of a polytope on the training tosses."""
    model = PolytopeModel(geometry, bench.body, Form.PHYSICAL)
    errors = evaluate_model(model, bench.training, EvaluationConfig(loss=ONE_THREAD)).errors
    return float(errors.position.mean()), float(errors.rotation.mean())


def print_why(bench: Bench) -> None:
    """Which friction sets of tosses say."""
    model = PolytopeModel(bench.reference, bench.body, Form.PHYSICAL)
    data = transitions_of(bench.training, bench.body.length_scale)
    sums = polytope_sums(model, data, Estimator.GAUSS_NEWTON, ONE_THREAD)
    scores, information = sums.scores[:, FRICTION], sums.fishers[:, FRICTION, FRICTION]
    friction = float(np.linalg.norm(bench.reference.tangents[0]))
    print(f"friction that tosses say, all else as in the fit to all {len(bench.training)}, which says {friction:.4f}\n")

    def said(places: Indices) -> float:
        return friction * float(np.exp(scores[places].sum() / information[places].sum()))

    for what, values in traits(bench).items():
        quarters = np.array_split(np.argsort(values), 4)
        edges = ", ".join(f"{values[quarter].min():.2f}" for quarter in quarters)
        print(f"{what:32}" + "".join(f"{said(quarter):9.4f}" for quarter in quarters) + f"   quarters from {edges}")
    names = {toss.toss_id: place for place, toss in enumerate(bench.training)}
    print(f"\n{'selected at that fit':22}" + "".join(f"{f'k = {size}':>10}" for size in (8, 16, 32)))
    for name, rule in RULES.items():
        if name != "all" and not (name.endswith("static") or rule.by_polytope or rule.redrawn):
            selected = [np.array([names[one] for one in select(rule, model, bench.training, size, 0)]) for size in (8, 16, 32)]
            print(f"{name:22}" + "".join(f"{said(places):10.4f}" for places in selected))


def traits(bench: Bench) -> dict[str, Array]:
    """(K,) each, of the training tosses [s, m, m, rad/s]: what came of them, and what is known at their releases."""
    slides = np.array([np.linalg.norm(toss.positions[-1, :2] - toss.positions[0, :2]) for toss in bench.training])
    foreseen = expected_slides(bench)
    return {
        "duration": np.array([toss.duration for toss in bench.training]),
        "slid farther than expected": slides - foreseen,
        "expected slide": foreseen,
        "spin at release": np.linalg.norm(releases_of(bench.training)[:, 10:], axis=1),
    }


def expected_slides(bench: Bench) -> Array:
    """(K,) how far across the board the fit expects the training tosses to come [m]."""
    motions = foreseen_motions(Particle(bench.reference, bench.body, ONE_THREAD), bench.training)
    ends = motions.states[np.arange(len(motions.states)), motions.frames - 1, :2]
    across = bench.body.length_scale * np.linalg.norm(ends - motions.states[:, 0, :2], axis=1)
    return np.asarray(across.reshape(-1, DEFAULT_PREDICTION.executions).mean(axis=1))


def foreseen_motions(particle: Particle, tosses: Sequence[Toss]) -> Motions:
    """What a theta predicts of the executions of each toss's release, toss by toss, whatever came of it."""
    releases = releases_of(tosses)
    draws = balanced_draws(DEFAULT_PREDICTION.executions, np.random.default_rng(0))
    return predicted_motions(particle, ExecutionNoise.expected().executions(releases, draws).reshape(-1, releases.shape[1]))


def releases_of(tosses: Sequence[Toss]) -> Array:
    """(K, 13) their first states."""
    return np.concatenate([states_of(toss, 1.0)[:1] for toss in tosses])


def print_ground(bench: Bench) -> None:
    """How three fits to all tosses predict the motion of the same tosses."""
    data = transitions_of(bench.training, bench.body.length_scale)
    free = fit_held(bench.initial_polytope(0), data, replace(FIT, tilt=INITIAL_NOISE)).model.geometry()
    level = bench.reference
    fits = {
        "level ground": level,
        "ground that may lean": free,
        "level, friction at the vertices of the gaps": replace(level, vertices_tangent=level.vertices_normal),
        "the cube as described": ContactGeometry.of_body(bench.body),
    }
    print(f"{'mean errors over the training tosses':46}{'position':>10}{'rotation':>10}{'friction':>10}{'lean, deg':>11}")
    for name, geometry in fits.items():
        position, rotation = _errors(bench, geometry)
        friction, lean = np.linalg.norm(geometry.tangents[0]), np.degrees(np.arccos(min(geometry.normal[2], 1.0)))
        print(f"{name:46}{position:10.2f}{rotation:10.2f}{friction:10.4f}{lean:11.2f}")


def search(arguments: argparse.Namespace, tosses: Sequence[Toss]) -> list[Row]:
    """The rows of all cells, those of the file included."""
    reference = Bench(CONTACTNETS_CUBE, tuple(tosses), (), GateConfig()).reference
    work = partial(judged_by_a_fold, tuple(tosses), reference)
    return finished_rows(list(cells_of(arguments)), work, arguments.out, arguments.jobs)


def finished_rows[Part: Keyed](cells: Sequence[Part], work: Callable[[Part], Row], out: Path | None, jobs: int) -> list[Row]:
    """The rows of all cells, those that a file has included; it gets the others."""
    finished: dict[str, Any] = {}
    if out and out.exists():
        finished = {row["key"]: row for row in map(json.loads, out.read_text().splitlines())}
    left = [cell for cell in cells if cell.key not in finished]
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        for cell, row in zip(left, pool.map(work, left)):
            finished[cell.key] = {"key": cell.key, **cell.fields, **row}
            if out:
                with out.open("a") as file:
                    file.write(json.dumps(finished[cell.key]) + "\n")
            print(f"{cell.key}: {row['rotation']:.1f} deg", file=sys.stderr)
    return [finished[cell.key] for cell in cells]


def cells_of(arguments: argparse.Namespace) -> Iterator[Cell]:
    """Seed by seed."""
    for seed in range(arguments.seeds):
        for size in arguments.sizes:
            for rule in arguments.rules:
                clean = Cell(rule, size, seed)
                yield clean
                if arguments.faults:
                    yield from (replace(clean, fault=fault.value, share=arguments.share) for fault in Fault)


def judged_by_a_fold(tosses: tuple[Toss, ...], reference: ContactGeometry, cell: Cell) -> Row:
    """A cell's row, its pool drawn from the folds that do not judge."""
    torch.set_num_threads(1)
    return run_cell(cell, fold_bench(tosses, reference, cell.seed))


def fold_bench(tosses: tuple[Toss, ...], reference: ContactGeometry, seed: int) -> Bench:
    """A seed's fold judges, and the others train; reference: fitted to all of them."""
    fold = [place % FOLDS == seed % FOLDS for place in range(len(tosses))]
    training = tuple(toss for toss, judges in zip(tosses, fold) if not judges)
    bench = Bench(CONTACTNETS_CUBE, training, tuple(toss for toss, judges in zip(tosses, fold) if judges), GateConfig())
    bench.__dict__["reference"] = reference
    return bench


def print_summaries(rows: Sequence[Row], fields: Sequence[str], measures: Sequence[str], baselines: Sequence[str]) -> None:
    """Medians over seeds, and differences to the baselines, with 95 % intervals."""
    summaries = summarised(rows, fields, measures, baselines, BootstrapConfig())
    for measure in measures:
        print(f"\n{measure}")
        for one in summaries:
            if one.measure == measure:
                name = " ".join(str(value) for _, value in one.group)
                beside = (f"   minus {other} {_interval(found, '+')}" for other, found in one.beside.items())
                print(f"  {name:34}{_interval(one.median)}" + "".join(beside))


def _interval(found: Interval, sign: str = "") -> str:
    return f"{found.value:{sign}8.4f} ({found.low:{sign}.4f} to {found.high:{sign}.4f})"


if __name__ == "__main__":
    sys.exit(main())
