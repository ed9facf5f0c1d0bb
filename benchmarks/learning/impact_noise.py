"""One set of vertices and a noise that grows with impacts, beside what is fitted without them: on tosses below 400 alone.

Three fits to the optimum, each from the same random initialisation: two sets of vertices (the physical form), one set with one
variance of all residuals, and one set with a variance that is learned (contact/impulse_noise.py; the rigid form). They learn
from random tosses, and from what criteria select of all by the information at the fit of all, weighted as that fit is. A part
of the tosses below 400 judges, corrected by the rig calibration of the others: a random third, or tosses 0 to 169. Judged by
our rollouts (two sets also with friction moved to the vertices of the gaps), and with --mujoco by MuJoCo, too (the convex hull
of the learned vertices, all contacts as in `simulation.world`). With --contact-time the tosses are those that MuJoCo makes of
the same releases with contacts of this stiffness, and the truth is known; they judge by our rollouts. The tosses are found
through CONTACTNETS_DATA.

    python -m benchmarks.learning.impact_noise [--judges third|first] [--arms two one noise] [--rules random longest ...]
                  [--sizes 4 8 16 32 0] [--seeds 4] [--contact-time SECONDS] [--mujoco] [--save ROWS.jsonl] [--rows ROWS.csv]

Size 0 is all. With --save rows are kept, and those that are there already are not made again; --rows adds them to a table.
"""

import argparse
import csv
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path

import numpy as np
import torch

from benchmarks._data import contactnets_folder, training_and_held_out
from benchmarks._saved_rows import Row, SavedRows
from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.contact.evaluation import Estimator
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.impulse_noise import ImpulseNoise
from contact_curation.contact.models.polytope import PolytopeModel
from contact_curation.contact.parameter_form import Form
from contact_curation.design.throw import throw_of_state
from contact_curation.experiments.cell_run import FIT, ONE_THREAD, Bench
from contact_curation.experiments.rules import RULES
from contact_curation.geometry.quaternions import Array
from contact_curation.information.pool import Pool, pool_of
from contact_curation.information.ranker import rank_particles
from contact_curation.information.record import TossInformation
from contact_curation.information.scoring import Scorer, ScoringConfig
from contact_curation.learning.evaluation.evaluation import EvaluationConfig, evaluate_model, predicted_motions
from contact_curation.learning.evaluation.held_out import toss_number
from contact_curation.learning.evaluation.motion_errors import motion_errors
from contact_curation.learning.fits.held_fit import fit_held
from contact_curation.motion.calibration import calibration_of
from contact_curation.motion.gate_config import GateConfig
from contact_curation.motion.toss import Toss
from contact_curation.motion.transitions import states_of, transitions_of
from contact_curation.simulation.thrown_toss import ThrownTossConfig, thrown_toss
from contact_curation.simulation.world import WorldConfig, free_motion

ARMS = {"two": (Form.PHYSICAL, 0), "one": (Form.RIGID, 0), "noise": (Form.RIGID, FIT.renewals)}
"""Form, and how often the noise is learned."""

DESCRIBED = "described"
ALL = 0
MEASURES = ("position", "rotation", "vertices", "friction")
JUDGES = ("shared", "mujoco")
"""Others than our rollouts of the model as it was fitted."""


@dataclass(frozen=True, eq=False)
class Arm:
    """A kind of fit on a bench."""

    name: str
    bench: Bench

    def start(self, seed: int) -> PolytopeModel:
        """The random initialisation, with as many sets of vertices as the arm has."""
        form, renewals = ARMS[self.name]
        start = self.bench.initial_polytope(seed)
        if form is Form.PHYSICAL:
            return start
        geometry = start.geometry()
        noise = ImpulseNoise() if renewals else ImpulseNoise(0.0)
        together = replace(geometry, vertices_tangent=geometry.vertices_normal, noise=noise)
        return PolytopeModel(together, self.bench.body, form)

    def fit(self, tosses: Sequence[Toss], seed: int) -> PolytopeModel:
        """The optimum of tosses."""
        data = transitions_of(tosses, self.bench.body.length_scale)
        return fit_held(self.start(seed), data, replace(FIT, renewals=ARMS[self.name][1])).model

    @cached_property
    def of_all(self) -> PolytopeModel:
        """The fit to all training tosses, at which information is taken."""
        return self.fit(self.bench.training, 0)

    def selected(self, rule: str, size: int, seed: int) -> list[Toss]:
        """What a rule selects of all."""
        tosses = self.bench.training
        if rule == "random":
            chosen = np.random.default_rng([seed, size]).choice(len(tosses), size, replace=False)
            return [tosses[place] for place in np.sort(chosen)]
        chosen_by = RULES[rule]
        pool = self._empirical if chosen_by.estimator is Estimator.EMPIRICAL else self._gauss_newton
        names = set(rank_particles([pool], chosen_by.ranking(size, seed)).selected_ids)
        return [toss for toss in tosses if toss.toss_id in names]

    @cached_property
    def _gauss_newton(self) -> Pool:
        return self._scored(Estimator.GAUSS_NEWTON)

    @cached_property
    def _empirical(self) -> Pool:
        return self._scored(Estimator.EMPIRICAL)

    def _scored(self, estimator: Estimator) -> Pool:
        model = self.of_all
        scorer = Scorer(model.geometry(), model.body, ScoringConfig(estimator, form=model.form, loss=ONE_THREAD))
        return pool_of(one for one in scorer.score(self.bench.training) if isinstance(one, TossInformation))


def bench_of(judges: str) -> Bench | None:
    """Tosses below 400: some judge, and all are corrected by the calibration of the others."""
    folder = contactnets_folder()
    if folder is None:
        return None
    tosses = training_and_held_out(folder).training
    if judges == "first":
        judging = np.array([toss_number(toss, -1) < 170 for toss in tosses])
    else:
        judging = np.random.default_rng(0).permutation(len(tosses)) < len(tosses) // 3
    sides = ([toss for toss, judge in zip(tosses, judging, strict=True) if judge == wanted] for wanted in (False, True))
    training, held_out = (tuple(side) for side in sides)
    recorded = Bench(CONTACTNETS_CUBE, training, held_out, GateConfig())
    return recorded.on(calibration_of(recorded.training, recorded.body.polytope))


def simulated(bench: Bench, contact_time: float) -> Bench:
    """The same releases, thrown in MuJoCo with contacts of this time constant [s]."""
    config = ThrownTossConfig(world=WorldConfig(longest_step=min(0.001, 0.4 * contact_time), contact_time=contact_time))

    def thrown(tosses: Sequence[Toss]) -> tuple[Toss, ...]:
        throws = [throw_of_state(toss.toss_id, toss.body, states_of(toss, 1.0)[0], 0.0, "") for toss in tosses]
        return tuple(thrown_toss(bench.body, throw, config) for throw in throws)

    return replace(bench, training=thrown(bench.training), held_out=thrown(bench.held_out))


def judged(model: PolytopeModel, bench: Bench, by_mujoco: bool) -> Row:
    """Means over the judging tosses; how far shape and friction are from the described."""
    found = evaluate_model(model, bench.held_out, EvaluationConfig(loss=ONE_THREAD))
    assert found.shape is not None
    finite = found.errors.finite
    row: Row = {name: float(getattr(found.errors, name)[finite].mean()) for name in MEASURES[:2]}
    row |= {"vertices": found.shape.vertex_rms_mm, "friction": found.shape.friction, "not_finite": int((~finite).sum())}
    noise = model.geometry().noise
    row |= {"growth": noise.growth, "power": noise.power} if noise is not None else {}
    if model.has_own_friction_vertices:
        shared = predicted_motions(model.with_shared_vertices(), bench.held_out, EvaluationConfig(loss=ONE_THREAD)).errors
        row |= {f"shared_{name}": float(getattr(shared, name)[shared.finite].mean()) for name in MEASURES[:2]}
    return row | (in_mujoco(model, bench) if by_mujoco else {})


def in_mujoco(model: PolytopeModel, bench: Bench) -> Row:
    """The errors of MuJoCo's motions of the hull of the learned vertices."""
    scale = bench.body.length_scale
    body = model.geometry().as_body(bench.body)
    measured = [states_of(toss, 1.0) for toss in bench.held_out]
    moved = [
        free_motion(body, each[0], len(each), toss.frame_period) for each, toss in zip(measured, bench.held_out, strict=True)
    ]
    starts = np.concatenate([[0], np.cumsum([len(each) for each in measured])])
    both = (np.concatenate(states) for states in (moved, measured))
    predicted, seen = (_characteristic(states, scale) for states in both)
    errors = motion_errors(predicted, seen, starts, bench.body)
    return {f"mujoco_{name}": float(getattr(errors, name)[errors.finite].mean()) for name in MEASURES[:2]}


def _characteristic(states: Array, scale: float) -> Array:
    scaled = states.copy()
    scaled[:, :3] /= scale
    scaled[:, 7:10] /= scale
    return scaled


def print_table(rows: Sequence[Row]) -> None:
    """Medians over seeds."""
    groups = dict.fromkeys((row["arm"], row["rule"], row["size"]) for row in rows)
    others = [f"{judge}_{name}" for judge in JUDGES for name in MEASURES[:2]]
    shown = [*MEASURES, *(name for name in others if any(name in row for row in rows))]
    print(f"{'arm':10}{'rule':16}{'size':>5}{'seeds':>6}" + "".join(f"{name:>17}" for name in shown))
    for arm, rule, size in sorted(groups, key=lambda group: (group[2] or 1 << 30, group[1], group[0])):
        own = [row for row in rows if (row["arm"], row["rule"], row["size"]) == (arm, rule, size)]
        medians = [np.median([row.get(name, np.nan) for row in own]) for name in shown]
        print(f"{arm:10}{rule:16}{size or 'all':>5}{len(own):>6}" + "".join(f"{value:17.3f}" for value in medians))


def main() -> int:
    """Runs the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--judges", choices=("third", "first"), default="third")
    parser.add_argument("--arms", nargs="+", choices=tuple(ARMS), default=list(ARMS))
    parser.add_argument("--rules", nargs="+", choices=tuple(RULES), default=["random"])
    parser.add_argument("--sizes", nargs="+", type=int, default=[4, 8, 16, 32, ALL])
    parser.add_argument("--seeds", type=int, default=4, help="of random sets and of initialisations")
    parser.add_argument("--contact-time", type=float, default=0.0, help="of simulated tosses [s]; 0 for the real ones")
    parser.add_argument("--mujoco", action="store_true")
    parser.add_argument("--save", type=Path)
    parser.add_argument("--rows", type=Path, help="CSV file")
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    bench = bench_of(arguments.judges)
    if bench is None:
        return 0
    world = {"judges": arguments.judges, "contact_time": arguments.contact_time, "mujoco": arguments.mujoco}
    if arguments.contact_time:
        bench = simulated(bench, arguments.contact_time)
    saved, rows = SavedRows(arguments.save), list[Row]()
    arms = {name: Arm(name, bench) for name in arguments.arms}
    for key in cells(arguments):
        rows.append(saved.one({**world, **key}, partial(run, key, arms, bench, arguments.mujoco)))
    if arguments.rows is not None:
        write_rows(rows, arguments.rows)
    print(f"{len(bench.training)} tosses to learn from, {len(bench.held_out)} judge")
    print_table(rows)
    return 0


def write_rows(rows: Sequence[Row], path: Path) -> None:
    """All rows to six digits, added to those of a file that is there."""
    columns = ["judges", "arm", "rule", "size", "seed", *MEASURES, *(f"{by}_{name}" for by in JUDGES for name in MEASURES[:2])]
    values = [[row.get(name, "") for name in columns] for row in rows]
    written = [[f"{value:.6g}" if isinstance(value, float) else value for value in each] for each in values]
    new = not path.exists()
    with path.open("a", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows([columns, *written] if new else written)


def cells(arguments: argparse.Namespace) -> list[Row]:
    """What is fitted; selected sets depend on no seed but that of the initialisation, which only the first one has."""
    found: list[Row] = [{"arm": DESCRIBED, "rule": "", "size": ALL, "seed": 0}]
    for size in arguments.sizes:
        for rule in arguments.rules if size != ALL else ["all"]:
            seeds = range(arguments.seeds if rule == "random" else 1)
            found += [{"arm": arm, "rule": rule, "size": size, "seed": seed} for seed in seeds for arm in arguments.arms]
    return found


def run(key: Row, arms: dict[str, Arm], bench: Bench, by_mujoco: bool) -> Row:
    """The row of one cell."""
    if key["arm"] == DESCRIBED:
        described = PolytopeModel(ContactGeometry.of_body(bench.body), bench.body, Form.PHYSICAL)
        return judged(described, bench, by_mujoco)
    arm = arms[key["arm"]]
    if key["size"] == ALL:
        return judged(arm.of_all, bench, by_mujoco)
    return judged(arm.fit(arm.selected(key["rule"], key["size"], key["seed"]), key["seed"]), bench, by_mujoco)


if __name__ == "__main__":
    sys.exit(main())
