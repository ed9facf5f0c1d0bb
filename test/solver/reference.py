"""The inner problem by Clarabel, an interior point solver of others, in its own standard form (method.md 4.1, 6.2)."""

import clarabel
import numpy as np
from scipy import sparse

from contact_curation.solver.certificate import FACET_NORMALS
from contact_curation.solver.cone_problem import Array, Cone, ConeProblems, quadratic_form

TIGHT = 1e-9
"""Tighter ones make Clarabel give up with a wrong answer (method.md 4.1)."""


def clarabel_impulses(problems: ConeProblems, tolerance: float = TIGHT) -> Array:
    """Impulses (B, K, 3); fails where Clarabel does not say Solved."""
    return np.array([_solve(problems.rows(slice(n, n + 1)), tolerance) for n in range(problems.batch)])


def _solve(problem: ConeProblems, tolerance: float) -> Array:
    """Variables: impulses, and u >= max(0, -predicted gap), which costs w_s u^2."""
    form, weights, contacts = quadratic_form(problem), problem.weights, problem.contacts
    motion, target, slack_rows, offsets = form.motion[0], form.target[0], form.slack_rows[0], form.slack_offsets[0]
    size = 3 * contacts
    curvature = np.zeros((size + contacts, size + contacts))
    curvature[:size, :size] = weights.match * motion.T @ motion + weights.regularization * np.eye(size)
    for i in range(contacts):
        curvature[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] += form.blocks[0, i]
    curvature[size:, size:] = weights.penetration * np.eye(contacts)
    linear = np.concatenate([-2.0 * weights.match * motion.T @ target, np.zeros(contacts)])
    above = np.hstack([-slack_rows, -np.eye(contacts)])
    positive = np.hstack([np.zeros((contacts, size)), -np.eye(contacts)])
    in_cone = -np.eye(size) if problem.cone is Cone.CIRCULAR else -np.kron(np.eye(contacts), FACET_NORMALS)
    rows = np.vstack([above, positive, np.hstack([in_cone, np.zeros((len(in_cone), contacts))])])
    limits = np.concatenate([offsets, np.zeros(contacts + len(in_cone))])
    cones = [clarabel.NonnegativeConeT(2 * contacts)]
    if problem.cone is Cone.CIRCULAR:
        cones += [clarabel.SecondOrderConeT(3)] * contacts
    else:
        cones += [clarabel.NonnegativeConeT(len(in_cone))]
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = tolerance
    upper = sparse.csc_matrix(np.triu(2.0 * curvature))
    solution = clarabel.DefaultSolver(upper, linear, sparse.csc_matrix(rows), limits, cones, settings).solve()
    assert solution.status == clarabel.SolverStatus.Solved, f"the reference itself failed: {solution.status}"
    return np.array(solution.x[:size]).reshape(contacts, 3)
