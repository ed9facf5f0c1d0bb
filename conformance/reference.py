"""The contact loss of CONVENTIONS.md as a program: plain loops over decimal numbers, with the standard library alone.

It is meant to be read beside CONVENTIONS.md, whose section numbers are given below, and to be slow and right. Everything
follows from one function, `residuals`: the problem is quadratic in its impulses, so its matrix is read off at unit impulses,
and derivatives by parameters are central differences with a step of 1e-20 in numbers of 60 digits. The minimum is found by a
barrier method, then improved by Newton's method on the optimality conditions of the faces of the cones on which it lies, until
its certificate is below 1e-40. So the answers are right to the last digit that a double has, on any machine.

    python reference.py problems/sliding.json > answers.json
"""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import dataclass
from decimal import Decimal, localcontext
from pathlib import Path
from typing import Any, Callable, Sequence

Vector = list["Decimal"]
Matrix = list[list["Decimal"]]

DIGITS = 60
STEP = Decimal(10) ** -20
"""Of the central differences: their error is its square."""
LAST_BARRIER = Decimal(10) ** -16
SMALLEST_GAP = Decimal(10) ** -40
"""Of the duality gap of an answer."""

ZERO, ONE, HALF = Decimal(0), Decimal(1), Decimal("0.5")


@dataclass(frozen=True)
class Theta:
    """What the loss is differentiated by (section 3)."""

    vertices_normal: Matrix
    normal: Vector
    vertices_tangent: Matrix
    tangents: Matrix
    height: Decimal

    def vector(self) -> Vector:
        """All parameters in the order of scores and Gauss-Newton matrices (section 8)."""
        flat = [x for p in self.vertices_normal for x in p] + self.normal
        flat += [x for p in self.vertices_tangent for x in p] + [x for t in self.tangents for x in t]
        return [*flat, self.height]

    @staticmethod
    def of_vector(flat: Vector) -> Theta:
        """The inverse of `vector`."""
        k = (len(flat) - 10) // 6
        rows = [flat[3 * i : 3 * i + 3] for i in range(2 * k + 3)]
        return Theta(rows[:k], rows[k], rows[k + 1 : 2 * k + 1], rows[2 * k + 1 :], flat[-1])


@dataclass(frozen=True)
class State:
    """Position, unit quaternion (w, x, y, z), linear velocity in the board's frame, angular velocity in the body's."""

    position: Vector
    quaternion: Vector
    linear_velocity: Vector
    angular_velocity: Vector

    def twist(self) -> Vector:
        """Linear and angular velocity, 6 numbers."""
        return self.linear_velocity + self.angular_velocity


@dataclass(frozen=True)
class Problem:
    """One transition and one theta (sections 1 to 4)."""

    theta: Theta
    pivot: Vector
    before: State
    after: State
    dt: Decimal
    gravity: Decimal
    mass: Decimal
    inertia: Matrix
    facets: int  # 0 for the circular cone
    weights: dict[str, Decimal]


@dataclass(frozen=True)
class Answer:
    """Impulses of least loss, their certificate, and what follows from them."""

    contacts: Contacts
    impulses: Matrix
    gradient: Matrix
    faces: list[str]
    terms: dict[str, Decimal]
    score: Vector
    gauss_newton: Matrix


def decimals(value: Any) -> Any:
    """Numbers and nested lists of numbers as decimals, each the exact value of the nearest double (section 1)."""
    return [decimals(each) for each in value] if isinstance(value, list) else Decimal(float(value))


def problem_of(given: dict[str, Any]) -> Problem:
    """A problem as the files hold it."""
    kinematics = ("position", "quaternion", "linear_velocity", "angular_velocity")
    states = [State(*(decimals(given[when][name]) for name in kinematics)) for when in ("before", "after")]
    theta = given["theta"]
    parameters = ("vertices_normal", "normal", "vertices_tangent", "tangents", "height")
    return Problem(
        Theta(*(decimals(theta[name]) for name in parameters)),
        decimals(theta["pivot"]),
        states[0],
        states[1],
        decimals(given["dt"]),
        decimals(given["gravity"]),
        decimals(given["mass"]),
        decimals(given["inertia"]),
        int(given["cone"].get("facets", 0)),
        {name: decimals(value) for name, value in given["weights"].items()},
    )


# Sections 2 and 3: kinematics.


def dot(a: Sequence[Decimal], b: Sequence[Decimal]) -> Decimal:
    """Inner product."""
    return sum((x * y for x, y in zip(a, b)), ZERO)


def cross(a: Vector, b: Vector) -> Vector:
    """The vector product a x b."""
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def rotation(q: Vector) -> Matrix:
    """R of a unit quaternion (w, x, y, z): it takes vectors of the body's frame to the board's."""
    w, x, y, z = q
    return [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]


def turned_back(r: Matrix, a: Vector) -> Vector:
    """R^T a."""
    return [r[0][k] * a[0] + r[1][k] * a[1] + r[2][k] * a[2] for k in range(3)]


def gaps_at(theta: Theta, pivot: Vector, state: State) -> Vector:
    """phi_i = n . (R p_i + x - c) - h."""
    r = rotation(state.quaternion)
    in_body = turned_back(r, theta.normal)
    level = dot(theta.normal, [x - c for x, c in zip(state.position, pivot)]) - theta.height
    return [dot(in_body, p) + level for p in theta.vertices_normal]


@dataclass(frozen=True)
class Contacts:
    """What the loss needs of the K contacts: gaps at both poses, Jacobians at the pose before, slips."""

    gaps: Vector
    next_gaps: Vector
    normal_jacobians: Matrix
    tangent_jacobians: list[Matrix]
    free_velocity: Vector
    slips: Matrix


def contacts_of(problem: Problem, theta: Theta) -> Contacts:
    """Sections 2 to 4."""
    r = rotation(problem.before.quaternion)
    normal, tangents = turned_back(r, theta.normal), [turned_back(r, t) for t in theta.tangents]
    j_n = [theta.normal + cross(p, normal) for p in theta.vertices_normal]
    j_t = [[t + cross(p, u) for t, u in zip(theta.tangents, tangents)] for p in theta.vertices_tangent]
    following = problem.after.twist()
    free = problem.before.twist()
    free[2] -= problem.gravity * problem.dt
    return Contacts(
        gaps_at(theta, problem.pivot, problem.before),
        gaps_at(theta, problem.pivot, problem.after),
        j_n,
        j_t,
        free,
        [[dot(row, following) for row in rows] for rows in j_t],
    )


# Section 5: the loss.


def residuals(problem: Problem, theta: Theta, impulses: Matrix, clamped: bool = True) -> Vector:
    """The 6 + 6K residuals r, in the order of section 5; not clamped: with the predicted gap in place of min(0, it)."""
    at, w = contacts_of(problem, theta), problem.weights
    push = [ZERO] * 6
    for i, impulse in enumerate(impulses):
        for c, row in enumerate([at.normal_jacobians[i], *at.tangent_jacobians[i]]):
            push = [a + impulse[c] * b for a, b in zip(push, row)]
    change = [x / problem.mass for x in push[:3]] + solve(problem.inertia, push[3:])
    reached = [a + b for a, b in zip(at.free_velocity, change)]
    match = [w["match"].sqrt() * (a - b) for a, b in zip(reached, problem.after.twist())]
    normal, tangent, dissipation, penetration = [], [], [], []
    for i, (upward, *pair) in enumerate(impulses):
        normal.append(w["complementarity_normal"].sqrt() * at.next_gaps[i] * upward)
        tangent += [w["complementarity_tangent"].sqrt() * at.next_gaps[i] * x for x in pair]
        speed = dot(at.slips[i], at.slips[i]).sqrt()
        dissipation += [w["dissipation"].sqrt() * (upward * s + speed * x) for s, x in zip(at.slips[i], pair)]
        predicted = at.gaps[i] + problem.dt * dot(at.normal_jacobians[i], reached)
        penetration.append(w["penetration"].sqrt() * (min(ZERO, predicted) if clamped else predicted))
    return match + normal + tangent + dissipation + penetration


TERMS = ("match", "complementarity_normal", "complementarity_tangent", "dissipation", "penetration")


def terms_of(problem: Problem, impulses: Matrix) -> dict[str, Decimal]:
    """The five terms of the loss."""
    r, k = residuals(problem, problem.theta, impulses), len(impulses)
    ends = [0, 6, 6 + k, 6 + 3 * k, 6 + 5 * k, 6 + 6 * k]
    return {name: dot(r[a:b], r[a:b]) for name, a, b in zip(TERMS, ends, ends[1:])}


# Section 6: the inner problem.


@dataclass(frozen=True)
class Quadratic:
    """The residuals as a function of the 3K impulses, C l + d; the last K rows count only where they are negative."""

    rows: Matrix
    offset: Vector
    regularization: Decimal

    @staticmethod
    def of(problem: Problem) -> Quadratic:
        """Read off at zero and at unit impulses."""
        k = len(problem.theta.vertices_normal)

        def at(n: int) -> Vector:
            flat = [ONE if m == n else ZERO for m in range(3 * k)]
            return residuals(problem, problem.theta, threes(flat), clamped=False)

        offset = at(-1)
        columns = [[a - b for a, b in zip(at(n), offset)] for n in range(3 * k)]
        return Quadratic([list(row) for row in zip(*columns)], offset, problem.weights["regularization"])

    def active(self, flat: Vector) -> list[int]:
        """Numbers of the rows that count."""
        size, contacts = len(self.offset), len(flat) // 3
        first = size - contacts
        return [*range(first), *(n for n in range(first, size) if dot(self.rows[n], flat) + self.offset[n] < 0)]

    def gradient(self, flat: Vector) -> Vector:
        """Of the objective, the regularisation included."""
        total = [2 * self.regularization * x for x in flat]
        for n in self.active(flat):
            value = 2 * (dot(self.rows[n], flat) + self.offset[n])
            if value:
                total = [a + value * b if b else a for a, b in zip(total, self.rows[n])]
        return total

    def hessian(self, flat: Vector) -> Matrix:
        """Of the objective."""
        size = len(flat)
        total = [[2 * self.regularization if a == b else ZERO for b in range(size)] for a in range(size)]
        for n in self.active(flat):
            row = self.rows[n]
            filled = [a for a in range(size) if row[a]]
            for a in filled:
                twice = 2 * row[a]
                for b in filled:
                    total[a][b] += twice * row[b]
        return total


def threes(flat: Vector) -> Matrix:
    """(K, 3) from 3K numbers."""
    return [flat[n : n + 3] for n in range(0, len(flat), 3)]


def solve(matrix: Matrix, right: Vector) -> Vector:
    """Gaussian elimination with row pivoting."""
    size = len(right)
    rows = [[*row, value] for row, value in zip(matrix, right)]
    for k in range(size):
        best = max(range(k, size), key=lambda n: abs(rows[n][k]))
        rows[k], rows[best] = rows[best], rows[k]
        for below in range(k + 1, size):
            if rows[below][k]:
                share = rows[below][k] / rows[k][k]
                rows[below] = [a - share * b if b else a for a, b in zip(rows[below], rows[k])]
    found = [ZERO] * size
    for k in reversed(range(size)):
        found[k] = (rows[k][size] - dot(rows[k][k + 1 : size], found[k + 1 :])) / rows[k][k]
    return found


def directions(facets: int) -> Matrix:
    """Unit vectors d_k of the polyhedral cone, 45 degrees apart from (1, 0) on (section 6)."""
    h = HALF.sqrt()
    found = [[ONE, ZERO], [h, h], [ZERO, ONE], [-h, h], [-ONE, ZERO], [-h, -h], [ZERO, -ONE], [h, -h]]
    if facets != len(found):
        raise ValueError(f"{facets} facets: this version has {len(found)}")
    return found


def facet_rows(facets: int) -> Matrix:
    """Rows F_k = (1, -d_k): the polyhedral cone is F_k . l >= 0 for all k."""
    return [[ONE, -x, -y] for x, y in directions(facets)]


def in_cone(impulse: Vector, facets: int) -> Decimal:
    """How far inside the cone an impulse is; negative outside."""
    if facets:
        return min(dot(row, impulse) for row in facet_rows(facets))
    return impulse[0] - dot(impulse[1:], impulse[1:]).sqrt()


def in_dual_cone(gradient: Vector, facets: int) -> Decimal:
    """The same of the dual cone, which holds the gradients of a minimum; the circular cone is its own dual."""
    if not facets:
        return in_cone(gradient, 0)
    around = directions(facets)
    rays = [[a + b for a, b in zip(d, e)] for d, e in zip(around, around[1:] + around[:1])]
    share = 1 + dot(around[0], around[1])  # of the rays, which lie where two facets meet, along the facets' normals
    return min(gradient[0] + dot(gradient[1:], ray) / share for ray in rays)


def barrier(impulse: Vector, facets: int) -> tuple[Vector, Matrix]:
    """Gradient (3) and Hessian (3, 3) of -log of the distance to the cone's surface."""
    if facets:
        slope, curve = [ZERO] * 3, [[ZERO] * 3 for _ in range(3)]
        for row in facet_rows(facets):
            inverse = 1 / dot(row, impulse)
            for a in range(3):
                slope[a] -= inverse * row[a]
                for b in range(3):
                    curve[a][b] += inverse * inverse * row[a] * row[b]
        return slope, curve
    signed = [impulse[0], -impulse[1], -impulse[2]]
    inverse = 1 / dot(signed, impulse)
    slope = [-2 * inverse * x for x in signed]
    curve = [[slope[a] * slope[b] for b in range(3)] for a in range(3)]
    for a in range(3):
        curve[a][a] += 2 * inverse * (1 if a else -1)
    return slope, curve


def central_path(quadratic: Quadratic, facets: int) -> tuple[Vector, Decimal]:
    """Impulses near the minimum, inside the cones, and the weight of the barrier that keeps them there."""
    flat = [HALF if n % 3 == 0 else ZERO for n in range(len(quadratic.rows[0]))]
    weight = ONE

    def slope(at: Vector) -> Vector:
        total = quadratic.gradient(at)
        for i, impulse in enumerate(threes(at)):
            for a, value in enumerate(barrier(impulse, facets)[0]):
                total[3 * i + a] += weight * value
        return total

    while True:
        for _ in range(60):
            matrix, right = quadratic.hessian(flat), slope(flat)
            for i, impulse in enumerate(threes(flat)):
                for a, row in enumerate(barrier(impulse, facets)[1]):
                    for b, value in enumerate(row):
                        matrix[3 * i + a][3 * i + b] += weight * value
            step = solve(matrix, [-x for x in right])
            falling = -dot(step, right)  # twice what the quadratic model promises
            if falling < weight / 100:
                break
            length = ONE
            while True:  # stays inside the cones and does not go far beyond the lowest point of the line
                trial = [x + length * y for x, y in zip(flat, step)]
                inside = all(impulse[0] > 0 and in_cone(impulse, facets) > 0 for impulse in threes(trial))
                if inside and dot(slope(trial), step) <= falling / 2:
                    break
                length *= HALF
            flat = trial
        if weight <= LAST_BARRIER:
            return flat, weight
        weight /= 10


def faces_of(flat: Vector, weight: Decimal, facets: int) -> list[str]:
    """On which face of its cone each impulse lies: "apex", "inside", "surface", or the facets, such as "facets 2 3"."""
    small, found = weight.sqrt(), []
    for impulse in threes(flat):
        if impulse[0] < small:
            found.append("apex")
        elif facets:
            touching = [str(k) for k, row in enumerate(facet_rows(facets)) if dot(row, impulse) < small]
            found.append("facets " + " ".join(touching) if touching else "inside")
        else:
            found.append("surface" if in_cone(impulse, 0) < small else "inside")
    return found


def polished(quadratic: Quadratic, flat: Vector, weight: Decimal, faces: list[str], facets: int) -> Vector:
    """Newton's method on the optimality conditions of the given faces."""
    size, normals = len(flat), facet_rows(facets) if facets else []

    def constraints(at: Vector) -> list[tuple[int, Vector, Decimal]]:
        """(contact, slope, value) of each equation that keeps an impulse on its face."""
        found: list[tuple[int, Vector, Decimal]] = []
        for i, (face, impulse) in enumerate(zip(faces, threes(at))):
            if face == "apex":
                found += [(i, [ONE if a == b else ZERO for b in range(3)], impulse[a]) for a in range(3)]
            elif face == "surface":
                signed = [impulse[0], -impulse[1], -impulse[2]]
                found.append((i, signed, dot(signed, impulse) / 2))
            elif face != "inside":
                found += [(i, normals[int(k)], dot(normals[int(k)], impulse)) for k in face.split()[1:3]]
        return found

    multipliers = [ZERO] * len(constraints(flat))
    for n, (i, slope, _) in enumerate(constraints(flat)):  # on the circular cone the first guess matters: it curves
        if faces[i] == "surface":
            multipliers[n] = quadratic.gradient(flat)[3 * i] / slope[0]
    for _ in range(30):
        equations = constraints(flat)
        matrix = [[*row, *([ZERO] * len(equations))] for row in quadratic.hessian(flat)]
        right = [-x for x in quadratic.gradient(flat)]
        for n, (i, slope, value) in enumerate(equations):
            row = [ZERO] * (size + len(equations))
            for a in range(3):
                row[3 * i + a] = slope[a]
                matrix[3 * i + a][size + n] = -slope[a]
                right[3 * i + a] += multipliers[n] * slope[a]
                if faces[i] == "surface":
                    matrix[3 * i + a][3 * i + a] -= multipliers[n] * (1 if a == 0 else -1)
            matrix.append(row)
            right.append(-value)
        step = solve(matrix, right)
        flat = [x + y for x, y in zip(flat, step)]
        multipliers = [x + y for x, y in zip(multipliers, step[size:])]
        if max(abs(x) for x in step[:size]) < Decimal(10) ** -45:
            return flat
    raise ArithmeticError("Newton's method on the faces does not converge")


# Section 7: the certificate.


def duality_gap(impulses: Matrix, gradient: Matrix) -> Decimal:
    """The sum l . gradient: how far the objective can be above its minimum, if the gradient is in the dual cone."""
    return sum((dot(a, b) for a, b in zip(impulses, gradient)), ZERO)


def certificate(problem: Problem, impulses: list[list[float]]) -> dict[str, float]:
    """How far given impulses, and the gradient at them, are outside their cones, and the duality gap over the objective."""
    with localcontext() as context:
        context.prec = DIGITS
        exact = decimals(impulses)
        gradient = threes(Quadratic.of(problem).gradient([x for impulse in exact for x in impulse]))
        squares = sum((x * x for impulse in exact for x in impulse), ZERO)
        objective = sum(terms_of(problem, exact).values()) + problem.weights["regularization"] * squares
        return {
            "impulse outside its cone": max(0.0, *(-float(in_cone(each, problem.facets)) for each in exact)),
            "gradient outside the dual cone": max(0.0, *(-float(in_dual_cone(each, problem.facets)) for each in gradient)),
            "duality gap over objective": abs(float(duality_gap(exact, gradient) / objective)),
        }


def margin_of(problem: Problem, impulses: Matrix, gradient: Matrix) -> Decimal:
    """How far the problem is from one whose derivatives jump (section 7)."""
    found, facets = [], problem.facets
    for impulse, slope in zip(impulses, gradient):
        if impulse[0] == 0:
            found.append(in_dual_cone(slope, facets))
        elif max(abs(x) for x in slope) < SMALLEST_GAP:
            found.append(in_cone(impulse, facets))
        else:
            found += [impulse[0], slope[0]]
            if facets:
                values = [dot(row, impulse) for row in facet_rows(facets)]
                found += [value for value in values if value > SMALLEST_GAP]
                found += facet_multipliers(slope, values, facets)
    at, weight = contacts_of(problem, problem.theta), problem.weights["penetration"].sqrt()
    if weight:
        open_ = residuals(problem, problem.theta, impulses, clamped=False)[-len(impulses) :]
        found += [abs(x) / weight for x in open_]
    speeds = [dot(s, s).sqrt() for s in at.slips]
    return min([*found, *(speed for speed in speeds if speed)])


def facet_multipliers(slope: Vector, values: Vector, facets: int) -> Vector:
    """Numbers y >= 0 with slope = sum y_k F_k over the one or two facets that are touched."""
    rows = [row for row, value in zip(facet_rows(facets), values) if value <= SMALLEST_GAP]
    gram = [[dot(a, b) for b in rows] for a in rows]
    return solve(gram, [dot(row, slope) for row in rows])


# Section 8: derivatives.


def slopes(function: Callable[[Vector], Vector], at: Vector) -> Matrix:
    """Central differences: one row for each number that `function` gives, one column for each that it takes."""
    columns = []
    for n in range(len(at)):
        up, down = list(at), list(at)
        up[n] += STEP
        down[n] -= STEP
        columns.append([(a - b) / (2 * STEP) for a, b in zip(function(up), function(down))])
    return [list(row) for row in zip(*columns)]


def free_directions(impulse: Vector, gradient: Vector, facets: int) -> Matrix:
    """Orthonormal directions in which an impulse can move on its face of the cone."""
    if impulse[0] == 0:
        return []
    if max(abs(x) for x in gradient) < SMALLEST_GAP:
        return [[ONE if a == b else ZERO for b in range(3)] for a in range(3)]
    length = dot(impulse, impulse).sqrt()
    ray = [x / length for x in impulse]
    if not facets:
        radius = dot(impulse[1:], impulse[1:]).sqrt()
        return [ray, [ZERO, -impulse[2] / radius, impulse[1] / radius]]
    touching = [row for row in facet_rows(facets) if abs(dot(row, impulse)) < SMALLEST_GAP]
    if len(touching) > 1:
        return [ray]
    _, x, y = touching[0]
    return [[HALF.sqrt(), -x * HALF.sqrt(), -y * HALF.sqrt()], [ZERO, y, -x]]


def gauss_newton(quadratic: Quadratic, by_theta: Matrix, impulses: Matrix, gradient: Matrix, facets: int) -> Matrix:
    """J^T P J with P = I - L (L^T L + eps I)^-1 L^T (section 8)."""
    flat = [x for impulse in impulses for x in impulse]
    counted = set(quadratic.active(flat))
    columns = []
    for i in range(len(impulses)):
        for way in free_directions(impulses[i], gradient[i], facets):
            column = [dot(way, row[3 * i : 3 * i + 3]) for row in quadratic.rows]
            columns.append([value if n in counted else ZERO for n, value in enumerate(column)])
    by_parameter = [list(column) for column in zip(*by_theta)]
    found = [[dot(a, b) for b in by_parameter[: k + 1]] for k, a in enumerate(by_parameter)]
    gram = [
        [dot(a, b) + (quadratic.regularization if m == n else 0) for n, b in enumerate(columns)] for m, a in enumerate(columns)
    ]
    explained = [[dot(a, b) for b in columns] for a in by_parameter]
    for a, row in enumerate(explained):
        weights = solve(gram, row) if columns and any(row) else []
        for b in range(a + 1 if weights else 0):
            found[a][b] -= dot(weights, explained[b])
    return found


def answer(problem: Problem) -> Answer:
    """Everything that CONVENTIONS.md defines, to more digits than a double holds.

    Raises:
        ArithmeticError: no certificate was found.
    """
    with localcontext() as context:
        context.prec = DIGITS
        quadratic = Quadratic.of(problem)
        flat, weight = central_path(quadratic, problem.facets)
        faces = faces_of(flat, weight, problem.facets)
        flat = polished(quadratic, flat, weight, faces, problem.facets)
        impulses = threes([ZERO if abs(x) < SMALLEST_GAP else x for x in flat])
        gradient = threes(quadratic.gradient(flat))
        for impulse, slope in zip(impulses, gradient):
            outside = min(in_cone(impulse, problem.facets), in_dual_cone(slope, problem.facets))
            if outside < -SMALLEST_GAP or abs(dot(impulse, slope)) > SMALLEST_GAP:
                raise ArithmeticError("the impulses carry no certificate")
        by_theta = slopes(lambda at: residuals(problem, Theta.of_vector(at), impulses), problem.theta.vector())
        r = residuals(problem, problem.theta, impulses)
        score = [-dot(column, r) for column in zip(*by_theta)]
        matrix = gauss_newton(quadratic, by_theta, impulses, gradient, problem.facets)
        return Answer(
            contacts_of(problem, problem.theta), impulses, gradient, faces, terms_of(problem, impulses), score, matrix
        )


def doubles(value: Any) -> Any:
    """Decimals and nested lists of them as the nearest doubles; what is below 1e-30 is zero."""
    if isinstance(value, list):
        return [doubles(each) for each in value]
    return float(value) if abs(value) > Decimal(10) ** -30 else 0.0


def expected(problem: Problem) -> dict[str, Any]:
    """The answer as the files hold it."""
    found = answer(problem)
    with localcontext() as context:
        context.prec = DIGITS
        flat = [x for impulse in found.impulses for x in impulse]
        loss = sum(found.terms.values())
        at = found.contacts
        return {
            "gaps": doubles(at.gaps),
            "next_gaps": doubles(at.next_gaps),
            "normal_jacobians": doubles(at.normal_jacobians),
            "tangent_jacobians": doubles(at.tangent_jacobians),
            "free_velocity": doubles(at.free_velocity),
            "slips": doubles(at.slips),
            "impulses": doubles(found.impulses),
            "terms": {name: doubles(value) for name, value in found.terms.items()},
            "loss": doubles(loss),
            "objective": doubles(loss + problem.weights["regularization"] * dot(flat, flat)),
            "score": doubles(found.score),
            "gauss_newton": doubles(found.gauss_newton),
            "certificate": {
                "gradient": doubles(found.gradient),
                "gap": doubles(duality_gap(found.impulses, found.gradient)),
                "faces": found.faces,
                "margin": doubles(margin_of(problem, found.impulses, found.gradient)),
            },
        }


def main() -> None:
    """Answers the problems of the files named on the command line."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("problems", nargs="+", type=Path)
    found = {}
    for path in parser.parse_args().problems:
        for given in json.loads(path.read_text(encoding="utf-8"))["problems"]:
            answers = expected(problem_of(given))
            del answers["certificate"]  # no quantity of a file of answers
            found[given["id"]] = answers
    head = {"format": "contact-loss-answers", "version": 1, "implementation": "reference.py"}
    json.dump({**head, "answers": found}, sys.stdout, indent=1)


if __name__ == "__main__":
    main()
