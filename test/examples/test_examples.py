"""The scripts in examples/ run as they stand."""

import os
import re
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import contact_curation as cc
from contact_curation.storage.manifest.file import read_manifest
from test.conftest import REPOSITORY

EXAMPLES = REPOSITORY / "examples"
LONGEST = 120.0
"""[s]"""


def run(name: str, *words: object, status: int = 0) -> str:
    """What a script prints."""
    done = subprocess.run(
        [sys.executable, EXAMPLES / name, *map(str, words)], capture_output=True, text=True, check=False, cwd=REPOSITORY
    )
    assert done.returncode == status, done.stderr
    return done.stdout


@pytest.mark.slow
def test_each_recording_has_a_verdict_and_a_faulty_one_ends_with_status_1(golden_bag: Path, tmp_path: Path) -> None:
    empty = tmp_path / "empty.mcap"
    empty.touch()
    said = run("check_recordings.py", golden_bag, empty, status=1)
    assert f"{golden_bag}: ok: 21 of 24 motions are sound tosses of cube\n" in said
    assert f"{empty}: " in said
    assert run("check_recordings.py", golden_bag).startswith(f"{golden_bag}: ok: ")


def test_a_bag_is_ranked(golden_bag: Path, tmp_path: Path) -> None:
    said = run("rank_my_bag.py", golden_bag, "--top", 4, "--out", tmp_path / "m.csv")
    assert said.count("rejected: cube-") == 3
    assert len(read_manifest(tmp_path / "m.csv").selected) == 4
    assert said.endswith(f"4 tosses selected: {tmp_path / 'm.csv'}\n")


def test_tosses_are_selected_by_a_criterion_of_ones_own(golden_bag: Path) -> None:
    said = run("own_criterion.py", golden_bag)
    assert "21 ranked by trace-rate, 5 selected" in said
    assert re.search(r"selected by both: [0-5] of 5", said)


@pytest.fixture
def curator(monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[subprocess.Popen[str], int]]:
    """The script in a ROS domain of its own."""
    from contact_curation.session.free_domain import free_domain

    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    with free_domain() as domain:
        environment = {**os.environ, "ROS_DOMAIN_ID": str(domain)}
        command = [sys.executable, str(EXAMPLES / "curate_live_topic.py")]
        process = subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True, cwd=REPOSITORY)
        watchdog = threading.Timer(LONGEST, process.kill)
        watchdog.start()
        yield process, domain
        watchdog.cancel()
        process.kill()
        process.communicate()


def test_a_live_topic_is_curated_in_forty_lines(golden_bag: Path, curator: Any) -> None:
    from contact_curation_msgs.msg import Toss as TossMessage

    from contact_curation.nodes.messages.toss import toss_message
    from contact_curation.nodes.ros.qos import latched
    from test.graph.parts.graph import Listener

    process, domain = curator
    tosses = cc.read(golden_bag)
    listener = Listener(domain)
    publisher = listener.node.create_publisher(TossMessage, "toss", latched(100))
    for sequence, toss in enumerate(tosses.accepted[:6], start=1):
        publisher.publish(toss_message(toss, sequence, "board"))
    last = next(line for line in process.stdout if line.startswith("6 tosses"))
    listener.close()
    expected = cc.rank(cc.Tosses.of(tosses.accepted[:6], tosses.body), top=4)
    assert last == f"6 tosses, selected: {', '.join(expected.selected_ids)}\n"
    assert len((EXAMPLES / "curate_live_topic.py").read_text().splitlines()) <= 40
