"""How still must a tracker be? Tosses that are found, and that pass the gates, over its noise and its rate.

The cube is released as in the real data and moved by MuJoCo, after a third of a second in which it is carried at the velocity
of its release; white noise is added to its poses in multiples of the real rig's, 0.022 mm and 0.024 degrees per axis. They go
the way of `pose_ingest`, once as by default, with the published bounds, and once told how noisy the tracker is
(`tracker_noise`). No data are needed.

    python -m benchmarks.tracker_noise [--tosses N] [--seed N] [--json]
"""

import argparse
import json
import sys
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import NamedTuple

import numpy as np

from contact_curation.contact.body import CONTACTNETS_CUBE as CUBE
from contact_curation.geometry import quaternions
from contact_curation.geometry.quaternions import Array
from contact_curation.geometry.scalars import ScalarPose
from contact_curation.motion.body_tracker import TrackerConfig
from contact_curation.motion.ingest import IngestConfig, IngestEvent, TossIngest
from contact_curation.motion.pose_stream import FramePose
from contact_curation.motion.toss import NANOSECONDS, Rejected, Toss
from contact_curation.sim.free_motion import free_motion
from test.simulated import RIG_NOISE, release_states

RATES = (60, 148, 240)
MULTIPLES = (1.0, 1.5, 2.0, 3.0, 5.0, 10.0)
BOARD = "board"
CARRIED, SEEN = 1.0 / 3.0, 3.0
"""Before the release and after it [s]."""


@dataclass(frozen=True)
class Row:
    """What became of the tosses.

    Attributes:
        rate: frames a second.
        multiple: of the real rig's noise.
        passed: share of them that were found and passed the gates, as by default.
        passed_told: likewise, told of the noise.
        late: when those begin after the release, median [ms].
        against: what most often keeps the others back, by default, and told.
    """

    rate: int
    multiple: float
    passed: float
    passed_told: float
    late: float
    against: tuple[str, str]


class Outcome(NamedTuple):
    """What keeps a toss back, empty for one that passed; and when that begins after the release [s]."""

    against: str
    late: float = np.nan


def main() -> int:
    """Prints a table, or JSON."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--tosses", type=int, default=40, help="how many (default 40)")
    parser.add_argument("--seed", type=int, default=0, help="of releases and noise (default 0)")
    parser.add_argument("--json", action="store_true", help="print JSON")
    arguments = parser.parse_args()
    rows = [row for rate in RATES for row in rows_of_rate(rate, arguments.tosses, arguments.seed)]
    if arguments.json:
        print(json.dumps([asdict(row) for row in rows], indent=1))
        return 0
    print(f"{'Hz':>4} {'noise':>6} {'mm':>6} {'passed':>7} {'told':>6} {'late, ms':>9}  most often against it; told")
    for row in rows:
        millimetres, against = 1e3 * RIG_NOISE.position * row.multiple, "; ".join(one or "-" for one in row.against)
        shares = f"{row.passed:7.0%} {row.passed_told:6.0%} {row.late:9.1f}"
        print(f"{row.rate:4d} {row.multiple:5.1f}x {millimetres:6.3f} {shares}  {against}")
    return 0


def rows_of_rate(rate: int, count: int, seed: int) -> Iterator[Row]:
    """A row per multiple, of the same tosses."""
    releases = release_states(count, np.random.default_rng(seed))
    motions = [motion(release, 1.0 / rate) for release in releases]
    for multiple in MULTIPLES:
        rng = np.random.default_rng([seed, rate])
        streams = [noisy(poses, multiple, rng) for poses in motions]
        plain, told = ([outcome(poses, rate, noise) for poses in streams] for noise in (1.0, max(multiple, 1.0)))
        late = [1e3 * one.late for one in told if not one.against]
        passed, passed_told = (float(np.mean([not one.against for one in each])) for each in (plain, told))
        yield Row(rate, multiple, passed, passed_told, float(np.median(late)) if late else np.nan, (most(plain), most(told)))


def motion(release: Array, period: float) -> Array:
    """(T, 7) poses from before the release on."""
    flown = free_motion(CUBE, release, round(SEEN / period), period)
    back = -period * np.arange(round(CARRIED / period), 0, -1)[:, None]
    turned = quaternions.multiply(np.tile(release[3:7], (len(back), 1)), quaternions.exp(back * release[10:]))
    return np.concatenate([np.concatenate([release[:3] + back * release[7:10], turned], axis=1), flown[:, :7]])


def noisy(poses: Array, multiple: float, rng: np.random.Generator) -> Array:
    """As the tracker tells them."""
    white = multiple * rng.standard_normal((2, len(poses), 3))
    turned = quaternions.multiply(poses[:, 3:], quaternions.exp(RIG_NOISE.orientation * white[1]))
    return np.concatenate([poses[:, :3] + RIG_NOISE.position * white[0], turned], axis=1)


def outcome(poses: Array, rate: int, noise: float) -> Outcome:
    """What becomes of a stream with one toss, told that the tracker is so noisy."""
    frames = TrackerConfig(CUBE.name, BOARD)
    ingest = TossIngest(IngestConfig(frames).of_tracker(noise), CUBE.polytope, body=CUBE.name, source="simulated")
    ended: list[IngestEvent] = []
    for frame, (x, y, z, *turn) in enumerate(poses.tolist()):
        pose = ScalarPose((x, y, z), (turn[0], turn[1], turn[2], turn[3]))
        ended += ingest.push(FramePose(round(frame * NANOSECONDS / rate), BOARD, CUBE.name, pose))
    ended += ingest.flush()
    for one in ended:
        if isinstance(one, Toss):
            return Outcome("", one.stamps_ns[0] / NANOSECONDS - round(CARRIED * rate) / rate)
    rejected = [one for one in ended if isinstance(one, Rejected)]
    return Outcome(rejected[0].reasons[0].partition(":")[0] if rejected else "no free fall seen")


def most(outcomes: Sequence[Outcome]) -> str:
    """What most often keeps tosses back."""
    against = [one.against for one in outcomes if one.against]
    return max(sorted(set(against)), key=against.count, default="")


if __name__ == "__main__":
    sys.exit(main())
