"""check.py says what agrees, what does not, and what is wrong with the form of a file."""

import json
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from test.conformance.vectors import FOLDER, problems

KEY = "sliding-06"


def run(tmp_path: Path, answers: Any, *options: str) -> subprocess.CompletedProcess[str]:
    """As others run it: without the package, with the standard library alone."""
    head = {"format": "contact-loss-answers", "version": 1, "implementation": "mine"}
    path = tmp_path / "answers.json"
    path.write_text(json.dumps({**head, "answers": answers}), encoding="utf-8")
    command = [sys.executable, "-I", "-S", str(FOLDER / "check.py"), str(path), *options]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def expected() -> dict[str, Any]:
    return {name: value for name, value in problems()[KEY]["expected"].items() if name != "certificate"}


def test_expected_answers_agree_to_all_digits_and_certify_themselves(tmp_path: Path) -> None:
    done = run(tmp_path, {KEY: expected()}, "--digits", "10", "--certify")
    assert done.returncode == 0, done.stdout + done.stderr
    assert "mine: 1 of 220 problems answered" in done.stdout
    assert "all that was answered agrees to 10 digits" in done.stdout
    gap = next(line for line in done.stdout.splitlines() if line.startswith("duality gap"))
    assert float(gap.split()[6].rstrip(",")) < 1e-13


def test_the_answers_that_the_reference_writes_are_accepted(tmp_path: Path) -> None:
    path, written = tmp_path / "some.json", tmp_path / "answers.json"
    path.write_text(json.dumps({"problems": [problems()["sliding-09"]]}), encoding="utf-8")
    command = [sys.executable, "-I", "-S", str(FOLDER / "reference.py"), str(path)]
    written.write_text(subprocess.run(command, capture_output=True, text=True, check=True).stdout, encoding="utf-8")
    done = run(tmp_path, json.loads(written.read_text(encoding="utf-8"))["answers"], "--digits", "15")
    assert done.returncode == 0, done.stdout + done.stderr


def test_a_loss_that_is_a_thousandth_off_agrees_to_three_digits_only(tmp_path: Path) -> None:
    off = {KEY: {"loss": 1.0009 * expected()["loss"]}}
    assert run(tmp_path, off, "--digits", "3").returncode == 0
    done = run(tmp_path, off)
    assert done.returncode == 1
    assert f"not to 6 digits: {KEY}" in done.stdout


def test_wrong_impulses_fail_by_their_own_certificate(tmp_path: Path) -> None:
    impulses = [[2.0 * x for x in row] for row in expected()["impulses"]]
    done = run(tmp_path, {KEY: {"impulses": impulses}}, "--certify")
    gap = next(line for line in done.stdout.splitlines() if line.startswith("duality gap"))
    assert float(gap.split()[6].rstrip(",")) > 0.1


def test_a_full_matrix_counts_by_its_lower_triangle_and_null_is_not_counted(tmp_path: Path) -> None:
    triangle, score = expected()["gauss_newton"], expected()["score"]
    full = [[*row, *(7.0 for _ in range(len(triangle) - len(row)))] for row in triangle]
    done = run(tmp_path, {KEY: {"gauss_newton": full, "score": [None, *score[1:]], "loss": None}}, "--digits", "10")
    assert done.returncode == 0, done.stdout
    assert [line.split()[1] for line in done.stdout.splitlines() if line.startswith("loss")] == ["0"]


def test_not_a_number_agrees_to_no_digit(tmp_path: Path) -> None:
    assert run(tmp_path, {KEY: {"loss": float("nan")}}, "--digits", "1").returncode == 1


def test_the_first_number_that_differs_is_shown_with_the_expected_one(tmp_path: Path) -> None:
    velocity = [1.0, *expected()["free_velocity"][1:]]
    done = run(tmp_path, {KEY: {**expected(), "free_velocity": velocity, "loss": 7.0}})
    assert f"look first at {KEY}.free_velocity[0]: found 1.0, expected {expected()['free_velocity'][0]}" in done.stdout


@pytest.mark.parametrize("number", [None, float("nan")])
def test_impulses_that_are_not_all_there_are_named_and_the_others_certified(tmp_path: Path, number: Any) -> None:
    partial = [[number, *row[1:]] for row in expected()["impulses"]]
    other = problems()["sliding-07"]["expected"]["impulses"]
    done = run(tmp_path, {KEY: {"impulses": partial}, "sliding-07": {"impulses": other}}, "--certify")
    assert done.stderr == ""
    assert "in sliding-07" in next(line for line in done.stdout.splitlines() if line.startswith("duality gap"))
    assert f"not certified, as impulses are missing or not finite: {KEY}\n" in done.stdout


def test_problems_and_checker_alone_compare(tmp_path: Path) -> None:
    folder = tmp_path / "problems"
    folder.mkdir()
    for path in (FOLDER / "check.py", FOLDER / "problems" / "sliding.json"):
        shutil.copy(path, tmp_path if path.suffix == ".py" else folder)
    answers = tmp_path / "answers.json"
    head = {"format": "contact-loss-answers", "version": 1, "implementation": "mine"}
    answers.write_text(json.dumps({**head, "answers": {KEY: expected()}}), encoding="utf-8")
    command = [sys.executable, "-I", "-S", str(tmp_path / "check.py"), str(answers)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert "mine: 1 of 20 problems answered" in done.stdout, done.stderr
    assert done.returncode == 0


def test_a_folder_that_holds_other_files_than_problems_is_said(tmp_path: Path) -> None:
    done = run(tmp_path, {KEY: expected()}, "--problems", str(tmp_path))
    assert done.returncode == 2
    assert 'answers.json: expected "format": "contact-loss-problems" and "version": 1' in done.stderr
    assert done.stderr.count("\n") == 1


def test_nothing_answered_is_no_success(tmp_path: Path) -> None:
    assert run(tmp_path, {}).returncode == 1


@pytest.mark.parametrize(
    ("answers", "said"),
    [
        ({"sliding-99": {"loss": 1.0}}, "sliding-99: no such problem"),
        ({KEY: {"lost": 1.0}}, "unknown quantity 'lost'"),
        ({KEY: {"score": [1.0]}}, f"{KEY}.score: found [1.0], expected 22 entries"),
        ({KEY: {"loss": "small"}}, f'{KEY}.loss: found "small", expected a number'),
        ({KEY: {"terms": {"matching": 1.0}}}, "expected the keys match,"),
        ([], 'expected "answers"'),
    ],
)
def test_what_is_wrong_with_the_form_is_said_in_one_line(tmp_path: Path, answers: Any, said: str) -> None:
    done = run(tmp_path, answers)
    assert done.returncode == 2
    assert said in done.stderr
    assert done.stderr.count("\n") == 1
