"""Answers the problems by contact_curation.

python runners/run_contact_curation.py problems/*.json > answers.json
"""

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np

from contact_curation.contact.body import CONTACTNETS_CUBE, Body
from contact_curation.contact.evaluation import Cone, Estimator, evaluate, fisher_sums
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.loss_config import LossConfig
from contact_curation.contact.torch_contacts import Frames, Theta, contacts_of
from contact_curation.version import __version__

STATE = ("position", "quaternion", "linear_velocity", "angular_velocity")


def answer(given: dict[str, Any]) -> dict[str, Any]:
    """All quantities of a problem; none if its impulses carry no certificate."""
    theta = {name: np.array(value) for name, value in given["theta"].items()}
    geometry = ContactGeometry(**{**theta, "height": given["theta"]["height"]})
    body = Body("body", CONTACTNETS_CUBE.vertices, given["mass"], np.array(given["inertia"]), 0.0, 1.0, given["gravity"])
    before, after = (np.concatenate([given[when][name] for name in STATE])[None] for when in ("before", "after"))
    rows = before, after, given["dt"]
    config = LossConfig(**given["weights"], cone=Cone(given["cone"]["kind"]))
    found = evaluate(geometry, body, *rows, config)
    if not found.solved.all():
        return {}
    fisher = fisher_sums(geometry, body, *rows, [0, 1], Estimator.GAUSS_NEWTON, config=config).fishers[0]
    frames = Frames.of(body, before, after, [given["dt"]])
    contacts = contacts_of(Theta.of(geometry), frames)
    names = ("match", "complementarity_normal", "complementarity_tangent", "dissipation", "penetration")
    jacobians = contacts.jacobians[0].numpy()
    loss, squares = float(found.losses[0]), float(np.square(found.impulses).sum())
    return {
        "gaps": contacts.gaps[0].tolist(),
        "next_gaps": contacts.gaps_next[0].tolist(),
        "normal_jacobians": jacobians[:, 0].tolist(),
        "tangent_jacobians": jacobians[:, 1:].tolist(),
        "free_velocity": frames.free_velocities[0].tolist(),
        "slips": (jacobians[:, 1:] @ after[0, 7:]).tolist(),
        "impulses": found.impulses[0].tolist(),
        "terms": dict(zip(names, found.terms[0].tolist())),
        "loss": loss,
        "objective": loss + config.regularization * squares,
        "score": found.scores[0].tolist(),
        "gauss_newton": fisher.tolist(),
    }


def main() -> None:
    """Reads the files named on the command line."""
    problems = [one for name in sys.argv[1:] for one in json.loads(Path(name).read_text(encoding="utf-8"))["problems"]]
    answers = {one["id"]: answer(one) for one in problems}
    head = {"format": "contact-loss-answers", "version": 1, "implementation": f"contact_curation {__version__}"}
    json.dump({**head, "answers": answers}, sys.stdout)


if __name__ == "__main__":
    main()
