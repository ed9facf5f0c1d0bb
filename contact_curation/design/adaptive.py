"""Throw, look, plan again (METHOD 1.10, 5): what was really thrown and learned takes the place of what was planned.

After each throw the noise of executions is learned anew from commands and executions; the toss's own information at theta is
added to what is known; and the next throws are planned from there. How much a toss taught in relation to what was planned is
the loop's health: far below 1 the model, the thrower or the tracker is not what the plan took it for.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from contact_curation.design.execution_noise import ExecutionNoise
from contact_curation.design.greedy_batch import gains
from contact_curation.design.planner import Plan, Planner
from contact_curation.design.releases import Releases
from contact_curation.design.throw import Throw
from contact_curation.information.record import TossInformation


@dataclass(frozen=True)
class Realised:
    """What a throw was planned to teach, and what its toss taught; log-det gains over what was known before it.

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
        """Realised against planned; not a number where nothing was planned."""
        return self.realised / self.planned if self.planned > 0.0 else float("nan")


class AdaptiveDesign:
    """Plans throws from all that is known so far.

    Args:
        planner: at the present theta.
        known: per particle, what the kept tosses teach at it.
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
        self._planner = planner
        self._learn()

    @property
    def planner(self) -> Planner:
        """With the noise as it is known now."""
        return self._planner

    @property
    def noise(self) -> ExecutionNoise:
        """As it is known now."""
        return self._planner.outlook.noise

    def plan(self, names: Sequence[str], seed: int) -> Plan:
        """The next throws, chosen together; errors as `Planner.plan`."""
        return self._planner.plan(names, self._known, seed)

    def made(self, commanded: Throw, executed: Throw) -> None:
        """A throw was made, in this way."""
        self._throws.append((commanded, executed))
        self._learn()

    def forecast(self, throw: Throw) -> Throw:
        """A throw that was planned elsewhere, with the gain that is expected of it here and now."""
        candidate = self._planner.outlook.candidates(Releases.of_states(throw.release[None]))
        gain = float(gains(self._known, candidate.fishers)[0])
        return replace(throw, expected_information=gain, parameters_version=self._planner.version)

    def add(self, throw: Throw, realised: Sequence[TossInformation]) -> Realised:
        """A throw's toss was scored; what it taught is known from now on.

        Args:
            throw: as it was planned.
            realised: per particle, what its toss teaches.

        Raises:
            InvalidValueError: scored at other thetas.
        """
        self._planner.known([[info] for info in realised])  # refuses what cannot be compared
        fishers = [info.fisher()[None] for info in realised]
        gain = float(gains(self._known, fishers)[0])
        for infos, info in zip(self._infos, realised, strict=True):
            infos.append(info)
        self._known = self._planner.known(self._infos)
        return Realised(throw.throw_id, realised[0].toss_id, throw.expected_information, gain)

    def _learn(self) -> None:
        if self._throws:
            commanded, executed = (np.array([pair[side].release for pair in self._throws]) for side in (0, 1))
            noise = ExecutionNoise.learned(commanded, executed, self._planner.config.outlook.noise)
            self._planner = self._planner.with_noise(noise)


def overall_ratio(realised: Sequence[Realised]) -> float:
    """What all tosses taught in relation to what was planned; not a number where nothing was planned."""
    planned = sum(one.planned for one in realised)
    return sum(one.realised for one in realised) / planned if planned > 0.0 else float("nan")
