"""The log of all throws and their outcomes on disk, from which a designer continues after a restart.

A throw that was under way when the designer died counts as lost: whether it was made is not known, and its toss, if there is
one, is kept and known like any other.
"""

from dataclasses import replace

from contact_curation.design.execution_noise import check_executed
from contact_curation.design.throw import Throw, ThrowReport, ThrowState
from contact_curation.errors import InvalidValueError
from contact_curation.stages.records import Proposal, ThrowLogRecord, ThrowRecord, kind_of_throw, load_record, stored_records
from contact_curation.storage.stores.state import States

LEAD_NS = 50_000_000
"""A motion may seem to begin so much before its throw is released; what begins earlier is how the thrower carried the body."""

LOST = "the designer died while it was under way; whether it was made is not known"


class ThrowLog:
    """All throws of a designer, in the order they were made.

    Args:
        states: where they are kept.
    """

    def __init__(self, states: States) -> None:
        self._states = states
        self._record = load_record(states.load, ThrowLogRecord) or ThrowLogRecord()
        self._lost, self._busy = self._record.under_way, False
        self._after_ns = 0

    @property
    def made(self) -> tuple[ThrowRecord, ...]:
        """All that were made."""
        return self._record.made

    @property
    def busy(self) -> bool:
        """Whether a throw is under way."""
        return self._busy

    @property
    def begun(self) -> int:
        """How many were begun, made or not."""
        return self._record.begun

    @property
    def reports(self) -> tuple[ThrowReport, ...]:
        """Of all that were made, and of the one that was under way when the designer died."""
        lost = () if self._lost is None else (_unmade(self._lost, ThrowState.NOT_MADE, LOST),)
        return (*(made.report for made in self.made), *lost)

    def begin(self, proposal: Proposal, newest_ns: int) -> ThrowReport:
        """A throw is about to be commanded: its number is used up, whatever becomes of it.

        Args:
            proposal: the throw.
            newest_ns: stamp of the newest toss that is known; its own ends later.
        """
        self._after_ns, self._lost, self._busy = newest_ns, None, True
        self._save(replace(self._record, begun=self.begun + 1, under_way=proposal, no_throw=""))
        return _unmade(proposal, ThrowState.COMMANDED, proposal.exploration or "")

    def abandon(self, reason: str) -> ThrowReport:
        """The throw under way was not made."""
        proposal = self._ended()
        self._save(replace(self._record, under_way=None))
        return _unmade(proposal, ThrowState.NOT_MADE, reason)

    def finish(self, executed: Throw, released_ns: int) -> None:
        """The throw under way was made.

        Raises:
            InvalidValueError: it is another one, or cannot have become of it.
        """
        proposal = self._record.under_way
        if self._busy and proposal is not None:
            commanded = proposal.throw
            if executed.throw_id != commanded.throw_id:
                raise InvalidValueError("executed throw", executed.throw_id, commanded.throw_id)
            if executed.body != commanded.body:
                raise InvalidValueError(f"body of executed throw {executed.throw_id}", executed.body, commanded.body)
            check_executed(commanded.release, executed.release)
        throw, exploration = self._ended()
        made = ThrowRecord(throw, executed, max(self._after_ns, released_ns), released_ns, exploration)
        self._save(replace(self._record, under_way=None, made=(*self.made, made)))

    def refuse(self, reason: str) -> None:
        """No throw could be proposed."""
        if reason != self._record.no_throw:
            self._save(replace(self._record, no_throw=reason))

    def follower(self, stamp_ns: int) -> int | None:
        """Index of the throw behind which a toss ended at `stamp_ns`: the last one that was released before."""
        return next((place for place in reversed(range(len(self.made))) if stamp_ns > self.made[place].after_ns), None)

    def thrower_of(self, first_ns: int) -> int | None:
        """Index of the throw that a motion began with, whose first frame is of `first_ns`: the last one released by then."""
        begun = first_ns + LEAD_NS
        return next((place for place in reversed(range(len(self.made))) if begun >= self.made[place].released_ns), None)

    def replace(self, place: int, made: ThrowRecord) -> None:
        """More is known of a throw."""
        self._save(replace(self._record, made=(*self.made[:place], made, *self.made[place + 1 :])))

    def _ended(self) -> Proposal:
        proposal = self._record.under_way if self._busy else None
        if proposal is None:
            raise InvalidValueError("throw under way", "none", "one that was begun")
        self._busy = False
        return proposal

    def _save(self, record: ThrowLogRecord) -> None:
        self._record = record
        self._states.save(stored_records(record))


def _unmade(proposal: Proposal, state: ThrowState, detail: str) -> ThrowReport:
    throw, exploration = proposal
    return ThrowReport(kind_of_throw(exploration), state, throw, planned=throw.expected_information, detail=detail)
