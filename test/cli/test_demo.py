"""`make demo`: the loop is closed in time, nodes and library agree, and no process is left behind however it ends."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from contact_curation.cli import demo
from contact_curation.cli.demo import GOLDEN_BAG, THROWS, main
from contact_curation.session.replay import Recording, rank_by_nodes
from contact_curation.session.supervisor import ProgramFailedError

COMMAND = [sys.executable, "-m", "contact_curation.cli.demo", "--out"]


def nodes_of(folder: Path) -> list[int]:
    """Processes of nodes whose temporary files are in a folder."""
    found = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                words, variables = ((entry / name).read_bytes().decode(errors="replace") for name in ("cmdline", "environ"))
            except OSError:
                continue
            if "contact_curation.nodes." in words and f"TMPDIR={folder}\0" in variables:
                found.append(int(entry.name))
    return found


def wait_until(holds: Callable[[], bool], seconds: float = 60.0) -> None:
    end = time.monotonic() + seconds
    while not holds():
        assert time.monotonic() < end, "waited too long"
        time.sleep(0.1)


@pytest.mark.slow
@pytest.mark.live
def test_nodes_and_library_agree_on_the_golden_bag(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--data", str(GOLDEN_BAG), "--out", str(tmp_path / "demo")]) == 0
    said = capsys.readouterr().out
    assert "Nodes and library agree: the same 8 tosses in the same order, the same 3 rejected." in said
    for reason in ("gap: found", "displacement beside the velocity: found", "lowest corner of the toss: found"):
        assert reason in said
    assert (tmp_path / "demo" / "manifest.parquet").exists()
    assert (tmp_path / "demo" / "manifest.png").exists()


def table_of(said: str) -> list[str]:
    """What a demo says of its throws and of what came of them: all but times, files and addresses."""
    rows = [line for line in said.splitlines() if re.match(r" +\d+  |throw +\d+ of |Throw \d+, |Learned: ", line)]
    facts = [
        line for line in said.splitlines() if re.match(r" +(throws|tosses|gain|learned|held out|buffer|training|replay) ", line)
    ]
    return [re.sub(r"  \(\d+ s\)$", "", line) for line in [*rows, *facts]]


@pytest.mark.slow
@pytest.mark.live
def test_the_demo_shows_the_same_table_on_a_busy_machine_and_with_another_processors_rounding(tmp_path: Path) -> None:
    """What runs beside the second one takes every core twice, and its libraries round as on a processor without AVX."""
    first = subprocess.run([*COMMAND, str(tmp_path / "first")], capture_output=True, text=True, check=False)
    busy = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(2 * (os.cpu_count() or 1))]
    try:
        environment = {**os.environ, "OPENBLAS_CORETYPE": "Nehalem", "NPY_DISABLE_CPU_FEATURES": "X86_V3 X86_V4"}
        second = subprocess.run(
            [*COMMAND, str(tmp_path / "second")], capture_output=True, text=True, check=False, env=environment
        )
    finally:
        for process in busy:
            process.kill()
            process.wait()
    assert first.returncode == second.returncode == 0, first.stderr + second.stderr
    table = table_of(first.stdout)
    assert table == table_of(second.stdout)
    assert len([line for line in table if re.match(r" +\d+  ", line)]) == THROWS
    assert sum(" planned, " in line and line.startswith("throw ") for line in table) >= THROWS / 2  # designed
    assert len([line for line in table if "rejected: " in line and line.startswith("throw ")]) == 1
    assert any(re.match(r"Throw 6, spoilt on purpose, was rejected: lowest corner", line) for line in table)
    assert any(re.fullmatch(r"Learned: friction 0\.\d+ ± 0\.\d+ .* RMS, from 8 tosses of 12 throws\.", line) for line in table)
    assert any("rank gives the same 8 tosses in the same order" in line for line in table)
    assert (tmp_path / "first" / "session" / "report.html").stat().st_size > 50_000
    assert "DASHBOARD=1" in first.stdout


def test_a_demo_whose_spoilt_throw_was_not_rejected_ends_with_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def session(words: list[str]) -> int:
        folder = Path(words[words.index("--record") + 1])
        folder.mkdir(parents=True)
        throws = [{"number": 6, "throw": "cube-throw-5", "outcome": "selected, rank 1 of 8"}]
        (folder / "session.json").write_text(json.dumps({"summary": {"throws": throws}}))
        return 0

    monkeypatch.setattr(demo, "command_line", session)
    assert main(["--out", str(tmp_path)]) == 1
    said = capsys.readouterr().err
    assert said == "demo: error: cube-throw-5: found selected, rank 1 of 8, expected that its spoilt poses are rejected\n"


@pytest.mark.slow
@pytest.mark.live
@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_no_node_outlives_the_demo(tmp_path: Path, how: signal.Signals) -> None:
    environment = {**os.environ, "TMPDIR": str(tmp_path)}
    with subprocess.Popen([*COMMAND, str(tmp_path / "demo")], env=environment, stdout=subprocess.DEVNULL) as demo:
        try:
            wait_until(lambda: len(nodes_of(tmp_path)) == 9)
            demo.send_signal(how)
            assert demo.wait(30) == (-9 if how is signal.SIGKILL else 130)
        finally:
            demo.kill()
    wait_until(lambda: not nodes_of(tmp_path))


def test_data_that_is_not_there_is_one_line(tmp_path: Path) -> None:
    command = [*COMMAND, str(tmp_path / "demo"), "--data", str(tmp_path / "none")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert done.stderr.count("\n") == 1
    assert done.stderr.startswith(f"demo: error: {tmp_path / 'none'}: cannot be opened")


@pytest.mark.parametrize("named", ["the file", "its folder"])
def test_a_bag_is_replayed_as_it_is_named_by_its_file_or_its_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, named: str
) -> None:
    bag = tmp_path / "recording" / "run.mcap"
    bag.parent.mkdir()
    bag.write_bytes(GOLDEN_BAG.read_bytes())
    path = bag if named == "the file" else bag.parent
    shown: list[Recording] = []
    monkeypatch.setattr(demo, "show", lambda recording, *_: shown.append(recording))
    assert main(["--data", str(path), "--out", str(tmp_path / "out")]) == 0
    assert [recording.bag for recording in shown] == [path]


@pytest.mark.slow
@pytest.mark.live
def test_a_node_that_cannot_be_kept_running_ends_it_with_its_last_words(tmp_path: Path) -> None:
    recording = Recording(tmp_path / "none.mcap", rate=5.0, top=8)
    with pytest.raises(ProgramFailedError, match=r"died 4 times right after its start, .*none\.mcap"):
        rank_by_nodes(recording, 1, ["cube-1"], tmp_path, tmp_path, print)
