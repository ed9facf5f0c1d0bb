"""`make demo`: the loop is closed in time, nodes and library agree, and no process is left behind however it ends."""

import os
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


@pytest.mark.slow
@pytest.mark.live
def test_the_loop_is_closed_for_twelve_throws_and_their_report_is_there(tmp_path: Path) -> None:
    done = subprocess.run([*COMMAND, str(tmp_path / "demo")], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert f"{THROWS} made" in done.stdout
    assert "in the same order" in done.stdout
    assert (tmp_path / "demo" / "session" / "report.html").stat().st_size > 50_000
    assert "DASHBOARD=1" in done.stdout


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
