"""`play`: options become the player's ROS parameters; the process becomes the node."""

import os
import sys

import pytest

from contact_curation.cli.main import build_parser
from contact_curation.cli.play import player_command
from contact_curation.session.graph import within_this_machine
from test.cli.commands import Cli


def command(*words: str) -> list[str]:
    return player_command(build_parser(["play"]).parse_args(["play", *words]))


def test_options_become_parameters_of_the_same_names() -> None:
    words = command(
        "a bag.mcap", "--rate", "2", "--loop", "--start-offset", "1.5", "--clock", "50", "--topics", "/tf", "/odom",
        "--remap", "/odom:=/pose", "--start-paused", "--as-fast-as-possible",
    )  # fmt: skip
    assert words[:5] == [sys.executable, "-P", "-m", "contact_curation.nodes.player", "--ros-args"]
    given = {value for flag, value in zip(words[5::2], words[6::2]) if flag == "-p"}
    assert given == {
        'bag:="a bag.mcap"',
        "rate:=2.0",
        "loop:=true",
        "start_offset:=1.5",
        "clock:=50.0",
        'topics:=["/tf", "/odom"]',
        "start_paused:=true",
        "as_fast_as_possible:=true",
    }
    assert words[-2:] == ["-r", "/odom:=/pose"]


def test_without_options_the_player_plays_everything_as_it_was_recorded() -> None:
    words = command("a.mcap")
    assert "rate:=1.0" in words
    assert "loop:=false" in words
    assert not any(word.startswith("topics") for word in words)


def test_the_process_becomes_the_node(cli: Cli, monkeypatch: pytest.MonkeyPatch) -> None:
    became: list[tuple[list[str], dict[str, str]]] = []

    def execve(program: str, words: list[str], environment: dict[str, str]) -> None:
        became.append(([program, *words], environment))
        raise KeyboardInterrupt

    monkeypatch.setattr(os, "execve", execve)
    monkeypatch.delenv("ROS_AUTOMATIC_DISCOVERY_RANGE", raising=False)
    cli("play", "a.mcap")
    words, environment = became[0]
    assert words[:5] == [sys.executable, sys.executable, "-P", "-m", "contact_curation.nodes.player"]
    assert environment == within_this_machine(os.environ)


@pytest.mark.parametrize("renamed", ["/a:=/x-y", "/a", "/a:=", "/a b:=/c", "/1:=/c"])
def test_a_name_that_ros_does_not_take_is_bad_usage(cli: Cli, renamed: str) -> None:
    done = cli("play", "a.mcap", "--remap", renamed)
    assert (done.status, done.out) == (2, "")
    assert f"found {renamed}, expected OLD:=NEW" in done.err


def test_a_path_that_is_no_text_is_one_line(cli: Cli) -> None:
    done = cli("play", "a\udcff.mcap")
    assert (done.status, len(done.err_lines)) == (1, 1)
    assert "expected one in UTF-8" in done.err
