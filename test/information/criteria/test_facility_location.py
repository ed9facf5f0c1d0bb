"""Every toss has a near one among the selected: against plain loops over every candidate set."""

import numpy as np
import pytest

from contact_curation.geometry.quaternions import Array
from contact_curation.information.criteria import facility_location
from contact_curation.information.criteria.facility_location import select_by_facility_location


def mean_distance(features: Array, picks: list[int]) -> float:
    return float(np.mean([min(np.linalg.norm(one - features[pick]) for pick in picks) for one in features]))


@pytest.mark.parametrize("seed", range(4))
def test_each_step_lowers_the_mean_distance_most(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(facility_location, "CHUNK", 3)  # so that old gains decide what is looked at
    features = np.random.default_rng(seed).standard_normal((40, 5)) + 2.0
    found = select_by_facility_location(features, 7)
    picks: list[int] = []
    for _ in range(7):
        left = [k for k in range(40) if k not in picks]
        picks.append(left[int(np.argmin([mean_distance(features, [*picks, k]) for k in left]))])
    assert found.order[:7].tolist() == picks
    falls = -np.diff([mean_distance(features, picks[:count]) for count in range(1, 8)])
    np.testing.assert_allclose(found.gains[picks[1:]], falls, rtol=1e-9)
    other = int(found.order[7])
    assert found.gains[other] == pytest.approx(mean_distance(features, picks) - mean_distance(features, [*picks, other]))


def test_one_toss_of_each_group_is_selected_before_a_second() -> None:
    rng = np.random.default_rng(0)
    group = np.arange(30) % 5
    features = 10.0 * np.eye(5)[group] + 0.1 * rng.standard_normal((30, 5))
    assert sorted(group[select_by_facility_location(features, 5).order[:5]]) == [0, 1, 2, 3, 4]
