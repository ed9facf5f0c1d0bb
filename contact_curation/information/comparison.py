"""How alike two rankings are: rank correlation, and overlap of their first k (METHOD 2.4)."""

import numpy as np

from contact_curation.errors import InvalidValueError
from contact_curation.information.ranking import Ranking


def spearman(one: Ranking, other: Ranking) -> float:
    """Spearman's rank correlation, from -1 to 1, over the tosses in both.

    Raises:
        InvalidValueError: they share fewer than two tosses.
    """
    from scipy.stats import spearmanr  # takes a second to import

    places = {entry.toss_id: entry.rank for entry in other.entries}
    pairs = [(entry.rank, places[entry.toss_id]) for entry in one.entries if entry.toss_id in places]
    if len(pairs) < 2:
        raise InvalidValueError("tosses in both rankings", len(pairs), "at least 2")
    return float(spearmanr(*np.transpose(pairs)).statistic)


def top_overlap(one: Ranking, other: Ranking, top: int) -> float:
    """Share of the first `top` tosses that the two have in common, from 0 to 1.

    Raises:
        InvalidValueError: `top` is below 1, or a ranking is shorter than that.
    """
    shortest = min(len(one.ids), len(other.ids))
    if not 1 <= top <= shortest:
        raise InvalidValueError("top", top, f"1 to {shortest}, the length of the shorter ranking")
    return len(set(one.ids[:top]) & set(other.ids[:top])) / top
