"""What the trainer's protocols make of the same loop: how soon theta may design throws, and what it knows after twelve.

The loop in one process, as `contact-curation reproduce designed-throws` has it (the simulated arm, a tracker's noise, the
designer with its readiness check), a learner of the node's own kind, form and settings. Judged by ContactNets' tosses
below 400, corrected by their rig calibration: settings are chosen by them, and what all learn from is thrown by the
simulated arm.

    python -m benchmarks.learning.trainer_rounds [--seeds 10] [--throws 12] [--arms budgeted exact without-2 ...]
                                                 [--save RUNS.jsonl]

With `--save` runs are kept, and those that are there already are not made again.
"""

import argparse
import sys
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np

from benchmarks._saved_rows import SavedRows
from benchmarks.selection.rules import Row, print_summaries, recorded_bench, releases_of
from contact_curation.contact.models.polytope import PolytopeModel, initial_geometry
from contact_curation.contact.parameter_form import Form
from contact_curation.design.designer import Designer, DesignerConfig
from contact_curation.design.releases import fitted_prior
from contact_curation.experiments.cell_run import ONE_THREAD, Bench
from contact_curation.experiments.counterfactuals.refitted import origin_of
from contact_curation.experiments.thrown.choice import DesignedThrows
from contact_curation.experiments.thrown.designed_throws import RoundsLearner, judged
from contact_curation.learning.training.protocols import TrainingConfig, budgeted, exact
from contact_curation.motion.calibration import calibration_of
from contact_curation.motion.toss import Toss
from contact_curation.simulation.arm.rig import ArmRig

STEPS = 400
"""Of a budgeted round, as in the node."""

ARMS: dict[str, TrainingConfig] = {
    "budgeted": budgeted("polytope"),
    "exact": exact(),
    "without-0.5": exact(trimmed=0.005),
    "without-1": exact(trimmed=0.01),
    "without-2": exact(trimmed=0.02),
}
"""The last three leave out of training the per cent of the transitions that are explained worst."""
MEASURES = ("position", "rotation", "vertices", "friction_from_described")


@dataclass(frozen=True)
class Run:
    """One learner.

    Attributes:
        arm, seed: which.
        designed: of all throws.
        first: number of the first designed one; 0 for none.
        results: by measure, at the end.
    """

    arm: str
    seed: int
    throws: int
    designed: int
    first: int
    results: dict[str, float]


def run(arm: str, seed: int, throws: int, bench: Bench) -> Run:
    """One loop."""
    drawn = initial_geometry(bench.body, Form.PHYSICAL, bench.pivot, np.random.default_rng(seed))
    rig, start = ArmRig(bench.body, seed), PolytopeModel(drawn, bench.body, Form.PHYSICAL)
    if ARMS[arm].exact:
        start = origin_of(bench, seed, bounces=False)
    learner = RoundsLearner(start, replace(ARMS[arm], loss=ONE_THREAD), STEPS, seed)
    designer = Designer(bench.body, DesignerConfig(loss=ONE_THREAD), fitted_prior(releases_of(bench.training)), rig.feasibility)
    chooser, tosses, designed = DesignedThrows(designer, start.geometry(), seed), list[Toss](), list[int]()
    for number in range(1, throws + 1):
        choice = chooser.choose(number)
        designed += [] if choice.reason else [number]
        seen = rig.throw(choice.throw)
        chooser.thrown(seen.commanded, seen.executed)
        if seen.toss is not None:
            chooser.came(seen.toss)
            tosses.append(seen.toss)
            if learner.learn(tosses):
                chooser.learned(learner.model.geometry(), tosses)
    row = judged(learner.model, bench)
    return Run(arm, seed, throws, len(designed), min(designed, default=0), {name: float(row[name]) for name in MEASURES})


def print_runs(runs: list[Run]) -> None:
    """Medians over the seeds with 95 % intervals, and what each arm has less of an error, seed by seed, than the exact one."""
    for arm in ARMS:
        own = [one for one in runs if one.arm == arm]
        if own:
            designed, first = (np.median([getattr(one, name) for one in own]) for name in ("designed", "first"))
            print(f"{arm:<12} {len(own):>3} seeds, {designed:.3g} throws designed, the first is number {first:.3g}")
    rows: list[Row] = [{"rule": one.arm, "seed": one.seed, **one.results} for one in runs]
    print_summaries(rows, ("rule",), MEASURES, ("exact",))


def main() -> int:
    """Runs the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--throws", type=int, default=12)
    parser.add_argument("--arms", nargs="+", choices=tuple(ARMS), default=list(ARMS))
    parser.add_argument("--save", type=Path)
    arguments = parser.parse_args()
    recorded = recorded_bench()
    if recorded is None:
        return 1
    bench = recorded.on(calibration_of(recorded.training, recorded.body.polytope))
    bench = replace(bench, held_out=bench.training)
    saved = SavedRows(arguments.save)
    runs = [Run(**row) for row in saved.rows]
    for seed in range(arguments.seeds):
        for arm in arguments.arms:
            if any((one.arm, one.seed, one.throws) == (arm, seed, arguments.throws) for one in runs):
                continue
            runs.append(run(arm, seed, arguments.throws, bench))
            print(runs[-1], file=sys.stderr, flush=True)
            saved.add([asdict(runs[-1])])
    print_runs([one for one in runs if one.seed < arguments.seeds and one.throws == arguments.throws])
    return 0


if __name__ == "__main__":
    sys.exit(main())
