"""Answers the problems by ContactNets' published code.

    python runners/run_contactnets.py CLONE problems/*.json > answers.json

CLONE is a clone of https://github.com/DAIRLab/contact-nets at commit 3357ba1 or later, in whose environment this runs
(Python 3.7 is enough). Body, ground, contacts, loss and the solver of its inner problem are theirs; what this file adds is a
theta and an inertia that are given instead of drawn. They ask OSQP for 1e-6, but the copy of osqpth in their `lib` does not
pass that on: OSQP stops at its own 1e-3, and half of the answers have three digits. Their loss has eight facets, and neither
a pivot nor a height of the ground, so that problems with the circular cone or with either are left out. It has no
regularisation (epsilon of section 6 is zero), which changes losses by less than 1e-5, and it cannot say an impulse's share
among contacts that stick.
"""

from __future__ import annotations

import json
import sys
from contextlib import redirect_stdout
from typing import Any

sys.path.insert(0, sys.argv[1])

import torch
from contactnets.entity import Dynamic3D, Dynamic3DParams, Ground3D
from contactnets.interaction import PolyGround3D
from contactnets.system import System, SystemParams
from contactnets.train import PolyGround3DSurrogate, SurrogateConfig3D
from contactnets.utils import solver_utils, system_io, utils
from torch import Tensor

torch.set_default_tensor_type(torch.DoubleTensor)

STATE = ("position", "quaternion", "linear_velocity", "angular_velocity")
TERMS = ("complementarity_normal", "complementarity_tangent", "match", "dissipation", "penetration")


class GivenBody(Dynamic3D):
    """Their body with any inertia in place of a multiple of the identity."""

    def __init__(self, mass: float, inertia: list[list[float]]) -> None:
        super().__init__(torch.zeros(1, 7, 1), torch.zeros(1, 6, 1), Dynamic3DParams())
        self.matrix = torch.zeros(6, 6)
        self.matrix[:3, :3] = mass * torch.eye(3)
        self.matrix[3:, 3:] = torch.tensor(inertia)

    def compute_M(self, _: Any) -> Tensor:
        """(B, 6, 6)."""
        return self.matrix.unsqueeze(0).repeat(self.batch_n(), 1, 1)

    def compute_M_i(self, _: Any) -> Tensor:
        """(B, 6, 6)."""
        return torch.inverse(self.matrix).unsqueeze(0).repeat(self.batch_n(), 1, 1)


class GivenContacts(PolyGround3D):
    """Their polytope over a plane with a given theta, as their `StructuredLearnable` has a drawn one."""

    def __init__(self, poly: Dynamic3D, ground: Ground3D, theta: dict[str, Tensor]) -> None:
        super().__init__(poly, ground, theta["vertices_normal"], torch.tensor(1.0))
        self.theta = theta

    def compute_phi(self, configurations: list[Tensor]) -> Tensor:
        """Gaps."""
        theta = self.theta
        found: Tensor = utils.transform_and_project_3d(configurations[0], theta["vertices_normal"], theta["normal"])
        return found

    def compute_Jn(self, configurations: list[Tensor]) -> Tensor:
        """Their slopes by the configuration."""
        theta = self.theta
        found: Tensor = utils.transform_and_project_3d_jacobian(configurations[0], theta["vertices_normal"], theta["normal"])
        return found

    def compute_phi_t(self, configurations: list[Tensor]) -> Tensor:
        """Tangential places."""
        theta = self.theta
        found: Tensor = utils.transform_and_project_3d(configurations[0], theta["vertices_tangent"], theta["tangents"])
        return found

    def compute_Jt_tilde(self, configurations: list[Tensor]) -> Tensor:
        """Their slopes by the configuration."""
        theta = self.theta
        found: Tensor = utils.transform_and_project_3d_jacobian(configurations[0], theta["vertices_tangent"], theta["tangents"])
        return found


def is_theirs(given: dict[str, Any]) -> bool:
    """Whether their loss can pose this problem."""
    theta = given["theta"]
    return given["cone"].get("facets") == 8 and not any(theta["pivot"]) and theta["height"] == 0.0


def answer(given: dict[str, Any]) -> dict[str, Any]:
    """Loss, its terms, score and impulses; nothing if their solver fails."""
    theta = {name: torch.tensor(given["theta"][name]) for name in ("vertices_normal", "vertices_tangent", "tangents")}
    theta["normal"] = torch.tensor([given["theta"]["normal"]])
    for value in theta.values():
        value.requires_grad_(True)
    body, ground = GivenBody(given["mass"], given["inertia"]), Ground3D(1)
    system = System([body, ground], None, SystemParams(torch.tensor(given["dt"]), torch.tensor(given["gravity"])))
    control = torch.zeros(6)
    rows = [torch.cat([*(torch.tensor(given[when][name]) for name in STATE), control]) for when in ("before", "after")]
    system_io.load_system(torch.stack(rows).unsqueeze(0), system)
    weights = given["weights"]
    config = SurrogateConfig3D(
        w_comp_n=weights["complementarity_normal"],
        w_comp_t=weights["complementarity_tangent"],
        w_match=weights["match"],
        w_cone=weights["dissipation"],
        w_penetration_slack=weights["penetration"],
        robust_sqrt=True,
    )
    contacts = GivenContacts(body, ground, theta)
    solutions: list[Tensor] = []
    solve = solver_utils.solve_qp_osqpth

    def remembered(*problem: Tensor) -> Tensor:
        solutions.append(solve(*problem))
        return solutions[-1]

    solver_utils.solve_qp_osqpth = remembered
    try:
        found = PolyGround3DSurrogate(system, contacts, config=config).compute_loss()
    finally:
        solver_utils.solve_qp_osqpth = solve
    if len(found) == 1:
        return {}
    order = ("vertices_normal", "normal", "vertices_tangent", "tangents")
    slopes = torch.autograd.grad(found[1], [theta[name] for name in order])
    k = len(given["theta"]["vertices_normal"])
    variables = solutions[0].detach().flatten()
    impulses = torch.cat([variables[:k, None], variables[k : 3 * k].reshape(k, 2)], dim=1)
    return {
        "impulses": impulses.tolist(),
        "terms": {name: value.item() for name, value in zip(TERMS, found[2:])},
        "loss": found[1].item(),
        "score": [*(-0.5 * torch.cat([slope.flatten() for slope in slopes])).tolist(), None],
    }


def main() -> None:
    """Reads the files named on the command line."""
    problems = []
    for name in sys.argv[2:]:
        with open(name, encoding="utf-8") as file:  # noqa: PTH123
            problems += json.load(file)["problems"]
    with redirect_stdout(sys.stderr):  # their code prints where its solver fails
        answers = {one["id"]: answer(one) for one in problems if is_theirs(one)}
    head = {"format": "contact-loss-answers", "version": 1, "implementation": "ContactNets"}
    json.dump({**head, "answers": {key: value for key, value in answers.items() if value}}, sys.stdout)


if __name__ == "__main__":
    main()
