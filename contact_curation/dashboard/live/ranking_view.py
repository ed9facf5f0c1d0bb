"""Views: the ranking with its reasons, the spectrum of the kept set's information, the theorem's epsilon over the session."""

import numpy as np
import rerun as rr

from contact_curation.dashboard.colours import BLUE, GREEN, VERMILION
from contact_curation.dashboard.evidence import Evidence, EvidenceRow, KeptSet, KeptSpectrum
from contact_curation.dashboard.live.pages import number, table
from contact_curation.dashboard.live.screen import Screen
from contact_curation.motion.toss import NANOSECONDS

TABLE, SPECTRUM, EPSILON = "ranking", "spectrum", "epsilon"
LISTED_OTHERS = 12
"""Tosses that are not kept, of those that would add most; all others are counted."""

HEADER = ("rank", "toss [s]", "trace", "gain", "why")

KEPT, POOL, WORST = BLUE, GREEN, VERMILION

FLOOR, DECIMALS = 1e-3, 6
"""Smaller eigenvalues are drawn as the floor; heights are rounded, so that a kept set of all tosses shows none."""


class RankingView:
    """Writes rankings.

    Args:
        screen: to write to.
    """

    def __init__(self, screen: Screen) -> None:
        self._screen = screen
        screen.curve(f"{EPSILON}/epsilon", "epsilon", KEPT)
        screen.curve(f"{EPSILON}/missing", "missing in the worst direction", WORST)
        screen.curve(f"{EPSILON}/efficiency", "D-efficiency of a kept toss", POOL)

    def show(self, kept: KeptSet, evidence: Evidence) -> None:
        """Writes a kept set and what speaks for it."""
        self.show_page(kept, evidence)
        self.show_spectrum(evidence.spectrum)

    def show_page(self, kept: KeptSet, evidence: Evidence) -> None:
        """Writes the ranking with its reasons."""
        self._screen.text(TABLE, ranking_page(kept, evidence))

    def show_spectrum(self, spectrum: KeptSpectrum) -> None:
        """Writes how a kept set stands to its pool."""
        heights = np.round(np.log10(np.maximum(spectrum.eigenvalues, FLOOR)), DECIMALS)
        self._screen.log(SPECTRUM, rr.BarChart(heights, color=KEPT))
        curves = {"epsilon": spectrum.epsilon, "missing": spectrum.missing, "efficiency": spectrum.efficiency}
        self._screen.values(EPSILON, curves)


def ranking_page(kept: KeptSet, evidence: Evidence) -> str:
    """The ranking as a page."""
    proven = f", at least {100.0 * kept.bound:.0f} % of the best set's D-efficiency" if kept.bound > 0.0 else ""
    off, by_chance = number(evidence.shift.distance), number(evidence.shift.at_random)
    title = f"**{len(kept.toss_ids)} of {kept.seen} tosses kept** by {kept.criterion}{proven}; theta `{kept.version[:12]}`"
    answer = f"Their answer is {off} from that of all, in units of a toss's scatter; as many at random about {by_chance}."
    count = len(kept.toss_ids) + LISTED_OTHERS
    rows = table(HEADER, (_cells(row) for row in evidence.rows[:count]))
    more = len(evidence.rows) - count
    return "\n\n".join([title, answer, rows, *([f"and {more} more that would add less"] if more > 0 else [])])


def _cells(row: EvidenceRow) -> tuple[str, ...]:
    strong = "**" if row.kept else ""
    return (f"{strong}{row.rank}{strong}", short_id(row.toss_id), number(row.trace), number(row.gain), row.reason)


def short_id(toss_id: str) -> str:
    """What tells tosses of a session apart in their ids: the first stamp [s]; any other id as it is."""
    stamp = toss_id.rpartition("-")[0].rpartition("-")[2]
    if not stamp.isdecimal():
        return toss_id
    seconds, nanoseconds = divmod(int(stamp), NANOSECONDS)
    return f"{seconds}.{nanoseconds // 1_000_000:03d}"
