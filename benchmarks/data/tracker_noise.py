"""How still must a tracker be? Tosses that pass segmenter and gates, over its noise and its rate.

The cube is released as in the real data and moved by MuJoCo; before that it is held still and swung. White noise is added to
its poses in multiples of that of ContactNets' rig, 0.022 mm and 0.024 degrees per axis. They go the way of `pose_ingest`: with
the bounds for ContactNets' rig (`segmenter.tracker_noise` 1), with those for the noise that is measured (the default), and told
of it. A toss that begins in the hand is no free motion: it does not count as passed. No data are needed.

    python -m benchmarks.data.tracker_noise [--tosses N] [--seed N] [--json]
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
from contact_curation.motion.segmenter_config import SegmenterConfig
from contact_curation.motion.toss import NANOSECONDS, Rejected, Toss
from contact_curation.simulation.world import free_motion
from test.simulated import RIG_NOISE, TrackerNoise, release_states, with_noise

RATES = (60, 148, 240)
MULTIPLES = (1.0, 2.0, 3.0, 5.0, 8.0, 12.0, 16.0, 24.0, 32.0)
BOARD, IN_HAND = "board", "begins in the hand"
HELD, SWUNG, SEEN = 2.0, 0.3, 3.0
"""Before the release, then again, and after it [s]."""

EARLY = 0.05
"""A toss that begins longer before the release begins in the hand [s]."""


@dataclass(frozen=True)
class Row:
    """What became of the tosses.

    Attributes:
        rate: frames a second.
        multiple: of the noise of ContactNets' rig.
        passed: share of them that were found and passed the gates, with the bounds for ContactNets' rig.
        passed_measured: likewise, by default.
        passed_told: likewise, told of the noise.
        in_hand: share that passed by default, but began in the hand.
        to_slide: how far the cube is from its rest where those that passed by default end, median [mm].
        against: what most often keeps the others back, with the bounds for ContactNets' rig, by default, and told.
    """

    rate: int
    multiple: float
    passed: float
    passed_measured: float
    passed_told: float
    in_hand: float
    to_slide: float
    against: tuple[str, str, str]


class Outcome(NamedTuple):
    """What keeps a toss back, empty for one that passed; how far that slides on after its end [m]."""

    against: str
    to_slide: float = np.nan


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
    print(f"{'Hz':>4} {'noise':>6} {'mm':>6} {'as rig':>7} {'passed':>7} {'told':>6} {'in hand':>8} {'slide':>6}  against each")
    for row in rows:
        millimetres, against = 1e3 * RIG_NOISE.position * row.multiple, "; ".join(one or "-" for one in row.against)
        shares = f"{row.passed:7.0%} {row.passed_measured:7.0%} {row.passed_told:6.0%} {row.in_hand:8.0%} {row.to_slide:6.2f}"
        print(f"{row.rate:4d} {row.multiple:5.1f}x {millimetres:6.3f} {shares}  {against}")
    return 0


def rows_of_rate(rate: int, count: int, seed: int) -> Iterator[Row]:
    """A row per multiple, of the same tosses."""
    releases = release_states(count, np.random.default_rng(seed))
    motions = [motion(release, 1.0 / rate) for release in releases]
    for multiple in MULTIPLES:
        rng = np.random.default_rng([seed, rate])
        noise = TrackerNoise(multiple * RIG_NOISE.position, multiple * RIG_NOISE.orientation)
        streams = [with_noise(poses, noise, rng) for poses in motions]
        plain, measured, told = (
            [outcome(poses, true, rate, said) for poses, true in zip(streams, motions, strict=True)]
            for said in (1.0, None, multiple)
        )
        as_rig, by_default, when_told = (float(np.mean([not one.against for one in each])) for each in (plain, measured, told))
        in_hand = float(np.mean([one.against == IN_HAND for one in measured]))
        left = [1e3 * one.to_slide for one in measured if not one.against]
        to_slide = float(np.median(left)) if left else np.nan
        yield Row(rate, multiple, as_rig, by_default, when_told, in_hand, to_slide, (most(plain), most(measured), most(told)))


def motion(release: Array, period: float) -> Array:
    """(T, 7) poses: held, swung to the speed of the release, thrown."""
    flown = free_motion(CUBE, release, round(SEEN / period), period)
    times = -period * np.arange(round((HELD + SWUNG) / period), 0, -1)
    swing = np.clip(times + SWUNG, 0.0, None)  # from rest to the release with constant acceleration
    way = (swing**2 / (2.0 * SWUNG) - 0.5 * SWUNG)[:, None]
    turned = quaternions.multiply(np.tile(release[3:7], (len(way), 1)), quaternions.exp(way * release[10:]))
    return np.concatenate([np.concatenate([release[:3] + way * release[7:10], turned], axis=1), flown[:, :7]])


def outcome(poses: Array, true: Array, rate: int, noise: float | None) -> Outcome:
    """What becomes of a stream with one toss, told that the tracker is so noisy, or nothing."""
    config = IngestConfig(TrackerConfig(CUBE.name, BOARD), SegmenterConfig(tracker_noise=noise))
    ingest = TossIngest(config, CUBE, source="simulated")
    ended: list[IngestEvent] = []
    for frame, (x, y, z, *turn) in enumerate(poses.tolist()):
        pose = ScalarPose((x, y, z), (turn[0], turn[1], turn[2], turn[3]))
        ended += ingest.push(FramePose(round(frame * NANOSECONDS / rate), BOARD, CUBE.name, pose))
    ended += ingest.flush()
    for one in ended:
        if isinstance(one, Toss):
            late = one.stamps_ns[0] / NANOSECONDS - round((HELD + SWUNG) * rate) / rate
            last = round(one.stamps_ns[-1] * rate / NANOSECONDS)
            to_slide = float(np.linalg.norm(true[-1, :3] - true[last, :3]))
            return Outcome(IN_HAND if late < -EARLY else "", to_slide)
    rejected = [one for one in ended if isinstance(one, Rejected)]
    return Outcome(rejected[0].reasons[0].partition(":")[0] if rejected else "no free fall seen")


def most(outcomes: Sequence[Outcome]) -> str:
    """What most often keeps tosses back."""
    against = [one.against for one in outcomes if one.against]
    return max(sorted(set(against)), key=against.count, default="")


if __name__ == "__main__":
    sys.exit(main())
