"""Draws the problems and writes them with their answers.

    python generate.py [GROUP ...]

Every draw follows from a text, such as "contact-loss-vectors 1 sliding 7 0", through `random.Random`, whose numbers are the
same on every machine; nothing but arithmetic and square roots is used, all of it exact or in decimals, so that inputs and
answers come out the same, digit by digit. A draw too close to a point where derivatives jump is drawn again (`margin`,
section 7 of CONVENTIONS.md).
"""

from __future__ import annotations

import argparse
import json
import random
import sys
from dataclasses import dataclass, replace
from decimal import Decimal, localcontext
from pathlib import Path
from typing import Any, Callable

sys.path.insert(0, str(Path(__file__).resolve().parent))

import reference

SEED = "contact-loss-vectors 1"
FOLDER = Path(__file__).resolve().parent / "problems"
LEAST_MARGIN = 2e-5
COUNT = 20
FACETS = 8

Row = list[float]
STILL: Row = [0.0] * 6

WEIGHTS = {
    "match": 0.1,
    "complementarity_normal": 1.0,
    "complementarity_tangent": 1.0,
    "dissipation": 1.0,
    "penetration": 1.0,
    "regularization": 1e-6,
}


@dataclass(frozen=True)
class Body:
    """A shape in characteristic lengths, with mass [kg] and inertia [kg per length squared]."""

    vertices: list[Row]
    mass: float
    inertia: list[Row]


def _box(a: float, b: float, c: float) -> list[Row]:
    return [[x * a, y * b, z * c] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)]


def _moments(a: float, b: float, c: float) -> list[Row]:
    return [[a, 0.0, 0.0], [0.0, b, 0.0], [0.0, 0.0, c]]


BODIES = {
    "cube": Body(_box(1.0, 1.0, 1.0), 0.37, _moments(0.295, 0.295, 0.295)),
    "brick": Body(_box(1.5, 0.8, 0.5), 0.6, _moments(0.178, 0.5, 0.578)),
    "slab": Body([[1.2, 1.0, 0.2], [-1.2, 1.0, 0.2], [-1.2, -1.0, 0.2], [1.2, -1.0, 0.2]], 0.25, _moments(0.087, 0.124, 0.203)),
    "tetrahedron": Body(
        [[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]], 0.2, _moments(0.08, 0.08, 0.08)
    ),
    "octahedron": Body(
        [[1.3, 0.0, 0.0], [-1.3, 0.0, 0.0], [0.0, 1.1, 0.0], [0.0, -1.1, 0.0], [0.0, 0.0, 0.9], [0.0, 0.0, -0.9]],
        0.3,
        _moments(0.061, 0.075, 0.087),
    ),
    "wedge": Body(
        [[-1.0, -0.8, -0.5], [1.0, -0.8, -0.5], [-1.0, 0.8, -0.5], [1.0, 0.8, -0.5], [-1.0, 0.0, 0.9]],
        0.33,
        [[0.11, 0.012, -0.02], [0.012, 0.15, 0.008], [-0.02, 0.008, 0.17]],
    ),
    "rod": Body([[2.0, 0.0, 0.0], [-2.0, 0.0, 0.0]], 0.15, _moments(0.004, 0.21, 0.21)),
    "triangle": Body([[1.0, 0.0, -0.1], [-0.6, 0.9, -0.1], [-0.5, -0.8, -0.1]], 0.18, _moments(0.04, 0.05, 0.08)),
    "point": Body([[0.3, -0.2, -0.7]], 0.5, [[0.2, 0.03, 0.01], [0.03, 0.25, -0.02], [0.01, -0.02, 0.22]]),
}


class Draw:
    """Numbers of one draw, rounded to 9 decimals."""

    def __init__(self, text: str) -> None:
        self._random = random.Random(text)

    def number(self, low: float, high: float) -> float:
        """Evenly between two bounds."""
        return round(low + (high - low) * self._random.random(), 9)

    def row(self, size: int, reach: float) -> Row:
        """Numbers between -reach and reach."""
        return [self.number(-reach, reach) for _ in range(size)]

    def sign(self) -> float:
        """-1 or 1."""
        return -1.0 if self._random.random() < 0.5 else 1.0

    def turn(self) -> Row:
        """Any orientation."""
        while True:
            found = self.row(4, 1.0)
            if 0.01 < sum(x * x for x in found) < 1.0:
                return unit(found)

    def yaw(self) -> Row:
        """A turn about the vertical."""
        return unit([1.0, 0.0, 0.0, self.number(-1.0, 1.0)])


@dataclass(frozen=True)
class Scene:
    """What a group says of a draw; the rest of the problem follows from it.

    Attributes:
        body: name in `BODIES`.
        turn: quaternion before.
        gap: of the lowest contact before.
        after_twist: v'; or None for a flight.
        carried: (contact, normal, share along the slip, share across) impulses that brought about v'.
        theta, pivot, weights, dt, gravity: as in the files.
        turn_error: spin [rad/s] by which the orientation after is measured wrong.
    """

    body: str
    turn: Row
    gap: float
    after_twist: Row | None
    carried: list[tuple[int, float, float, float]]
    theta: dict[str, Any]
    pivot: Row
    weights: dict[str, float]
    dt: float = 0.006756757
    gravity: float = 187.213740458
    turn_error: tuple[float, ...] = (0.0, 0.0, 0.0)


def unit(given: Row) -> Row:
    """The same direction with length one, each number the nearest double."""
    with localcontext() as context:
        context.prec = 40
        exact = [Decimal(x) for x in given]
        length = sum((x * x for x in exact), Decimal(0)).sqrt()
        return [float(x / length) for x in exact]


def level_theta(body: Body, friction: float) -> dict[str, Any]:
    """The body as it is, on the plane z = 0."""
    axes = [[friction, 0.0, 0.0], [0.0, friction, 0.0]]
    vertices = body.vertices
    return {
        "vertices_normal": vertices,
        "normal": [0.0, 0.0, 1.0],
        "vertices_tangent": vertices,
        "tangents": axes,
        "height": 0.0,
    }


def tilted_theta(draw: Draw, body: Body, friction: float) -> dict[str, Any]:
    """On a plane that leans by up to 30 degrees, with friction evenly in all directions."""
    x, y = draw.row(2, 0.4)
    normal = unit([x, y, 1.0])
    first = unit([normal[2], 0.0, -normal[0]])
    second = [
        normal[1] * first[2] - normal[2] * first[1],
        normal[2] * first[0] - normal[0] * first[2],
        normal[0] * first[1] - normal[1] * first[0],
    ]
    tangents = [[friction * value for value in axis] for axis in (first, second)]
    return {**level_theta(body, friction), "normal": normal, "tangents": tangents, "height": draw.number(-0.3, 0.3)}


def noisy_theta(draw: Draw, body: Body, friction: float, share: float) -> dict[str, Any]:
    """Everything off, as while it is learned: the normal is no unit vector, the tangents are not orthogonal."""

    def near(rows: list[Row], reach: float) -> list[Row]:
        return [[round(value + draw.number(-reach, reach), 9) for value in row] for row in rows]

    return {
        "vertices_normal": near(body.vertices, share),
        "normal": near([[0.0, 0.0, 1.0]], 0.5 * share)[0],
        "vertices_tangent": near(body.vertices, share),
        "tangents": near([[friction, 0.0, 0.0], [0.0, friction, 0.0]], 0.5 * share * friction),
        "height": 0.0,
    }


def lowest(scene: Scene) -> list[int]:
    """Contacts from the lowest to the highest at the orientation before, along the ground's normal."""
    return sorted(range(len(scene.theta["vertices_normal"])), key=lambda i: _height(scene, i))


def _height(scene: Scene, i: int) -> float:
    r = reference.rotation(reference.decimals(scene.turn))
    n, p = reference.decimals(scene.theta["normal"]), reference.decimals(scene.theta["vertices_normal"][i])
    return round(float(reference.dot(reference.turned_back(r, n), p)), 9)


def _stepped(turn: Row, omega: Row, dt: float) -> Row:
    """The product q (1, dt omega / 2), normalised: the exponential map to second order."""
    w, x, y, z = turn
    a, b, c = (0.5 * dt * value for value in omega)
    return unit([w - x * a - y * b - z * c, x + w * a + y * c - z * b, y + w * b + z * a - x * c, z + w * c + x * b - y * a])


def problem_of(name: str, cone: str, scene: Scene, draw: Draw, noise: float) -> dict[str, Any]:
    """The problem of a scene: the twist before is what the carried impulses and gravity make of the twist after."""
    body, theta = BODIES[scene.body], scene.theta
    n = theta["normal"]
    level = sum(a * (x - c) for a, x, c in zip(n[:2], (0.3, -0.2), scene.pivot)) - theta["height"]
    z = scene.pivot[2] + (scene.gap - level - _height(scene, lowest(scene)[0])) / n[2]
    position = [0.3, -0.2, round(z, 9)]
    before = {"position": position, "quaternion": scene.turn, "linear_velocity": [0.0] * 3, "angular_velocity": [0.0] * 3}
    after = dict(before)
    given = {
        "id": name,
        "body": scene.body,
        "dt": scene.dt,
        "gravity": scene.gravity,
        "mass": body.mass,
        "inertia": body.inertia,
        "cone": {"kind": cone, "facets": FACETS} if cone == "polyhedral" else {"kind": cone},
        "weights": scene.weights,
        "theta": {**theta, "pivot": scene.pivot},
        "before": before,
        "after": after,
    }
    if scene.after_twist is None:
        before["linear_velocity"], before["angular_velocity"] = draw.row(3, 12.0), draw.row(3, 8.0)
        moved = [*before["linear_velocity"], *before["angular_velocity"]]
        moved[2] = round(moved[2] - scene.gravity * scene.dt, 9)
        twist = [round(value + draw.number(-noise, noise), 9) for value in moved]
    else:
        twist = scene.after_twist
    after["linear_velocity"], after["angular_velocity"] = twist[:3], twist[3:]
    after["position"] = [round(x + scene.dt * v + draw.number(-0.02 * noise, 0.02 * noise), 9) for x, v in zip(position, twist)]
    after["quaternion"] = _stepped(scene.turn, [a + b for a, b in zip(twist[3:], scene.turn_error)], scene.dt)
    if scene.after_twist not in (None, STILL):
        moved = _backwards(given, scene, twist)
        moved = [round(value + draw.number(-noise, noise), 9) for value in moved]
        before["linear_velocity"], before["angular_velocity"] = moved[:3], moved[3:]
    return given


def _backwards(given: dict[str, Any], scene: Scene, twist: Row) -> Row:
    """The twist v' + g dt e3 - M^-1 J^T l of the carried impulses l."""
    problem = reference.problem_of(given)
    with localcontext() as context:
        context.prec = 40
        at, push = reference.contacts_of(problem, problem.theta), [Decimal(0)] * 6
        for i, normal, along, across in scene.carried:
            s = at.slips[i]
            speed = reference.dot(s, s).sqrt()
            ahead = [x / speed for x in s] if speed else [Decimal(1), Decimal(0)]
            pair = [
                Decimal(along) * ahead[0] - Decimal(across) * ahead[1],
                Decimal(along) * ahead[1] + Decimal(across) * ahead[0],
            ]
            for share, row in zip([Decimal(1), *pair], [at.normal_jacobians[i], *at.tangent_jacobians[i]]):
                push = [a + Decimal(normal) * share * b for a, b in zip(push, row)]
        change = [x / problem.mass for x in push[:3]] + reference.solve(problem.inertia, push[3:])
        moved = [Decimal(a) - b for a, b in zip(twist, change)]
        moved[2] += problem.gravity * problem.dt
        return [float(value) for value in moved]


# The groups: each makes a scene of a draw and the number of the problem.

SMALL = ("cube", "tetrahedron", "octahedron", "slab", "triangle", "wedge", "rod", "brick", "tetrahedron", "point")


def _scene(draw: Draw, name: str, turn: Row, gap: float, twist: Row | None, friction: float = 0.18) -> Scene:
    return Scene(name, turn, gap, twist, [], level_theta(BODIES[name], friction), [0.0] * 3, WEIGHTS)


def _other_weights(draw: Draw) -> dict[str, float]:
    return {name: round(value * draw.number(0.3, 3.0), 15) for name, value in WEIGHTS.items()}


def _weight(scene: Scene) -> float:
    """The impulse that carries the body for one time step."""
    return BODIES[scene.body].mass * scene.gravity * scene.dt


def _pinned(scene: Scene, contact: int, omega: Row, slip: Row) -> Row:
    """The twist that turns with omega and moves a contact with the given velocity over the board."""
    r = reference.rotation(reference.decimals(scene.turn))
    swept = reference.cross(reference.decimals(omega), reference.decimals(scene.theta["vertices_tangent"][contact]))
    carried = [float(reference.dot(row, swept)) for row in r]
    return [*(round(s - c, 9) for s, c in zip(slip, carried)), *omega]


def separated(draw: Draw, n: int) -> Scene:
    """In the air, 0.3 to 2 lengths above the ground."""
    return _scene(draw, SMALL[n % 10], draw.turn(), draw.number(0.3, 2.0), None)


def impact(draw: Draw, n: int) -> Scene:
    """The lowest contact is hit: an impulse some ten times what carries the body."""
    scene = _scene(draw, SMALL[n % 10], draw.turn(), draw.number(-0.02, 0.05), None)
    contact = lowest(scene)[0]
    twist = _pinned(scene, contact, draw.row(3, 8.0), [*draw.row(2, 6.0), draw.number(0.0, 1.0)])
    hit = _weight(scene) * draw.number(4.0, 15.0)
    return replace(scene, after_twist=twist, carried=[(contact, hit, draw.number(-1.0, -0.3), draw.number(-0.2, 0.2))])


def sticking(draw: Draw, n: int) -> Scene:
    """The lowest contact stays where it is, but for some thousandths of a length per step, and friction is not used up."""
    scene = _scene(draw, SMALL[n % 10], draw.turn(), draw.number(-0.02, 0.01), None)
    contact = lowest(scene)[0]
    twist = _pinned(scene, contact, draw.row(3, 1.5), [*draw.row(2, 0.2), 0.0])
    return replace(
        scene, after_twist=twist, carried=[(contact, _weight(scene), draw.number(-0.6, 0.3), draw.number(-0.5, 0.5))]
    )


def sliding(draw: Draw, n: int) -> Scene:
    """The lowest contacts slide at 1 to 9 lengths per second, friction against the slip and used up."""
    flat = n % 2 == 1 and SMALL[n % 10] in ("slab", "brick")
    scene = _scene(draw, SMALL[n % 10], draw.yaw() if flat else draw.turn(), draw.number(-0.02, 0.01), None)
    touching = lowest(scene)[: 4 if flat else 1]
    slip = [draw.sign() * draw.number(1.0, 6.0), draw.sign() * draw.number(1.0, 6.0), 0.0]
    twist = _pinned(scene, touching[0], [0.0, 0.0, draw.number(-4.0, 4.0)] if flat else draw.row(3, 2.0), slip)
    return replace(scene, after_twist=twist, carried=[(i, _weight(scene) / len(touching), -1.0, 0.0) for i in touching])


def rolling(draw: Draw, n: int) -> Scene:
    """The body turns over its lowest contact or edge at 5 to 20 rad/s."""
    scene = _scene(draw, SMALL[n % 10], draw.turn(), draw.number(-0.02, 0.01), None)
    contact = lowest(scene)[0]
    omega = [draw.sign() * draw.number(3.0, 11.0) for _ in range(3)]
    twist = _pinned(scene, contact, omega, [*draw.row(2, 0.05), 0.0])
    return replace(
        scene, after_twist=twist, carried=[(contact, _weight(scene), draw.number(-0.9, 0.9), draw.number(-0.3, 0.3))]
    )


def several_contacts(draw: Draw, n: int) -> Scene:
    """On a face that is not quite level, all its contacts loaded."""
    name = ("cube", "slab", "brick", "triangle", "wedge")[n % 5]
    lean = [1.0, *draw.row(2, 0.004), draw.number(-1.0, 1.0)]
    scene = _scene(draw, name, unit(lean), draw.number(-0.02, 0.0), None)
    touching = lowest(scene)[: 3 if name == "triangle" else 4]
    twist = [*draw.row(2, 2.0), draw.number(-0.2, 0.2), *draw.row(3, 0.5)]
    loads = [(i, _weight(scene) * draw.number(0.05, 0.6), draw.number(-1.0, 0.0), draw.number(-0.3, 0.3)) for i in touching]
    return replace(scene, after_twist=twist, carried=loads)


def coincident(draw: Draw, n: int) -> Scene:
    """Degenerate: contacts at exactly the same height, twice the same contact, a body that lies quite still."""
    still = n % 5 in (2, 3)
    name = ("slab", "triangle")[n // 2 % 2] if still else ("cube", "slab", "brick", "triangle")[n % 4]
    body = BODIES[name]
    scene = _scene(draw, name, draw.yaw(), draw.number(-0.015, 0.005), None, draw.number(0.1, 0.6))
    if n % 5 == 1:
        double = [*body.vertices[:3], body.vertices[0]]
        scene = replace(scene, theta={**scene.theta, "vertices_normal": double, "vertices_tangent": double})
    if still:
        return replace(scene, after_twist=STILL)
    touching = lowest(scene)[: 3 if name == "triangle" else 4]
    twist = [*draw.row(2, 4.0), 0.0, 0.0, 0.0, draw.number(-3.0, 3.0)]
    return replace(scene, after_twist=twist, carried=[(i, _weight(scene) / len(touching), -0.9, 0.0) for i in touching])


def tilted_ground(draw: Draw, n: int) -> Scene:
    """On a plane that leans, away from the origin: pivot and height count."""
    name = SMALL[n % 10]
    theta = tilted_theta(draw, BODIES[name], draw.number(0.1, 0.8))
    scene = replace(_scene(draw, name, draw.turn(), draw.number(-0.02, 0.02), None), theta=theta, pivot=draw.row(3, 2.0))
    contact = lowest(scene)[0]
    twist = _pinned(scene, contact, draw.row(3, 4.0), draw.row(3, 2.0))
    hit = _weight(scene) * draw.number(0.5, 6.0)
    return replace(scene, after_twist=twist, carried=[(contact, hit, draw.number(-1.0, 0.0), draw.number(-0.3, 0.3))])


def friction(draw: Draw, n: int) -> Scene:
    """Without friction, and with coefficients from 1 to 3."""
    name = SMALL[n % 10]
    scene = _scene(draw, name, draw.turn(), draw.number(-0.02, 0.02), None, 0.0 if n < COUNT // 2 else draw.number(1.0, 3.0))
    contact = lowest(scene)[0]
    twist = _pinned(scene, contact, draw.row(3, 4.0), [*draw.row(2, 3.0), 0.0])
    hit = _weight(scene) * draw.number(0.5, 6.0)
    return replace(scene, after_twist=twist, carried=[(contact, hit, draw.number(-1.0, 0.0), draw.number(-0.3, 0.3))])


def learned(draw: Draw, n: int) -> Scene:
    """Theta as while it is learned: two sets of contacts, a normal of any length, tangents that are not orthogonal."""
    name = ("cube", "tetrahedron", "slab", "octahedron", "triangle")[n % 5]
    theta = noisy_theta(draw, BODIES[name], 0.18, (0.1, 0.4)[n // 10])
    scene = replace(_scene(draw, name, draw.turn(), draw.number(-0.1, 0.1), None), theta=theta)
    contact = lowest(scene)[0]
    twist = _pinned(scene, contact, draw.row(3, 5.0), [*draw.row(2, 5.0), draw.number(-1.0, 1.0)])
    hit = _weight(scene) * draw.number(0.5, 8.0)
    return replace(scene, after_twist=twist, carried=[(contact, hit, draw.number(-1.0, 0.0), draw.number(-0.3, 0.3))])


def general(draw: Draw, n: int) -> Scene:
    """Everything at once: other time steps, gravities and weights; theta as learned, on a plane that leans, with a pivot."""
    name = SMALL[n % 10]
    theta = noisy_theta(draw, BODIES[name], draw.number(0.1, 0.8), 0.2)
    lean = draw.row(2, 0.4)
    theta["normal"] = [*(round(a + b, 9) for a, b in zip(theta["normal"], lean)), draw.number(0.6, 1.5)]
    theta["height"] = draw.number(-0.5, 0.5)
    scene = replace(
        _scene(draw, name, draw.turn(), draw.number(-0.05, 0.05), None),
        theta=theta,
        pivot=draw.row(3, 2.0),
        weights=_other_weights(draw),
        dt=draw.number(0.002, 0.02),
        gravity=draw.number(20.0, 400.0),
        turn_error=tuple(draw.row(3, 0.5)),
    )
    contact = lowest(scene)[0]
    twist = _pinned(scene, contact, draw.row(3, 5.0), draw.row(3, 3.0))
    hit = _weight(scene) * draw.number(0.5, 6.0)
    return replace(scene, after_twist=twist, carried=[(contact, hit, draw.number(-1.0, 0.3), draw.number(-0.3, 0.3))])


GROUPS: dict[str, Callable[[Draw, int], Scene]] = {
    maker.__name__: maker
    for maker in (
        separated, impact, sticking, sliding, rolling, several_contacts, coincident, tilted_ground, friction, learned, general,
    )
}  # fmt: skip


def drawn(group: str, n: int, attempt: int) -> dict[str, Any]:
    """A problem without its answer. The last four of each group have other weights."""
    draw = Draw(f"{SEED} {group} {n} {attempt}")
    scene = GROUPS[group](draw, n)
    if n >= COUNT - 4:
        scene = replace(scene, weights=_other_weights(draw))
    noise = 0.0 if scene.after_twist == STILL else 0.3
    return problem_of(f"{group}-{n:02d}", ("circular", "polyhedral")[n // 2 % 2], scene, draw, noise)


def made(group: str, n: int) -> dict[str, Any]:
    """A problem with its answer, from the first draw that is far enough from where derivatives jump."""
    for attempt in range(1000):
        given = drawn(group, n, attempt)
        try:
            found = reference.expected(reference.problem_of(given))
        except ArithmeticError:  # no margin at all: the faces of the cones cannot be told
            continue
        if found["certificate"]["margin"] >= LEAST_MARGIN:
            return {**given, "expected": found}
    raise ArithmeticError(f"{group} {n}: no draw has a margin of {LEAST_MARGIN}")


def text_of(group: str, problems: list[dict[str, Any]]) -> str:
    """A file of problems, a line for each value."""
    lines = ["{", f' "format": "contact-loss-problems",\n "version": 1,\n "license": "BSD-3-Clause",\n "group": "{group}",']
    lines.append(f' "about": {json.dumps(GROUPS[group].__doc__)},\n "problems": [')
    pieces = []
    for problem in problems:
        keys = [f'   "{key}": {json.dumps(value)}' for key, value in problem["expected"].items()]
        head = [f'  "{key}": {json.dumps(value)}' for key, value in problem.items() if key != "expected"]
        pieces.append("  {\n" + ",\n".join([*head, '  "expected": {\n' + ",\n".join(keys) + "\n  }"]) + "\n  }")
    return "\n".join([*lines, ",\n".join(pieces), " ]\n}\n"])


def main() -> None:
    """Writes the named groups, or all."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("groups", nargs="*", metavar="GROUP", help=", ".join(GROUPS))
    groups = parser.parse_args().groups or list(GROUPS)
    if unknown := set(groups) - set(GROUPS):
        parser.error(f"unknown group {', '.join(sorted(unknown))}, expected some of {', '.join(GROUPS)}")
    FOLDER.mkdir(exist_ok=True)
    for group in groups:
        text = text_of(group, [made(group, n) for n in range(COUNT)])
        (FOLDER / f"{group}.json").write_text(text, encoding="utf-8")
        print(group, len(text), flush=True)


if __name__ == "__main__":
    main()
