"""Views: the ranking with its reasons, the selected set's spectrum, epsilon over the session, and what the gates rejected."""

from collections.abc import Sequence

import numpy as np
import rerun as rr

from contact_curation.dashboard.evidence import Evidence, EvidenceRow, SelectedSet, SelectedSpectrum
from contact_curation.dashboard.live.screen import Screen, number, table
from contact_curation.dashboard.style import BLUE, GREEN, VERMILION
from contact_curation.motion.toss import NANOSECONDS, first_stamp_in

TABLE, SPECTRUM, EPSILON = "ranking", "spectrum", "epsilon"
LISTED_OTHERS = 12
"""Tosses that are not selected, of those that would add most; all others are counted."""

HEADER = ("rank", "toss [s]", "trace", "gain", "why")

SELECTED, POOL, WORST = BLUE, GREEN, VERMILION

FLOOR, DECIMALS = 1e-3, 6
"""Smaller eigenvalues are drawn as the floor; heights are rounded, so that a selected set of all tosses shows none."""


class RankingView:
    """Writes rankings.

    Args:
        screen: to write to.
    """

    def __init__(self, screen: Screen) -> None:
        self._screen = screen
        screen.curve(f"{EPSILON}/epsilon", "epsilon", SELECTED)
        screen.curve(f"{EPSILON}/missing", "missing in the worst direction", WORST)
        screen.curve(f"{EPSILON}/efficiency", "D-efficiency of a selected toss", POOL)

    def show(self, selected: SelectedSet, evidence: Evidence) -> None:
        """Writes a selected set and the reasons for it."""
        self.show_page(selected, evidence)
        self.show_spectrum(evidence.spectrum)

    def show_page(self, selected: SelectedSet, evidence: Evidence) -> None:
        """Writes the ranking with its reasons."""
        self._screen.text(TABLE, ranking_page(selected, evidence))

    def show_spectrum(self, spectrum: SelectedSpectrum) -> None:
        """Writes how a selected set stands to its pool."""
        heights = np.round(np.log10(np.maximum(spectrum.eigenvalues, FLOOR)), DECIMALS)
        self._screen.log(SPECTRUM, rr.BarChart(heights, color=SELECTED))
        curves = {"epsilon": spectrum.epsilon, "missing": spectrum.missing, "efficiency": spectrum.efficiency}
        self._screen.values(EPSILON, curves)


def ranking_page(selected: SelectedSet, evidence: Evidence) -> str:
    """The ranking as a page."""
    proven = f", at least {100.0 * selected.bound:.0f} % of the best set's D-efficiency" if selected.bound > 0.0 else ""
    off, by_chance = number(evidence.shift.distance), number(evidence.shift.at_random)
    chosen = f"**{len(selected.toss_ids)} of {selected.seen} tosses selected** by {selected.criterion}{proven}"
    title = f"{chosen}; theta `{selected.version[:12]}`"
    answer = (
        f"Their estimate is {off} from the full-data estimate, in units of a toss's scatter; "
        f"about {by_chance} is expected for random subsets of the same size."
    )
    count = len(selected.toss_ids) + LISTED_OTHERS
    rows = table(HEADER, (_cells(row) for row in evidence.rows[:count]))
    more = len(evidence.rows) - count
    return "\n\n".join([title, answer, rows, *([f"and {more} more that would add less"] if more > 0 else [])])


def _cells(row: EvidenceRow) -> tuple[str, ...]:
    strong = "**" if row.selected else ""
    return (f"{strong}{row.rank}{strong}", short_id(row.toss_id), number(row.trace), number(row.gain), row.reason)


def short_id(toss_id: str) -> str:
    """What tells tosses of a session apart in their ids: the first stamp [s]; any other id as it is."""
    stamp_ns = first_stamp_in(toss_id)
    if stamp_ns is None:
        return toss_id
    seconds, nanoseconds = divmod(stamp_ns, NANOSECONDS)
    return f"{seconds}.{nanoseconds // 1_000_000:03d}"


REJECTED = "rejected"


class GateView:
    """Writes what was rejected.

    Args:
        screen: to write to.
    """

    def __init__(self, screen: Screen) -> None:
        self._screen = screen

    def show(self, toss_id: str, frames: int, reasons: Sequence[str]) -> None:
        """Writes a motion and why it is no toss to learn from."""
        text = f"{short_id(toss_id)}, {frames} frames: {'; '.join(reasons)}"
        self._screen.log(REJECTED, rr.TextLog(text, level=rr.TextLogLevel.WARN))
