"""What a learned polytope predicts of held-out tosses, by two engines: our rollouts and MuJoCo.

MuJoCo moves the hull of the vertices with the friction, without a restitution. Both begin at the first measured state.
"""

from dataclasses import replace

import numpy as np

from contact_curation.contact.models.polytope import PolytopeModel
from contact_curation.experiments.cell_run import ONE_THREAD, Bench, Row
from contact_curation.geometry.quaternions import Array
from contact_curation.learning.evaluation.evaluation import EvaluationConfig, predicted_motions, shape_errors
from contact_curation.learning.evaluation.motion_errors import MotionErrors, motion_errors
from contact_curation.motion.transitions import states_of

JUDGES = ("ours", "mujoco")
MEASURES = tuple(f"{judge}_{name}" for judge in JUDGES for name in ("position", "rotation"))


def judged_by_engines(model: PolytopeModel, bench: Bench, contact: tuple[float, float] | None = None) -> Row:
    """Shape, friction, and for each of MEASURES the values of all judging tosses, joined by blanks; NaN where not finite.

    Args:
        model: what is judged.
        bench: its held-out tosses judge.
        contact: time constant [s] and damping ratio of MuJoCo's contacts; by default those of all simulated tosses.
    """
    shape = shape_errors(model)
    assert shape is not None  # of a polytope
    ours = predicted_motions(model, bench.held_out, EvaluationConfig(loss=ONE_THREAD)).errors
    row: Row = {"vertices": shape.vertex_rms_mm, "friction": shape.friction}
    for judge, errors in zip(JUDGES, (ours, _in_mujoco(model, bench, contact)), strict=True):
        for name in ("position", "rotation"):
            row[f"{judge}_{name}"] = " ".join(f"{value:.5g}" for value in getattr(errors, name))
    return row


def _in_mujoco(model: PolytopeModel, bench: Bench, contact: tuple[float, float] | None) -> MotionErrors:
    """The errors of MuJoCo's motions of the hull of the learned vertices."""
    from contact_curation.simulation.world import DEFAULT_WORLD, free_motion  # MuJoCo takes a second to import

    scale = bench.body.length_scale
    world = replace(DEFAULT_WORLD, contact_time=contact[0], damping_ratio=contact[1]) if contact else DEFAULT_WORLD
    body = model.geometry().as_body(bench.body)
    measured = [states_of(toss, 1.0) for toss in bench.held_out]
    moved = [free_motion(body, each[0], len(each), toss.frame_period, world) for each, toss in zip(measured, bench.held_out)]
    starts = np.concatenate([[0], np.cumsum([len(each) for each in measured])])
    predicted, seen = (np.concatenate(states) / _units(scale) for states in (moved, measured))
    return motion_errors(predicted, seen, starts, bench.body)


def _units(scale: float) -> Array:
    """(13,) what states in SI units are divided by to be in characteristic lengths."""
    return np.array([scale] * 3 + [1.0] * 4 + [scale] * 3 + [1.0] * 3)
