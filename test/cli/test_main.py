"""The door: exit statuses, one line per error, and a start that does not wait for libraries nobody needs yet."""

import subprocess
import sys
from collections.abc import Sequence

import pytest

from contact_curation.cli import main as door
from contact_curation.cli import rank
from contact_curation.errors import InvalidValueError
from test.cli.commands import Cli

HEAVY = ("numpy", "torch", "matplotlib", "rosbags", "mcap", "pyarrow", "scipy", "rclpy")


def python(code: str, *words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, "-c", code, *words], capture_output=True, text=True, check=False)


def test_help_imports_none_of_the_large_libraries() -> None:
    done = python(
        "import sys\n"
        "from contact_curation.cli.main import main\n"
        "try: main(['--help'])\n"
        "except SystemExit: pass\n"
        f"print(sorted(set({HEAVY}) & set(sys.modules)), file=sys.stderr)"
    )
    assert "rank" in done.stdout
    assert done.stderr.strip() == "[]"


@pytest.mark.parametrize("verb", ["import", "rank", "score", "train", "play"])
def test_every_verb_explains_itself(cli: Cli, verb: str) -> None:
    done = cli(verb, "--help")
    assert done.status == 0
    assert f"usage: contact-curation {verb}" in done.out


@pytest.mark.parametrize(
    "words",
    [
        (),
        ("sing",),
        ("rank",),
        ("rank", "a.mcap", "--top", "0"),
        ("rank", "a.mcap", "--top", "many"),
        ("rank", "a.mcap", "--criterion", "luck"),
        ("rank", "a.mcap", "--seed", "-1"),
        ("rank", "a.mcap", "--out", "manifest.txt"),
        ("rank", "a.mcap", "--bound-influence", "--influence-bound", "3"),
        ("rank", "a.mcap", "--influence-bound", "nan"),
        ("rank", "a.mcap", "--model", "sphere"),
        ("rank", "a.mcap", "--block", "upper"),
        ("score", "a.mcap", "--out", "scores.npz"),
        ("score", "a.mcap", "--params", "p.json", "--out", "scores.csv"),
        ("score", "a.mcap", "--params", "p.json", "--out", "s.npz", "--cone", "square"),
        ("import", "contactnets", "folder"),
        ("import", "elsewhere", "folder", "--out", "a.mcap"),
        ("play", "a.mcap", "--rate", "0"),
        ("play", "a.mcap", "--remap", "no_arrow"),
    ],
)
def test_bad_usage_is_exit_status_2(cli: Cli, words: Sequence[str]) -> None:
    done = cli(*words)
    assert done.status == 2
    assert done.out == ""
    assert "usage: contact-curation" in done.err


def raising(error: BaseException) -> object:
    def run(*_: object) -> int:
        raise error

    return run


def test_an_error_of_ours_is_one_line_and_exit_status_1(cli: Cli, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rank, "run", raising(InvalidValueError("a\nname", 1, "2")))
    done = cli("rank", "a.mcap")
    assert (done.status, done.out, done.err) == (1, "", "contact-curation: error: a name: found 1, expected 2\n")


def test_an_interrupt_is_exit_status_130(cli: Cli, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rank, "run", raising(KeyboardInterrupt()))
    assert cli("rank", "a.mcap").status == door.INTERRUPTED == 130


def test_a_programming_error_keeps_its_traceback(cli: Cli, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rank, "run", raising(ZeroDivisionError()))
    with pytest.raises(ZeroDivisionError):
        cli("rank", "a.mcap")


def test_a_reader_that_goes_away_ends_it_without_a_traceback(golden: object) -> None:
    command = f"{sys.executable} -m contact_curation.cli.main rank {golden} --json | true"
    done = subprocess.run(["bash", "-c", f"set -o pipefail; {command}"], capture_output=True, text=True, check=False)
    assert "Traceback" not in done.stderr
    assert "BrokenPipe" not in done.stderr
