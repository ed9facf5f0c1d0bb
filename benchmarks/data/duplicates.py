"""Which public tosses are one recording under two headings of the board, and how many of them leak into the held-out ids.

Heights and body-frame velocities do not depend on the heading. The tosses are found through CONTACTNETS_DATA.

    python -m benchmarks.data.duplicates [--json]
"""

import argparse
import json
from itertools import combinations

import numpy as np

from benchmarks._data import contactnets_folder
from contact_curation.motion.toss import Toss
from contact_curation.storage.datasets.contactnets import read_contactnets

FIRST_HELD_OUT = 400
SAME = 1e-9
"""Largest difference of equal numbers: [m] for heights, [rad/s] for angular velocities."""


def main() -> int:
    """Prints a table, or JSON."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--json", action="store_true", help="print JSON instead of a table")
    arguments = parser.parse_args()
    folder = contactnets_folder()
    if folder is None:
        return 0
    tosses = [toss for toss in read_contactnets(folder) if isinstance(toss, Toss)]
    pairs = [(int(a.toss_id), int(b.toss_id)) for a, b in combinations(tosses, 2) if are_the_same(a, b)]
    leaking = [pair for pair in pairs if min(pair) < FIRST_HELD_OUT <= max(pair)]
    if arguments.json:
        print(json.dumps({"tosses": len(tosses), "pairs": pairs, "leaking_pairs": leaking}))
        return 0
    print(f"{len(tosses)} tosses, {len(pairs)} pairs that are one recording under two headings:")
    print("  " + " ".join(f"{a}={b}" for a, b in pairs))
    print(f"{len(leaking)} pairs have one toss below {FIRST_HELD_OUT} and one held out:")
    print("  " + " ".join(f"{a}={b}" for a, b in leaking))
    return 0


def are_the_same(one: Toss, other: Toss) -> bool:
    """Whether two tosses differ in the board's heading only."""
    if one.frames != other.frames:
        return False
    heights = np.abs(one.positions[:, 2] - other.positions[:, 2]).max()
    return bool(heights < SAME and np.abs(one.angular_velocities - other.angular_velocities).max() < SAME)


if __name__ == "__main__":
    raise SystemExit(main())
