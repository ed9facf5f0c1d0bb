"""The way over a bag changes no ranking of the public tosses."""

from itertools import product
from pathlib import Path

import pytest

from benchmarks.data.import_parity import TOP, Parity, compared_velocities, parities, sources
from contact_curation.contact.evaluation import Estimator
from contact_curation.information.ranker import criterion_names

NO_DIRECTION = {"trace", "longest", "random"}
"""Criteria that do not know which way a board is tilted; the files' random yaw is nothing to them."""

SCORES_DIFFER = {"representative": 1e-4}
"""Relative differences of scores; representative's are differences of large quadratic forms, some of them near zero."""


@pytest.fixture(scope="module")
def rankings(contactnets_folder: Path) -> list[Parity]:
    tosses = sources(contactnets_folder)
    assert compared_velocities(tosses).within == 1.0
    return parities(tosses)


@pytest.mark.slow
def test_the_bag_ranks_as_the_files_turned_back_do_by_every_criterion_and_estimator(rankings: list[Parity]) -> None:
    rows = [row for row in rankings if row.compared == "files, turned back"]
    assert {(row.criterion, row.estimator) for row in rows} == set(product(criterion_names(), map(str, Estimator)))
    for row in rows:
        assert row.common == TOP, row
        assert row.same_order or (row.criterion == "trace" and row.ties_only), row
        assert row.score_difference < SCORES_DIFFER.get(row.criterion, 1e-5), row


@pytest.mark.slow
def test_the_files_as_they_are_keep_the_same_tosses_where_the_tilt_has_no_direction(rankings: list[Parity]) -> None:
    """Elsewhere they do not: their yaw turns each toss's tilt of the board its own way."""
    rows = [row for row in rankings if row.compared == "files"]
    for row in rows:
        assert row.common == TOP or row.criterion not in NO_DIRECTION, row
    assert any(row.common < TOP for row in rows), "or the docstring is wrong"
