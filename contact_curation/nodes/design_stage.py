"""Designing that may be killed at any time: what was thrown is on disk, and the next throw follows from that and what is known.

Until the canary trusts theta, throws are spread over first impacts (`design.warm_up`); from then on they are what is expected
to teach most, given the kept tosses and the tosses of its own throws. A throw that was under way when the designer died counts
as lost: whether it was made is not known, and its toss, if there is one, is kept and known like any other.
"""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import NamedTuple

import numpy as np

from contact_curation.contact.body import Body
from contact_curation.contact.evaluation import DEFAULT_LOSS, LossConfig
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.design.adaptive import AdaptiveDesign, Realised, overall_ratio
from contact_curation.design.canary import CanaryConfig, distrust
from contact_curation.design.particle import Particle
from contact_curation.design.planner import DesignConfig, Planner
from contact_curation.design.safety_set import Feasible
from contact_curation.design.throw import Throw
from contact_curation.design.throw_prior import PUBLISHED_PRIOR, ReleasePrior
from contact_curation.design.warm_up_plan import warm_up_plan
from contact_curation.geometry.quaternions import Array
from contact_curation.information.record import TossInformation
from contact_curation.nodes.messages.model_parameters import bytes_of_geometry, geometry_of_bytes
from contact_curation.storage.state_store import StateStore

THETA, SCORES, THROWS, BEGUN = "theta", "reference scores", "throws", "begun"

ONE_THREAD = replace(DEFAULT_LOSS, threads=1)
"""The nodes of a graph share the processors."""

VERSIONS_KEPT = 2
"""Thetas whose information is kept in memory."""


@dataclass(frozen=True)
class DesignStageConfig:
    """How throws are designed and when theta is trusted with it.

    Attributes:
        planner: how throws are chosen.
        canary: when theta is trusted.
        loss: of the information.
    """

    planner: DesignConfig = field(default_factory=DesignConfig)
    canary: CanaryConfig = field(default_factory=CanaryConfig)
    loss: LossConfig = ONE_THREAD


@dataclass(frozen=True)
class Made:
    """A throw that was made.

    Attributes:
        commanded: as planned.
        executed: as it really left.
        after_ns: its toss ends later than this.
        toss_id: its toss, once one was scored.
        realised: what that taught; None until it was scored at the theta of the plan.
    """

    commanded: Throw
    executed: Throw
    after_ns: int
    toss_id: str = ""
    realised: Realised | None = None


class Proposal(NamedTuple):
    """The next throw, and why it is no designed one; None when it is."""

    throw: Throw
    warm_up: str | None


class DesignStage:
    """Proposes throws of one body, and learns from those that were made.

    Args:
        body: as described.
        config: how.
        states: where what was thrown is kept.
        geometry: theta to begin with; None for none.
        prior: where releases are drawn from.
        feasible: what the thrower says; None where it can throw anything.
    """

    def __init__(
        self,
        body: Body,
        config: DesignStageConfig,
        states: StateStore,
        geometry: ContactGeometry | None = None,
        prior: ReleasePrior = PUBLISHED_PRIOR,
        feasible: Feasible | None = None,
    ) -> None:
        self._body = body
        self._config = config
        self._states = states
        self._prior = prior
        self._feasible = feasible
        self._infos: dict[str, dict[str, TossInformation]] = {}
        self._stamps: dict[str, int] = {}
        self._kept: frozenset[str] = frozenset()
        self._planner: Planner | None = None
        self._throws = [_made_of(entry) for entry in json.loads(states.load(THROWS) or b"[]")]
        self._begun = int(states.load(BEGUN) or b"0")
        known = states.load(THETA)
        self._theta = geometry_of_bytes(known) if known is not None else geometry

    @property
    def version(self) -> str:
        """Of theta; empty while there is none."""
        return self._particle(self._theta).version if self._theta is not None else ""

    @property
    def throws(self) -> tuple[Made, ...]:
        """All that were made."""
        return tuple(self._throws)

    @property
    def awaits_toss(self) -> bool:
        """Whether the toss of the last throw was not scored yet."""
        return bool(self._throws) and not self._throws[-1].toss_id

    @property
    def ratio(self) -> float:
        """What tosses taught in relation to what was planned; not a number where nothing was planned."""
        return overall_ratio([made.realised for made in self._throws if made.realised])

    def renew(self, geometry: ContactGeometry) -> bool:
        """Goes on with another theta; False when it is the same."""
        if self._particle(geometry).version == self.version:
            return False
        self._states.save({THETA: bytes_of_geometry(geometry)})
        self._theta, self._planner = geometry, None
        return True

    def keep(self, toss_ids: Sequence[str]) -> None:
        """The kept set is another."""
        self._kept = frozenset(toss_ids)

    def add(self, info: TossInformation, stamp_ns: int) -> None:
        """A toss was scored, at some theta.

        Args:
            info: what it teaches.
            stamp_ns: of its last frame.
        """
        self._infos.setdefault(info.parameters_version, {})[info.toss_id] = info
        while len(self._infos) > VERSIONS_KEPT:
            oldest = next(version for version in self._infos if version != self.version)
            del self._infos[oldest]
        if info.toss_id not in self._stamps and self._states.load(_loss_key(info.toss_id)) is None:
            self._states.save({_loss_key(info.toss_id): repr(info.mean_loss).encode()})
        self._stamps[info.toss_id] = stamp_ns
        self._match(info, stamp_ns)

    def propose(self, seed: int | None = None) -> Proposal:
        """The next throw; the same knowledge and seed give the same.

        Args:
            seed: of the pool; by default the number of throws that were begun.

        Raises:
            InvalidValueError: no release may be thrown.
        """
        own = self._begun if seed is None else seed
        name = f"{self._body.name}-throw-{self._begun}" + ("" if seed is None else f"-{seed}")
        reason = self.distrust()
        if reason is None:
            return Proposal(self._design().plan([name], own).throws[0], None)
        planner = self._planner_of(Particle(ContactGeometry.of_body(self._body), self._body, self._config.loss))
        thrown = [made.executed.release for made in self._throws]
        plan = warm_up_plan(planner, [name], planner.known(), own, thrown)
        return Proposal(replace(plan.throws[0], expected_information=0.0, parameters_version=""), reason)

    def distrust(self) -> str | None:
        """Why theta is not trusted with choosing throws; None when it is."""
        if self._theta is None:
            return "parameters: found none, expected model_parameters"
        canary = self._config.canary
        if not canary.enabled:
            return None
        losses = self._first_losses()
        early = distrust(replace(canary, least_agreement=-1.0), losses, [np.arange(2.0)] * 2)
        if early is not None:
            return early  # before anything costly is asked
        return distrust(canary, losses, self._reference_scores())

    def begin(self) -> int:
        """A throw is about to be commanded: its number is used up, whatever becomes of it; returns the newest known stamp."""
        self._begun += 1
        self._states.save({BEGUN: str(self._begun).encode()})
        return max(self._stamps.values(), default=0)

    def finish(self, commanded: Throw, executed: Throw, after_ns: int) -> None:
        """A throw was made; its toss will end after `after_ns`."""
        self._throws.append(Made(commanded, executed, after_ns))
        self._save_throws()
        for version in list(self._infos):
            for info in sorted(self._infos[version].values(), key=lambda one: self._stamps[one.toss_id]):
                self._match(info, self._stamps[info.toss_id])

    def _match(self, info: TossInformation, stamp_ns: int) -> None:
        """Gives a toss to the last throw, if it is the first behind it, and measures what it taught."""
        if not self._throws:
            return
        last = self._throws[-1]
        taken = any(made.toss_id == info.toss_id for made in self._throws)
        if not last.toss_id and stamp_ns > last.after_ns and not taken:
            last = replace(last, toss_id=info.toss_id)
        planned_here = info.parameters_version == last.commanded.parameters_version == self.version
        if last.toss_id == info.toss_id and last.realised is None and planned_here:
            design = self._design(without=info.toss_id)
            last = replace(last, realised=design.add(last.commanded, [info]))
        if last is not self._throws[-1]:
            self._throws[-1] = last
            self._save_throws()

    def _known_infos(self, without: str = "") -> list[TossInformation]:
        """Of the kept tosses and those of its own throws, at this theta."""
        wanted = (self._kept | {made.toss_id for made in self._throws}) - {without}
        here = self._infos.get(self.version, {})
        return [here[toss_id] for toss_id in sorted(wanted & here.keys())]

    def _design(self, without: str = "") -> AdaptiveDesign:
        if self._planner is None:
            assert self._theta is not None
            self._planner = self._planner_of(self._particle(self._theta))
        pairs = [(made.commanded, made.executed) for made in self._throws]
        return AdaptiveDesign(self._planner, [self._known_infos(without)], pairs)

    def _first_losses(self) -> list[float]:
        """Of the tosses that are known at this theta, as they were scored first, oldest first."""
        ids = sorted((info.toss_id for info in self._known_infos()), key=lambda toss_id: (self._stamps[toss_id], toss_id))
        return [float(self._states.load(_loss_key(toss_id)) or b"nan") for toss_id in ids]

    def _reference_scores(self) -> list[Array]:
        """Of the last two thetas, this one last; kept on disk, so that a restart asks nothing again."""
        kept: dict[str, list[float]] = json.loads(self._states.load(SCORES) or b"{}")
        if self.version not in kept:
            kept[self.version] = self._design().planner.reference_scores().tolist()
            kept = dict(list(kept.items())[-VERSIONS_KEPT:])
            self._states.save({SCORES: json.dumps(kept).encode()})
        return [np.array(scores) for scores in kept.values()]

    def _particle(self, geometry: ContactGeometry) -> Particle:
        return Particle(geometry, self._body, self._config.loss)

    def _planner_of(self, particle: Particle) -> Planner:
        return Planner([particle], self._prior, config=self._config.planner, feasible=self._feasible)

    def _save_throws(self) -> None:
        self._states.save({THROWS: json.dumps([_entry_of(made) for made in self._throws]).encode()})


def _loss_key(toss_id: str) -> str:
    return f"first loss/{toss_id}"


def _entry_of(made: Made) -> dict[str, object]:
    return {
        "commanded": made.commanded.to_mapping(),
        "executed": made.executed.to_mapping(),
        "after_ns": made.after_ns,
        "toss_id": made.toss_id,
        "realised": asdict(made.realised) if made.realised else None,
    }


def _made_of(entry: dict[str, object]) -> Made:
    given: dict[str, object] = dict(entry)
    realised = given.pop("realised")
    throws = {name: Throw.from_mapping(given.pop(name)) for name in ("commanded", "executed")}  # type: ignore[arg-type]
    return Made(**throws, **given, realised=Realised(**realised) if realised else None)  # type: ignore[arg-type]
