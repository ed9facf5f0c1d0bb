"""Which throws were made and what became of each, on disk, so that a designer that is killed knows it when it comes back.

A throw that was under way when the designer died counts as lost: whether it was made is not known, and its toss, if there is
one, is kept and known like any other.
"""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import NamedTuple

from contact_curation.design.designer import Realised
from contact_curation.design.throw import Throw, ThrowKind, ThrowReport, ThrowState
from contact_curation.errors import InvalidValueError
from contact_curation.storage.stores.state import StateStore

THROWS, BEGUN, UNDER_WAY = "throws", "begun", "under way"

LEAD_NS = 50_000_000
"""A motion may seem to begin so much before its throw is released; what begins earlier is how the thrower carried the body."""

LOST = "the designer died while it was under way; whether it was made is not known"


class Proposal(NamedTuple):
    """The next throw, and why it is no designed one; None when it is."""

    throw: Throw
    warm_up: str | None


@dataclass(frozen=True, eq=False)
class Made:
    """A throw that was made.

    Attributes:
        commanded: as planned.
        executed: as it really left.
        after_ns: its toss ends later than this.
        released_ns: when it left.
        warm_up: why it was no designed one; None when it was.
        toss_id: its toss, once one was scored.
        realised: what that taught; None until it was scored at a theta that is known here, and for a warm-up.
        rejected: why its motion was kept back; empty where it was not.
    """

    commanded: Throw
    executed: Throw
    after_ns: int
    released_ns: int = 0
    warm_up: str | None = None
    toss_id: str = ""
    realised: Realised | None = None
    rejected: str = ""

    @property
    def report(self) -> ThrowReport:
        """What is known of it."""
        return ThrowReport(
            kind=_kind(self.warm_up),
            state=ThrowState.SCORED if self.toss_id else ThrowState.EXECUTED,
            commanded=self.commanded,
            executed=self.executed,
            released_ns=self.released_ns,
            toss_id=self.toss_id,
            planned=self.realised.planned if self.realised else self.commanded.expected_information,
            realised=self.realised.realised if self.realised else float("nan"),
            detail=f"rejected: {self.rejected}" if self.rejected and not self.toss_id else self.warm_up or "",
        )


class ThrowLog:
    """All throws of a designer, in the order they were made.

    Args:
        states: where they are kept.
    """

    def __init__(self, states: StateStore) -> None:
        self._states = states
        self._made = [_made_of(entry) for entry in json.loads(states.load(THROWS) or b"[]")]
        self._begun = int(states.load(BEGUN) or b"0")
        self._under_way: Proposal | None = None
        self._after_ns = 0
        entry = json.loads(states.load(UNDER_WAY) or b"null")
        self._lost = _proposal_of(entry) if entry else None

    @property
    def made(self) -> tuple[Made, ...]:
        """All that were made."""
        return tuple(self._made)

    @property
    def busy(self) -> bool:
        """Whether a throw is under way."""
        return self._under_way is not None

    @property
    def begun(self) -> int:
        """How many were begun, made or not."""
        return self._begun

    @property
    def reports(self) -> tuple[ThrowReport, ...]:
        """Of all that were made, and of the one that was under way when the designer died."""
        lost = () if self._lost is None else (_unmade(self._lost, ThrowState.NOT_MADE, LOST),)
        return (*(made.report for made in self._made), *lost)

    def begin(self, proposal: Proposal, newest_ns: int) -> ThrowReport:
        """A throw is about to be commanded: its number is used up, whatever becomes of it.

        Args:
            proposal: the throw.
            newest_ns: stamp of the newest toss that is known; its own ends later.
        """
        self._begun += 1
        self._under_way, self._after_ns, self._lost = proposal, newest_ns, None
        self._save({BEGUN: self._begun, UNDER_WAY: _entry_of_proposal(proposal)})
        return _unmade(proposal, ThrowState.COMMANDED, proposal.warm_up or "")

    def abandon(self, reason: str) -> ThrowReport:
        """The throw under way was not made."""
        proposal = self._ended()
        self._save({UNDER_WAY: None})
        return _unmade(proposal, ThrowState.NOT_MADE, reason)

    def finish(self, executed: Throw, released_ns: int) -> Made:
        """The throw under way was made."""
        if self._under_way is not None and executed.throw_id != self._under_way.throw.throw_id:
            raise InvalidValueError("executed throw", executed.throw_id, self._under_way.throw.throw_id)
        throw, warm_up = self._ended()
        made = Made(throw, executed, max(self._after_ns, released_ns), released_ns, warm_up)
        self._made.append(made)
        self._save({UNDER_WAY: None, THROWS: self._entries()})
        return made

    def follower(self, stamp_ns: int) -> int | None:
        """Index of the throw behind which a toss ended at `stamp_ns`: the last one that was released before."""
        return next((place for place in reversed(range(len(self._made))) if stamp_ns > self._made[place].after_ns), None)

    def thrower_of(self, first_ns: int) -> int | None:
        """Index of the throw that a motion began with, whose first frame is of `first_ns`: the last one released by then."""
        begun = first_ns + LEAD_NS
        return next((place for place in reversed(range(len(self._made))) if begun >= self._made[place].released_ns), None)

    def replace(self, place: int, made: Made) -> None:
        """More is known of a throw."""
        self._made[place] = made
        self._save({THROWS: self._entries()})

    def _ended(self) -> Proposal:
        proposal, self._under_way = self._under_way, None
        if proposal is None:
            raise InvalidValueError("throw under way", "none", "one that was begun")
        return proposal

    def _entries(self) -> list[dict[str, object]]:
        return [_entry_of(made) for made in self._made]

    def _save(self, values: Mapping[str, object]) -> None:
        self._states.save({name: json.dumps(value).encode() for name, value in values.items()})


def _kind(warm_up: str | None) -> ThrowKind:
    return ThrowKind.DESIGNED if warm_up is None else ThrowKind.EXPLORATION


def _unmade(proposal: Proposal, state: ThrowState, detail: str) -> ThrowReport:
    throw, warm_up = proposal
    return ThrowReport(_kind(warm_up), state, throw, planned=throw.expected_information, detail=detail)


def _entry_of_proposal(proposal: Proposal) -> dict[str, object]:
    return {"commanded": proposal.throw.to_mapping(), "warm_up": proposal.warm_up}


def _proposal_of(entry: dict[str, object]) -> Proposal:
    return Proposal(Throw.from_mapping(entry["commanded"]), entry["warm_up"])  # type: ignore[arg-type]


def _entry_of(made: Made) -> dict[str, object]:
    return {
        "commanded": made.commanded.to_mapping(),
        "executed": made.executed.to_mapping(),
        "after_ns": made.after_ns,
        "released_ns": made.released_ns,
        "warm_up": made.warm_up,
        "toss_id": made.toss_id,
        "realised": asdict(made.realised) if made.realised else None,
        "rejected": made.rejected,
    }


def _made_of(entry: dict[str, object]) -> Made:
    given: dict[str, object] = dict(entry)
    realised = given.pop("realised")
    throws = {name: Throw.from_mapping(given.pop(name)) for name in ("commanded", "executed")}  # type: ignore[arg-type]
    return Made(**throws, **given, realised=Realised(**realised) if realised else None)  # type: ignore[arg-type]
