"""The predicted information of a throw, that of its toss, and where the difference comes from.

Theta is learned from exploration throws of the simulated arm. Then throws are designed, each alone, and drawn at random; the
arm makes them, and gains in log-det are taken over the same known tosses:

- stated: as the plan says
- own: of the model's own motion from the release as it was executed
- own, measured: the same rolled out with four steps a frame, its velocities taken from the poses as the tracker's are
- MuJoCo: of the true motion, as many frames as the toss has
- MuJoCo, measured: the same with velocities from its poses
- toss: as it was tracked, with noise

    python -m benchmarks.design.forecast [--seeds 3] [--learned 10] [--throws 8]

CONTACTNETS_DATA names the folder of the tosses whose releases are the prior.
"""

import argparse
import sys
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import torch

from contact_curation.contact.rollout import rollout
from contact_curation.design.designer import AdaptiveDesign, Designer
from contact_curation.design.greedy_batch import gains
from contact_curation.design.predicted_information import (
    PredictionConfig,
    predicted_information,
    predicted_motions,
    scaled,
)
from contact_curation.design.releases import fitted_prior
from contact_curation.design.throw import Throw
from contact_curation.experiments.bodies import bench_of
from contact_curation.experiments.cell_run import ONE_THREAD
from contact_curation.experiments.counterfactuals.refitted import origin_of
from contact_curation.experiments.thrown.choice import ExplorationThrows
from contact_curation.experiments.thrown.designed_throws import DEFAULT_DESIGN, RoundsLearner
from contact_curation.geometry.quaternions import Array
from contact_curation.information.record import TossInformation
from contact_curation.learning.training.protocols import ROUND_TRIMMED, exact
from contact_curation.motion.smoothing import kinematics
from contact_curation.motion.toss import NANOSECONDS, Toss
from contact_curation.motion.transitions import states_of
from contact_curation.simulation.arm.rig import ArmRig
from contact_curation.simulation.world import free_motion

COLUMNS = ("stated", "own", "own, measured", "MuJoCo", "MuJoCo, measured", "toss")
EXACT = PredictionConfig(thinning=1)
STEPS = 4
"""Of a frame, in the finer motion."""


class Session:
    """A theta that was learned from exploration throws, and what is known."""

    def __init__(self, seed: int, learned: int) -> None:
        bench = bench_of("cube", seed)
        releases = np.array([states_of(toss, 1.0)[0] for toss in bench.training])
        self.rig, self.seed = ArmRig(bench.body, seed), seed
        designer = Designer(bench.body, DEFAULT_DESIGN, fitted_prior(releases), self.rig.feasibility)
        exploration, tosses = ExplorationThrows(designer, seed), list[Toss]()
        for number in range(1, learned + 1):
            seen = self.rig.throw(exploration.choose(number).throw)
            exploration.thrown(seen.commanded, seen.executed)
            tosses += [seen.toss] if seen.toss else []
        config = replace(exact(ROUND_TRIMMED), loss=ONE_THREAD)
        learner = RoundsLearner(origin_of(bench, seed, False), config, 1, seed)
        learner.learn(tosses)
        self.particle = designer.particle(learner.model.geometry())
        known = [info for info in self.particle.scorer.score(tosses) if isinstance(info, TossInformation)]
        self.planner = designer.planner(self.particle)
        self.design = AdaptiveDesign(self.planner, [known], exploration.pairs)
        self.known = self.planner.known([known])

    def designed(self, count: int) -> list[Throw]:
        """Each planned alone."""
        return [self.design.plan([f"designed-{k}"], 1000 * self.seed + k).throws[0] for k in range(count)]

    def random(self, count: int) -> list[Throw]:
        """With the gains that are predicted for them."""
        drawn = self.rig.random_throws(self.planner, count, self.seed + 99, "random")
        return [self.design.predicted(throw) for throw in drawn]

    def row(self, throw: Throw) -> tuple[float, ...] | None:
        """The gains of COLUMNS; None where no toss came."""
        seen = self.rig.throw(throw)
        if seen.toss is None:
            return None
        release, toss, body = seen.executed.release, seen.toss, self.particle.body
        own = predicted_motions(self.particle, release[None], EXACT)
        frames = int(own.frames[0])
        period = toss.frame_period / STEPS
        fine = rollout(self.particle.geometry, body, scaled(release[None], body.length_scale), STEPS * (frames - 1) + 1, period)
        true = free_motion(body, release, toss.frames, toss.frame_period)
        return (
            throw.expected_information,
            self._gain(predicted_information(self.particle, own, EXACT).fishers),
            self._gain_of(_measured(_toss(toss, scaled(fine.states[::STEPS], 1.0 / body.length_scale)))),
            self._gain_of(_toss(toss, true)),
            self._gain_of(_measured(_toss(toss, true))),
            self._gain_of(toss),
        )

    def _gain(self, fishers: Array) -> float:
        return float(gains(self.known, [fishers])[0])

    def _gain_of(self, toss: Toss) -> float:
        (info,) = self.particle.scorer.score([toss])
        assert isinstance(info, TossInformation)
        return self._gain(info.fisher()[None])


def _toss(like: Toss, states: Array) -> Toss:
    """A toss of states (T, 13) in SI units, with the period of another."""
    stamps = np.rint(np.arange(len(states)) * like.frame_period * NANOSECONDS).astype(np.int64)
    return replace(
        like, stamps_ns=stamps, positions=states[:, :3], orientations_wxyz=states[:, 3:7],
        linear_velocities=states[:, 7:10], angular_velocities=states[:, 10:],
    )  # fmt: skip


def _measured(toss: Toss) -> Toss:
    """The same with velocities from its poses."""
    rates = kinematics(toss.stamps_ns, toss.positions, toss.orientations_wxyz)
    return replace(toss, linear_velocities=rates.linear_velocities, angular_velocities=rates.angular_velocities)


def main() -> int:
    """Prints the mean gains of designed and of random throws."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--learned", type=int, default=10, help="exploration throws (default 10)")
    parser.add_argument("--throws", type=int, default=8, help="of each kind and seed (default 8)")
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    found: dict[str, list[tuple[float, ...]]] = {"designed": [], "random": []}
    for seed in range(arguments.seeds):
        session = Session(seed, arguments.learned)
        kinds: dict[str, Sequence[Throw]] = {
            "designed": session.designed(arguments.throws), "random": session.random(arguments.throws)
        }  # fmt: skip
        for kind, throws in kinds.items():
            found[kind] += [row for throw in throws if (row := session.row(throw))]
    print(f"| throws | {' | '.join(COLUMNS)} | toss over stated |\n|{'---|' * (len(COLUMNS) + 2)}")
    for kind, rows in found.items():
        means = np.mean(rows, axis=0)
        print(f"| {kind} | {' | '.join(f'{mean:.2f}' for mean in means)} | {means[-1] / means[0]:.2f} |")
    return 0


if __name__ == "__main__":
    sys.exit(main())
