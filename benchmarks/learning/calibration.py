"""Is what is said to be known of the cube true? The sandwich and both Cramer-Rao bounds beside a bootstrap over real tosses.

The polytope is fitted to so many random tosses of those below id 400 without a held-out duplicate, from the published random
initialisation, and again to as many drawn from them with replacement, for every resample. A ratio of 1 means that a deviation
is as large as it was said to be (method.md 6, check 16: 0.7 to 1.4 for friction and for at least 6 of 8 vertex heights).
sigma^2 is that of tosses 400 to 569. The tosses are found through CONTACTNETS_DATA.

    python -m benchmarks.learning.calibration [--tosses N] [--resamples N] [--seed N] [--json]
"""

import argparse
import json
import sys
import time
from typing import Any

import numpy as np
import torch

from benchmarks._data import contactnets_folder, training_and_held_out
from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.contact.models.polytope import PolytopeModel
from contact_curation.contact.models.registry import model_class
from contact_curation.contact.parameter_form import Form
from contact_curation.experiments.coverage import HIGH, LOW, SAID, count_within, deviations_said, kind_of
from contact_curation.geometry.quaternions import Array
from contact_curation.learning.evaluation.evaluation import EvaluationConfig, evaluate_model, shape_errors
from contact_curation.learning.evaluation.motion_errors import MotionErrors
from contact_curation.learning.fits.polytope_fit import PolytopeFit, fit_polytope
from contact_curation.learning.training.data import rows_of
from contact_curation.learning.uncertainty.coverage import Calibration, calibration
from contact_curation.learning.uncertainty.parameters import KnownConfig
from contact_curation.motion.transitions import transitions_of

GROUPS = {
    "friction": ("friction",),
    "vertex heights": ("vertex heights",),
    "vertices of the gap": ("vertices_normal", "vertex heights"),
    "vertices of friction": ("vertices_tangent",),
    "tilt": ("tilt",),
    "height": ("height",),
}
"""Kinds of parameters (`experiments.coverage`) that are shown together."""


def main() -> int:
    """Prints a table, or JSON."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--tosses", type=int, default=64, help="that are fitted to (default 64)")
    parser.add_argument("--resamples", type=int, default=48, help="of the bootstrap (default 48)")
    parser.add_argument("--seed", type=int, default=0, help="of the choice of tosses, the initialisation and the bootstrap")
    parser.add_argument("--json", action="store_true", help="print JSON instead of a table")
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    folder = contactnets_folder()
    if folder is None:
        return 0
    parts = training_and_held_out(folder)
    if not 1 <= arguments.tosses <= len(parts.training):
        parser.error(f"--tosses {arguments.tosses}: expected 1 to {len(parts.training)}, which are there to be fitted to")
    rng = np.random.default_rng(arguments.seed)
    chosen = sorted(rng.choice(len(parts.training), arguments.tosses, replace=False).tolist())
    scale = CONTACTNETS_CUBE.length_scale
    rows = transitions_of([parts.training[k] for k in chosen], scale)
    others = transitions_of(parts.held_out, scale)
    begin = time.perf_counter()
    start = model_class("polytope").initial(CONTACTNETS_CUBE, Form.PHYSICAL, rows_of(rows), rng)
    assert isinstance(start, PolytopeModel)
    fit = fit_polytope(start, rows)
    fitted = time.perf_counter()
    found = calibration(fit.model, rows, others, arguments.resamples, arguments.seed, KnownConfig())
    seconds = fitted - begin, time.perf_counter() - fitted
    errors = evaluate_model(fit.model, parts.held_out, EvaluationConfig()).errors
    if arguments.json:
        print(json.dumps(as_json(fit, found, seconds, errors), indent=2))
    else:
        print_table(fit, found, seconds, errors)
    return 0


def said(found: Calibration) -> dict[str, Array]:
    """By name, (P,) standard deviations that are said; the second is the sandwich about the loss's whole Hessian."""
    sandwich, cramer_rao, naive = (deviations_said(found, name) for name in SAID)
    return {"sandwich": sandwich, "whole Hessian": found.whole_hessian, "Cramer-Rao": cramer_rao, "naive": naive}


def as_json(fit: PolytopeFit, found: Calibration, seconds: tuple[float, float], errors: MotionErrors) -> dict[str, Any]:
    """Everything."""
    rows = [
        {**parameter._asdict(), "bootstrap": deviation, "whole_hessian": whole}
        for parameter, deviation, whole in zip(
            found.known.parameters, found.bootstrap.tolist(), found.whole_hessian.tolist(), strict=True
        )
    ]
    return {
        "tosses": found.known.tosses,
        "resamples": found.resamples,
        "converged": found.converged,
        "noise_variance": found.known.noise_variance,
        "fit_steps": fit.steps,
        "fit_seconds": seconds[0],
        "calibration_seconds": seconds[1],
        "held_out_position_mean": float(errors.position.mean()),
        "held_out_rotation_mean": float(errors.rotation.mean()),
        "parameters": rows,
    }


def print_table(fit: PolytopeFit, found: Calibration, seconds: tuple[float, float], errors: MotionErrors) -> None:
    """For people."""
    shape = shape_errors(fit.model)
    known = found.known
    print(f"{known.tosses} tosses: fitted in {fit.steps} steps, {seconds[0]:.1f} s, converged: {fit.converged}")
    if shape:
        print(f"vertices {shape.vertex_rms_mm:.2f} mm RMS from the cube as described, friction {shape.friction:.4f}")
    position, rotation = ((float(np.median(each)), float(each.mean())) for each in (errors.position, errors.rotation))
    print(
        "tosses from 400 on, median (mean): " + f"position {position[0]:.1f} ({position[1]:.1f}) % of the width, "
        f"rotation {rotation[0]:.1f} ({rotation[1]:.1f}) degrees"
    )
    resampled = f"{found.converged} of {found.resamples} resampled fits converged, {seconds[1]:.0f} s"
    print(f"sigma^2 {known.noise_variance:.4g}; {resampled}\n")
    deviations = said(found)
    print("median standard deviation")
    print(f"{'':26} {'bootstrap':>14}" + "".join(f"{name:>16}" for name in deviations))
    for name, chosen, unit in groups(found):
        cells = "".join(f"{np.median(column[chosen]):15.4f} " for column in (found.bootstrap, *deviations.values()))
        print(f"{f'{name} [{unit or 1}]':26}{cells}")
    print(f"\nbootstrap over what was said: median, and how many of them are within {LOW} to {HIGH}")
    print(f"{'':26} {'':14}" + "".join(f"{name:>16}" for name in deviations))
    for name, chosen, _ in groups(found):
        cells = "".join(ratio_cell((found.bootstrap / column)[chosen]) for column in deviations.values())
        print(f"{name:26} {'':14}{cells}")


def groups(found: Calibration) -> list[tuple[str, list[int], str]]:
    """Name, places of its parameters, and unit of every group."""
    parameters = found.known.parameters
    places = {name: [k for k, one in enumerate(parameters) if kind_of(one.name) in kinds] for name, kinds in GROUPS.items()}
    return [(name, chosen, parameters[chosen[0]].unit) for name, chosen in places.items()]


def ratio_cell(ratios: Array) -> str:
    """The median, and how many are as they should be."""
    return f"{f'{np.median(ratios):.2f} ({count_within(ratios)} of {ratios.size})':>16}"


if __name__ == "__main__":
    sys.exit(main())
