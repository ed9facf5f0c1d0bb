"""Stamps of reception: how many good tosses are lost where header stamps are late by what varies from frame to frame?

The cube is held, swung, released as in the real data and moved by MuJoCo, and seen with the noise of ContactNets' rig. Its
stamps are off by a normal distribution; by delays that are exponentially distributed, in a queue that keeps the order; or by
single delays of 1 to 20 ms of one frame in fifty, which hold up those behind. They go the way of `pose_ingest`. No data are
needed.

    python -m benchmarks.data.stamp_jitter [--tosses N] [--seed N]
"""

import argparse
import sys
from collections.abc import Callable

import numpy as np

from benchmarks.data.tracker_noise import BOARD, motion
from contact_curation.contact.body import CONTACTNETS_CUBE as CUBE
from contact_curation.geometry.quaternions import Array
from contact_curation.geometry.scalars import ScalarPose
from contact_curation.motion.body_tracker import TrackerConfig
from contact_curation.motion.ingest import IngestConfig, IngestEvent, TossIngest
from contact_curation.motion.pose_stream import FramePose
from contact_curation.motion.toss import NANOSECONDS, Rejected, Toss
from test.simulated import RIG_NOISE, TrackerNoise, release_states, with_noise

RATES = (60, 120, 148, 250)
RARE, SHORTEST, LONGEST = 0.02, 1e-3, 20e-3
"""Share of the frames that are late now and then, and by how much [s]."""

type Stamps = Callable[[Array, np.random.Generator], Array]
"""Stamps (T,) of frames that were taken at some times (T,) [s]."""


def main() -> int:
    """Prints a row per kind of delay."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--tosses", type=int, default=20, help="of each cell (default 20)")
    parser.add_argument("--seed", type=int, default=0, help="of releases, noise and delays (default 0)")
    arguments = parser.parse_args()
    releases = release_states(arguments.tosses, np.random.default_rng(arguments.seed))
    noise = TrackerNoise(RIG_NOISE.position, RIG_NOISE.orientation)
    for rate in RATES:
        motions = [motion(release, 1.0 / rate) for release in releases]
        for name, stamps in KINDS.items():
            rng = np.random.default_rng([arguments.seed, rate])
            lost = [one for poses in motions if (one := against(with_noise(poses, noise, rng), rate, stamps, rng))]
            print(f"{rate:4d} Hz  {name:32s} lost {len(lost)}/{len(motions)}  {'; '.join(sorted(set(lost)))}", flush=True)
    return 0


def normal(size: float) -> Stamps:
    """Off by so much, either way (standard deviation) [s]."""
    return lambda times, rng: times + size * rng.standard_normal(len(times))


def queued(size: float) -> Stamps:
    """Late by so much on average [s]."""
    return lambda times, rng: received(times + rng.exponential(size, len(times)))


def held_up(times: Array, rng: np.random.Generator) -> Array:
    """On time, but for some."""
    late = rng.random(len(times)) < RARE
    return received(times + np.where(late, rng.uniform(SHORTEST, LONGEST, len(times)), 0.0))


def received(times: Array) -> Array:
    """One after the other, a microsecond apart at least."""
    return np.asarray(np.maximum.accumulate(times) + 1e-6 * np.arange(len(times)))


KINDS: dict[str, Stamps] = {
    "as they were taken": lambda times, _: times,
    **{f"normal, {1e3 * size:g} ms": normal(size) for size in (2e-4, 1e-3, 2e-3)},
    "exponential, 2 ms, in order": queued(2e-3),
    "1 frame in 50 late by 1 to 20 ms": held_up,
}


def against(poses: Array, rate: int, stamps: Stamps, rng: np.random.Generator) -> str:
    """What keeps the toss in a stream (T, 7) back; empty where it comes out, alone."""
    ingest = TossIngest(IngestConfig(TrackerConfig(CUBE.name, BOARD)), CUBE, source="simulated")
    ended: list[IngestEvent] = []
    stamps_ns = np.rint(NANOSECONDS * (1.0 + stamps(np.arange(len(poses)) / rate, rng))).astype(np.int64)
    for stamp_ns, (x, y, z, *turn) in zip(stamps_ns.tolist(), poses.tolist(), strict=True):
        ended += ingest.push(FramePose(stamp_ns, BOARD, CUBE.name, ScalarPose((x, y, z), (turn[0], turn[1], turn[2], turn[3]))))
    ended += ingest.flush()
    if len(ended) == 1 and isinstance(ended[0], Toss):
        return ""
    return next((one.reasons[0].partition(":")[0] for one in ended if isinstance(one, Rejected)), "not seen")


if __name__ == "__main__":
    sys.exit(main())
