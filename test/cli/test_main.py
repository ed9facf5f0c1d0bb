"""The door: exit statuses, one line per error, and a start that does not wait for libraries nobody needs yet."""

import argparse
import contextlib
import errno
import json
import os
import shlex
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest

from contact_curation.cli import main as door
from contact_curation.cli.options.one_line_parser import EXAMPLES
from contact_curation.cli.rank import command as rank
from contact_curation.errors import InvalidValueError
from test.cli.commands import Cli
from test.storage.written_bags import NOTE, recording, write_mcap

HEAVY = ("argcomplete", "numpy", "torch", "matplotlib", "rosbags", "mcap", "pyarrow", "scipy", "rclpy")


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
def test_bad_usage_is_one_line_that_says_where_help_is_and_exit_status_2(cli: Cli, words: Sequence[str]) -> None:
    done = cli(*words)
    assert done.status == 2
    assert done.out == ""
    assert len(done.err_lines) == 1
    assert done.err.startswith("contact-curation")
    assert "(usage: contact-curation" in done.err


def test_an_option_that_no_verb_has_names_the_verb_and_the_option_that_was_meant(cli: Cli) -> None:
    done = cli("rank", "a.mcap", "--criterium", "trace")
    assert done.status == 2
    assert done.err.startswith("contact-curation rank: error: unknown option --criterium: did you mean --criterion?")


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("train", "a.mcap", "-o", "m.safetensors", "--canary"), "unknown option --canary: did you mean --rerank-when-stale?"),
        (("design", "a.mcap", "-o", "t.json", "--warm-up"), "unknown option --warm-up: did you mean --exploration-throws?"),
        (("rank", "--hlep"), "unknown option --hlep: did you mean --help?"),  # and not that an input is missing
        (("import", "contactnets", "--hlep"), "unknown option --hlep: did you mean --help?"),
        (("rnak", "a.mcap"), "VERB: unknown rnak: did you mean rank?"),
        (("rank", "a.mcap", "-c", "logdet"), "unknown logdet: did you mean log-det?"),
        (("rank", "a.mcap", "--model", "deep-vertex"), "unknown deep-vertex: did you mean deepvertex?"),
        (("rank", "a.mcap", "--estimator", "gaussnewton"), "unknown gaussnewton: did you mean gauss-newton?"),
        (
            ("rank", "a.mcap", "--model", "sphere"),
            "unknown sphere: expected one of contactnets, deep, deepvertex, end_to_end, polytope",
        ),
        (("reproduce", "robustnes", "--out", "a"), "unknown robustnes: did you mean robustness?"),
    ],
)
def test_an_unknown_word_is_refused_with_the_one_that_was_meant(cli: Cli, words: Sequence[str], says: str) -> None:
    done = cli(*words)
    assert done.status == 2
    assert says in done.err


def test_a_letter_is_the_option_that_it_stands_for_in_every_verb() -> None:
    parser = door.build_parser(["rank"])
    short = parser.parse_args(["rank", "a", "-k", "4", "-c", "trace", "-j2", "-b", "b.yaml", "-o", "m.csv", "-p", "t.json"])
    long = ["--top", "4", "--criterion", "trace", "--jobs", "2", "--body", "b.yaml", "--out", "m.csv", "--params", "t.json"]
    assert short == parser.parse_args(["rank", "a", *long])


@pytest.mark.parametrize("verb", door.VERBS)
def test_the_help_of_a_verb_ends_with_two_commands_that_can_be_typed(verb: str) -> None:
    parser = door.build_parser([verb])
    action = next(one for one in parser._actions if isinstance(one, argparse._SubParsersAction))
    title, *commands = (line.strip() for line in (action.choices[verb].epilog or "").splitlines())
    assert title == EXAMPLES
    assert len(commands) >= 2
    for command in commands:
        name, *words = shlex.split(command.replace("*", "all"))
        assert (name, words[0]) == ("contact-curation", verb)
        parser.parse_args(words)


@pytest.mark.parametrize(
    ("line", "answer"),
    [("contact-curation ra", ["rank"]), ("contact-curation rank a.mcap --crit", ["--criterion"])],
)
def test_a_shell_completes_verbs_and_options(line: str, answer: list[str], tmp_path: Path) -> None:
    asked = {"_ARGCOMPLETE": "1", "COMP_LINE": line, "COMP_POINT": str(len(line))}
    written = {"_ARGCOMPLETE_STDOUT_FILENAME": str(tmp_path / "out"), "_ARGCOMPLETE_SUPPRESS_SPACE": "1"}
    command = [sys.executable, "-m", "contact_curation.cli.main"]
    subprocess.run(command, env={**os.environ, **asked, **written}, check=True)
    assert (tmp_path / "out").read_text().split() == answer


def test_an_option_cut_short_is_not_guessed(cli: Cli) -> None:
    assert cli("rank", "a.mcap", "--crit", "trace").status == 2


SAME_EVERYWHERE = (
    "--body",
    "--topic",
    "--board-frame",
    "--criterion",
    "--variant",
    "--estimator",
    "--model",
    "--seed",
    "--rate",
)


@pytest.mark.parametrize("option", SAME_EVERYWHERE)
def test_an_option_has_the_same_default_in_every_verb(option: str) -> None:
    verbs = next(each for each in door.build_parser(list(door.VERBS))._actions if each.choices and each.dest != "version")
    parsers: dict[str, argparse.ArgumentParser] = verbs.choices  # type: ignore[assignment]
    actions = [action for parser in parsers.values() for action in parser._actions if option in action.option_strings]
    told = {str(action.help).rpartition("(default")[2] for action in actions if "(default" in str(action.help)}
    assert len(actions) > 1
    assert len(told) <= 1


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


def test_another_interrupt_after_the_first_one_is_no_traceback(cli: Cli, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(door, "_status", raising(KeyboardInterrupt()))
    assert cli("rank", "a.mcap").status == 130


def test_a_full_disk_is_one_line_and_exit_status_1(cli: Cli, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(door, "_forget_output", lambda: None)  # pytest's own output has no file to point elsewhere
    monkeypatch.setattr(rank, "run", raising(OSError(errno.ENOSPC, "No space left on device", "/tmp/spool")))
    done = cli("rank", "a.mcap")
    assert done.status == 1
    assert done.err == "contact-curation: error: /tmp/spool: found No space left on device, expected to read and write there\n"


def test_too_little_memory_is_one_line_and_exit_status_1(cli: Cli, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rank, "run", raising(MemoryError("Unable to allocate 9 TiB")))
    done = cli("rank", "a.mcap")
    assert (done.status, len(done.err_lines)) == (1, 1)
    assert "9 TiB" in done.err


@pytest.fixture
def nothing_ignored() -> Iterator[None]:
    """As in a shell, though the tests themselves may run under `nohup` or in the background; processes inherit it."""
    every = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    ignored = [each for each in every if signal.getsignal(each) is signal.SIG_IGN]
    for each in ignored:
        signal.signal(each, signal.default_int_handler if each is signal.SIGINT else signal.SIG_DFL)
    yield
    for each in ignored:
        signal.signal(each, signal.SIG_IGN)


@pytest.mark.usefixtures("nothing_ignored")
def test_a_signal_that_nohup_ignores_stays_ignored(cli: Cli, monkeypatch: pytest.MonkeyPatch) -> None:
    def run(*_: object) -> int:
        signal.raise_signal(signal.SIGHUP)
        return 0

    monkeypatch.setattr(rank, "run", run)
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        assert cli("rank", "a.mcap").status == 0
    finally:
        signal.signal(signal.SIGHUP, before)
    assert cli("rank", "a.mcap").status == 130


def test_a_programming_error_keeps_its_traceback(cli: Cli, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rank, "run", raising(ZeroDivisionError()))
    with pytest.raises(ZeroDivisionError):
        cli("rank", "a.mcap")


def test_a_reader_that_goes_away_ends_it_without_a_traceback(golden: object) -> None:
    command = f"{sys.executable} -m contact_curation.cli.main rank {golden} --json | true"
    done = subprocess.run(["bash", "-c", f"set -o pipefail; {command}"], capture_output=True, text=True, check=False)
    assert "Traceback" not in done.stderr
    assert "BrokenPipe" not in done.stderr


@pytest.mark.parametrize("word", ["--help", "--version"])
@pytest.mark.parametrize(("where", "lines"), [("| true", 0), (">/dev/full", 1)])
def test_a_help_that_nobody_takes_is_at_most_one_line(word: str, where: str, lines: int) -> None:
    command = f"{sys.executable} -m contact_curation.cli.main {word} {where}"
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}
    done = subprocess.run(
        ["bash", "-c", f"set -o pipefail; {command}"], env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 1
    assert len(done.stderr.splitlines()) == lines


def test_a_working_folder_that_was_deleted_is_one_line(
    cli: Cli, golden: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "gone"
    folder.mkdir()
    monkeypatch.chdir(folder)
    folder.rmdir()
    done = cli("train", golden, "--out", tmp_path / "model.safetensors")
    assert done.status == 1
    assert done.err_lines == [
        "contact-curation: error: working folder: found one that was deleted, expected one that is there: cd to it"
    ]


def test_a_backend_of_figures_that_is_not_there_is_not_asked_for() -> None:
    code = (
        "import os, sys\n"
        "os.environ['MPLBACKEND'] = 'module://matplotlib_inline.of_a_notebook'\n"
        "from contact_curation.cli.main import main\n"
        "status = main()\n"
        "import matplotlib\n"
        "print(matplotlib.get_backend())"
    )
    assert python(code, "body", "nothing.yaml").stdout == "agg\n"


def test_another_interrupt_while_the_interpreter_ends_gives_no_traceback() -> None:
    done = python(
        "import atexit, signal, sys\n"
        "from contact_curation.cli.main import main\n"
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "atexit.register(signal.raise_signal, signal.SIGINT)\n"
        "sys.exit(main())",
        "body",
        "nothing.yaml",
    )
    assert done.returncode == -signal.SIGINT
    assert len(done.stderr.splitlines()) == 1


@pytest.mark.parametrize(
    ("where", "status", "says"),
    [(">/dev/full", 1, "No space left on device"), (">&-", 0, "no --body given"), (">&- 2>&-", 0, "")],
)
def test_an_output_that_takes_nothing_is_at_most_one_line(where: str, status: int, says: str, golden: object) -> None:
    command = f"{sys.executable} -m contact_curation.cli.main rank {golden} --json {where}"
    done = subprocess.run(["bash", "-c", command], capture_output=True, text=True, check=False)
    assert done.returncode == status
    assert len(done.stderr.splitlines()) == len([says] if says else [])
    assert says in done.stderr


def test_where_all_streams_are_closed_what_libraries_print_is_in_no_output(tmp_path: Path) -> None:
    code = (
        "import os, pathlib\n"
        "from contact_curation.cli import body, main\n"
        f"with_output = lambda _: pathlib.Path({str(tmp_path / 'out')!r}).open('w').write(os.readlink('/proc/self/fd/2')) * 0\n"
        "body.run = with_output\n"
        "main.main(['body', 'a.yaml'])"
    )
    subprocess.run(["bash", "-c", f"{sys.executable} -c {shlex.quote(code)} <&- >&- 2>&-"], check=True)
    assert (tmp_path / "out").read_text() == os.devnull


COMMANDS = "/poses\x1b[2J\x1b]52;c;cm0=\x07\x9b31m"
"""A topic whose name erases a terminal's screen, fills its clipboard and colours its text."""


def test_names_in_a_recording_send_no_commands_to_a_terminal(cli: Cli, tmp_path: Path) -> None:
    path = write_mcap(tmp_path / "bag.mcap", [one._replace(topic=COMMANDS) for one in recording(20) if one.topic != NOTE])
    listed, refused = cli("check", path), cli("rank", path, "--topic", "/others")
    shown = r"/poses\u001b[2J\u001b]52;c;cm0=\u0007\u009b31m"
    assert (shown in listed.out, shown in refused.err) == (True, True)
    assert all(character.isprintable() or character == "\n" for one in (listed, refused) for character in one.out + one.err)


@pytest.mark.parametrize("encoding", ["ascii", pytest.param("utf-8", marks=pytest.mark.slow)])
def test_a_name_that_no_terminal_can_show_is_shown_in_escapes(encoding: str, golden: Path, tmp_path: Path) -> None:
    bag = os.fsencode(tmp_path) + b"/t\xc3\xb6ss\xff.mcap"
    Path(os.fsdecode(bag)).write_bytes(golden.read_bytes()[:-1000])
    environment = {**os.environ, "PYTHONIOENCODING": f"{encoding}:strict"}
    command: list[str | bytes | Path] = [sys.executable, "-m", "contact_curation.cli.main", "rank", bag]
    as_json = subprocess.run([*command, "--json"], env=environment, capture_output=True, check=False)
    assert as_json.returncode == 0
    assert os.fsencode(json.loads(as_json.stdout)["inputs"][0]["path"]) == bag
    options: list[str | bytes | Path] = ["--out", tmp_path / "m.csv", "--index", tmp_path / "index"]
    manifest = subprocess.run([*command, *options], env=environment, capture_output=True, check=False)
    assert manifest.returncode == 1
    assert b"expected names and paths that are Unicode" in manifest.stderr
    assert not any((tmp_path / "index").glob("*/*")), "it is said before the work"
    assert len(manifest.stderr) < 1000


def open_files(process: int) -> list[str]:
    """What a process has open, by path."""
    found = []
    for link in Path(f"/proc/{process}/fd").iterdir():
        with contextlib.suppress(OSError):
            found.append(str(link.readlink()))
    return found


@pytest.mark.usefixtures("nothing_ignored")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_ends_it_with_status_130_and_leaves_nothing_half_written(
    number: signal.Signals, golden: object, true_parameters: Path, tmp_path: Path
) -> None:
    folder = tmp_path / "out"
    folder.mkdir()
    command = [sys.executable, "-m", "contact_curation.cli.main", "score", *[str(golden)] * 40]
    words = ["--params", str(true_parameters), "--out", str(folder / "scores.npz")]
    running = subprocess.Popen([*command, *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    while not any(str(folder) in name for name in open_files(running.pid)):  # nameless ones, which only work under way has
        assert running.poll() is None
        time.sleep(0.01)
    running.send_signal(number)
    _, err = running.communicate(timeout=60)
    assert err == "contact-curation: interrupted\n"
    # Where the interrupt meets an import, CPython ends itself by SIGINT instead, which a shell calls 130 as well.
    assert running.returncode in (130, -signal.SIGINT)
    assert not any(folder.iterdir())
