"""Tracked releases by a hand that is off its plan: how well the beginning of the fall and the gripper's delay are found.

    python -m benchmarks.design.release_delay [--throws 50] [--noise 1e-4]

The gripper opens 60 ms after its command, with a jitter of 10 ms (standard deviation). The hand's place, velocity and
acceleration are off by 2 mm, 0.01 m/s and 0.2 m/s^2. The noise of the tracker is given in metres; its orientations scatter by
that over 50 mm.

Then grippers of several jitters are learned from drawn delays: in how many the jitter is at least `MOST` for certain after any
of 3 to 30 throws, for which further throws are refused.
"""

import argparse

import numpy as np

from contact_curation.design.release_delay import Seen, learned_delay, with_release
from contact_curation.motion.release import Fall
from contact_curation.simulation.arm.steady_swing import SteadyConfig
from contact_curation.stages.trajectory_throw import TrajectoryConfig
from test.motion.release.hand import COMMANDED, thrown

GRIPPERS, THROWS, JITTERS = 200, 30, (0.008, 0.01, 0.012, 0.015, 0.02, 0.03)
"""How many grippers, throws of each, and jitters [s]."""

LEARNING, MOST = TrajectoryConfig().learning, 0.5 * SteadyConfig().window
"""Throws before any is refused, and the largest jitter that the default steady window allows [s]."""


def ever_refused(jitter: float, seed: int) -> bool:
    """Whether any of its throws is."""
    seen: tuple[Seen, ...] = ()
    for delay in 0.06 + jitter * np.random.default_rng([seed, 5]).standard_normal(THROWS):
        seen, _ = with_release(seen, Seen(max(float(delay), 1e-3), 5e-4))
        if len(seen) >= LEARNING and learned_delay(seen).least_jitter > MOST:
            return True
    return False


def main() -> None:
    """Runs it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--throws", type=int, default=50)
    parser.add_argument("--noise", type=float, default=1e-4, help="standard deviation of the tracker's positions per axis [m]")
    arguments = parser.parse_args()
    throws = [thrown(seed, arguments.noise) for seed in range(arguments.throws)]
    seen: tuple[Seen, ...] = ()
    times, shares, speeds, spins, changes = [], [], [], [], 0
    for one in throws:
        fall = one.found()
        if not isinstance(fall, Fall):
            print(fall)
            continue
        seen, changed = with_release(seen, Seen(fall.time - COMMANDED, fall.time_sd))
        speed = float(np.linalg.norm(one.release[1]))
        times.append(1e3 * (fall.time - one.fall))
        shares.append((fall.time - one.fall) / fall.time_sd)
        speeds.append(100.0 * abs(float(np.linalg.norm(fall.state[7:10])) / speed - 1.0))
        spins.append(float(np.linalg.norm(fall.state[10:] - one.spin)))
        changes += bool(changed)
    delay, true = learned_delay(seen), 1e3 * (np.array([one.fall for one in throws]) - COMMANDED)
    print(f"falls found: {len(times)} of {len(throws)}")
    print(f"error of the beginning [ms]: median {np.median(np.abs(times)):.2f}, largest {np.abs(times).max():.2f}; "
          f"over its stated standard deviation: {np.sqrt(np.mean(np.square(shares))):.2f}")  # fmt: skip
    print(f"error of the speed [%]: median {np.median(speeds):.2f}, largest {max(speeds):.2f}; "
          f"of the spin [rad/s]: median {np.median(spins):.3f}, largest {max(spins):.3f}")  # fmt: skip
    print(f"delay [ms]: learned {1e3 * delay.mean:.1f} +- {1e3 * delay.mean_sd:.1f}, drawn {true.mean():.1f} on average; "
          f"jitter: learned {1e3 * delay.jitter:.1f}, drawn {true.std():.1f}; changes reported: {changes}")  # fmt: skip
    for jitter in JITTERS:
        refused = sum(ever_refused(jitter, seed) for seed in range(GRIPPERS))
        print(f"jitter of {1e3 * jitter:.0f} ms: {refused} of {GRIPPERS} grippers refused in {THROWS} throws")


if __name__ == "__main__":
    main()
