"""Whether bodies that bounce predict tosses better than bodies that do not: rollouts with Newton's law of restitution.

A contact that closes within the step shall part with e times the speed that it came with, J v' + gap / dt >= -e J v, so that
e = 0 is the model as it is (method.md 4.2). For the cube as described, the fit to all training tosses, and that fit with
friction at the vertices of the gaps; judged by tosses below 400 alone, corrected by their rig calibration. The tosses are
found through CONTACTNETS_DATA.

    python -m benchmarks.learning.restitution [--slowest SPEED]
"""

import argparse
import sys

import numpy as np
import torch

from benchmarks.selection.rules import recorded_bench
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.models.polytope import PolytopeModel
from contact_curation.contact.parameter_form import Form
from contact_curation.contact.time_step import step_at_contacts
from contact_curation.experiments.cell_run import Bench
from contact_curation.geometry import quaternions
from contact_curation.geometry.quaternions import Array
from contact_curation.learning.evaluation.motion_errors import MotionErrors, motion_errors
from contact_curation.motion.calibration import calibration_of
from contact_curation.motion.transitions import states_of

RESTITUTIONS = (0.0, 0.05, 0.1, 0.125, 0.15, 0.2, 0.3)
"""The body's file says 0.125 (method.md 1.0)."""


def main() -> int:
    """Prints a table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--slowest", type=float, default=0.0, help="contacts that close slower than this do not bounce [m/s]")
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    recorded = recorded_bench()
    if recorded is None:
        return 0
    bench = recorded.on(calibration_of(recorded.training, recorded.body.polytope))
    described = PolytopeModel(ContactGeometry.of_body(bench.body), bench.body, Form.PHYSICAL)
    fitted = PolytopeModel(bench.reference, bench.body, Form.PHYSICAL)
    models = {"described": described, "fitted": fitted, "fitted, friction at the gaps": fitted.with_shared_vertices()}
    print(f"{len(bench.training)} tosses\n\n{'restitution':12}" + "".join(f"{name:>30}" for name in models))
    print(" " * 12 + f"{'position %':>18}{'rotation':>12}" * len(models))
    for restitution in RESTITUTIONS:
        errors = [bounced(model, bench, restitution, arguments.slowest) for model in models.values()]
        print(f"{restitution:<12g}" + "".join(f"{each.position.mean():18.2f}{each.rotation.mean():12.2f}" for each in errors))
    return 0


def bounced(model: PolytopeModel, bench: Bench, restitution: float, slowest: float) -> MotionErrors:
    """Errors of the training tosses' motions from their first states on; `slowest` [m/s]."""
    tosses = sorted(bench.training, key=lambda toss: -toss.frames)
    measured = [states_of(toss, model.body.length_scale) for toss in tosses]
    lengths, periods = np.array([toss.frames for toss in tosses]), np.array([toss.frame_period for toss in tosses])
    starts = np.concatenate([[0], np.cumsum(lengths)])
    predicted, states, impulses = np.concatenate(measured), np.stack([each[0] for each in measured]), None
    for frame in range(1, lengths.max()):
        running = np.count_nonzero(lengths > frame)
        states, impulses = states[:running], None if impulses is None else impulses[:running]
        gaps, jacobians = contacts_at(model, states)
        speeds = (jacobians[:, :, 0] @ states[:, 7:13, np.newaxis])[..., 0]
        dt = periods[:running, np.newaxis]
        bounces = (gaps + dt * speeds < 0.0) & (speeds < -slowest / model.body.length_scale)
        steps = step_at_contacts(
            model.body, states, dt[:, 0], gaps + np.where(bounces, restitution * dt * speeds, 0.0), jacobians, impulses
        )
        states, impulses = steps.states, steps.impulses
        predicted[starts[:running] + frame] = states
    return motion_errors(predicted, np.concatenate(measured), starts, model.body)


def contacts_at(model: PolytopeModel, states: Array) -> tuple[Array, Array]:
    """Gaps (N, K) and Jacobians (N, K, 3, 6) at states (N, 13)."""
    rotations = torch.as_tensor(quaternions.to_matrix(states[:, 3:7]))
    with torch.no_grad():
        gaps, jacobians = model.contacts_at(rotations, torch.as_tensor(states[:, :3]))
    return gaps.numpy(), jacobians.numpy()


if __name__ == "__main__":
    sys.exit(main())
