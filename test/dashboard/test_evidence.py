"""The numbers behind the ranking's views agree with those of `rank`."""

from dataclasses import replace

import numpy as np
import pytest

from contact_curation.dashboard.evidence import SelectedSet, evidence_of
from contact_curation.dashboard.live.ranking_view import ranking_page
from contact_curation.dashboard.live.screen import number, table
from contact_curation.dashboard.live.toss_names import linked, time_of, zoned
from contact_curation.errors import InvalidValueError
from contact_curation.information.criteria.representative import swap_costs
from contact_curation.information.curation import curate
from contact_curation.information.ranker import RankingConfig
from contact_curation.information.subspace import pool_subspace
from test.dashboard.sessions import Scored, scored, selected_set

COUNT, TOP = 12, 5


@pytest.fixture(scope="module")
def made() -> Scored:
    return scored(COUNT)


def test_spectrum_epsilon_and_efficiency_are_those_of_the_ranking(made: Scored) -> None:
    curation = made.curation(TOP)
    spectrum = evidence_of(made.pool, selected_set(curation, TOP, COUNT, "v")).spectrum
    assert spectrum.eigenvalues == pytest.approx(curation.spectrum)
    assert spectrum.epsilon == pytest.approx(curation.epsilon)
    assert spectrum.missing == pytest.approx(curation.raw_epsilon)
    assert spectrum.efficiency == pytest.approx(curation.efficiency.determinant)


@pytest.mark.parametrize("criterion", ["representative", "log-det"])
def test_what_is_not_kept_is_told_what_it_would_still_add_in_the_order_of_the_ranking(made: Scored, criterion: str) -> None:
    curation = made.curation(TOP, criterion)
    rows = evidence_of(made.pool, selected_set(curation, TOP, COUNT, "v")).rows
    entries = curation.ranking.entries
    assert [row.toss_id for row in rows] == [entry.toss_id for entry in entries]
    assert [row.gain for row in rows] == pytest.approx([entry.marginal_gain for entry in entries])
    assert [row.rank for row in rows] == list(range(1, COUNT + 1))
    assert all(row.reason.startswith("selected") == row.selected for row in rows)


def test_by_representative_the_reasons_say_what_becomes_of_the_expected_error(made: Scored) -> None:
    curation = made.curation(TOP)
    evidence = evidence_of(made.pool, selected_set(curation, TOP, COUNT, "v"))
    coordinates = pool_subspace(made.pool).per_mean_toss(COUNT)
    kept = [made.pool.ids.index(one) for one in curation.ranking.selected_ids]
    costs = swap_costs([made.pool], [coordinates], kept, RankingConfig().prior)
    told = {row.toss_id: row.reason for row in evidence.rows}
    for place, one in enumerate(curation.ranking.selected_ids):
        assert told[one] == f"selected: expected error × {costs.without[place] / costs.error:.3g} without it"
    for one in curation.ranking.ids[TOP:]:
        times = f"{costs.joined[made.pool.ids.index(one)] / costs.error:.3g}"
        assert told[one] == f"not selected: expected error × {times} with it"
    assert evidence.shift == curation.optimum_shift
    assert f"their estimate is {number(curation.optimum_shift.distance)} sigma from" in ranking_page(
        selected_set(curation, TOP, COUNT, "v"), evidence, {}
    )


@pytest.mark.parametrize("criterion", ["representative", "log-det"])
def test_the_numbers_follow_the_settings_of_the_ranking(made: Scored, criterion: str) -> None:
    config = RankingConfig(criterion, TOP, prior=0.3, cut=0.01)
    curation = curate(made.informations, config)
    evidence = evidence_of(made.pool, selected_set(curation, TOP, COUNT, "v"), config)
    entries = curation.ranking.entries
    assert [row.toss_id for row in evidence.rows] == [entry.toss_id for entry in entries]
    assert [row.gain for row in evidence.rows] == pytest.approx([entry.marginal_gain for entry in entries])
    assert evidence.shift == curation.optimum_shift
    assert evidence.spectrum.eigenvalues == pytest.approx(curation.spectrum)


def test_by_log_det_the_reason_is_what_is_new(made: Scored) -> None:
    rows = evidence_of(made.pool, selected_set(made.curation(TOP, "log-det"), TOP, COUNT, "v")).rows
    assert rows[0].reason == "selected: most new by itself"
    assert all(row.reason.startswith("not selected: less new than the last") for row in rows[TOP:])


def test_by_trace_the_reason_is_the_trace(made: Scored) -> None:
    curation = made.curation(TOP, "trace")
    rows = evidence_of(made.pool, selected_set(curation, TOP, COUNT, "v")).rows
    smallest = min(row.trace for row in rows if row.selected)
    assert {row.reason for row in rows if not row.selected} == {f"not selected: trace below {smallest:.3g}"}
    assert all(row.trace <= smallest for row in rows if not row.selected)


def test_a_kept_set_that_singles_out_too_few_directions_has_no_efficiency(made: Scored) -> None:
    few = made.pool.ids[:1]
    assert evidence_of(made.pool, SelectedSet("longest", 1, few, (1.0,))).spectrum.efficiency == 0.0
    with pytest.raises(InvalidValueError, match="found nowhere"):
        evidence_of(made.pool, SelectedSet("longest", 1, ("nowhere",), (1.0,)))


def test_a_kept_set_has_a_gain_for_each_toss() -> None:
    with pytest.raises(InvalidValueError, match="gains of the selected tosses: found 1, expected 2, one each"):
        SelectedSet("trace", 2, ("a", "b"), (1.0,))


def test_a_long_ranking_ends_with_how_many_more_there_are(made: Scored) -> None:
    kept = SelectedSet("longest", 1, made.pool.ids[:1], (1.0,), "0123456789abcdef", COUNT)
    evidence = evidence_of(made.pool, kept)
    page = ranking_page(kept, replace(evidence, rows=evidence.rows + evidence.rows[1:]), {made.pool.ids[0]: 7})
    assert page.endswith(f"and {COUNT - 1 - 12 + COUNT - 1} more that would add less")
    assert "| 1 | [#7](recording://scene/tosses/7) | " in page
    assert "| 2 | - | " in page


def test_what_stands_in_a_cell_stays_in_it() -> None:
    assert table(("a", "b"), [("one | two", "three\nfour")]).splitlines()[2:] == ["| one \\| two | three four |"]
    assert [number(value) for value in (np.nan, 4485.2, 0.0123456, 12.0, -250.0)] == ["-", "4485", "0.0123", "12", "-250"]


def test_a_toss_is_called_by_its_number_and_its_time_of_day() -> None:
    recorded, simulated = "red-cube-1600000500250000000-abcdef01", "cube-12340000000-abcdef01"
    assert (time_of(recorded), zoned(recorded)) == ("12:35:00", "12:35:00 UTC")
    assert (time_of(simulated), zoned(simulated)) == ("12.3 s", "12.3 s")
    assert time_of("anything") == zoned("anything") == "anything"
    assert (linked(12), linked(None)) == ("[#12](recording://scene/tosses/12)", "-")
