"""`reproduce`: each experiment to its tables and figure, the same digits however it was stopped, one line for what is wrong."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest

from test.cli.commands import Cli
from test.cli.simulated_files import write_simulated

SMALL = ("--held-out", "8,9", "--quick")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Ten simulated tosses as ContactNets' files."""
    return write_simulated(tmp_path_factory.mktemp("tosses"), 10)


@pytest.fixture(scope="module")
def more(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """16 of them, enough for a prior of releases when a third judges."""
    return write_simulated(tmp_path_factory.mktemp("more"), 16)


def table(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def lines_without_seconds(path: Path) -> list[dict[str, object]]:
    lines = [json.loads(line) for line in path.read_text().splitlines()]
    return [{name: value for name, value in line.items() if name != "seconds"} for line in lines]


@pytest.mark.slow
def test_dataset_quality_compares_rules_seed_by_seed(cli: Cli, folder: Path, tmp_path: Path) -> None:
    rules = ("longest", "log-det")
    done = cli("reproduce", "dataset-quality", folder, "--out", tmp_path, *SMALL, "--rules", *rules)
    assert done.status == 0
    assert done.out.splitlines()[1:] == [str(tmp_path / name) for name in ("rows.csv", "summary.csv", "figure.png")]
    rows = table(tmp_path / "rows.csv")
    assert [(row["rule"], row["size"], row["seed"]) for row in rows] == [
        (rule, size, seed) for seed in "01" for rule, size in [*((rule, "2") for rule in rules), ("all", "0")]
    ]
    assert {len(row["selected"].split()) for row in rows if row["size"] == "2"} == {2}
    assert not any({"8", "9"} & set(row["selected"].split()) for row in rows)
    by_rule = {(row["rule"], row["seed"]): float(row["friction"]) for row in rows if row["size"] == "2"}
    summary = {(row["rule"], row["measure"]): row for row in table(tmp_path / "summary.csv") if row["size"] == "2"}
    own = summary["log-det", "friction"]
    assert float(own["median"]) == pytest.approx(np.median([by_rule["log-det", seed] for seed in "01"]))
    paired = [by_rule["log-det", seed] - by_rule["longest", seed] for seed in "01"]
    assert float(own["minus longest"]) == pytest.approx(np.median(paired))
    assert (tmp_path / "figure.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.slow
def test_it_goes_on_where_it_was_stopped_and_gives_the_same_digits(cli: Cli, folder: Path, tmp_path: Path) -> None:
    words = ("reproduce", "theorem", folder, *SMALL, "--rules", "random", "trace", "--out")
    cli(*words, tmp_path / "whole")
    cells = tmp_path / "whole" / "cells.jsonl"
    (tmp_path / "torn").mkdir()
    lines = cells.read_text().splitlines(keepends=True)
    (tmp_path / "torn" / "cells.jsonl").write_text("".join(lines[:3]) + lines[3][:25])
    report = cli(*words, tmp_path / "torn", "--json").json
    assert (report["cells"], report["run"], report["failed"]) == (4, 2, 0)
    assert lines_without_seconds(tmp_path / "torn" / "cells.jsonl") == lines_without_seconds(cells)
    for name in ("rows.csv", "summary.csv"):
        assert (tmp_path / "torn" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes()
    assert cli(*words, tmp_path / "torn", "--json").json["run"] == 0


@pytest.mark.slow
def test_robustness_says_what_the_gates_caught(cli: Cli, folder: Path, tmp_path: Path) -> None:
    done = cli("reproduce", "robustness", folder, "--out", tmp_path, *SMALL, "--rules", "longest", "--shares", 0.5)
    assert done.status == 0
    rows = table(tmp_path / "rows.csv")
    assert {(row["fault"], row["gated"]) for row in rows} == {("", "True"), ("spike", "True"), ("spike", "False")}
    gated = [row for row in rows if row["fault"] and row["gated"] == "True"]
    assert {(row["gate_hits"], row["gate_false_alarms"], row["selected_bad"]) for row in gated} == {("1.0", "0.0", "0.0")}


@pytest.mark.parametrize("experiment", ["theorem", pytest.param("calibration", marks=pytest.mark.slow)])
def test_experiments_without_rules_that_learn(cli: Cli, folder: Path, tmp_path: Path, experiment: str) -> None:
    done = cli("reproduce", experiment, folder, "--out", tmp_path, *SMALL)
    assert done.status == 0
    rows = table(tmp_path / "rows.csv")
    if experiment == "theorem":
        plain = [row for row in rows if row["weights"] == "plain"]
        assert all(-1e-6 < float(row["smallest"]) <= float(row["largest"]) < 1.0 + 1e-6 for row in plain)
        assert {row["weights"] for row in rows} == {"plain", "rescaled", "drawn by leverage, re-weighted"}
    else:
        assert {"friction", "vertex heights", "tilt", "height"} <= {row["parameters"] for row in rows}
        assert all(float(row["found"]) > 0.0 for row in rows)


@pytest.mark.slow
def test_ways_of_choosing_throws_are_compared_throw_by_throw(cli: Cli, more: Path, tmp_path: Path) -> None:
    words = ("reproduce", "designed-throws", more, *SMALL, "--seeds", 1, "--rules", "random", "raw", "--out")
    done = cli(*words, tmp_path / "whole")
    assert done.status == 0
    rows = table(tmp_path / "whole" / "rows.csv")
    assert [(row["rule"], row["throws"]) for row in rows] == [(arm, n) for arm in ("random", "raw") for n in ("1.0", "2.0")]
    assert [bool(row["position"]) for row in rows] == [False, True, False, True]  # judged after the second throw
    assert {row["reason"] for row in rows} == {"at random"}
    assert len({row["seconds"] for row in rows}) == len(rows)  # other throws from the other prior
    summary = table(tmp_path / "whole" / "summary.csv")
    own = {(row["rule"], row["measure"]): row for row in summary if row["throws"] == "2.0"}
    errors = [float(row["position"]) for row in rows if row["position"]]
    assert float(own["raw", "position"]["minus random"]) == pytest.approx(errors[1] - errors[0])
    assert (tmp_path / "whole" / "figure.png").read_bytes().startswith(b"\x89PNG")
    lines = (tmp_path / "whole" / "cells.jsonl").read_text().splitlines(keepends=True)
    (tmp_path / "before").mkdir()
    (tmp_path / "before" / "cells.jsonl").write_text(lines[0].replace("balanced=true", "balanced=false") + lines[1])
    assert "loss of " in cli(*words, tmp_path / "before").err  # cells of both losses in one table would be wrong
    (tmp_path / "torn").mkdir()
    (tmp_path / "torn" / "cells.jsonl").write_text(lines[0] + lines[2] + lines[1][:40])
    report = cli(*words, tmp_path / "torn", "--json").json
    assert (report["cells"], report["run"], report["failed"]) == (2, 1, 0)
    for name in ("rows.csv", "summary.csv"):
        assert (tmp_path / "torn" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes()


@pytest.mark.slow
def test_throws_are_the_same_in_processes_of_their_own(cli: Cli, more: Path, tmp_path: Path) -> None:
    words = ("reproduce", "designed-throws", more, *SMALL, "--rules", "exploration", "designed", "--out")
    assert cli(*words, tmp_path / "one").status == 0
    assert cli(*words, tmp_path / "two", "--jobs", 2).status == 0
    assert (tmp_path / "one" / "rows.csv").read_bytes() == (tmp_path / "two" / "rows.csv").read_bytes()


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (("--rules", "longest"), "unknown rule of designed-throws longest: expected one of "),
        (("--model", "deep"), "unknown model of designed-throws deep: expected one of polytope"),
        (("--protocol", "published"), "unknown protocol of designed-throws published: expected one of budgeted, exact"),
    ],
)
def test_what_no_throws_are_designed_for_is_one_line(
    cli: Cli, folder: Path, tmp_path: Path, words: tuple[str, ...], line: str
) -> None:
    done = cli("reproduce", "designed-throws", folder, "--out", tmp_path, *SMALL, *words)
    assert done.status == 1
    assert line in done.err
    assert len(done.err_lines) == 1


@pytest.mark.slow
def test_other_protocols_learn_along_gradient_steps(cli: Cli, folder: Path, tmp_path: Path) -> None:
    words = ("--rules", "longest", "trace", "--protocol", "budgeted", "--steps", 3)
    done = cli("reproduce", "functionals", folder, "--out", tmp_path, *SMALL, *words)
    assert done.status == 0
    assert {(row["protocol"], row["steps"]) for row in table(tmp_path / "rows.csv")} == {("budgeted", "3")}


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (("--rules", "best"), "unknown rule best: expected one of "),
        (("--model", "deep", "--protocol", "exact"), "protocol of a network: found exact"),
        (("--steps", "5"), "--steps: found protocol exact"),
        (("--model", "shallow"), "unknown model shallow: expected one of "),
    ],
)
def test_what_is_not_accepted_is_one_line(cli: Cli, folder: Path, tmp_path: Path, words: tuple[str, ...], line: str) -> None:
    done = cli("reproduce", "functionals", folder, "--out", tmp_path, *SMALL, *words)
    assert done.status == 1
    assert line in done.err
    assert len(done.err_lines) == 1


@pytest.mark.slow
def test_what_the_pool_is_too_small_for_is_said_and_the_rest_is_done(cli: Cli, folder: Path, tmp_path: Path) -> None:
    words = ("--rules", "random", "random", "longest", "--sizes", "2", "100", "--seeds", "1")
    done = cli("reproduce", "dataset-quality", folder, "--out", tmp_path, "--held-out", "7,8", *words)
    assert "random 100, seed 0: found 6 tosses in the pool, expected at least 100" in done.err
    assert [(row["rule"], row["size"]) for row in table(tmp_path / "rows.csv")] == [("random", "2"), ("longest", "2")]
    few = cli("reproduce", "calibration", folder, "--out", tmp_path / "calibration", "--held-out", "7,8")
    assert few.status == 1
    assert "expected at least 64" in few.err


def test_a_folder_of_other_tosses_is_refused(cli: Cli, folder: Path, tmp_path: Path) -> None:
    words = ("reproduce", "theorem", folder, "--out", tmp_path, "--quick", "--rules", "longest", "--held-out")
    assert cli(*words, "8,9").status == 0
    done = cli(*words, "7,8")
    assert done.status == 1
    assert f"tosses of {tmp_path / 'cells.jsonl'}" in done.err


def test_without_an_input_the_tosses_are_those_that_the_environment_names(
    cli: Cli, folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    words = ("reproduce", "theorem", *SMALL, "--rules", "random", "--out", tmp_path / "out")
    monkeypatch.delenv("CONTACTNETS_DATA", raising=False)
    refused = cli(*words)
    assert refused.status == 1
    assert "found none, and no CONTACTNETS_DATA" in refused.err
    (tmp_path / "data").mkdir()
    (tmp_path / "data" / "tosses_processed").symlink_to(folder)
    monkeypatch.setenv("CONTACTNETS_DATA", str(tmp_path / "data"))
    assert cli(*words).status == 0
    assert len(table(tmp_path / "out" / "rows.csv")) > 0


@pytest.mark.parametrize(
    ("experiment", "words", "line"),
    [
        ("dataset-quality", ("--shares", 0.2), "--shares: found dataset-quality, expected robustness, which it belongs to"),
        ("theorem", ("--model", "deep"), "--model: found theorem, expected dataset-quality or functionals or "),
        ("calibration", ("--rules", "random"), "--rules: found calibration, expected dataset-quality or "),
        ("criteria", ("tosses.mcap",), "INPUT: found criteria, expected dataset-quality or "),
        ("counterfactuals", ("--set", "gates.depth=1"), "--set: found counterfactuals, expected dataset-quality or "),
    ],
)
def test_an_option_of_other_experiments_is_refused(
    cli: Cli, tmp_path: Path, experiment: str, words: tuple[str, ...], line: str
) -> None:
    done = cli("reproduce", experiment, *words, "--out", tmp_path / "out")
    assert (done.status, len(done.err_lines)) == (1, 1)
    assert line in done.err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("experiment", "words", "line"),
    [
        ("robustness", ("--shares", 1.5), "share of bad tosses: found 1.5, expected a number from 0 to 1"),
        ("theorem", ("--sizes", 0, 4), "--sizes: found 0, expected at least 1"),
        ("theorem", ("--rules", "foo"), "unknown rule foo: "),
        ("calibration", ("--resamples", 1), "calibration: found 64 tosses, 1 resamples, expected "),
        ("criteria", ("--sizes", 0), "--sizes: found 0, expected at least 1"),
        ("against-sysid", ("--sizes", 0), "--sizes: found 0, expected at least 1"),
    ],
)
def test_a_value_that_no_cell_can_have_is_refused_before_any_runs(
    cli: Cli, folder: Path, tmp_path: Path, experiment: str, words: tuple[str, ...], line: str
) -> None:
    inputs = () if experiment in ("criteria", "against-sysid") else (folder,)
    done = cli("reproduce", experiment, *inputs, *words, "--out", tmp_path / "out")
    assert (done.status, len(done.err_lines)) == (1, 1)
    assert line in done.err
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
def test_quick_leaves_what_is_given_and_another_body_is_not_taken_into_the_same_table(
    cli: Cli, folder: Path, tmp_path: Path
) -> None:
    body = Path("contact_curation/config/cube.yaml").resolve()
    words = ("reproduce", "theorem", folder, *SMALL, "--rules", "random", "--body", body, "--sizes", 3, 4, "--seeds", 3,
             "--out", tmp_path / "out")  # fmt: skip
    assert cli(*words).status == 0
    rows = table(tmp_path / "out" / "rows.csv")
    assert {float(row["size"]) for row in rows} == {3.0, 4.0}
    assert {float(row["seed"]) for row in rows} == {0.0, 1.0, 2.0}
    refused = cli(*words, "--friction", 0.5)
    assert (refused.status, refused.err.count("error: body of ")) == (1, 1)
