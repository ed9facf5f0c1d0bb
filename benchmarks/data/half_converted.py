"""How often `check` says that positions and orientations are given in other frames: of sound poses, and of half converted ones.

Sets of n tosses are drawn from the real cube's below 400, from bodies of the experiments, which MuJoCo throws, and from random
bodies with soft contacts at several rates (`benchmarks.learning.starts`, `coverage`). Their positions alone are then mirrored
(left-handed), or turned about the vertical. Shares of the sets that are said to be so.

    python -m benchmarks.data.half_converted [--sizes 8 16 32] [--sets 20]

CONTACTNETS_DATA names the folder of the real tosses.
"""

import argparse
import sys
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from benchmarks.learning.coverage import World, contacts
from benchmarks.learning.starts import body_of
from contact_curation.contact.body import Body
from contact_curation.experiments.bodies import bench_of
from contact_curation.geometry import quaternions
from contact_curation.geometry.quaternions import Array
from contact_curation.motion.survey.one_frame import other_frame
from contact_curation.motion.toss import Toss

BENCHES = {"real cube": ("cube",), "slab, wedge, irregular": ("slab", "wedge", "irregular")}
"""Bodies of the experiments."""

RATES, SOFTNESS, DAMPING = (60.0, 90.0, 148.0, 250.0), (2.0, 8.0), (0.3, 1.0)
"""Of worlds of random bodies: frames per second, time constants [ms], and damping ratios of contacts."""


def about_z(degrees: float) -> Array:
    """(3, 3) a turn."""
    return quaternions.to_matrix(quaternions.exp(np.radians([0.0, 0.0, degrees])))


CHANGES = {
    "as read": np.eye(3),
    "mirrored": np.diag([1.0, -1.0, 1.0]),
    "turned by 90": about_z(90.0),
    "turned by 40": about_z(40.0),
}


def pools(sets: int, largest: int) -> Iterator[tuple[str, Sequence[tuple[Body, Sequence[Toss]]]]]:
    """Name, and for each of some sets a body and tosses to draw from."""
    for name, bodies in BENCHES.items():
        benches = [bench_of(bodies[seed % len(bodies)], seed) for seed in range(sets)]
        yield name, [(one.body, (*one.training, *one.held_out)) for one in benches]
    for rate in RATES:
        drawn = []
        for number in range(sets):
            rng = np.random.default_rng([number, int(rate)])
            world = World(body_of(number), contacts(rng.uniform(*SOFTNESS), rng.uniform(*DAMPING)), 1.0 / rate)
            drawn.append((world.body, world.tosses(largest, number)))
        yield f"random bodies at {rate:.0f} Hz", drawn


def is_said(body: Body, tosses: Sequence[Toss], change: Array) -> bool:
    """Whether something is said of tosses whose positions alone are changed (3, 3)."""
    changed = [
        replace(toss, positions=toss.positions @ change.T, linear_velocities=toss.linear_velocities @ change.T)
        for toss in tosses
    ]
    return other_frame(changed, body.vertices, body.inertia / body.mass, body.gravity) is not None


def main() -> int:
    """Prints shares."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--sizes", type=int, nargs="+", default=[8, 16, 32], help="of the sets (default 8 16 32)")
    parser.add_argument("--sets", type=int, default=20, help="of each size (default 20)")
    arguments = parser.parse_args()
    print(f"| tosses of | n | {' | '.join(CHANGES)} |\n|{'---|' * (len(CHANGES) + 2)}")
    for name, drawn in pools(arguments.sets, max(arguments.sizes)):
        for size in arguments.sizes:
            said = dict.fromkeys(CHANGES, 0)
            for number, (body, tosses) in enumerate(drawn):
                chosen = np.random.default_rng([number, size]).permutation(len(tosses))[:size]
                for change, matrix in CHANGES.items():
                    said[change] += is_said(body, [tosses[place] for place in chosen], matrix)
            print(f"| {name} | {size} | {' | '.join(f'{count} of {len(drawn)}' for count in said.values())} |", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
