"""The next throw, planned again after each one that was made (method.md 1.10, 2.4, 5).

Until theta passes the readiness check, exploration throws are spread over first impacts, by flight and shape alone; from then
on throws have the largest predicted information, planned at theta from all known tosses.

After each throw the noise of executions is re-estimated from commands and executions; the toss's own information at theta is
added to what is known; and the next throws are planned from there. The ratio of the realised to the planned gain is the
loop's health: far below 1 the model, the thrower or the tracker is not what the plan took it for.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from contact_curation.contact.body import Body
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.loss_config import DEFAULT_LOSS, LossConfig
from contact_curation.contact.parameter_form import Form
from contact_curation.design.execution_noise import ExecutionNoise
from contact_curation.design.exploration import exploration_plan
from contact_curation.design.greedy_batch import gains
from contact_curation.design.planner import DesignConfig, Plan, Planner
from contact_curation.design.predicted_information import Particle
from contact_curation.design.readiness import ReadinessConfig, unready_reason
from contact_curation.design.releases import PUBLISHED_PRIOR, ReleasePrior, Releases
from contact_curation.design.safety import Feasible
from contact_curation.design.throw import Throw
from contact_curation.geometry.quaternions import Array
from contact_curation.information.record import TossInformation
from contact_curation.motion.smoothing import QUIET_PERIOD


@dataclass(frozen=True)
class Realised:
    """Planned and realised gain of a throw, in log-det over the information before it.

    Attributes:
        throw_id: the throw.
        toss_id: its toss.
        planned: gain.
        realised: gain.
    """

    throw_id: str
    toss_id: str
    planned: float
    realised: float

    @property
    def ratio(self) -> float:
        """Ratio of realised to planned gain; NaN without a planned gain."""
        return self.realised / self.planned if self.planned > 0.0 else float("nan")


class AdaptiveDesign:
    """Plans throws from all that is known so far.

    Args:
        planner: at the present theta.
        known: per particle, the information of the selected tosses.
        throws: pairs of commands and executions so far.
    """

    def __init__(
        self,
        planner: Planner,
        known: Sequence[Sequence[TossInformation]] = (),
        throws: Sequence[tuple[Throw, Throw]] = (),
    ) -> None:
        self._throws = list(throws)
        self._infos = [list(infos) for infos in (known or [()] * len(planner.particles))]
        self._known = planner.known(self._infos)
        self._planner = planner.with_known(self._infos)
        self._learn()

    @property
    def planner(self) -> Planner:
        """The planner with the current estimate of the execution noise."""
        return self._planner

    @property
    def noise(self) -> ExecutionNoise:
        """The current estimate of the execution noise."""
        return self._planner.evaluator.noise

    def plan(self, names: Sequence[str], seed: int) -> Plan:
        """The next throws, chosen together; errors as `Planner.plan`."""
        return self._planner.plan(names, self._known, seed)

    def made(self, commanded: Throw, executed: Throw) -> None:
        """Adds an executed throw to the estimate of the execution noise."""
        self._throws.append((commanded, executed))
        self._learn()

    def predicted(self, throw: Throw) -> Throw:
        """A throw that was planned elsewhere, with the gain that is predicted for it here and now."""
        candidate = self._planner.forecast(Releases.of_states(throw.release[None]))
        gain = float(gains(self._known, candidate.fishers)[0])
        return replace(throw, expected_information=gain, parameters_version=self._planner.version)

    def add(self, throw: Throw, realised: Sequence[TossInformation]) -> Realised:
        """Adds the information of a throw's toss.

        Args:
            throw: as it was planned.
            realised: per particle, the information of its toss.

        Raises:
            InvalidValueError: scored at other thetas.
        """
        self._planner.known([[info] for info in realised])  # refuses what cannot be compared
        fishers = [info.fisher()[None] for info in realised]
        gain = float(gains(self._known, fishers)[0])
        for infos, info in zip(self._infos, realised, strict=True):
            infos.append(info)
        self._known = self._planner.known(self._infos)
        self._planner = self._planner.with_known(self._infos)
        return Realised(throw.throw_id, realised[0].toss_id, throw.expected_information, gain)

    def _learn(self) -> None:
        if self._throws:
            commanded, executed = (np.array([pair[side].release for pair in self._throws]) for side in (0, 1))
            noise = ExecutionNoise.learned(commanded, executed, self._planner.config.candidates.noise)
            self._planner = self._planner.with_noise(noise)


def overall_ratio(realised: Sequence[Realised]) -> float:
    """Ratio of realised to planned gain over all tosses; NaN without a planned gain."""
    planned = sum(one.planned for one in realised)
    return sum(one.realised for one in realised) / planned if planned > 0.0 else float("nan")


ONE_THREAD = replace(DEFAULT_LOSS, threads=1)
"""Who designs while others work shares the processors."""


@dataclass(frozen=True)
class DesignerConfig:
    """How throws are designed, and when theta is good enough for it.

    Attributes:
        planner: how throws are chosen.
        readiness: when theta is good enough to choose throws.
        loss: loss from which information is computed.
        form: physical or rigid, of a theta with one set of vertices and no learned noise; the same as the scorer's.
    """

    planner: DesignConfig = field(default_factory=DesignConfig)
    readiness: ReadinessConfig = field(default_factory=ReadinessConfig)
    loss: LossConfig = ONE_THREAD
    form: Form = Form.PHYSICAL


@dataclass(frozen=True, eq=False)
class Designer:
    """Designs throws of one body, without state.

    Attributes:
        body: as described.
        config: how.
        prior: where releases are drawn from.
        feasible: what the thrower says; None where it can throw anything.
    """

    body: Body
    config: DesignerConfig = field(default_factory=DesignerConfig)
    prior: ReleasePrior = PUBLISHED_PRIOR
    feasible: Feasible | None = None

    def particle(self, geometry: ContactGeometry) -> Particle:
        """A theta, to score tosses and design throws at."""
        rigid = self.config.form is Form.RIGID and not geometry.has_own_friction_vertices
        return Particle(geometry.rigid() if rigid else geometry, self.body, self.config.loss)

    def planner(self, particle: Particle) -> Planner:
        """Of throws at a theta; errors as there."""
        return Planner([particle], self.prior, config=self.config.planner, feasible=self.feasible)

    def unready_reason(
        self, losses: Sequence[float], known: Sequence[TossInformation], scores: Callable[[], Sequence[Array]]
    ) -> str | None:
        """Why a theta does not pass the readiness check, in one line; None when it does.

        Args:
            losses: mean loss of each toss that is known at it, when it was first scored, oldest first.
            known: the same tosses; their frame period is the tracker's.
            scores: gives the reference throws' scores at it and at the theta before; costly, and asked for last.
        """
        periods = [one.duration / one.transitions for one in known if one.transitions]
        check = self.config.readiness.of_body(self.body, float(np.median(periods)) if periods else QUIET_PERIOD)
        if not check.enabled:
            return None
        without_scores = unready_reason(replace(check, least_agreement=-1.0), losses, [np.arange(2.0)] * 2)
        return without_scores or unready_reason(check, losses, scores())

    def explore(self, name: str, seed: int, thrown: Sequence[Array]) -> Throw:
        """A throw that first touches the board differently from those before; no theta is asked.

        Args:
            name: of the throw.
            seed: of the pool.
            thrown: releases (13,) in SI units of throws before.

        Raises:
            InvalidValueError: no release may be thrown.
        """
        planner = self._as_described
        plan = exploration_plan(planner, [name], planner.known(), seed, thrown)
        return replace(plan.throws[0], expected_information=0.0, parameters_version="")

    @cached_property
    def _as_described(self) -> Planner:
        return self.planner(Particle(ContactGeometry.of_body(self.body), self.body, self.config.loss))
