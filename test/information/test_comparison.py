"""Two rankings are compared by rank correlation and by their first k."""

import pytest

from contact_curation.errors import InvalidValueError
from contact_curation.information.ranking import RankedToss, Ranking, spearman, top_overlap


def ranking(ids: str) -> Ranking:
    return Ranking("trace", tuple(RankedToss(toss_id, rank, 0.0, 0.0, rank <= 2) for rank, toss_id in enumerate(ids, start=1)))


def test_the_same_order_correlates_fully_and_the_opposite_order_inversely() -> None:
    assert spearman(ranking("abcde"), ranking("abcde")) == pytest.approx(1.0)
    assert spearman(ranking("abcde"), ranking("edcba")) == pytest.approx(-1.0)
    assert spearman(ranking("abcd"), ranking("bacd")) == pytest.approx(1 - 6 * 2 / (4 * 15))


def test_only_tosses_in_both_rankings_count() -> None:
    assert spearman(ranking("axbyc"), ranking("abzc")) == pytest.approx(1.0)
    assert spearman(ranking("ab"), ranking("ba")) == pytest.approx(-1.0)
    with pytest.raises(InvalidValueError, match=r"^tosses in both rankings: found 1, expected at least 2$"):
        spearman(ranking("ab"), ranking("bc"))


def test_overlap_is_the_share_of_common_tosses_at_the_top() -> None:
    assert top_overlap(ranking("abcde"), ranking("baxcd"), 2) == 1.0
    assert top_overlap(ranking("abcde"), ranking("xbyad"), 4) == 0.5
    assert top_overlap(ranking("abc"), ranking("axyzb"), 1) == 1.0
    assert top_overlap(ranking("abc"), ranking("axyzb"), 3) == pytest.approx(1 / 3)
    with pytest.raises(InvalidValueError, match=r"^top: found 6, expected 1 to 5, the length of the shorter ranking$"):
        top_overlap(ranking("abcde"), ranking("abcdefg"), 6)
    with pytest.raises(InvalidValueError, match=r"^top: found 0, expected 1 to 3, the length of the shorter ranking$"):
        top_overlap(ranking("abc"), ranking("abc"), 0)
