"""Medians over seeds, and rules compared seed by seed."""

from pathlib import Path

import numpy as np
import pytest

from contact_curation.errors import InvalidValueError
from contact_curation.experiments import tables
from contact_curation.experiments.catalogue import Experiment
from contact_curation.experiments.cell_run import Row
from contact_curation.experiments.summary import Summary, summarised
from contact_curation.experiments.tables import write_tables
from contact_curation.learning.evaluation.bootstrap import BootstrapConfig

CONFIG = BootstrapConfig(resamples=200)


def rows() -> list[Row]:
    """Seeds differ by far more than rules; ours is 1 below random in each, and has a seed less."""
    easy = np.random.default_rng(0).uniform(0.0, 50.0, 9)
    made: list[Row] = [{"rule": "random", "size": 8.0, "seed": float(k), "error": value} for k, value in enumerate(easy)]
    made += [{"rule": "ours", "size": 8.0, "seed": float(k), "error": value - 1.0} for k, value in enumerate(easy[:8])]
    return [*made, {"rule": "ours", "size": 16.0, "seed": 0.0, "error": float("nan")}]


def told() -> dict[tuple[float | str, float | str], Summary]:
    found = summarised(rows(), ("rule", "size"), ("error",), ("random",), CONFIG)
    return {(dict(one.group)["rule"], dict(one.group)["size"]): one for one in found}


def test_a_rule_is_compared_by_the_differences_that_each_seed_makes() -> None:
    ours = told()["ours", 8.0]
    assert ours.seeds == 8
    assert ours.median.high - ours.median.low > 5.0
    assert tuple(ours.beside["random"]) == pytest.approx((-1.0, -1.0, -1.0))
    assert ours.as_row()["minus random high"] == pytest.approx(-1.0)


def test_a_rule_is_not_compared_with_itself_and_what_is_no_number_is_left_out() -> None:
    found = told()
    assert found["random", 8.0].beside == {}
    assert ("ours", 16.0) not in found


def test_a_seed_twice_is_refused() -> None:
    with pytest.raises(InvalidValueError, match=r"seed 0\.0 twice"):
        summarised([*rows(), rows()[0]], ("rule", "size"), ("error",), (), CONFIG)


@pytest.mark.parametrize(("seeds", "ending"), [(8, " with 95 % intervals"), (2, "")])
def test_the_title_of_a_figure_promises_intervals_only_where_seeds_suffice(
    seeds: int, ending: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    titles: list[str] = []
    monkeypatch.setattr(tables, "save_experiment_figure", lambda panels, title, *_: titles.append(title))
    measured = [{**row, "weights": "", "epsilon": row["error"]} for row in rows() if float(row["seed"]) < seeds]
    write_tables(Experiment.THEOREM, [row for row in measured if row["size"] == 8.0], tmp_path)
    assert titles[0].partition(" seeds")[2] == ending
