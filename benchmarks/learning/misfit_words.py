"""How often `check` says of random bodies that they bounce, by their restitution.

Bodies are those of `benchmarks.learning.starts`, many of whose corners rise by themselves when the next one lands, and slender
boxes. They are thrown in our own simulation and tracked with the noise of ContactNets' rig; the body as described is the true
one. Then come the lines of the experiments' bodies, and how far the corners of those go below where they rest that MuJoCo
throws with contacts of several time constants. Last come frictions that models learn from 16 random tosses in MuJoCo, and in
how many of the frames that move on the board contacts use them up.

    python -m benchmarks.learning.misfit_words [--bodies 20] [--tosses 16] [--restitutions 0 0.1 0.2 0.3] [--draws 1]
"""

import argparse
import sys
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from benchmarks.learning.coverage import SLAB, STONE, World, contacts, fitted
from benchmarks.learning.starts import DENSITY, FRICTION, body_of
from contact_curation.contact.body import CONTACTNETS_CUBE, Body
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.design.throw import throw_of_state
from contact_curation.experiments.bodies import BODIES, bench_of
from contact_curation.geometry.polytopes import box
from contact_curation.geometry.solids.mass_properties import of_hull
from contact_curation.learning.evaluation.misfit import (
    bounce_in_words,
    friction_use,
    impact_depth,
    sliding_of,
    softness_in_words,
    sticking_in_words,
)
from contact_curation.motion.toss import Toss
from contact_curation.motion.transitions import states_of, transitions_of
from contact_curation.simulation.thrown_toss import ThrownTossConfig, thrown_toss
from contact_curation.simulation.world import WorldConfig
from test.simulated import RIG_NOISE, simulated_tosses

IN_MUJOCO, MANY, SOME = ("slab", "wedge", "irregular"), 60, 20
RECORDED, TIMES = ("cube", "square"), (6, 12, 20)
FRICTIONS, FITTED, DRAWS = (0.05, 0.18, 0.3, 0.45, 0.6, 0.9), 16, 3


def slender(number: int) -> Body:
    """A box 1.5 to 6 times as long as wide."""
    rng = np.random.default_rng([number, 22])
    half = np.array([0.02, 0.02 * rng.uniform(0.8, 1.5), 0.02 * rng.uniform(1.5, 6.0)])
    unit = of_hull(box(half).vertices)
    size = float(np.cbrt(np.prod(half)))
    return Body(f"box_{number}", box(half).vertices, DENSITY * unit.mass, DENSITY * unit.inertia, FRICTION, size)


def softer(body: Body, tosses: Sequence[Toss], milliseconds: int) -> list[Toss]:
    """Throws from the releases of tosses onto a board of another time constant."""
    config = ThrownTossConfig(world=WorldConfig(contact_time=0.001 * milliseconds))
    starts = [throw_of_state(toss.source, body.name, states_of(toss, 1.0)[0]) for toss in tosses]
    return [thrown_toss(body, start, config) for start in starts]


def sliding_line(body: Body, tosses: Sequence[Toss], seed: int) -> str:
    """What is learned of their friction, and what is said of it."""
    data = transitions_of(tosses, body.length_scale)
    geometry = fitted(body, data, seed, bounces=False).geometry()
    use = friction_use(data, geometry, body)
    learned = float(np.linalg.norm(geometry.tangents[0]))
    words = sticking_in_words(data, geometry, body, sliding_of(tosses, body))
    said = f"said: ...{words[words.rindex(', ') + 1 :]}" if words else "not said"
    return f"{learned:.3f} learned, {100.0 * (use.sliding if use else 0.0):.0f} % of frames slide, {said}"


def main() -> int:
    """Prints a line for each kind of body and restitution."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--bodies", type=int, default=20)
    parser.add_argument("--tosses", type=int, default=16)
    parser.add_argument("--restitutions", nargs="+", type=float, default=[0.0, 0.1, 0.2, 0.3])
    parser.add_argument("--draws", type=int, default=1, help="of tosses of each body (default 1)")
    arguments = parser.parse_args()
    for kind, make in (("random bodies", body_of), ("slender boxes", slender)):
        for restitution in arguments.restitutions:
            said = 0
            for number in range(arguments.bodies):
                body = make(number)
                geometry = replace(ContactGeometry.of_body(body).rigid(), restitution=restitution or None)
                for draw in range(arguments.draws):
                    seed = number + 1000 * draw
                    tosses = simulated_tosses(arguments.tosses, seed, RIG_NOISE, body=body, geometry=geometry)
                    said += bool(bounce_in_words(tosses, body))
            of = arguments.bodies * arguments.draws
            print(f"{kind}, restitution {restitution:g}: said of {said} of {of}", flush=True)
    for name in IN_MUJOCO:
        described, thrown = BODIES[name]()
        print(f"{name}, thrown in MuJoCo: {bounce_in_words(thrown[:MANY], described)}")
        for milliseconds in TIMES:
            soft = softer(described, thrown[:SOME], milliseconds)
            depth = impact_depth(soft, described) / described.length_scale
            print(f"{name}, time constant {milliseconds} ms: {depth:.3f} lengths deep; {softness_in_words(soft, described)}")
    for name in RECORDED:
        bench = bench_of(name, 0)
        recorded = bench.training + bench.held_out
        depth = impact_depth(recorded, bench.body) / bench.body.length_scale
        print(f"{name}: {depth:.3f} lengths deep; {softness_in_words(recorded, bench.body)}")
        if slid := sliding_of(recorded, bench.body):
            found = f"{slid.median:.3f}, of {len(slid.friction)} of {len(recorded)} tosses"
            print(f"{name}: sliding friction {found}, relative standard deviation {slid.variation:.3f}")
        for draw in range(DRAWS):
            some = np.random.default_rng(draw).choice(len(bench.training), FITTED, replace=False).tolist()
            print(f"{name}: {sliding_line(bench.body, [bench.training[place] for place in some], draw)}", flush=True)
    for body in (CONTACTNETS_CUBE, SLAB, STONE):
        for friction in FRICTIONS:
            tosses = World(replace(body, friction=friction), contacts(2.0, 1.0)).tosses(FITTED, DRAWS)
            print(f"{body.name}, friction {friction:.2f}: {sliding_line(body, tosses, DRAWS)}", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
