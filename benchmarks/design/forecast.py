"""The predicted information of a throw, that of its toss, and where the difference comes from.

Theta is learned from exploration throws of the simulated arm. Then throws are designed, each alone, and drawn at random; the
arm makes them, and gains in log-det are taken over the same known tosses:

- stated: as the plan says
- own: of the model's own motion from the release as it was executed
- own, measured: the same rolled out with four steps a frame, its velocities taken from the poses as the tracker's are
- MuJoCo: of the true motion, as many frames as the toss has
- MuJoCo, measured: the same with velocities from its poses
- toss: as it was tracked, with noise

With --real theta is learned from real tosses of a body, and others of them are the throws: their releases are known but for the
tracker's noise, and their true motion is not.

    python -m benchmarks.design.forecast [--seeds 3] [--learned 10] [--throws 8] [--real {cube,square}]

CONTACTNETS_DATA names the folder of the tosses whose releases are the prior.
"""

import argparse
import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import torch

from contact_curation.contact.rollout import rollout
from contact_curation.design.designer import AdaptiveDesign, Designer
from contact_curation.design.execution_noise import NoiseConfig
from contact_curation.design.greedy_batch import gains
from contact_curation.design.predicted_information import (
    PredictionConfig,
    predicted_information,
    predicted_motions,
    scaled,
)
from contact_curation.design.releases import fitted_prior
from contact_curation.design.throw import Throw, throw_of_state
from contact_curation.experiments.bodies import bench_of
from contact_curation.experiments.cell_run import ONE_THREAD, Bench
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
REAL_COLUMNS = ("stated", "own", "own, measured", "toss")
"""Gains of real throws: MuJoCo's motions are those of simulated ones."""

AS_COMMANDED = NoiseConfig(position=1e-5, turn=1e-5, speed=0.0, velocity=1e-5, spin=1e-5)
"""Executions of throws whose releases were measured."""

EXACT = PredictionConfig(thinning=1)
STEPS = 4
"""Of a frame, in the finer motion."""


class Known:
    """A theta that was learned from some tosses, and what they tell.

    Args:
        bench: of the body.
        designer: of throws.
        tosses: that it is learned from.
        pairs: commanded and executed throws of these; none where they were not commanded.
        seed: of the initialisation.
    """

    def __init__(
        self, bench: Bench, designer: Designer, tosses: Sequence[Toss], pairs: Sequence[tuple[Throw, Throw]], seed: int
    ) -> None:
        config = replace(exact(ROUND_TRIMMED), loss=ONE_THREAD)
        learner = RoundsLearner(origin_of(bench, seed, False), config, 1, seed)
        learner.learn(tosses)
        self.particle = designer.particle(learner.model.geometry())
        infos = [info for info in self.particle.scorer.score(tosses) if isinstance(info, TossInformation)]
        self.planner = designer.planner(self.particle)
        self.design = AdaptiveDesign(self.planner, [infos], pairs)
        self.infos = self.planner.known([infos])

    def own(self, release: Array, toss: Toss) -> tuple[float, float]:
        """Gains of the model's own motion from a release (13,), as predicted, and as the tracker would see it."""
        body = self.particle.body
        exactly = replace(EXACT, frame_period=toss.frame_period)
        motion = predicted_motions(self.particle, release[None], exactly)
        period = toss.frame_period / STEPS
        count = STEPS * (int(motion.frames[0]) - 1) + 1
        fine = rollout(self.particle.geometry, body, scaled(release[None], body.length_scale), count, period)
        seen = _measured(_toss(toss, scaled(fine.states[::STEPS], 1.0 / body.length_scale)))
        return self.gain(predicted_information(self.particle, motion, exactly).fishers), self.gain_of(seen)

    def gain(self, fishers: Array) -> float:
        """Of predicted information (1, P, P)."""
        return float(gains(self.infos, [fishers])[0])

    def gain_of(self, toss: Toss) -> float:
        """Of a toss."""
        (info,) = self.particle.scorer.score([toss])
        assert isinstance(info, TossInformation)
        return self.gain(info.fisher()[None])


class Session(Known):
    """A theta that was learned from exploration throws of the simulated arm."""

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
        super().__init__(bench, designer, tosses, exploration.pairs, seed)

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
        release, toss = seen.executed.release, seen.toss
        true = _toss(toss, free_motion(self.particle.body, release, toss.frames, toss.frame_period))
        of_true = self.gain_of(true), self.gain_of(_measured(true))
        return throw.expected_information, *self.own(release, toss), *of_true, self.gain_of(toss)


class RealThrows(Known):
    """A theta that was learned from real tosses, and others of them as throws that were executed as commanded."""

    def __init__(self, name: str, seed: int, learned: int) -> None:
        bench = bench_of(name, seed)
        drawn = np.random.default_rng(seed).permutation(len(bench.training))
        tosses = [bench.training[place] for place in drawn]
        planner = DEFAULT_DESIGN.planner
        forecast = replace(planner.candidates.forecast, frame_period=bench.training[0].frame_period)
        executed = replace(planner.candidates, forecast=forecast, noise=AS_COMMANDED)
        design = replace(DEFAULT_DESIGN, planner=replace(planner, candidates=executed))
        super().__init__(bench, Designer(bench.body, design), tosses[:learned], (), seed)
        self.others = tosses[learned:]

    def rows(self, count: int) -> list[tuple[float, ...]]:
        """The gains of REAL_COLUMNS of some tosses."""
        found: list[tuple[float, ...]] = []
        for toss in self.others[:count]:
            throw = self.design.predicted(throw_of_state(toss.toss_id, toss.body, states_of(toss, 1.0)[0]))
            found.append((throw.expected_information, *self.own(throw.release, toss), self.gain_of(toss)))
        return found


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
    parser.add_argument("--real", choices=("cube", "square"), help="throws are real tosses of this body")
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    if arguments.real:
        sessions = (RealThrows(arguments.real, seed, arguments.learned) for seed in range(arguments.seeds))
        print_table(REAL_COLUMNS, {"real": [row for one in sessions for row in one.rows(arguments.throws)]})
        return 0
    found: dict[str, list[tuple[float, ...]]] = {"designed": [], "random": []}
    for seed in range(arguments.seeds):
        session = Session(seed, arguments.learned)
        kinds: dict[str, Sequence[Throw]] = {
            "designed": session.designed(arguments.throws), "random": session.random(arguments.throws)
        }  # fmt: skip
        for kind, throws in kinds.items():
            found[kind] += [row for throw in throws if (row := session.row(throw))]
    print_table(COLUMNS, found)
    return 0


def print_table(columns: Sequence[str], found: Mapping[str, Sequence[tuple[float, ...]]]) -> None:
    """Mean gains of each kind of throws."""
    print(f"| throws | {' | '.join(columns)} | toss over stated |\n|{'---|' * (len(columns) + 2)}")
    for kind, rows in found.items():
        means = np.mean(rows, axis=0)
        print(f"| {kind} | {' | '.join(f'{mean:.2f}' for mean in means)} | {means[-1] / means[0]:.2f} |")


if __name__ == "__main__":
    sys.exit(main())
