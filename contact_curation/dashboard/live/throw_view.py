"""Views: throws as planned and as made, and what they were planned to gain against what they gained."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from contact_curation.dashboard.live.screen import Screen, number, table
from contact_curation.dashboard.style import BLUE, PURPLE
from contact_curation.design.throw import Throw

TABLE, GAINS = "throws", "gains"
PLANNED, REALISED = PURPLE, BLUE
NEXT_STATE, DONE_STATE = "commanded", "scored"
LISTED = 12
"""Throws on the page, newest first."""

HEADER = ("throw", "kind", "state", "planned", "realised", "note")


@dataclass(frozen=True, eq=False)
class ThrowMade:
    """A throw and its outcome.

    Attributes:
        kind: designed or exploration.
        state: commanded, not made, executed or scored.
        commanded: the throw.
        planned: gain in log-det; 0 for exploration.
        realised: gain of its toss in log-det; NaN until that was scored.
        detail: why it explores, or was not made.
    """

    kind: str
    state: str
    commanded: Throw
    planned: float
    realised: float
    detail: str


class ThrowView:
    """Writes throws.

    Args:
        screen: to write to.
    """

    def __init__(self, screen: Screen) -> None:
        self._screen = screen
        screen.curve(f"{GAINS}/planned", "planned gain [nats]", PLANNED)
        screen.curve(f"{GAINS}/realised", "realised gain [nats]", REALISED)
        screen.text(TABLE, "No throw was commanded yet.")

    def show(self, throws: Sequence[ThrowMade], newest: ThrowMade) -> None:
        """Writes all throws so far, oldest first, of which one is news."""
        self._screen.text(TABLE, throws_page(throws))
        if newest.state == DONE_STATE and np.isfinite(newest.realised):
            planned = {"planned": newest.planned} if newest.planned > 0.0 else {}
            self._screen.values(GAINS, {**planned, "realised": newest.realised})


def throws_page(throws: Sequence[ThrowMade]) -> str:
    """Throws as a page, the newest first."""
    waiting = next((one for one in reversed(throws) if one.state == NEXT_STATE), None)
    title = f"**Next throw: {_in_words(waiting)}**" if waiting else "No throw is under way; gains in log-det [nats]"
    numbered = list(enumerate(throws, start=1))[-LISTED:]
    return f"{title}\n\n{table(HEADER, (_cells(place, one) for place, one in reversed(numbered)))}"


def _in_words(throw: ThrowMade) -> str:
    expected = f", planned to add {throw.planned:.2f} nats" if throw.planned > 0.0 else ""
    return f"{throw.kind}, {_speed(throw.commanded)} m/s, {_spin(throw.commanded)} rad/s{expected}"


def _cells(place: int, throw: ThrowMade) -> tuple[str, ...]:
    planned = number(throw.planned) if throw.planned > 0.0 else "-"
    note = (
        throw.detail.partition(": found")[0] if throw.detail.startswith("rejected") else throw.detail
    )  # whole in its own view
    return (str(place), throw.kind, throw.state, planned, number(throw.realised), note)


def _speed(throw: Throw) -> str:
    return f"{np.linalg.norm(throw.linear_velocity):.2f}"


def _spin(throw: Throw) -> str:
    return f"{np.linalg.norm(throw.angular_velocity):.1f}"
