"""The closed loop as processes: it ends by itself, its bag gives its ranking, and nothing is left behind however it ends."""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any
from urllib.request import urlopen

import pytest

from contact_curation.session.session import SERVED
from contact_curation.storage.bags.reader import BagReader
from test.cli.test_demo import nodes_of

pytestmark = [pytest.mark.slow, pytest.mark.live]

ONLINE = [sys.executable, "-m", "contact_curation.cli.main", "online", "--rate", "0"]
QUICK = """
/**/trainer: {ros__parameters: {steps: 100}}
/**/throw_designer: {ros__parameters: {design: {pool: 48, reference: 32}, refinement: {generations: 2}}}
"""
LONG = 240.0


def wait_until(holds: Callable[[], bool], seconds: float = LONG) -> None:
    end = time.monotonic() + seconds
    while not holds():
        assert time.monotonic() < end, "waited too long"
        time.sleep(0.2)


def events_of(folder: Path) -> list[dict[str, Any]]:
    path = folder / "events.jsonl"
    return [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []


def count(folder: Path, event: str, node: str = "") -> int:
    return sum(one["event"] == event and node in ("", one.get("node")) for one in events_of(folder))


def quick(folder: Path) -> list[str]:
    path = folder / "quick.yaml"
    path.write_text(QUICK)
    return ["--params-file", str(path)]


def test_five_throws_with_nodes_killed_on_the_way_give_the_ranking_that_their_bag_gives(tmp_path: Path) -> None:
    folder = tmp_path / "session"
    golden = Path(__file__).resolve().parents[2] / "bags" / "golden.mcap"
    command = [*ONLINE, *quick(tmp_path), "--throws", "5", "--top", "3", "--record", str(folder), "--held-out", str(golden)]
    with subprocess.Popen([*command, "--json"], stdout=subprocess.PIPE, text=True) as online:
        for throws, node in ((1, "fisher_scorer"), (2, "sim_arm"), (3, "session_recorder")):
            wait_until(lambda throws=throws: count(folder, "throw") >= throws)  # type: ignore[misc]
            pid = next(one["pid"] for one in events_of(folder) if one.get("node") == node)
            os.kill(pid, signal.SIGKILL)
        told = json.loads(online.communicate(timeout=LONG)[0])
    assert online.returncode == 0
    assert len(told["throws"]) == 5
    assert told["settled"]
    assert told["restarts"] == {"fisher_scorer": 1, "sim_arm": 1, "session_recorder": 1}
    assert told["same"], told["replay"]
    assert told["held_out"]["tosses"] == 21
    by_hand = ["rank", str(folder / "session.mcap"), "--params", str(folder / "checkpoint.safetensors"), "--top", "3", "--json"]
    done = subprocess.run([*ONLINE[:3], *by_hand], capture_output=True, check=True)
    ranked = sorted((row for row in json.loads(done.stdout)["tosses"] if row["selected"]), key=lambda row: int(row["rank"]))
    assert [row["toss_id"] for row in ranked] == told["selected"]
    for name in ("report.html", "manifest.parquet", "session.json", "session.rrd", "figures/gains.png", "logs/curator.log"):
        assert (folder / name).exists(), name
    with BagReader(folder / "session.mcap") as bag:
        topics = {info.name for info in bag.topics}
        states = [one.message.state for one in bag.messages(["/throw_report"])]
    assert {"/toss", "/toss_information", "/curated_buffer", "/model_parameters", "/ground_truth", "/joint_states"} <= topics
    assert states.count("scored") >= 5


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_it_in_order_with_what_there_is(tmp_path: Path, how: signal.Signals) -> None:
    folder = tmp_path / "session"
    environment = {**os.environ, "TMPDIR": str(tmp_path)}
    command = [*ONLINE, *quick(tmp_path), "--record", str(folder)]
    with subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True) as online:
        wait_until(lambda: count(folder, "throw") >= 1)
        online.send_signal(how)
        said = online.communicate(timeout=LONG)[0]
    assert online.returncode == 0  # no number of throws was asked for
    assert "interrupted before everything was scored and trained on" in said
    assert all(one["detail"] == "status 0" for one in events_of(folder) if one["event"] == "stopped")
    assert count(folder, "stopped") == 9
    assert not nodes_of(tmp_path)
    with BagReader(folder / "session.mcap") as bag:
        list(bag.raw_messages())
        assert not bag.losses


@pytest.mark.parametrize("how", [signal.SIGTERM, signal.SIGKILL])
def test_a_session_that_was_ended_goes_on_with_its_throws_and_gives_the_ranking_of_its_bag(
    tmp_path: Path, how: signal.Signals
) -> None:
    folder = tmp_path / "session"
    command = [*ONLINE, *quick(tmp_path), "--throws", "3", "--top", "2", "--record", str(folder), "--json"]
    environment = {**os.environ, "TMPDIR": str(tmp_path)}
    with subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL) as online:
        wait_until(lambda: count(folder, "throw") >= 1)
        online.send_signal(how)
        assert online.wait(LONG) == (130 if how is signal.SIGTERM else -how)
    wait_until(lambda: not nodes_of(tmp_path), 10.0)
    done = subprocess.run(
        [*command, "--resume"], env=environment, capture_output=True, text=True, check=False, timeout=2 * LONG
    )
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    assert len(told["throws"]) == count(folder, "throw") == 3
    assert told["settled"]
    assert told["same"], told["replay"]
    assert count(folder, "started", "curator") == 2
    times = [one["time"] for one in events_of(folder)]
    assert times == sorted(times)
    with BagReader(folder / "session.mcap") as bag:
        assert len({one.message.toss_id for one in bag.messages(["/toss"])}) == told["tosses"]


def test_nothing_outlives_a_command_that_is_killed_and_its_bag_can_be_read(tmp_path: Path) -> None:
    folder = tmp_path / "session"
    environment = {**os.environ, "TMPDIR": str(tmp_path)}
    with subprocess.Popen(
        [*ONLINE, *quick(tmp_path), "--record", str(folder)], env=environment, stdout=subprocess.DEVNULL
    ) as online:
        wait_until(lambda: count(folder, "throw") >= 2)  # the toss of the first one is recorded by then
        online.kill()
    wait_until(lambda: not nodes_of(tmp_path), 10.0)
    with BagReader(folder / "session.mcap") as bag:
        assert len(list(bag.messages(["/toss"]))) >= 1


def test_a_dashboard_that_stays_is_served_when_the_throws_are_over_until_a_signal(tmp_path: Path) -> None:
    folder = tmp_path / "session"
    command = [*ONLINE, *quick(tmp_path), "--throws", "1", "--record", str(folder), "--stay"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as online:
        assert online.stdout is not None
        said = ""
        while SERVED not in said:
            line = online.stdout.readline()
            assert line, said
            said += line
        address = said.strip().rpartition(" ")[2]
        with urlopen(address, timeout=30.0) as page:
            assert page.status == 200
        assert count(folder, "stopped") == 8
        online.send_signal(signal.SIGINT)
        assert online.wait(LONG) == 0
    assert "1 made" in said
    assert count(folder, "stopped", "dashboard") == 1


def test_a_node_that_refuses_its_parameters_ends_it_with_one_line(tmp_path: Path) -> None:
    path = tmp_path / "bad.yaml"
    path.write_text("/**/curator: {ros__parameters: {prior: -1.0}}")
    command = [*ONLINE, "--params-file", str(path), "--record", str(tmp_path / "session")]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=LONG)
    assert done.returncode == 1
    assert done.stderr.count("\n") == 1
    assert "curator died 4 times right after its start" in done.stderr
    assert "value: -1.0: prior" in done.stderr  # the range that the parameter declares
