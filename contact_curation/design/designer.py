"""The next throw, for whoever keeps what was thrown and learned: whether theta is trusted with it, and what is thrown if not.

Until the canary trusts theta (METHOD 2.4) throws are spread over first impacts, by flight and shape alone; from then on they
are what is expected to teach most (`AdaptiveDesign`), planned at theta from all that is known.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from contact_curation.contact.body import Body
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.loss_config import DEFAULT_LOSS, LossConfig
from contact_curation.design.exploration_plan import warm_up_plan
from contact_curation.design.particle import Particle
from contact_curation.design.planner import DesignConfig, Planner
from contact_curation.design.readiness import CanaryConfig, distrust
from contact_curation.design.safety_set import Feasible
from contact_curation.design.throw import Throw
from contact_curation.design.throw_prior import PUBLISHED_PRIOR, ReleasePrior
from contact_curation.geometry.quaternions import Array

ONE_THREAD = replace(DEFAULT_LOSS, threads=1)
"""Who designs while others work shares the processors."""


@dataclass(frozen=True)
class DesignerConfig:
    """How throws are designed and when theta is trusted with it.

    Attributes:
        planner: how throws are chosen.
        canary: when theta is trusted.
        loss: of the information.
    """

    planner: DesignConfig = field(default_factory=DesignConfig)
    canary: CanaryConfig = field(default_factory=CanaryConfig)
    loss: LossConfig = ONE_THREAD


@dataclass(frozen=True, eq=False)
class Designer:
    """Decides for one body; remembers nothing.

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
        return Particle(geometry, self.body, self.config.loss)

    def planner(self, particle: Particle) -> Planner:
        """Of throws at a theta; errors as there."""
        return Planner([particle], self.prior, config=self.config.planner, feasible=self.feasible)

    def distrust(self, losses: Sequence[float], scores: Callable[[], Sequence[Array]]) -> str | None:
        """Why a theta is not trusted with choosing throws, in one line; None when it is.

        Args:
            losses: mean loss of each toss that is known at it, when it was first scored, oldest first.
            scores: gives the reference throws' scores at it and at the theta before; costly, and asked for last.
        """
        canary = self.config.canary
        if not canary.enabled:
            return None
        without_scores = distrust(replace(canary, least_agreement=-1.0), losses, [np.arange(2.0)] * 2)
        return without_scores or distrust(canary, losses, scores())

    def warm_up(self, name: str, seed: int, thrown: Sequence[Array]) -> Throw:
        """A throw that first touches the board differently from those before; no theta is asked.

        Args:
            name: of the throw.
            seed: of the pool.
            thrown: releases (13,) in SI units of throws before.

        Raises:
            InvalidValueError: no release may be thrown.
        """
        planner = self._as_described
        plan = warm_up_plan(planner, [name], planner.known(), seed, thrown)
        return replace(plan.throws[0], expected_information=0.0, parameters_version="")

    @cached_property
    def _as_described(self) -> Planner:
        return self.planner(self.particle(ContactGeometry.of_body(self.body)))
