"""`reproduce counterfactuals`: a row per refit, the same after a stop, and a table that follows from the rows."""

import csv
import json
from pathlib import Path

import pytest

from contact_curation.experiments import bodies
from contact_curation.experiments.counterfactuals.table import read_refits
from test.cli.commands import Cli


@pytest.mark.slow
def test_refits_go_on_after_a_stop_and_judge_the_same(cli: Cli, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bodies, "SIMULATED", 12)
    words = ("reproduce", "counterfactuals", "--bodies", "slab", "--sizes", 2, 4, "--refits", 6, "--json", "--out")
    whole = cli(*words, tmp_path / "whole")
    assert whole.status == 0
    assert (whole.json["refits"], whole.json["run"], whole.json["failed"]) == (6, 6, 0)
    rows = read_refits(tmp_path / "whole" / "counterfactuals.parquet")
    assert [(row["size"], row["draw"]) for row in rows] == [(size, draw) for size in (2, 4) for draw in range(3)]
    assert all(len(set(str(row["tosses"]).split())) == row["size"] for row in rows)
    assert all(float(row["rotation"]) > 0.0 and 0.0 < float(row["friction"]) < 1.0 for row in rows)
    lines = (tmp_path / "whole" / "slab.jsonl").read_text().splitlines(keepends=True)
    (tmp_path / "torn").mkdir()
    (tmp_path / "torn" / "slab.jsonl").write_text("".join(lines[:4]) + lines[4][:30])
    torn = cli(*words, tmp_path / "torn")
    assert torn.json["run"] == 3
    more = cli(
        "reproduce", "counterfactuals", "--bodies", "slab", "--sizes", 3, "--refits", 1, "--json", "--out", tmp_path / "torn"
    )
    assert (more.json["refits"], more.json["run"]) == (7, 1)
    assert {row["size"] for row in read_refits(tmp_path / "torn" / "counterfactuals.parquet")} == {2, 3, 4}
    with (tmp_path / "whole" / "datamodeling_scores.csv").open(newline="") as file:
        table = list(csv.DictReader(file))
    assert {"influence", "log-det", "representative", "herding", "trace", "duration"} <= {row["score"] for row in table}
    assert all(-1.0 <= float(row["spearman"]) <= 1.0 for row in table if row["spearman"] != "nan")
    mended = [json.loads(line) for line in (tmp_path / "torn" / "slab.jsonl").read_text().splitlines()]
    for line, other in zip(mended[1:7], map(json.loads, lines[1:]), strict=True):
        one, two = ({name: value for name, value in each["rows"][0].items() if "seconds" not in name} for each in (line, other))
        assert one == two


def test_what_cannot_be_refitted_is_one_line(cli: Cli, tmp_path: Path) -> None:
    done = cli("reproduce", "counterfactuals", "--bodies", "ball", "--out", tmp_path)
    assert done.status == 1
    assert "--bodies: found ball, expected one of cube, square, slab, wedge, irregular" in done.err
    assert len(done.err_lines) == 1
