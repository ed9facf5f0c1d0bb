"""Processes of a session that are killed leave nothing in shared memory, and nobody waits for them."""

import subprocess
import sys

import pytest


@pytest.mark.slow
@pytest.mark.live
def test_a_publisher_does_not_stand_still_while_its_subscribers_are_killed() -> None:
    command = [sys.executable, "-W", "ignore", "-m", "test.reliability.killed_subscribers", "10"]
    row = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True).stdout
    _, kills, _, _, deaf, left = (cell.strip() for cell in row.strip().strip("|").split("|"))
    assert (kills, deaf, left) == ("10", "0", "0")
