"""View: where the session stands, in a few lines."""

from dataclasses import dataclass
from math import isfinite

from contact_curation.dashboard.live.screen import Screen

PAGE = "session"
MILLIMETRES = 1e3


@dataclass(frozen=True)
class Standing:
    """Where a session stands.

    Attributes:
        throws: commanded so far; 0 where nobody throws.
        planned: throws in all; 0: not known.
        under_way: whether the newest throw's toss is still to come.
        tosses: that passed the quality checks.
        selected: of them.
        rejected: motions that did not pass.
        friction: what is known of it, in words; empty where that is nothing.
        drawn: the toss in the view of a toss, in words; empty before the first.
        error: mean distance of its predicted from its measured centre [m]; NaN where the prediction is not finite.
    """

    throws: int = 0
    planned: int = 0
    under_way: bool = False
    tosses: int = 0
    selected: int = 0
    rejected: int = 0
    friction: str = ""
    drawn: str = ""
    error: float = float("nan")


class SummaryView:
    """Writes where a session stands, when that is another than before.

    Args:
        screen: to write to.
    """

    def __init__(self, screen: Screen) -> None:
        self._screen = screen
        self._page = ""

    def show(self, standing: Standing) -> None:
        """Writes it."""
        page = summary_page(standing)
        if page != self._page:
            self._page = page
            self._screen.text(PAGE, page)


def summary_page(standing: Standing) -> str:
    """Where a session stands, as a page."""
    others = standing.tosses - standing.selected
    counts = f"{standing.tosses} tosses: **{standing.selected} selected**, {others} not selected; {standing.rejected} rejected"
    of = f" of {standing.planned}" if standing.planned else ""
    state = "is under way" if standing.under_way else "is done"
    throws = f"**Throw {standing.throws}{of}** {state}. " if standing.throws else ""
    known = f" Friction {standing.friction}." if standing.friction else ""
    if not standing.drawn:
        return f"{throws}{counts}.{known}\n\nNo toss is drawn yet."
    off = f"{MILLIMETRES * standing.error:.0f} mm off on average" if isfinite(standing.error) else "without a finite motion"
    return f"{throws}{counts}.{known}\n\nDrawn: **{standing.drawn}**, predicted {off}."
