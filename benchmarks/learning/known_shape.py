"""What it is worth to say how exactly a body's corners are known: fits that begin at the described shape and are held there.

For each seed a third of the tosses judges (experiments/bodies.py), and fits learn from n random ones of the others. The
description has each corner off by 1 or 3 mm in each direction (standard deviation, another draw for each seed). Beside the fit
from the published initialisation, which knows of no description, stand the described body itself (also with 1.5 times its
friction), and fits with `shape_known_to` of 1 or 3 mm: as it is, and once 1 mm where it is 3. Of tosses that a rule selects in
place of random ones, at the described theta, the description is 1 mm off, and is said to be. Two engines judge. Held says how
often the 95 % interval of a coordinate of a corner, and of friction, holds the truth; of the cube that is what its authors
describe.

    python -m benchmarks.learning.known_shape [--bodies cube slab irregular] [--sizes 4 8 16] [--seeds 10] [--save ROWS.jsonl]

With --save rows are kept, and seeds that are there already are not made again.
"""

import sys
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from benchmarks._saved_rows import Row
from benchmarks.learning import mass_centre
from benchmarks.learning.mass_centre import as_described, compare, errors_of
from contact_curation.contact.models.polytope import PolytopeModel
from contact_curation.contact.parameter_form import Form
from contact_curation.experiments.bodies import bench_of
from contact_curation.experiments.cell_run import ONE_THREAD, Bench, select
from contact_curation.experiments.comparison.intervals import nested_interval
from contact_curation.experiments.rules import RULES
from contact_curation.learning.evaluation.bootstrap import BootstrapConfig
from contact_curation.learning.fits.exact_fit import optimum
from contact_curation.learning.training.data import rows_of
from contact_curation.learning.training.protocols import USUAL_STARTS
from contact_curation.learning.uncertainty.parameters import KnownConfig, known
from contact_curation.motion.toss import Toss
from contact_curation.motion.transitions import transitions_of

OTHERS = 8
"""Judging tosses that tell the noise."""

MEASURES = ("position", "rotation", "mujoco_position", "mujoco_rotation", "vertices_mm", "friction")
HELD = ("vertices_held", "friction_held")


class Arm(NamedTuple):
    """What is off and what is said of a description [mm]; None for the published initialisation, or for no fit.

    Its friction is so many times that of the body.
    """

    name: str
    off: float
    said: float | None
    rule: str = "random"
    friction: float = 1.0


ARMS = (
    Arm("published", 0.0, None),
    Arm("off 1 mm, said 1", 1.0, 1.0),
    Arm("off 3 mm, said 3", 3.0, 3.0),
    Arm("off 3 mm, said 1", 3.0, 1.0),
    Arm("1 mm, representative", 1.0, 1.0, "representative"),
    Arm("1 mm, longest", 1.0, 1.0, "longest"),
)
DESCRIBED = (
    Arm("described, off 1 mm", 1.0, None),
    Arm("described, off 3 mm", 3.0, None),
    Arm("1 mm, friction x 1.5", 1.0, None, friction=1.5),
)


def described(bench: Bench, off: float, seed: int) -> Bench:
    """The same tosses of a body that is described so far off [mm]."""
    noise = np.random.default_rng([seed, 9]).standard_normal(bench.body.vertices.shape)
    return replace(bench, body=replace(bench.body, vertices=bench.body.vertices + 1e-3 * off * noise))


def fitted(bench: Bench, arm: Arm, tosses: Sequence[Toss], seed: int) -> PolytopeModel:
    """The optimum of some tosses."""
    if arm.said is None:
        return mass_centre.fitted(bench, tosses, seed)
    body = described(bench, arm.off, seed).body
    data = transitions_of(tosses, body.length_scale)
    start = PolytopeModel.as_described(body, Form.RIGID, rows_of(data))
    return optimum(start, data, ONE_THREAD, 0.0, USUAL_STARTS, shape=1e-3 * arm.said / body.length_scale).model


def held(model: PolytopeModel, bench: Bench, arm: Arm, tosses: Sequence[Toss]) -> Row:
    """Shares of the intervals that hold the truth: the body of the bench."""
    data, others = (transitions_of(each, bench.body.length_scale) for each in (tosses, bench.held_out[:OTHERS]))
    shape = None if arm.said is None else 1e-3 * arm.said / bench.body.length_scale
    found = known(model, data, others, KnownConfig(ONE_THREAD).with_shape(shape)).parameters
    truth = 1e3 * bench.body.vertices.ravel()
    corners = [abs(one.value - true) <= one.interval for one, true in zip(found, truth.tolist(), strict=False)]
    friction = next(one for one in found if one.name == "friction")
    holds = abs(friction.value - bench.body.friction) <= friction.interval
    return {"vertices_held": float(np.mean(corners)), "friction_held": float(holds)}


def chosen(bench: Bench, arm: Arm, size: int, seed: int) -> list[Toss]:
    """The tosses that are learned from."""
    if arm.rule == "random":
        places = np.random.default_rng([seed, 7]).permutation(len(bench.training))[:size]
        return [bench.training[place] for place in places]
    model = as_described(described(bench, arm.off, seed).body)
    ids = select(RULES[arm.rule], model, bench.training, size, seed)
    return [toss for toss in bench.training if toss.toss_id in ids]


def row_of(bench: Bench, arm: Arm, size: int, seed: int) -> Row:
    """Of one model; of size 0 that of the described body."""
    if not size:
        body = described(bench, arm.off, seed).body
        return errors_of(as_described(replace(body, friction=arm.friction * body.friction)), bench, np.zeros(3))
    tosses = chosen(bench, arm, size, seed)
    model = fitted(bench, arm, tosses, seed)
    return {**errors_of(model, bench, np.zeros(3)), **held(model, bench, arm, tosses)}


def rows(name: str, sizes: Sequence[int], seed: int) -> list[Row]:
    """Of a seed: the described bodies, and fits of each size."""
    bench, made = bench_of(name, seed), list[Row]()
    for size, arm in [(0, arm) for arm in DESCRIBED] + [(size, arm) for size in sizes for arm in ARMS]:
        key = {"body": name, "size": size, "seed": seed, "arm": arm.name}
        made.append({**key, **row_of(bench, arm, size, seed)})
    return made


def print_table(rows: Sequence[Row]) -> None:
    """Means over seeds, and differences to the first arm with 95 % intervals over seeds and judging tosses."""
    for name, size in dict.fromkeys((row["body"], row["size"]) for row in rows):
        own = [row for row in rows if (row["body"], row["size"]) == (name, size)]
        print(f"{name}, {f'fit to {size}' if size else 'no fit'}, {len({row['seed'] for row in own})} seeds")
        arms = list(dict.fromkeys(row["arm"] for row in own))
        by_arm = {arm: sorted((row for row in own if row["arm"] == arm), key=lambda row: row["seed"]) for arm in arms}
        for arm in arms:
            others = [by_arm[arm], by_arm[arms[0]]] if arm != arms[0] else [by_arm[arm]]
            shown = "  ".join(_said(measure, *others) for measure in MEASURES)
            shares = [(key, np.mean([row[key] for row in by_arm[arm]])) for key in HELD if key in by_arm[arm][0]]
            shown += "".join(f"  {key} {share:.2f}" for key, share in shares)
            print(f"  {arm:22}{shown}")


def _said(measure: str, after: Sequence[Row], before: Sequence[Row] | None = None) -> str:
    mean = float(np.mean([np.mean(row[measure]) for row in after]))
    if before is None or measure not in MEASURES[:4]:
        return f"{measure} {mean:.3g}"
    off = [np.subtract(row[measure], other[measure]) for row, other in zip(after, before, strict=True)]
    interval = nested_interval(off, BootstrapConfig())
    return f"{measure} {mean:.3g} ({interval.low:+.1f}, {interval.high:+.1f})"


if __name__ == "__main__":
    sys.exit(compare(rows, print_table, ["cube", "slab", "irregular"], [4, 8, 16]))
