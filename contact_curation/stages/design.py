"""Design of throws that can be interrupted at any time: all throws are on disk, and the next one follows from them.

Until theta passes the readiness check, throws are spread over first impacts (`design.exploration`); from then on they are those
that are expected to add most information, given the selected tosses and its own throws. While everything is scored again at a
new theta, throws are planned at the one before, at which everything is known.
"""

from collections.abc import Sequence
from dataclasses import replace
from math import nan
from typing import NamedTuple

import numpy as np

from contact_curation.contact.body import Body
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.design.designer import AdaptiveDesign, Designer, DesignerConfig, overall_ratio
from contact_curation.design.planner import Planner
from contact_curation.design.predicted_information import Particle
from contact_curation.design.releases import PUBLISHED_PRIOR, ReleasePrior
from contact_curation.design.safety import Feasible
from contact_curation.design.throw import Throw, ThrowReport
from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array
from contact_curation.information.record import TossInformation
from contact_curation.learning.checkpoints.theta_bytes import bytes_of_geometry, geometry_of_bytes
from contact_curation.stages.records import (
    FirstLoss,
    Proposal,
    ReferenceScores,
    ThrowRecord,
    load_record,
    record_key,
    stored_records,
)
from contact_curation.stages.scored_theta import forget_theta_of_another_body
from contact_curation.stages.throw_log import ThrowLog
from contact_curation.storage.stores.state import States


class RankedBuffer(NamedTuple):
    """What the curator selected.

    Attributes:
        toss_ids: selected.
        revision: of the buffer.
        version: of the theta that it is ranked at.
        seen: how many tosses it was selected from.
        newest_ns: stamp of the newest of them.
    """

    toss_ids: tuple[str, ...] = ()
    revision: int = 0
    version: str = ""
    seen: int = 0
    newest_ns: int = 0


class TrainerRest(NamedTuple):
    """That the trainer has nothing left to do for a buffer.

    Attributes:
        revision: of the buffer; 0 while there is something to do.
        newest_ns: stamp of the buffer's newest toss.
        version: of the theta that was trained last; empty where none was.
    """

    revision: int = 0
    newest_ns: int = 0
    version: str = ""


THETA = "theta"
"""What its safetensors bytes are kept under."""

MOST_VERSIONS = 3
"""Thetas that are kept in memory, with their information: a trainer may be this much ahead of the scorer."""


class DesignStage:
    """Proposes throws of one body, from theta and the throws that were made.

    Args:
        body: as described.
        config: how.
        states: where what was thrown is kept.
        geometry: theta to begin with; None for none.
        prior: where releases are drawn from.
        feasible: what the thrower says; None where it can throw anything.

    Attributes:
        keeps_newer: whether another theta than the given one is taken, because the store has kept it.
    """

    def __init__(
        self,
        body: Body,
        config: DesignerConfig,
        states: States,
        geometry: ContactGeometry | None = None,
        prior: ReleasePrior = PUBLISHED_PRIOR,
        feasible: Feasible | None = None,
    ) -> None:
        self._designer = Designer(body, config, prior, feasible)
        self._states = states
        self._infos: dict[str, dict[str, TossInformation]] = {}
        self._stamps: dict[str, int] = {}
        self._rejected: dict[int, tuple[str, ...]] = {}
        self._buffer, self._rest = RankedBuffer(), TrainerRest()
        self._up_to_date = True
        self._particles: dict[str, Particle] = {}
        self._planners: dict[str, Planner] = {}
        self._log = ThrowLog(states)
        forget_theta_of_another_body(states, body, THETA)
        known = states.load(THETA)
        theta = geometry_of_bytes(known) if known else geometry
        self.keeps_newer = bool(known) and geometry is not None and known != bytes_of_geometry(geometry)
        if theta is not None:
            self._take_up(self._designer.particle(theta))

    @property
    def version(self) -> str:
        """Version of the newest theta; empty while there is none."""
        return next(reversed(self._particles), "")

    @property
    def throws(self) -> tuple[ThrowRecord, ...]:
        """All that were made."""
        return self._log.made

    @property
    def reports(self) -> tuple[ThrowReport, ...]:
        """What is known of each throw that was made, and of one that was lost."""
        return self._log.reports

    @property
    def awaits_toss(self) -> bool:
        """Whether the toss of the last throw was neither scored yet nor rejected."""
        return bool(self.throws) and self.throws[-1].awaits_motion

    @property
    def ratio(self) -> float:
        """Ratio of realised to planned gain; NaN without a planned gain."""
        return overall_ratio([made.realised for made in self.throws if made.realised])

    def renew(self, geometry: ContactGeometry) -> bool:
        """Goes on with another theta; False when it is the same."""
        particle = self._designer.particle(geometry)
        if particle.version == self.version:
            return False
        self._states.save({THETA: bytes_of_geometry(geometry)})
        self._take_up(particle)
        self._measure()
        self._compare()
        return True

    def select(self, buffer: RankedBuffer) -> None:
        """Takes over a new selection of tosses."""
        self._buffer = buffer
        self._compare()

    def rest(self, rest: TrainerRest) -> None:
        """The trainer says where it is."""
        self._rest = rest
        self._compare()

    @property
    def is_up_to_date(self) -> bool:
        """Whether everything that can be learned from the tosses that are known here has been learned, and is known here."""
        return self._up_to_date

    def add(self, info: TossInformation, stamp_ns: int) -> None:
        """Takes in the information of a toss at some theta.

        Args:
            info: its information.
            stamp_ns: of its last frame.
        """
        self._infos[info.parameters_version] = self._infos.pop(info.parameters_version, {})  # the newest last
        self._infos[info.parameters_version][info.toss_id] = info
        while len(self._infos) > MOST_VERSIONS:
            oldest = next(version for version in self._infos if version != self.version)
            del self._infos[oldest]
        if info.toss_id not in self._stamps and self._states.load(record_key(FirstLoss, info.toss_id)) is None:
            self._states.save(stored_records(FirstLoss(info.mean_loss), name=info.toss_id))
        self._stamps[info.toss_id] = stamp_ns
        self._compare()
        if not self._log.busy:  # else it may be that of the throw under way, whose release nobody has told of yet
            self._match(info.toss_id)
            self._measure()

    def reject(self, first_ns: int, reasons: Sequence[str]) -> None:
        """Takes in a rejected motion, which gives no toss.

        Args:
            first_ns: stamp of its first frame.
            reasons: why.
        """
        self._rejected[first_ns] = tuple(reasons)
        if not self._log.busy:  # else it may be that of the throw under way
            self._match_rejected()

    def propose(self, seed: int | None = None) -> Proposal:
        """The next throw; the same knowledge and seed give the same.

        Args:
            seed: of the pool; by default the number of throws that were begun.

        Raises:
            InvalidValueError: no release may be thrown, not even as the body is described.
        """
        own = self._log.begun if seed is None else seed
        name = f"{self._designer.body.name}-throw-{self._log.begun}" + ("" if seed is None else f"-{seed}")
        reason = self.distrust()
        if reason is None:
            design = self._design(self._best_known())
            try:
                return Proposal(design.plan([name], own).throws[0], None)
            except InvalidValueError as error:  # a theta at which no throw comes to rest, say
                reason = str(error)
        thrown = [made.executed.release for made in self.throws]
        return Proposal(self._designer.explore(name, own, thrown), reason)

    def refuse(self, reason: str) -> None:
        """No throw could be proposed, for this reason; whoever supervises can read it."""
        self._log.refuse(reason)

    def distrust(self) -> str | None:
        """Why theta does not pass the readiness check; None when it does."""
        if not self._particles:
            return "parameters: found none, expected model_parameters"
        version = self._best_known()
        losses, known = self._first_losses(version), self._known_infos(version)
        return self._designer.unready_reason(losses, known, lambda: self._reference_scores(version))

    def begin(self, proposal: Proposal) -> ThrowReport:
        """A throw is about to be commanded: its number is used up, whatever becomes of it."""
        return self._log.begin(proposal, max(self._stamps.values(), default=0))

    def abandon(self, reason: str) -> ThrowReport:
        """The throw under way was not made."""
        report = self._log.abandon(reason)
        self._match_all()
        return report

    def finish(self, executed: Throw, released_ns: int) -> None:
        """The throw under way was made; its toss will end after `released_ns`.

        Raises:
            InvalidValueError: it is another throw than the one that was commanded, or too far from it.
        """
        self._log.finish(executed, released_ns)
        self._match_all()

    def _compare(self) -> None:
        """Whether the buffer holds what is known here, the trainer rests on it, and its theta has come with all information."""
        buffer, rest, known = self._buffer, self._rest, self._stamps
        holds_all = buffer.seen >= len(known) and buffer.newest_ns >= max(known.values(), default=0)
        rests = (rest.revision, rest.newest_ns, rest.version) == (buffer.revision, buffer.newest_ns, self.version)
        scored = self._infos.get(self.version, {}).keys() >= known.keys() and self.version == buffer.version
        self._up_to_date = not known or (holds_all and rests and (scored or not self.version))

    def _match_all(self) -> None:
        for toss_id in sorted(self._stamps, key=lambda one: (self._stamps[one], one)):
            self._match(toss_id)
        self._match_rejected()
        self._measure()

    def _match_rejected(self) -> None:
        """Gives each rejected motion to the throw that it began with; the first one there counts."""
        for first_ns, reasons in sorted(self._rejected.items()):
            place = self._log.thrower_of(first_ns)
            if place is not None and self.throws[place].awaits_motion:
                self._log.replace(place, replace(self.throws[place], rejected=reasons))
        self._rejected.clear()

    def _match(self, toss_id: str) -> None:
        """Gives a toss to the throw that it ended behind, if it is the first one there."""
        place = self._log.follower(self._stamps[toss_id])
        if place is None or any(made.toss_id == toss_id for made in self.throws):
            return
        if not self.throws[place].toss_id:
            self._log.replace(place, replace(self.throws[place], toss_id=toss_id))

    def _measure(self) -> None:
        """Computes the gains of designed throws whose tosses are scored at a theta that is known here, also of late ones.

        The expected gain is predicted again: it may have been planned at another theta, or before an earlier throw's toss
        came, and only gains at one theta over the same tosses compare.
        """
        for place, made in enumerate(self.throws):
            scored = [version for version in self._particles if made.toss_id in self._infos.get(version, {})]
            if made.awaits_gain and scored:
                planned_at = made.commanded.parameters_version
                version = planned_at if planned_at in scored else scored[-1]
                design = self._design(version, before=place)
                realised = design.add(design.predicted(made.commanded), [self._infos[version][made.toss_id]])
                self._log.replace(place, replace(made, realised=realised))

    def _take_up(self, particle: Particle) -> None:
        self._particles.pop(particle.version, None)
        self._particles[particle.version] = particle
        while len(self._particles) > MOST_VERSIONS:
            oldest = next(iter(self._particles))
            del self._particles[oldest]
            self._planners.pop(oldest, None)

    def _wanted(self) -> frozenset[str]:
        """The selected tosses and those of its own throws."""
        return frozenset(self._buffer.toss_ids) | {made.toss_id for made in self.throws}

    def _best_known(self) -> str:
        """The version of the theta at which most of the wanted tosses are scored; the newest of several."""
        wanted = self._wanted()
        return max(reversed(self._particles), key=lambda version: len(wanted & self._infos.get(version, {}).keys()))

    def _known_infos(self, version: str, before: int | None = None) -> list[TossInformation]:
        """Of the wanted tosses, at a theta; without those of its own throws from `before` on."""
        here, later = self._infos.get(version, {}), () if before is None else self.throws[before:]
        return [here[toss_id] for toss_id in sorted((self._wanted() & here.keys()) - {made.toss_id for made in later})]

    def _design(self, version: str, before: int | None = None) -> AdaptiveDesign:
        """At a theta, from all that is known, or from what was known before the own throw at index `before`."""
        if version not in self._planners:
            self._planners[version] = self._designer.planner(self._particles[version])
        pairs = [(made.commanded, made.executed) for made in self.throws[:before]]
        return AdaptiveDesign(self._planners[version], [self._known_infos(version, before)], pairs)

    def _first_losses(self, version: str) -> list[float]:
        """Of the tosses that are known at a theta, as they were scored first, oldest first."""
        known = (info.toss_id for info in self._known_infos(version))
        ids = sorted(known, key=lambda toss_id: (self._stamps[toss_id], toss_id))
        losses = [load_record(self._states.load, FirstLoss, toss_id) for toss_id in ids]
        return [nan if loss is None else loss.mean_loss for loss in losses]

    def _reference_scores(self, version: str) -> list[Array]:
        """Of a theta and the last one that was asked about before, that one first; kept on disk for a restart."""
        planner = self._design(version).planner
        known = load_record(self._states.load, ReferenceScores)
        if known is None or known.throws != planner.reference_digest:  # of a designer with other settings
            known = ReferenceScores({}, planner.reference_digest)
        if version not in known.scores:
            scores = {**known.scores, version: tuple(planner.reference_scores().tolist())}
            known = replace(known, scores=dict(list(scores.items())[-2:]))
            self._states.save(stored_records(known))
        return [np.array(scores) for scores in known.scores.values()]
