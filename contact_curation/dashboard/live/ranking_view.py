"""Views: the ranking with its reasons, the selected set's spectrum, epsilon over the session, and the rejected motions."""

from collections.abc import Mapping, Sequence

import rerun as rr

from contact_curation.dashboard.evidence import Evidence, EvidenceRow, SelectedSet, SelectedSpectrum
from contact_curation.dashboard.live.screen import STRUCTURE, Screen, number, table
from contact_curation.dashboard.live.toss_names import linked, time_of
from contact_curation.dashboard.style import BLUE

TABLE, SPECTRUM, EPSILON = "ranking", "spectrum", "epsilon"
LISTED_OTHERS = 12
"""Tosses that are not selected, of those that would add most; all others are counted."""

HEADER = ("rank", "toss", "time", "gain", "why")

SELECTED = BLUE


class RankingView:
    """Writes rankings.

    Args:
        screen: to write to.
    """

    def __init__(self, screen: Screen) -> None:
        self._screen = screen
        screen.curve(f"{EPSILON}/epsilon", "epsilon", SELECTED)

    def show(self, selected: SelectedSet, evidence: Evidence, numbers: Mapping[str, int]) -> None:
        """Writes a selected set and the reasons for it; tosses by their numbers."""
        self.show_page(selected, evidence, numbers)
        self.show_spectrum(evidence.spectrum)

    def show_page(self, selected: SelectedSet, evidence: Evidence, numbers: Mapping[str, int]) -> None:
        """Writes the ranking with its reasons."""
        self._screen.text(TABLE, ranking_page(selected, evidence, numbers))

    def show_spectrum(self, spectrum: SelectedSpectrum) -> None:
        """Writes how a selected set stands to its pool."""
        self._screen.log(SPECTRUM, rr.BarChart(spectrum.eigenvalues, color=SELECTED))
        self._screen.values(EPSILON, {"epsilon": spectrum.epsilon})


def ranking_page(selected: SelectedSet, evidence: Evidence, numbers: Mapping[str, int]) -> str:
    """The ranking as a page; tosses by their numbers, where they have one."""
    proven = f", at least {100.0 * selected.bound:.0f} % of the best set's D-efficiency" if selected.bound > 0.0 else ""
    chosen = f"**{len(selected.toss_ids)} of {selected.seen} tosses selected** by {selected.criterion}{proven}"
    inside = [row for row in evidence.rows if row.selected]
    others = [row for row in evidence.rows if not row.selected]
    parts = [f"{chosen}{_against_all(evidence) if others else ''}.", table(HEADER, (_cells(row, numbers) for row in inside))]
    if others:
        listed = (_cells(row, numbers) for row in others[:LISTED_OTHERS])
        parts += ["**Not selected**; the gain is what each would add now", table(HEADER, listed)]
    more = len(others) - LISTED_OTHERS
    return "\n\n".join([*parts, *([f"and {more} more that would add less"] if more > 0 else [])])


def _against_all(evidence: Evidence) -> str:
    """How a selected set that is not everything stands to all tosses."""
    off, by_chance = number(evidence.shift.distance), number(evidence.shift.at_random)
    distance = f"their estimate is {off} sigma from the full-data estimate (random subsets of the same size: {by_chance})"
    spectrum = evidence.spectrum
    missing = f"{100.0 * spectrum.missing:.0f} % of the information is missing in the worst direction"
    return f"; {distance}; D-efficiency of a selected toss {number(spectrum.efficiency)}; {missing}"


def _cells(row: EvidenceRow, numbers: Mapping[str, int]) -> tuple[str, ...]:
    reason = row.reason.removeprefix("not ").removeprefix("selected: ")  # the table says which
    return (f"{row.rank}", linked(numbers.get(row.toss_id)), time_of(row.toss_id), number(row.gain), reason)


REJECTED = "rejected"
LISTED_REJECTED = 12


class GateView:
    """Writes what was rejected.

    Args:
        screen: to write to.
    """

    def __init__(self, screen: Screen) -> None:
        self._screen = screen
        self._lines: dict[str, str] = {}
        screen.text(REJECTED, "No motion was rejected yet.")

    @property
    def rejected(self) -> int:
        """How many motions so far."""
        return len(self._lines)

    def show(self, toss_id: str, frames: int, reasons: Sequence[str]) -> None:
        """Writes a motion and why it is no toss to learn from, the newest first."""
        self._lines[toss_id] = f"- **{time_of(toss_id)}** ({frames} frames): {'; '.join(reasons)}".translate(STRUCTURE)
        newest = list(reversed(self._lines.values()))[:LISTED_REJECTED]
        more = self.rejected - len(newest)
        self._screen.text(REJECTED, "\n".join([*newest, *([f"- and {more} earlier ones"] if more else [])]))
