"""A throw and what became of it, as far as that is known."""

from dataclasses import dataclass
from enum import StrEnum

from contact_curation.design.throw import Throw
from contact_curation.errors import InvalidValueError


class ThrowKind(StrEnum):
    """Why a throw was chosen."""

    DESIGNED = "designed"
    EXPLORATION = "exploration"


class ThrowState(StrEnum):
    """How far a throw is; each but the second follows on the one before."""

    COMMANDED = "commanded"
    NOT_MADE = "not made"
    EXECUTED = "executed"
    SCORED = "scored"


@dataclass(frozen=True, eq=False)
class ThrowReport:
    """What is known of a throw.

    Attributes:
        kind: why it was chosen.
        state: how far it is.
        commanded: as planned.
        executed: as it left the thrower; None until then.
        released_ns: stamp of that; 0 until then.
        toss_id: its toss; empty until one was scored.
        planned: gain in log-det; once the toss was scored, forecast at the theta it was scored at; 0 for exploration.
        realised: gain of its toss over what was known before, at that theta; not a number until then, and for exploration.
        detail: why it is an exploration throw, why it was not made, or why its motion was rejected.
    """

    kind: ThrowKind
    state: ThrowState
    commanded: Throw
    executed: Throw | None = None
    released_ns: int = 0
    toss_id: str = ""
    planned: float = 0.0
    realised: float = float("nan")
    detail: str = ""

    def __post_init__(self) -> None:
        name = f"report of throw {self.commanded.throw_id}"
        if (self.executed is None) == (self.state in (ThrowState.EXECUTED, ThrowState.SCORED)):
            found = "no executed throw" if self.executed is None else "an executed throw"
            raise InvalidValueError(name, f"{self.state} with {found}", "an executed throw once it was made, and not before")
        if bool(self.toss_id) != (self.state is ThrowState.SCORED):
            raise InvalidValueError(
                name, f"{self.state} with toss {self.toss_id!r}", "a toss once it was scored, and not before"
            )
        if self.executed is not None and self.executed.throw_id != self.commanded.throw_id:
            raise InvalidValueError(name, f"executed as {self.executed.throw_id}", "the same throw")
