"""How the arms of `designed-throws` choose: at random, or as the node throw_designer does, without a disk and a graph."""

from collections.abc import Iterable, Sequence
from typing import NamedTuple, Protocol

from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.design.designer import AdaptiveDesign, Designer, Realised
from contact_curation.design.planner import Planner
from contact_curation.design.predicted_information import Particle
from contact_curation.design.throw import Throw
from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array
from contact_curation.information.record import TossInformation
from contact_curation.motion.toss import Toss

POOLS = 1000
"""Most throws of a seed, whose pools no other seed shares."""


class Choice(NamedTuple):
    """The next throw, and why it is no designed one; empty when it is."""

    throw: Throw
    reason: str


class Chooser(Protocol):
    """Chooses one throw after the other, and hears what became of each."""

    def choose(self, number: int) -> Choice:
        """Throw `number`, from 1 on; raises InvalidValueError where no release may be thrown."""

    def thrown(self, commanded: Throw, executed: Throw) -> None:
        """What it chose was made."""

    def came(self, toss: Toss) -> Realised | None:
        """Its toss before any training on it, and its gain if it was designed."""

    def learned(self, geometry: ContactGeometry, tosses: Sequence[Toss]) -> None:
        """Theta is another, after these tosses."""


class RandomThrows:
    """Throws that were drawn before.

    Args:
        throws: enough of them.
    """

    def __init__(self, throws: Iterable[Throw]) -> None:
        self._throws = iter(throws)

    def choose(self, number: int) -> Choice:
        """The next one."""
        return Choice(next(self._throws), "at random")

    def thrown(self, commanded: Throw, executed: Throw) -> None:
        """Changes nothing."""

    def came(self, toss: Toss) -> Realised | None:
        """Changes nothing."""
        return None

    def learned(self, geometry: ContactGeometry, tosses: Sequence[Toss]) -> None:
        """Changes nothing."""


class ExplorationThrows:
    """Throws that first touch the board as none before.

    Args:
        designer: decides.
        seed: of the pools.

    Attributes:
        pairs: commands and executions so far.
    """

    def __init__(self, designer: Designer, seed: int) -> None:
        self._designer, self._seed = designer, seed
        self.pairs: list[tuple[Throw, Throw]] = []

    def choose(self, number: int) -> Choice:
        """Asks no theta, ever."""
        return self.explored(number, "all are")

    def thrown(self, commanded: Throw, executed: Throw) -> None:
        """Keeps clear of it from here on."""
        self.pairs.append((commanded, executed))

    def came(self, toss: Toss) -> Realised | None:
        """Changes nothing."""
        return None

    def learned(self, geometry: ContactGeometry, tosses: Sequence[Toss]) -> None:
        """Changes nothing."""

    def explored(self, number: int, reason: str) -> Choice:
        """A throw that asks no theta, and why it is made."""
        thrown = [executed.release for _, executed in self.pairs]
        return Choice(self._designer.explore(name_of(number), self.pool(number), thrown), reason)

    def pool(self, number: int) -> int:
        """Seed of a throw's pool."""
        return POOLS * self._seed + number


class DesignedThrows:
    """Designed throws, from the first one at which theta passes the readiness check.

    Args:
        designer: decides.
        geometry: theta to begin with, at which first losses are taken; nothing is designed at it.
        seed: of the pools.
    """

    def __init__(self, designer: Designer, geometry: ContactGeometry, seed: int) -> None:
        self._exploration = ExplorationThrows(designer, seed)
        self._designer = designer
        self._particle = designer.particle(geometry)
        self._begun = False
        self._planner: Planner | None = None
        self._infos: list[TossInformation] = []
        self._losses: dict[str, float] = {}
        self._scores: dict[str, Array] = {}
        self._design: AdaptiveDesign | None = None
        self._planned: Throw | None = None

    def choose(self, number: int) -> Choice:
        """The designed throw, or an exploration throw and why."""
        reason = self._unready_reason()
        self._planned, self._design = None, None
        if reason is None:
            try:
                return Choice(self._plan(number), "")
            except InvalidValueError as error:  # with a friction that is far too small nothing comes to rest
                reason = str(error)
        return self._exploration.explored(number, reason)

    def thrown(self, commanded: Throw, executed: Throw) -> None:
        """Learns the thrower's noise from it."""
        self._exploration.thrown(commanded, executed)

    def came(self, toss: Toss) -> Realised | None:
        """Takes its loss, for the readiness check, and its gain at the theta that it was designed at."""
        for info in _scored(self._particle, [toss]):
            self._losses[info.toss_id] = info.mean_loss
            if self._design is not None and self._planned is not None:
                return self._design.add(self._planned, [info])
        return None

    def learned(self, geometry: ContactGeometry, tosses: Sequence[Toss]) -> None:
        """Scores everything again."""
        self._particle, self._planner, self._begun = self._designer.particle(geometry), None, True
        self._infos = _scored(self._particle, tosses)

    def _plan(self, number: int) -> Throw:
        self._design = AdaptiveDesign(self._planner_here(), [self._infos], self._exploration.pairs)
        self._planned = self._design.plan([name_of(number)], self._exploration.pool(number)).throws[0]
        return self._planned

    def _unready_reason(self) -> str | None:
        if not self._begun:
            return "parameters: found none, expected some"
        losses = [self._losses[info.toss_id] for info in self._infos if info.toss_id in self._losses]
        return self._designer.unready_reason(losses, self._infos, self._reference_scores)

    def _reference_scores(self) -> Sequence[Array]:
        """At this theta and at the last other one that was asked about."""
        version = self._particle.version
        if version not in self._scores:
            self._scores = {**dict(list(self._scores.items())[-1:]), version: self._planner_here().reference_scores()}
        return list(self._scores.values())

    def _planner_here(self) -> Planner:
        if self._planner is None:
            self._planner = self._designer.planner(self._particle)
        return self._planner


def name_of(number: int) -> str:
    """Of a throw."""
    return f"throw-{number}"


def _scored(particle: Particle, tosses: Sequence[Toss]) -> list[TossInformation]:
    return [info for info in particle.scorer.score(tosses) if isinstance(info, TossInformation)]
