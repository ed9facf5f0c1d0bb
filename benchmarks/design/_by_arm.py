"""What designed throws are worth when the simulated arm makes them and a tracker watches.

D-efficiency of batches of throws, Gauss-Newton, at the theta that they were designed at: a fit to a few tosses. Planned from
the commands, executed from the tosses that the tracker saw, as they are. 1 is an average replayed throw at the same theta.
"""

import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from contact_curation.design.execution_noise import ExecutionNoise
from contact_curation.design.greedy_batch import RefinementConfig
from contact_curation.design.planner import DesignConfig, Planner
from contact_curation.design.predicted_information import (
    Motions,
    Particle,
    PredictionConfig,
    predicted_information,
    predicted_motions,
)
from contact_curation.design.releases import ReleasePrior, fitted_prior, raw_prior
from contact_curation.design.throw import Throw
from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array
from contact_curation.information.subspace import identifiable_subspace
from contact_curation.learning.evaluation.bootstrap import BootstrapConfig, Interval, spread
from contact_curation.motion.toss import Toss
from contact_curation.motion.transitions import states_of
from contact_curation.simulation.arm.rig import ArmRig, Seen

THROWS = 8
RANDOM_SETS = 2
"""Of each prior; their mean counts."""

EXACT = PredictionConfig(thinning=1)
DESIGNS = {"greedy": RefinementConfig(generations=0), "greedy and CMA-ES": RefinementConfig()}
RANDOM = ("random canonical", "random raw")


@dataclass(frozen=True)
class ByArm:
    """D-efficiency of batches made in one way: median over the seeds with its 95 % bootstrap interval.

    Attributes:
        how: they were chosen.
        planned, executed: efficiency.
        planned_gain, executed_gain: relative to the better random column of the same seed.
        lost: throws of all seeds that gave no toss.
    """

    how: str
    planned: Interval
    executed: Interval
    planned_gain: Interval
    executed_gain: Interval
    lost: int


@dataclass(frozen=True, eq=False)
class Scale:
    """D-efficiency at one theta, in units of replayed throws."""

    particle: Particle
    whitening: Array

    @staticmethod
    def of(particle: Particle, releases: Array) -> "Scale":
        """In units of the mean replayed throw."""
        information = predicted_information(particle, predicted_motions(particle, releases, EXACT), EXACT)
        fishers = information.fishers[information.known]
        return Scale(particle, identifiable_subspace(fishers.sum(axis=0)).per_mean_toss(len(fishers)))

    def planned(self, throws: Sequence[Throw]) -> float:
        """As commanded."""
        return self._of(predicted_motions(self.particle, np.array([throw.release for throw in throws]), EXACT), len(throws))

    def executed(self, seen: Sequence[Seen]) -> float:
        """As it happened; a throw without a toss gave no information."""
        return self._of(_motions_of(_tosses_of(seen), self.particle), len(seen))

    def _of(self, motions: Motions, count: int) -> float:
        information = predicted_information(self.particle, motions, EXACT)
        total = information.fishers[information.known].sum(axis=0)
        values = np.linalg.eigvalsh(self.whitening.T @ total @ self.whitening) / count
        return float(np.exp(np.log(np.maximum(values, 1e-300)).mean()))


def _tosses_of(seen: Sequence[Seen]) -> list[Toss]:
    """Of the throws whose motion was a toss.

    Raises:
        InvalidValueError: none was.
    """
    tosses = [one.toss for one in seen if one.toss is not None]
    if not tosses:
        raise InvalidValueError("tosses", f"none of {len(seen)} throws", "at least one")
    return tosses


def _motions_of(tosses: Sequence[Toss], particle: Particle) -> Motions:
    states = [states_of(toss, particle.body.length_scale) for toss in tosses]
    frames = np.array([len(one) for one in states])
    padded = np.stack([np.concatenate([one, np.repeat(one[-1:], frames.max() - len(one), axis=0)]) for one in states])
    fine = np.ones(len(states), dtype=np.bool_)
    return Motions(padded, frames, fine, fine)


def worths_by_arm(particles: Sequence[Particle], releases: Array) -> list[ByArm]:
    """A table; one seed for each theta.

    Args:
        particles: fitted thetas.
        releases: (K, 13) replayed throws, which the priors are fitted to.
    """
    values: dict[str, list[tuple[float, float]]] = {}
    lost: dict[str, int] = {}
    for seed, particle in enumerate(particles):
        for how, (planned, executed, missing) in _one_seed(particle, releases, seed).items():
            values.setdefault(how, []).append((planned, executed))
            lost[how] = lost.get(how, 0) + missing
        print(f"arm: seed {seed} of {len(particles)} done", file=sys.stderr, flush=True)
    best = np.asarray(np.max([values[how] for how in RANDOM], axis=0), dtype=float)  # (seeds, 2)
    return [_row(how, np.array(pairs), best, lost[how]) for how, pairs in values.items()]


def _one_seed(particle: Particle, releases: Array, seed: int) -> dict[str, tuple[float, float, int]]:
    """Planned and executed efficiency, and how many throws gave no toss, by the way they were chosen."""
    rig, scale = ArmRig(particle.body, seed), Scale.of(particle, releases)
    prior = fitted_prior(releases)
    priors: dict[str, ReleasePrior] = dict(zip(RANDOM, (prior, raw_prior(releases))))
    found, made = {}, list[Seen]()
    for how, source in priors.items():
        throws = rig.random_throws(Planner([particle], source), THROWS * RANDOM_SETS, seed, how)
        seen = [rig.throw(throw) for throw in throws]
        sets = [seen[first : first + THROWS] for first in range(0, len(seen), THROWS)]
        pairs = [(scale.planned([one.commanded for one in part]), scale.executed(part)) for part in sets]
        found[how] = (*np.mean(pairs, axis=0).tolist(), _missing(seen))
        made += seen
    commanded, executed = (np.array([getattr(one, side).release for one in made]) for side in ("commanded", "executed"))
    noise = ExecutionNoise.learned(commanded, executed)
    for how, refinement in DESIGNS.items():
        config = replace(DesignConfig(), refinement=refinement)
        planner = Planner([particle], prior, config=config, feasible=rig.feasibility).with_noise(noise)
        plan = planner.plan([f"{how}-{number}" for number in range(THROWS)], planner.known(), seed)
        seen = [rig.throw(throw) for throw in plan.throws]
        found[how] = (scale.planned(plan.throws), scale.executed(seen), _missing(seen))
    return found


def _missing(seen: Sequence[Seen]) -> int:
    return sum(one.toss is None for one in seen)


def _row(how: str, pairs: Array, best: Array, lost: int) -> ByArm:
    columns = np.concatenate([pairs, pairs / best], axis=1).T
    planned, executed, planned_gain, executed_gain = (spread(column, BootstrapConfig()).median for column in columns)
    return ByArm(how, planned, executed, planned_gain, executed_gain, lost)
