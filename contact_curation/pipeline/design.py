"""Designs the throws with the largest predicted information, given theta and the known tosses."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from contact_curation.configs import set_whole_numbers
from contact_curation.contact.body import Body
from contact_curation.contact.loss_config import DEFAULT_LOSS, LossConfig
from contact_curation.design.exploration import exploration_plan
from contact_curation.design.planner import DesignConfig, Plan, Planner, random_plan, top_trace_plan
from contact_curation.design.predicted_information import Particle
from contact_curation.design.releases import PUBLISHED_PRIOR, ReleasePrior, fitted_prior, published_releases, raw_prior
from contact_curation.design.safety import Feasible
from contact_curation.design.throw import Throw
from contact_curation.errors import UnknownNameError
from contact_curation.geometry.quaternions import Array
from contact_curation.information.record import TossInformation
from contact_curation.motion.toss import Toss
from contact_curation.motion.transitions import states_of
from contact_curation.pipeline.wording import counted, counted_tosses
from contact_curation.storage.parameters_file import Parameters
from contact_curation.storage.saved_path import saved_path
from contact_curation.storage.throws_file import write_throws

PUBLISHED_DRAWS = 570
"""Releases that the paper's prior is fitted to where no recordings are given: as many as the published tosses."""

BASELINES = ("paper", "prior")
"""paper: a normal in raw coordinates, best by trace; prior: at random."""

EXPLORATION = "exploration"
METHODS = ("information", EXPLORATION, *BASELINES)


@dataclass(frozen=True, eq=False)
class DesignTask:
    """The inputs of a design.

    Attributes:
        thetas: polytopes; gains are averaged over them.
        known: tosses that were selected until now.
        examples: tosses like those to be made, which the prior is fitted to; none for the published prior.
        config: how throws are chosen.
        loss: of the information.
        method: one of `METHODS`.
        arm: only throws that the simulated arm can make.
        seed: the same gives the same throws.
        name: beginning of their ids.
    """

    thetas: tuple[Parameters, ...]
    known: tuple[Toss, ...] = ()
    examples: tuple[Toss, ...] = ()
    config: DesignConfig = field(default_factory=DesignConfig)
    loss: LossConfig = DEFAULT_LOSS
    method: str = METHODS[0]
    arm: bool = False
    seed: int = 0
    name: str = "throw"

    def __post_init__(self) -> None:
        if self.method not in METHODS:
            raise UnknownNameError("method", self.method, METHODS)
        set_whole_numbers(self, ("seed",))

    def simulations(self, count: int) -> int | None:
        """About how many throws the design of so many simulates; None for baselines, which need few."""
        return len(self.thetas) * self.config.simulations(count) if self.method == METHODS[0] else None


@dataclass(frozen=True, eq=False)
class DesignedThrows:
    """Throws to make, best first. `len` counts them, iterating gives them, `print` shows a table.

    Attributes:
        plan: the throws, with what each is expected to add, and the releases that were refused.
        known: how many tosses were known.
        seed: that they were designed with.
        body: that is thrown.
        warnings: what was assumed, one line each.
    """

    plan: Plan
    known: int
    seed: int
    body: Body
    warnings: tuple[str, ...] = ()

    def save(self, path: str | Path, *, overwrite: bool = False) -> None:
        """Writes the throws as JSON, for `simulate` or a robot.

        Args:
            path: of the file.
            overwrite: whether to replace any file that is there; without it, only an earlier manifest or file of throws is
                replaced.

        Raises:
            InvalidValueError: another ending, a file that must not be replaced, or the file cannot be written.
        """
        write_throws(saved_path(path, (".json",), overwrite=overwrite), self.plan.throws, self.body)

    def document(self) -> dict[str, Any]:
        """Everything, as one object for JSON."""
        return {
            "throws": [throw.to_mapping() for throw in self.plan.throws],
            "expected_information": self.plan.expected,
            "pool": self.plan.pool,
            "refused": dict(self.plan.refused),
            "known": self.known,
            "seed": self.seed,
        }

    def summary(self) -> str:
        """One line."""
        plan = self.plan
        refused = ", ".join(f"{count} {name}" for name, count in plan.refused.most_common())
        known = counted_tosses(self.known).replace("toss", "known toss", 1)
        return (
            f"{counted(len(plan.throws), 'throw')}, {plan.expected:.2f} in log-det over {known}; "
            f"{plan.refused.total()} of {plan.pool} releases of the pool refused{f' ({refused})' if refused else ''}"
        )

    def table(self) -> Iterator[str]:
        """A line for each throw, below two for the head."""
        yield f"{'throw':<20} {'gain':>8} {'height':>8} {'speed':>8} {'spin':>8}"
        yield f"{'':<20} {'log-det':>8} {'m':>8} {'m/s':>8} {'rad/s':>8}"
        for throw in self.plan.throws:
            speed, spin = (float(np.linalg.norm(vector)) for vector in (throw.linear_velocity, throw.angular_velocity))
            gain, height = throw.expected_information, throw.position[2]
            yield f"{throw.throw_id:<20} {gain:8.2f} {height:8.3f} {speed:8.2f} {spin:8.2f}"

    def __len__(self) -> int:
        return len(self.plan.throws)

    def __iter__(self) -> Iterator[Throw]:
        return iter(self.plan.throws)

    def __str__(self) -> str:
        return "\n".join((*self.table(), self.summary()))

    def __repr__(self) -> str:
        return f"<{self.summary()}>"


def design_throws(task: DesignTask, count: int, simulated: Callable[[int], None] = lambda count: None) -> DesignedThrows:
    """Chooses throws together.

    Args:
        task: what is known, and how throws are chosen.
        count: how many.
        simulated: told how many throws were simulated, now and then.

    Raises:
        InvalidValueError: thetas that do not go together, or nothing safe can be thrown.
    """
    particles = [Particle(theta.geometry, theta.body, task.loss) for theta in task.thetas]
    examples = np.array([_release(toss) for toss in task.examples]).reshape(-1, 13)
    feasible = _arm(particles[0].body) if task.arm else None
    planner = Planner(particles, _prior(task, examples), config=task.config, feasible=feasible, simulated=simulated)
    scored = [_scored(particle, task.known) for particle in particles]
    known, planner = planner.known(scored), planner.with_known(scored)
    names = [f"{task.name}-{task.seed}-{number}" for number in range(count)]
    match task.method:
        case "prior":
            plan = random_plan(planner, names, known, task.seed)
        case "paper":
            plan = top_trace_plan(planner, names, known, task.seed)
        case "exploration":
            plan = exploration_plan(planner, names, known, task.seed, [_release(toss) for toss in task.known])
        case _:
            plan = planner.plan(names, known, task.seed)
    return DesignedThrows(plan, len(task.known), task.seed, task.thetas[0].body)


def _prior(task: DesignTask, examples: Array) -> ReleasePrior:
    if task.method == "paper":
        drawn = examples if len(examples) else published_releases(PUBLISHED_DRAWS, np.random.default_rng(task.seed))
        return raw_prior(drawn)
    return fitted_prior(examples) if len(examples) else PUBLISHED_PRIOR


def _scored(particle: Particle, known: tuple[Toss, ...]) -> list[TossInformation]:
    results = particle.scorer.score(known) if known else ()
    return [result for result in results if isinstance(result, TossInformation)]


def _release(toss: Toss) -> Array:
    """(13,) its release in SI units."""
    return np.asarray(states_of(toss, 1.0)[0])


def _arm(body: Body) -> Feasible:
    """What the simulated arm says; MuJoCo is imported only for it."""
    from contact_curation.simulation.arm.feasibility import ArmFeasibility
    from contact_curation.simulation.arm.safety import GateConfig
    from contact_curation.simulation.arm.throw_motion import ThrowPlanner

    return ArmFeasibility(ThrowPlanner(body), GateConfig())
