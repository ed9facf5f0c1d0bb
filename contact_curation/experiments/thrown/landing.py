"""A task for a learned model: throw so that the body comes to rest on a given face, its centre near a mark.

The face and the mark of a task are those of a random throw in the world, which nobody learned from. The throw is the one of a
pool of random releases whose executions, predicted by the model, do the task most often. It is executed in MuJoCo.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from contact_curation.contact.body import Body
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.rollout import rollout
from contact_curation.contact.time_step import STATE_SIZE
from contact_curation.design.execution_noise import ExecutionNoise, balanced_draws
from contact_curation.design.predicted_information import SWEEPS, scaled
from contact_curation.geometry import quaternions
from contact_curation.geometry.quaternions import Array
from contact_curation.simulation.thrown_toss import ThrownTossConfig
from contact_curation.simulation.world import free_motion

NEAR = 0.05
"""Largest distance of the centre at rest from the mark [m]."""

EXECUTIONS = 8
"""Predicted ones of each release of the pool."""

DOWN = np.array([0.0, 0.0, -1.0])


class Rest(NamedTuple):
    """Where a body comes to rest: the vertices of the face below, and x and y of its centre [m]."""

    face: tuple[int, ...]
    place: Array


@dataclass(frozen=True, eq=False)
class Thrower:
    """Throws a body from some releases in a world.

    Attributes:
        body: that is thrown.
        releases: (R, 13) that it can make, in SI units.
        noise: of its executions.
        thrown: frame period, longest motion, and the world.
    """

    body: Body
    releases: Array
    noise: ExecutionNoise
    thrown: ThrownTossConfig

    @property
    def frames(self) -> int:
        """Of the longest motion."""
        return round(self.thrown.longest / self.thrown.frame_period)

    def rest(self, state: Array) -> Rest:
        """Of a final state (13,) in SI units."""
        down = quaternions.rotate(quaternions.conjugate(state[3:7]), DOWN)
        return Rest(tuple(self.body.polytope.face_towards(down).tolist()), state[:2])

    def executed(self, release: Array, rng: np.random.Generator) -> Rest:
        """Where a command (13,) leads in the world."""
        start = self.noise.executions(release[None], rng.standard_normal((1, len(self.noise.bias))))[0, 0]
        return self.rest(free_motion(self.body, start, self.frames, self.thrown.frame_period, self.thrown.world)[-1])

    def predicted(self, geometry: ContactGeometry, rng: np.random.Generator) -> list[list[Rest]]:
        """Where each release leads, by a model: R lists of E rests."""
        draws = balanced_draws(EXECUTIONS, rng)
        starts = scaled(self.noise.executions(self.releases, draws).reshape(-1, STATE_SIZE), self.body.length_scale)
        rolled = rollout(geometry, self.body, starts, self.frames, self.thrown.frame_period, SWEEPS)
        last = scaled(rolled.states[rolled.starts[1:] - 1], 1.0 / self.body.length_scale)
        last[~rolled.finite] = [1e9] * 3 + [1.0] + [0.0] * 9  # nowhere near a mark
        rests = [self.rest(state) for state in last]
        return [rests[first : first + EXECUTIONS] for first in range(0, len(rests), EXECUTIONS)]


def successes(geometry: ContactGeometry, thrower: Thrower, tasks: int, seed: int) -> float:
    """Share of the tasks that throws planned with a model do. Equal seeds have equal tasks and executions."""
    rng = np.random.default_rng([seed, 41])
    wanted = [thrower.executed(release, rng) for release in thrower.releases[:tasks]]
    pool = thrower.predicted(geometry, np.random.default_rng([seed, 42]))
    done = []
    for number, task in enumerate(wanted):
        own = max((place for place in range(len(pool)) if place != number), key=lambda place: _share(pool[place], task))
        done.append(_does(thrower.executed(thrower.releases[own], np.random.default_rng([seed, 43, number])), task))
    return float(np.mean(done))


def _share(rests: Sequence[Rest], task: Rest) -> tuple[float, float]:
    """Share of executions that do a task; among equal ones the nearer on the right face is better."""
    away = [float(np.linalg.norm(rest.place - task.place)) + (rest.face != task.face) for rest in rests]
    return float(np.mean([_does(rest, task) for rest in rests])), -float(np.mean(away))


def _does(rest: Rest, task: Rest) -> bool:
    return rest.face == task.face and float(np.linalg.norm(rest.place - task.place)) <= NEAR
