"""View: an overview of the session, in a few lines."""

from dataclasses import dataclass
from math import isfinite

from contact_curation.dashboard.live.screen import Screen

PAGE = "session"
MILLIMETRES = 1e3


@dataclass(frozen=True)
class SessionOverview:
    """The state of a session in numbers.

    Attributes:
        throws: commanded so far; 0 where nobody throws.
        planned: throws in all; 0: not known.
        under_way: whether the newest throw's toss is still to come.
        tosses: number of tosses that passed the quality checks.
        selected: number of selected ones.
        rejected: motions that did not pass.
        friction: what is known of it, in words; empty where that is nothing.
        drawn: the toss in the view of a toss, in words; empty before the first.
        error: mean distance of its predicted from its measured centre [m]; NaN where the prediction is not finite.
        trained: whether a training has been reported; None where nobody trains.
        position_error: of held-out tosses [% of the width]; NaN where there are none.
        rotation_error: of them [deg].
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
    trained: bool | None = None
    position_error: float = float("nan")
    rotation_error: float = float("nan")


class SummaryView:
    """Writes the overview of a session when it has changed.

    Args:
        screen: to write to.
    """

    def __init__(self, screen: Screen) -> None:
        self._screen = screen
        self._page = ""

    def show(self, overview: SessionOverview) -> None:
        """Writes it."""
        page = summary_page(overview)
        if page != self._page:
            self._page = page
            self._screen.text(PAGE, page)


def summary_page(overview: SessionOverview) -> str:
    """The overview of a session, as a page."""
    others = overview.tosses - overview.selected
    tosses = "1 toss" if overview.tosses == 1 else f"{overview.tosses} tosses"
    counts = f"{tosses}: **{overview.selected} selected**, {others} not selected; {overview.rejected} rejected"
    of = f" of {overview.planned}" if overview.planned else ""
    state = "is under way" if overview.under_way else "is done"
    throws = f"**Throw {overview.throws}{of}** {state}. " if overview.throws else ""
    known = f" Friction {overview.friction}." if overview.friction else ""
    learned = () if overview.trained is None else (_learned(overview),)
    return "\n\n".join((f"{throws}{counts}.{known}", *learned, _drawn(overview)))


def _learned(overview: SessionOverview) -> str:
    """What the views of held-out errors and losses show, or why they are empty."""
    if not overview.trained:
        return "Held-out errors: none before the first training."
    if not isfinite(overview.position_error):
        return "Held-out errors: none, because the trainer has no recordings to evaluate on (`evaluate_on`)."
    rotation = f", {overview.rotation_error:.1f} degrees" if isfinite(overview.rotation_error) else ""
    return f"Held-out errors: **{overview.position_error:.1f} % of the width**{rotation}."


def _drawn(overview: SessionOverview) -> str:
    if not overview.drawn:
        return "No toss is drawn yet."
    off = f"{MILLIMETRES * overview.error:.0f} mm off on average" if isfinite(overview.error) else "without a finite motion"
    return f"Drawn: **{overview.drawn}**, predicted {off}."
