"""`design --out THROWS.json`: the throws that would teach most, given theta and what is known already."""

import argparse
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from contact_curation.cli.design.options import add_design_options, design_config
from contact_curation.cli.options.body import chosen_body
from contact_curation.cli.options.output_paths import check_outputs
from contact_curation.cli.options.theta import polytope_of
from contact_curation.cli.report import counted, print_json, warn
from contact_curation.contact.body import Body
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.design.exploration import exploration_plan
from contact_curation.design.planner import DesignConfig, Plan, Planner, random_plan, top_trace_plan
from contact_curation.design.predicted_information import Particle
from contact_curation.design.releases import PUBLISHED_PRIOR, ReleasePrior, fitted_prior, published_releases, raw_prior
from contact_curation.design.safety import Feasible
from contact_curation.geometry.quaternions import Array
from contact_curation.information.record import TossInformation
from contact_curation.motion.toss import Toss
from contact_curation.motion.transitions import states_of
from contact_curation.pipeline.known_tosses import tosses_in
from contact_curation.solver.compiled import load_kernel
from contact_curation.storage.throws_file import write_throws

PUBLISHED_DRAWS = 570
"""Releases that the paper's prior is fitted to where no recordings are given: as many as the published tosses."""


def add_options(parser: argparse.ArgumentParser) -> None:
    """Adds the verb's options to its parser."""
    parser.description = (
        "Chooses throws together: from a pool of safe releases, greedily by the log-det that each is expected to add to what "
        "is known, under the noise of executions, and then moved to where they add more. Theta is a polytope's."
    )
    add_design_options(parser)
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Designs, writes, and says what is expected.

    Raises:
        ContactCurationError: a file cannot be used, nothing safe can be thrown, or `--out` cannot be written.
    """
    load_kernel()  # information is predicted by rollouts
    check_outputs(out=arguments.out)
    config = design_config(arguments)
    body = chosen_body(arguments)
    thetas = [polytope_of(path, body) for path in (*arguments.checkpoint, *arguments.params)]
    particles = [Particle(theta.geometry, theta.body, config.loss) for theta in thetas]
    particles = particles or [Particle(ContactGeometry.of_body(body), body, config.loss)]
    known, seen = tosses_in(arguments.known, arguments.manifest, config.reading)
    examples, warnings = tosses_in(arguments.prior, None, config.reading)
    warnings = (*seen, *warnings)
    warn(warnings)
    situation = _Situation(particles, tuple(known), _states(examples), config.design, _arm(body) if arguments.arm else None)
    names = [f"{arguments.name}-{arguments.seed}-{number}" for number in range(arguments.throws)]
    plan = situation.plan(names, arguments.seed, "warm-up" if arguments.warm_up else arguments.baseline)
    write_throws(arguments.out, plan.throws)
    _report(arguments, plan, situation, warnings)
    return 0


@dataclass(frozen=True, eq=False)
class _Situation:
    """What a design starts from.

    Attributes:
        particles: thetas.
        known: tosses.
        examples: (K, 13) releases that the prior is fitted to; none for the published one.
        config: how.
        feasible: what the thrower says.
    """

    particles: Sequence[Particle]
    known: tuple[Toss, ...]
    examples: Array
    config: DesignConfig
    feasible: Feasible | None = None

    def plan(self, names: Sequence[str], seed: int, method: str | None) -> Plan:
        """Throws by the way that was asked for."""
        planner = Planner(self.particles, self._prior(method, seed), config=self.config, feasible=self.feasible)
        known = planner.known([self._scored(particle) for particle in self.particles])
        if method == "prior":
            return random_plan(planner, names, known, seed)
        if method == "paper":
            return top_trace_plan(planner, names, known, seed)
        if method == "warm-up":
            return exploration_plan(planner, names, known, seed, [states_of(toss, 1.0)[0] for toss in self.known])
        return planner.plan(names, known, seed)

    def _prior(self, method: str | None, seed: int) -> ReleasePrior:
        if method == "paper":
            examples = self.examples if len(self.examples) else published_releases(PUBLISHED_DRAWS, np.random.default_rng(seed))
            return raw_prior(examples)
        return fitted_prior(self.examples) if len(self.examples) else PUBLISHED_PRIOR

    def _scored(self, particle: Particle) -> list[TossInformation]:
        results = particle.scorer.score(self.known) if self.known else ()
        return [result for result in results if isinstance(result, TossInformation)]


def _arm(body: Body) -> Feasible:
    """What the simulated arm says; MuJoCo is imported only for it."""
    from contact_curation.simulation.arm.feasibility import ArmFeasibility
    from contact_curation.simulation.arm.safety import GateConfig
    from contact_curation.simulation.arm.throw_motion import ThrowPlanner

    return ArmFeasibility(ThrowPlanner(body), GateConfig())


def _states(tosses: Sequence[Toss]) -> Array:
    """(K, 13) releases in SI units."""
    return np.array([states_of(toss, 1.0)[0] for toss in tosses]) if tosses else np.zeros((0, 13))


def _report(arguments: argparse.Namespace, plan: Plan, situation: _Situation, warnings: Sequence[str]) -> None:
    if arguments.json:
        throws = [throw.to_mapping() for throw in plan.throws]
        content = {"out": str(arguments.out), "throws": throws, "expected_information": plan.expected, "pool": plan.pool}
        content |= {"refused": dict(plan.refused), "known": len(situation.known), "seed": arguments.seed}
        print_json({**content, "warnings": warnings})
        return
    print(f"{'throw':<20} {'gain':>8} {'height':>8} {'speed':>8} {'spin':>8}")
    print(f"{'':<20} {'log-det':>8} {'m':>8} {'m/s':>8} {'rad/s':>8}")
    for throw in plan.throws:
        speed, spin = (float(np.linalg.norm(vector)) for vector in (throw.linear_velocity, throw.angular_velocity))
        print(f"{throw.throw_id:<20} {throw.expected_information:8.2f} {throw.position[2]:8.3f} {speed:8.2f} {spin:8.2f}")
    refused = ", ".join(f"{count} {name}" for name, count in plan.refused.most_common())
    because = f" ({refused})" if refused else ""
    print(
        f"{arguments.out}: {counted(len(plan.throws), 'throw')}, {plan.expected:.2f} in log-det over "
        f"{counted(len(situation.known), 'known toss').replace('tosss', 'tosses')}; "
        f"{plan.refused.total()} of {plan.pool} releases of the pool refused{because}"
    )
