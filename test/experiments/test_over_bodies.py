"""The driver of experiments over bodies counts cells, says each fault once, and goes on from its file."""

import json
from argparse import Namespace
from dataclasses import dataclass
from pathlib import Path

import pytest

from contact_curation.errors import InvalidValueError
from contact_curation.experiments.cell import Planned
from contact_curation.experiments.cell_run import Row
from contact_curation.experiments.over_bodies import run_over_bodies
from contact_curation.version import __version__


@dataclass(frozen=True)
class Drawn(Planned):
    body: str
    seed: int


CELLS = [Drawn(body, seed) for body in ("cube", "slab") for seed in range(2)]


def row_of(cell: Drawn) -> Row:
    if cell.body == "cube":
        raise InvalidValueError("CONTACTNETS_DATA", "nothing", "a folder")
    return {"error": float(cell.seed)}


def report(folder: Path, capsys: pytest.CaptureFixture[str]) -> tuple[int, dict[str, object], str]:
    arguments = Namespace(out=folder, experiment="criteria", jobs=1, json=True)
    status = run_over_bodies(arguments, CELLS, row_of, lambda rows: {"rows.csv": rows})
    said = capsys.readouterr()
    return status, json.loads(said.out), said.err


def test_cells_that_fail_alike_are_counted_and_said_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    status, found, said = report(tmp_path, capsys)
    assert (status, found["cells"], found["run"], found["failed"]) == (1, 4, 2, 2)
    assert said.count("CONTACTNETS_DATA: found nothing") == 1
    _, again, _ = report(tmp_path, capsys)
    assert (again["run"], again["failed"]) == (0, 2)
    assert len((tmp_path / "rows.csv").read_text().splitlines()) == 3


def test_without_any_row_the_first_fault_is_the_error(tmp_path: Path) -> None:
    arguments = Namespace(out=tmp_path, experiment="criteria", jobs=1, json=True)
    with pytest.raises(InvalidValueError, match=r"^finished cells: found none, expected at least one \(cube: CONTACTNETS_DATA"):
        run_over_bodies(arguments, CELLS[:2], row_of, lambda rows: {"rows.csv": rows})


def test_cells_of_another_loss_are_not_taken_into_the_same_table(tmp_path: Path) -> None:
    arguments = Namespace(out=tmp_path, experiment="criteria", jobs=1, json=True)
    before = json.dumps({"experiment": "criteria", "package version": __version__}) + "\n"
    (tmp_path / "cells.jsonl").write_text(before)
    with pytest.raises(InvalidValueError, match=r"^loss of .*cells\.jsonl: found none, .* balanced=true.*, or another --out"):
        run_over_bodies(arguments, CELLS, row_of, lambda rows: {"rows.csv": rows})
    assert (tmp_path / "cells.jsonl").read_text() == before


def test_cells_of_other_data_are_not_taken_into_the_same_table(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def learn(cell: Drawn) -> Row:
        return {"error": 1.0}

    arguments, cells = Namespace(out=tmp_path / "out", experiment="criteria", jobs=1, json=True), CELLS
    for name in ("first", "second"):
        (tmp_path / name / "tosses_processed").mkdir(parents=True)
        (tmp_path / name / "tosses_processed" / "0.pt").write_bytes(name.encode())
    run_over_bodies(arguments, cells[2:], learn, lambda rows: {"rows.csv": rows})
    for _ in range(2):  # a body may be added, and the same data continue
        monkeypatch.setenv("CONTACTNETS_DATA", str(tmp_path / "first"))
        run_over_bodies(arguments, cells, learn, lambda rows: {"rows.csv": rows})
    monkeypatch.setenv("CONTACTNETS_DATA", str(tmp_path / "second"))
    with pytest.raises(InvalidValueError, match=r"^data of cube of .*cells\.jsonl: found .*, or another --out"):
        run_over_bodies(arguments, cells, learn, lambda rows: {"rows.csv": rows})
    run_over_bodies(arguments, cells[2:], learn, lambda rows: {"rows.csv": rows})
