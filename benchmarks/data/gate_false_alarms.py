"""How many good tosses the segmenter and the quality checks reject, and how many bad ones: nine bodies, three rates and noises.

Bodies of `thrown_bodies` are thrown in MuJoCo, seen by a tracker at 60, 120 and 250 frames a second with 1, 2 and 4 times the
noise of ContactNets' rig, and go the way of `pose_ingest`, told how noisy the tracker is. Every toss is good: one that does not
come out as one accepted toss is a false alarm. Accepted tosses are then made bad as in `experiments.faults` (5 mm off for one
frame or for some, 10 mm of drift, a board off by 3 mm and 2 degrees, tags taken for others, orientations 2 frames late), turned
by 90 degrees in one frame, or made 5 % too large; a fault is found if the checks reject the toss.

    python -m benchmarks.data.gate_false_alarms [--tosses N] [--bodies NAME ...] [--out FILE.csv [--resume]]

Rows are written as they are known, and `--resume` goes on with a file that was begun with the same number of tosses and seed.
"""

import argparse
import csv
import sys
from collections import Counter
from collections.abc import Iterator, Sequence, Set
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np

from benchmarks.data.thrown_bodies import FINE_PERIOD, ThrownBody, bodies, release, thrown
from contact_curation.contact.body import Body
from contact_curation.errors import InvalidValueError
from contact_curation.experiments.faults import MAKERS, FaultConfig
from contact_curation.geometry import quaternions
from contact_curation.geometry.quaternions import Array
from contact_curation.geometry.scalars import ScalarPose
from contact_curation.motion.body_tracker import TrackerConfig
from contact_curation.motion.gate_config import GateConfig
from contact_curation.motion.gates import inspect
from contact_curation.motion.ingest import IngestConfig, IngestEvent, TossIngest
from contact_curation.motion.pose_noise import RIG_NOISE, RIG_TURN
from contact_curation.motion.pose_stream import FramePose
from contact_curation.motion.segmenter_config import SegmenterConfig
from contact_curation.motion.smoothing import kinematics
from contact_curation.motion.toss import NANOSECONDS, Rejected, Toss

RATES, NOISES = (60, 120, 250), (1.0, 2.0, 4.0)
BOARD = "board"
SPOILT = 50
"""So many accepted tosses of a cell are made bad, each in every way."""

FLIP, SCALE = 0.5 * np.pi, 1.05
"""A turn of one frame [rad]; how much too large lengths are."""


@dataclass(frozen=True)
class Cell:
    """What became of the tosses of one body, rate and noise.

    Attributes:
        body: name.
        rate: frames a second.
        noise: in multiples of that of ContactNets' rig.
        tosses: how many.
        rejected: how many of these good ones were rejected or not seen.
        against: what most often.
        found: share of the tosses with a fault that were rejected, by its name.
    """

    body: str
    rate: int
    noise: float
    tosses: int
    rejected: int
    against: str
    found: dict[str, float]

    def row(self) -> dict[str, object]:
        """As a row of a table."""
        shares = {name: f"{share:.2f}" for name, share in self.found.items()}
        return {name: value for name, value in asdict(self).items() if name != "found"} | shares


def main() -> int:
    """Prints a row per cell; writes them, too, where a file is named."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--tosses", type=int, default=40, help="of each body (default 40)")
    parser.add_argument("--seed", type=int, default=0, help="of throws, noise and faults (default 0)")
    parser.add_argument("--bodies", nargs="+", help="names (default all)")
    parser.add_argument("--out", type=Path, help="CSV file to write")
    parser.add_argument("--resume", action="store_true", help="go on with the file")
    arguments = parser.parse_args()
    if arguments.out and not arguments.resume:
        arguments.out.unlink(missing_ok=True)
    known = known_cells(arguments.out, arguments.tosses) if arguments.out else set()
    for thrower in bodies():
        if arguments.bodies and thrower.body.name not in arguments.bodies:
            continue
        for cell in cells_of(thrower, arguments.tosses, arguments.seed, known):
            shares = "  ".join(f"{name} {share:.0%}" for name, share in cell.found.items())
            against = f"({cell.against}) " if cell.against else ""
            head = f"{cell.body:16s} {cell.rate:4d} Hz {cell.noise:g}x  rejected {cell.rejected}/{cell.tosses}"
            print(f"{head} {against} found: {shares}", flush=True)
            if arguments.out:
                append(arguments.out, cell)
    return 0


def known_cells(path: Path, tosses: int) -> set[tuple[str, int, float]]:
    """Body, rate and noise of the cells that a file has.

    Raises:
        InvalidValueError: they are of another number of tosses.
    """
    if not path.exists():
        return set()
    with path.open(newline="") as file:
        rows = list(csv.DictReader(file))
    if others := {row["tosses"] for row in rows} - {str(tosses)}:
        raise InvalidValueError(f"tosses in {path}", ", ".join(sorted(others)), f"{tosses}, as --tosses says")
    return {(row["body"], int(row["rate"]), float(row["noise"])) for row in rows}


def append(path: Path, cell: Cell) -> None:
    """Writes a row more."""
    row, begun = cell.row(), path.exists()
    with path.open("a", newline="") as file:
        table = csv.DictWriter(file, list(row), lineterminator="\n")
        if not begun:
            table.writeheader()
        table.writerow(row)


def cells_of(thrower: ThrownBody, count: int, seed: int, known: Set[tuple[str, int, float]]) -> Iterator[Cell]:
    """A cell per rate and noise that is not known, of the same throws."""
    if all((thrower.body.name, rate, noise) in known for rate in RATES for noise in NOISES):
        return
    rng, motions = np.random.default_rng(seed), list[Array]()
    while len(motions) < count:
        poses = thrown(thrower, release(thrower.body, rng))
        motions += [] if poses is None else [poses]
    for rate in RATES:
        frames = [poses[:: round(1.0 / (rate * FINE_PERIOD))] for poses in motions]
        for noise in NOISES:
            if (thrower.body.name, rate, noise) in known:
                continue
            yield cell_of(thrower.body, rate, noise, frames, np.random.default_rng([seed, rate, round(noise)]))


def cell_of(body: Body, rate: int, noise: float, motions: Sequence[Array], rng: np.random.Generator) -> Cell:
    """What becomes of some motions (T, 7)."""
    rules, accepted, against = SegmenterConfig(tracker_noise=noise), list[Toss](), Counter[str]()
    for poses in motions:
        ended = ingested(body, rate, noisy(poses, noise, rng), rules)
        found = [event for event in ended if isinstance(event, Toss)]
        if len(found) == len(ended) == 1:
            accepted += found
        else:
            against[next((one.reasons[0].partition(":")[0] for one in ended if isinstance(one, Rejected)), "not seen")] += 1
    most = against.most_common(1)
    return Cell(
        body.name,
        rate,
        noise,
        len(motions),
        sum(against.values()),
        most[0][0] if most else "",
        {name: found_share(body, rules, spoilt) for name, spoilt in spoilt_tosses(accepted[:SPOILT], rng)},
    )


def noisy(poses: Array, noise: float, rng: np.random.Generator) -> Array:
    """Poses (T, 7) as a tracker with so many times the noise of ContactNets' rig sees them."""
    off, turns = (
        noise * RIG_NOISE * rng.standard_normal((len(poses), 3)),
        noise * RIG_TURN * rng.standard_normal((len(poses), 3)),
    )
    return np.concatenate([poses[:, :3] + off, quaternions.multiply(poses[:, 3:], quaternions.exp(turns))], axis=1)


def ingested(body: Body, rate: int, poses: Array, rules: SegmenterConfig) -> list[IngestEvent]:
    """What segmenter and checks make of poses (T, 7)."""
    ingest = TossIngest(IngestConfig(TrackerConfig(body.name, BOARD), rules), body, source="simulated")
    ended: list[IngestEvent] = []
    for frame, (x, y, z, *turn) in enumerate(poses.tolist()):
        pose = ScalarPose((x, y, z), (turn[0], turn[1], turn[2], turn[3]))
        ended += ingest.push(FramePose(round(frame * NANOSECONDS / rate), BOARD, body.name, pose))
    return [*ended, *ingest.flush()]


def spoilt_tosses(tosses: Sequence[Toss], rng: np.random.Generator) -> Iterator[tuple[str, list[Toss]]]:
    """The tosses with each of the faults, by its name."""
    for fault, made_bad in MAKERS.items():
        yield fault.value, [made_bad(toss, rng, FaultConfig()) for toss in tosses]
    yield "flip", [flipped(toss, rng) for toss in tosses]
    larger = [
        replace(toss, positions=SCALE * toss.positions, linear_velocities=SCALE * toss.linear_velocities) for toss in tosses
    ]
    yield "scale", larger


def flipped(toss: Toss, rng: np.random.Generator) -> Toss:
    """One frame is turned about one of the body's axes."""
    at = int(rng.integers(1, toss.frames - 1))
    orientations = toss.orientations_wxyz.copy()
    orientations[at] = quaternions.multiply(orientations[at], quaternions.exp(FLIP * np.eye(3)[rng.integers(3)]))
    rates = kinematics(toss.stamps_ns, toss.positions, orientations)
    return replace(toss, orientations_wxyz=orientations, angular_velocities=rates.angular_velocities)


def found_share(body: Body, rules: SegmenterConfig, tosses: Sequence[Toss]) -> float:
    """The share of tosses that the checks reject."""
    return float(np.mean([bool(inspect(toss, body, GateConfig(), rules.tracker)) for toss in tosses])) if tosses else np.nan


if __name__ == "__main__":
    sys.exit(main())
