"""The Markdown tables of experiments over bodies have the numbers of their rows."""

from contact_curation.experiments.cell_run import Row
from contact_curation.experiments.comparison.page import pages_of
from contact_curation.experiments.counterfactuals.page import page_of
from contact_curation.experiments.engines import MEASURES


def test_a_table_of_rules_has_means_and_marks_what_is_certain() -> None:
    rows: list[Row] = [
        {"body": "slab", "seed": seed, "size": size, "rule": rule, "vertices": 2.0 + seed, "friction": 0.21,
         **dict.fromkeys(MEASURES, f"{10.0 * size} nan {12.0 * size}")}
        for seed in (0.0, 1.0)
        for size in (4.0, 8.0)
        for rule in ("random", "herding")
    ]  # fmt: skip
    table: list[Row] = [
        {"body": "slab", "size": 4.0, "rule": "herding", "measure": measure, "minus": "random", "difference": -1.25,
         "low": -2.0, "high": -0.5, "p_bonferroni": 0.04 if measure == "ours_rotation" else 0.06}
        for measure in MEASURES
    ]  # fmt: skip
    ours, mujoco = pages_of(rows, table, "random").split("\n\n`")
    assert ours.startswith("`slab`, 2 seeds, judged by ours:\n\n| selected | rule | position % | difference to random |")
    assert "| 4 | random | 44.0 |  | 44.0 |  | 2.5 | 0.210 |" in ours
    assert "| 4 | herding | 44.0 | -1.2 (-2.0 to -0.5) | 44.0 | **-1.2** (-2.0 to -0.5) | 2.5 | 0.210 |" in ours
    assert "| 8 | herding | 88.0 |  | 88.0 |  | 2.5 | 0.210 |" in ours
    assert "friction" not in mujoco
    few: list[Row] = [row | {"low": "nan", "high": "nan", "seeds": 2.0, "seeds_better": 1.0} for row in table]
    assert "| 4 | herding | 44.0 | -1.2 (1 of 2) | 44.0 | **-1.2** (1 of 2) | 2.5 | 0.210 |" in pages_of(rows, few, "random")


def test_a_table_of_correlations_has_a_column_for_each_size() -> None:
    table: list[Row] = [
        {"body": body, "size": size, "subsets": 9.0, "outcome": outcome, "score": score,
         "spearman": 0.5, "low": 0.25, "high": 0.75}
        for body, sizes in (("slab", (16.0, 180.0)), ("all", (0.0,)))
        for size in sizes
        for outcome in ("loss", "rotation", "position", "vertices")
        for score in ("influence", "trace")
    ]  # fmt: skip
    loss, rotation, means = page_of(table).split("\n\n|")[1:]
    assert page_of(table).startswith("`slab`, loss, 9 subsets:\n\n| score | 16 | 180 |\n")
    assert loss.count("| 0.50 (0.25 to 0.75) | 0.50 (0.25 to 0.75) |\n") == 2
    assert rotation.endswith("All bodies, 9 subsets:")
    assert means.startswith(" score | loss | position | rotation | vertices |")
