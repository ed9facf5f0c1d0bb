"""Solves the inner problem in plain torch, by a method of its own: the reference that the kernel is tested against.

The slack becomes a variable t >= 0, w_s min(0, r)^2 = min over t of w_s (r - t)^2, so that the objective is a strictly convex
quadratic in x = (l, t) over a product of cones. Its minimum is the zero of x - proj(x - step gradient), found by a semismooth
Newton method that descends on the forward-backward envelope, whose Newton direction is that of the residual (Stella, Themelis,
Patrinos: Forward-backward quasi-Newton methods for nonsmooth optimization problems, 2017). Each contact is first measured in a
unit of its own, which leaves its cone a cone.
"""

from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from contact_curation.solver.certificate import EDGES, FACET_NORMALS, natural_residuals
from contact_curation.solver.cone_problem import (
    DEFAULT_TOLERANCE,
    Cone,
    ConeProblems,
    ConeSolutions,
    SolveStatus,
    quadratic_form,
)
from test.solver.central_path import follow_central_path

MAX_ITERATIONS = 30
"""Newton steps at a time."""

PROXIMAL_WEIGHTS = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7)
"""Of |x - before|^2 / 2: they keep Newton's method near the end of the central path while it finds the last digits."""

CHUNK = 4096
"""Problems solved at a time."""

STEP_SHARE = 0.95
"""Of the inverse of the largest curvature; under 1, so that the envelope has the minimum of the problem."""

CLOSED = 1e-12
"""A problem is done when its scaled residual is this small."""

ARMIJO = 1e-4
ROUNDING = 1e-15
HALVINGS = 12


class _Quadratic(NamedTuple):
    """x^T H x / 2 + q^T x, scaled: H (B, n, n), q (B, n), the step (B, 1) and the units (B, n) of x; n = 4K."""

    hessian: Tensor
    linear: Tensor
    step: Tensor
    units: Tensor

    def rows(self, chosen: Tensor) -> "_Quadratic":
        return _Quadratic(*(value[chosen] for value in self))

    def near(self, x: Tensor, weight: float) -> "_Quadratic":
        """The same with weight |. - x|^2 / 2 added."""
        identity = torch.eye(x.shape[1], dtype=x.dtype, device=x.device)
        step = self.step / (1.0 + weight * self.step)
        return _Quadratic(self.hessian + weight * identity, self.linear - weight * x, step, self.units)


class _Foot(NamedTuple):
    """A projection (B, n) and its generalised Jacobian (B, n, n)."""

    point: Tensor
    jacobian: Tensor


def solve_in_torch(
    problems: ConeProblems,
    tolerance: float = DEFAULT_TOLERANCE,
    max_iterations: int = MAX_ITERATIONS,
    device: str | torch.device = "cpu",
) -> ConeSolutions:
    """The impulses of B problems; one that is not finite does not disturb its neighbours.

    Args:
        problems: what to solve.
        tolerance: largest natural residual that counts as solved.
        max_iterations: Newton steps before the central path is asked for help.
        device: where torch works, in float64.
    """
    impulses = np.empty((problems.batch, problems.contacts, 3))
    residuals = np.empty(problems.batch)
    iterations = np.empty(problems.batch, np.int32)
    for first in range(0, problems.batch, CHUNK):
        piece = slice(first, first + CHUNK)
        own = problems.rows(piece)
        found, steps = _minimise(_quadratic(own, device), own.cone, max_iterations)
        impulses[piece] = found[:, : 3 * own.contacts].reshape(-1, own.contacts, 3).cpu().numpy()
        residuals[piece] = natural_residuals(own, impulses[piece])
        iterations[piece] = steps.cpu().numpy()
    status = np.where(residuals <= tolerance, SolveStatus.SOLVED, SolveStatus.NOT_SOLVED)
    status = np.where(np.isfinite(residuals), status, SolveStatus.NOT_FINITE)
    return ConeSolutions(impulses, residuals, status.astype(np.int32), iterations)


@np.errstate(invalid="ignore", over="ignore")  # what is not finite becomes a status
def _quadratic(problems: ConeProblems, device: str | torch.device) -> _Quadratic:
    form = [torch.as_tensor(value, device=device) for value in quadratic_form(problems)]
    motion, target, blocks, slack_rows, offsets = form
    weights, size, contacts = problems.weights, 3 * problems.contacts, problems.contacts
    hessian = motion.new_zeros(problems.batch, size + contacts, size + contacts)
    stiff = weights.match * motion.mT @ motion + weights.penetration * slack_rows.mT @ slack_rows
    stiff.diagonal(dim1=-2, dim2=-1).add_(weights.regularization)
    for i in range(contacts):
        stiff[:, 3 * i : 3 * i + 3, 3 * i : 3 * i + 3] += blocks[:, i]
    hessian[:, :size, :size] = stiff
    hessian[:, size:, :size] = -weights.penetration * slack_rows
    hessian[:, :size, size:] = -weights.penetration * slack_rows.mT
    hessian[:, size:, size:] = weights.penetration * torch.eye(contacts, dtype=motion.dtype, device=device)
    pull = weights.penetration * (slack_rows.mT @ offsets[..., None]) - weights.match * (motion.mT @ target[..., None])
    linear = torch.cat([pull[..., 0], -weights.penetration * offsets], dim=1)
    return _scaled(2.0 * hessian, 2.0 * linear, contacts)


def _scaled(hessian: Tensor, linear: Tensor, contacts: int) -> _Quadratic:
    """One unit for the three components of a contact, in which none is steeper than 1."""
    diagonal = hessian.diagonal(dim1=-2, dim2=-1)
    steepest = diagonal[:, : 3 * contacts].reshape(-1, contacts, 3).amax(dim=-1)
    units = torch.cat([steepest.repeat_interleave(3, dim=1), diagonal[:, 3 * contacts :]], dim=1).rsqrt()
    scaled = hessian * units[:, :, None] * units[:, None, :]
    step = STEP_SHARE / scaled.abs().sum(dim=-1).amax(dim=-1, keepdim=True)
    return _Quadratic(scaled, linear * units, step, units)


def _minimise(given: _Quadratic, cone: Cone, max_iterations: int) -> tuple[Tensor, Tensor]:
    """Minimisers (B, n) in the problem's own units, and Newton steps (B,) taken.

    The few problems in which Newton's method creeps along a curved rim start again from near the end of the central path.
    """
    x, steps, finished = _descend(given, cone, torch.zeros_like(given.linear), max_iterations)
    left = torch.nonzero(~finished)[:, 0]
    if len(left):
        hard = given.rows(left)
        nearer, taken = follow_central_path(hard.hessian, hard.linear, cone)
        steps[left] += taken
        for weight in PROXIMAL_WEIGHTS:
            nearer, more, _ = _descend(hard.near(nearer, weight), cone, nearer, max_iterations)
            steps[left] += more
        x[left] = nearer
    # The projection of the last forward step is in the cone to the last digit.
    return _project_all(_forward(given, x), cone).point * given.units, steps


def _descend(given: _Quadratic, cone: Cone, start: Tensor, max_iterations: int) -> tuple[Tensor, Tensor, Tensor]:
    """Newton's method from `start` (B, n): minimisers (B, n), steps (B,), and whether it ended (B,), NaN included."""
    x = start.clone()
    steps = torch.zeros(len(x), dtype=torch.int32, device=x.device)
    working = torch.arange(len(x), device=x.device)
    for _ in range(max_iterations):
        now = given.rows(working)
        foot = _project_all(_forward(now, x[working]), cone)
        miss = x[working] - foot.point
        open_rows = miss.abs().amax(dim=1) > CLOSED  # false where it is not a number
        working, now, miss = working[open_rows], now.rows(open_rows), miss[open_rows]
        if not len(working):
            break
        x[working] = _search(now, cone, x[working], _newton(now, foot.jacobian[open_rows], miss), miss)
        steps[working] += 1
    finished = torch.ones(len(x), dtype=torch.bool, device=x.device)
    finished[working] = False
    return x, steps, finished


def _forward(of: _Quadratic, x: Tensor) -> Tensor:
    return x - of.step * ((of.hessian @ x[..., None])[..., 0] + of.linear)


def _newton(of: _Quadratic, jacobian: Tensor, miss: Tensor) -> Tensor:
    """The direction that solves (I - V (I - step H)) d = -miss."""
    identity = torch.eye(miss.shape[1], dtype=miss.dtype, device=miss.device)
    matrix = identity - jacobian @ (identity - of.step[..., None] * of.hessian)
    direction: Tensor = torch.linalg.solve_ex(matrix, -miss)[0]
    return direction


def _envelope(of: _Quadratic, cone: Cone, x: Tensor) -> Tensor:
    """Forward-backward envelope (B,): min over z in K of f(x) + f'(x) (z - x) + |z - x|^2 / (2 step)."""
    bent = (of.hessian @ x[..., None])[..., 0]
    gradient = bent + of.linear
    apart = _project_all(x - of.step * gradient, cone).point - x
    value = (x * (0.5 * bent + of.linear)).sum(dim=1)
    return value + (gradient * apart).sum(dim=1) + 0.5 * (apart * apart).sum(dim=1) / of.step[:, 0]


def _search(of: _Quadratic, cone: Cone, x: Tensor, direction: Tensor, miss: Tensor) -> Tensor:
    """Where x (B, n) moves: the first of the halved steps along Newton's direction that lowers the envelope enough."""
    slope = ((miss - of.step * (of.hessian @ miss[..., None])[..., 0]) * direction).sum(dim=1) / of.step[:, 0]
    start = _envelope(of, cone, x)
    rounding = ROUNDING * (1.0 + start.abs())
    found, open_rows, length = x - miss, torch.arange(len(x), device=x.device), 1.0
    for _ in range(HALVINGS):
        trial = x[open_rows] + length * direction[open_rows]
        wanted = start[open_rows] + ARMIJO * length * slope[open_rows] + rounding[open_rows]
        reached = _envelope(of.rows(open_rows), cone, trial) <= wanted
        found[open_rows[reached]] = trial[reached]
        open_rows = open_rows[~reached]
        if not len(open_rows):
            break
        length *= 0.5
    return found


def _project_all(x: Tensor, cone: Cone) -> _Foot:
    """Projects the impulses on their cones and the slacks on t >= 0."""
    contacts = x.shape[1] // 4
    size = 3 * contacts
    projection = _project_circular if cone is Cone.CIRCULAR else _project_polyhedral
    points, jacobians = projection(x[:, :size].reshape(-1, contacts, 3))
    slack = x[:, size:].clamp(min=0.0)
    whole = x.new_zeros(len(x), 4 * contacts, 4 * contacts)
    for i in range(contacts):
        whole[:, 3 * i : 3 * i + 3, 3 * i : 3 * i + 3] = jacobians[:, i]
    whole.diagonal(dim1=-2, dim2=-1)[:, size:] = (x[:, size:] > 0.0).to(x.dtype)
    return _Foot(torch.cat([points.reshape(-1, size), slack], dim=1), whole)


def _project_circular(points: Tensor) -> tuple[Tensor, Tensor]:
    normal, tangent = points[..., :1], points[..., 1:]
    radius = tangent.norm(dim=-1, keepdim=True)
    across = tangent / torch.where(radius > 0.0, radius, 1.0)
    inside, polar = radius <= normal, radius <= -normal
    along = 0.5 * (normal + radius)
    ray = torch.cat([torch.ones_like(radius), across], dim=-1)
    foot = torch.where(inside, points, torch.where(polar, torch.zeros_like(points), along * ray))
    identity = torch.eye(3, dtype=points.dtype, device=points.device)
    rim = torch.cat([torch.zeros_like(radius), -across[..., 1:], across[..., :1]], dim=-1)
    bend = (along / torch.where(radius > 0.0, radius, 1.0))[..., None]
    rolled = 0.5 * ray[..., :, None] * ray[..., None, :] + bend * rim[..., :, None] * rim[..., None, :]
    jacobian = torch.where(inside[..., None], identity, torch.where(polar[..., None], 0.0 * identity, rolled))
    return foot, jacobian


def _project_polyhedral(points: Tensor) -> tuple[Tensor, Tensor]:
    normals, edges = (torch.as_tensor(rows, dtype=points.dtype, device=points.device) for rows in (FACET_NORMALS, EDGES))
    identity = torch.eye(3, dtype=points.dtype, device=points.device)
    units = edges / edges[0].norm()
    maps = torch.cat(
        [
            identity[None],
            identity - 0.5 * normals[:, :, None] * normals[:, None, :],
            units[:, :, None] * units[:, None, :],
            torch.zeros_like(identity)[None],
        ]
    )  # (18, 3, 3): the point itself, its feet on facets and edges, the apex
    feet = torch.einsum("fij,...j->...fi", maps, points)
    slack = 1e-12 * points.norm(dim=-1)[..., None]
    outside = (feet @ normals.T).amin(dim=-1) < -slack
    distance = torch.where(outside, torch.inf, (feet - points[..., None, :]).square().sum(dim=-1))
    chosen = distance.argmin(dim=-1)
    foot = torch.gather(feet, -2, chosen[..., None, None].expand(*chosen.shape, 1, 3))[..., 0, :]
    return foot, maps[chosen]
