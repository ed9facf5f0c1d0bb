"""Inner problems with answers by hand, and random ones, for every solver to try."""

from dataclasses import dataclass, replace

import numpy as np

from contact_curation.solver.cone_problem import Array, ConeProblems, ConeWeights

MASS, FRICTION, DT = 0.37, 0.18, 1.0 / 148.0
WEIGHTS = ConeWeights()
LIFT = WEIGHTS.match + WEIGHTS.penetration * DT**2
"""Weight of a missed upward velocity where the predicted gap is negative too."""


@dataclass(frozen=True, eq=False)
class KnownProblem:
    """A single problem and its impulses (K, 3)."""

    name: str
    problems: ConeProblems
    impulses: Array


def point_mass(velocity: Array, following: Array, gap: float = 0.0, gap_next: float = 0.0) -> ConeProblems:
    """One contact under a body that cannot turn: free velocity and measured next velocity (3,)."""
    jacobian = np.zeros((1, 1, 3, 6))
    jacobian[0, 0, 0, 2] = 1.0
    jacobian[0, 0, 1:, :2] = FRICTION * np.eye(2)
    before, after = (np.concatenate([v, np.zeros(3)])[None] for v in (velocity, following))
    inverse_mass = np.diag([1 / MASS] * 3 + [1.0] * 3)
    return ConeProblems(
        jacobian, inverse_mass, np.array([[gap]]), np.array([[gap_next]]), before, after, np.array([DT]), WEIGHTS
    )


def airborne() -> KnownProblem:
    """Nothing pushes where nothing is missing."""
    falling = np.array([3.0, -2.0, -20.0])
    return KnownProblem("airborne", point_mass(falling, falling, gap=2.0, gap_next=1.9), np.zeros((1, 3)))


def pulled_down() -> KnownProblem:
    """The body was faster than it should be: a contact cannot pull."""
    return KnownProblem(
        "pulled down", point_mass(np.array([0.0, 0.0, -1.0]), np.array([0.0, 0.0, -2.0]), gap=2.0), np.zeros((1, 3))
    )


def sticking() -> KnownProblem:
    """The body stops dead: both components stay free, eps takes a little from each."""
    speed, drop = 0.5, 4.0
    normal = LIFT * drop / MASS / (LIFT / MASS**2 + WEIGHTS.regularization)
    per_impulse = FRICTION / MASS
    tangent = WEIGHTS.match * per_impulse * speed / (WEIGHTS.match * per_impulse**2 + WEIGHTS.regularization)
    problems = point_mass(np.array([-speed, 0.0, -drop]), np.zeros(3))
    return KnownProblem("sticking", problems, np.array([[normal, tangent, 0.0]]))


def slipping_stop() -> KnownProblem:
    """It stops dead sideways with more friction than there is: the best answer is on the cone's rim, between the two wishes."""
    speed, drop = 2.0, 1.0
    normal = WEIGHTS.match * (drop + FRICTION * speed) / MASS
    normal /= WEIGHTS.match * (1.0 + FRICTION**2) / MASS**2 + 2.0 * WEIGHTS.regularization
    problems = point_mass(np.array([-speed, 0.0, -drop]), np.zeros(3), gap=1.0)
    return KnownProblem("slipping stop", problems, np.array([[normal, normal, 0.0]]))


def sliding() -> KnownProblem:
    """Coulomb's law holds to the letter: full friction against the motion explains everything, up to eps."""
    normal = 2.0
    following = np.array([6.0, 0.0, 0.0])
    change = np.array([-FRICTION * normal, 0.0, normal]) / MASS
    return KnownProblem("sliding", point_mass(following - change, following), np.array([[normal, -normal, 0.0]]))


def resting_cube() -> KnownProblem:
    """Four of eight corners touch and share the weight; the four above are too far away."""
    corners = np.array([[x, y, z] for z in (-1.0, 1.0) for x in (-1.0, 1.0) for y in (-1.0, 1.0)])
    jacobian = np.zeros((1, 8, 3, 6))
    for i, corner in enumerate(corners):
        for c, direction in enumerate((np.array([0, 0, 1.0]), np.array([FRICTION, 0, 0]), np.array([0, FRICTION, 0]))):
            jacobian[0, i, c] = np.concatenate([direction, np.cross(corner, direction)])
    gaps = (corners[:, 2] + 1.0)[None]
    drop = 187.2 * DT
    problems = ConeProblems(
        jacobian, np.diag([1 / MASS] * 3 + [1 / 0.295] * 3), gaps, gaps, np.array([[0, 0, -drop, 0, 0, 0.0]]), np.zeros((1, 6)),
        np.array([DT]), WEIGHTS,
    )  # fmt: skip
    lift = WEIGHTS.match + 4.0 * WEIGHTS.penetration * DT**2
    share = lift * 4.0 * drop / MASS / (16.0 * lift / MASS**2 + 4.0 * WEIGHTS.regularization)
    impulses = np.zeros((8, 3))
    impulses[:4, 0] = share
    return KnownProblem("resting cube", problems, impulses)


KNOWN = [airborne(), pulled_down(), sticking(), slipping_stop(), sliding(), resting_cube()]
"""Friction points along the first facet's direction, so that both cones give the same answer."""


def random_problems(batch: int, contacts: int, seed: int) -> ConeProblems:
    """Bodies of random corners near the board, fast and at rest, whose measured velocities fit the contacts badly."""
    rng = np.random.default_rng(seed)
    corners = rng.standard_normal((batch, contacts, 3))
    directions = np.diag([1.0, FRICTION, FRICTION])[:, [1, 2, 0]]  # upward, then the tangents
    jacobians = np.empty((batch, contacts, 3, 6))
    jacobians[..., :3] = directions
    jacobians[..., 3:] = np.cross(corners[:, :, None], directions)
    heights = corners[..., 2] - corners[..., 2].min(axis=1, keepdims=True)
    return ConeProblems(
        jacobians=jacobians,
        inverse_mass=np.diag([1 / MASS] * 3 + [1 / 0.295, 1 / 0.4, 1 / 0.25]),
        gaps=heights + 0.02 * rng.standard_normal((batch, 1)),
        gaps_next=heights + 0.02 * rng.standard_normal((batch, 1)),
        free_velocities=3.0 * rng.standard_normal((batch, 6)),
        velocities_next=3.0 * rng.standard_normal((batch, 6)) * rng.choice([0.0, 1.0], (batch, 1)),
        dt=rng.uniform(0.003, 0.02, batch),
    )


def with_bad_element(problems: ConeProblems, index: int) -> ConeProblems:
    """The same with one number of one problem missing: a single gap, which touches one contact only."""
    gaps_next = problems.gaps_next.copy()
    gaps_next[index, 0] = np.nan
    return replace(problems, gaps_next=gaps_next)
