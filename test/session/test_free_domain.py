"""No two graphs of this machine are given one ROS domain, and whoever dies gives his back."""

import signal
import socket
import subprocess
import sys
from contextlib import ExitStack

import pytest

from contact_curation.errors import InvalidValueError
from contact_curation.session import free_domain as module
from contact_curation.session.free_domain import FIRST_PORT, PORTS_EACH, free_domain, graph_domain

HOLDS = """
from contact_curation.session.free_domain import free_domain
with free_domain() as domain:
    print(domain, flush=True)
    input()
"""


def test_graphs_that_run_together_have_different_domains_until_there_are_none(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "LARGEST_DOMAIN", 8)
    with ExitStack() as running:
        held = []
        with pytest.raises(InvalidValueError, match="free ROS domains: found none"):
            for _ in range(9):
                held.append(running.enter_context(free_domain()))
        assert len(set(held)) == len(held)
    with free_domain() as again:
        assert again in held


def test_a_domain_in_which_somebody_else_is_heard_is_left_alone() -> None:
    with free_domain() as first:
        pass
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as participant:
        participant.bind(("", FIRST_PORT + PORTS_EACH * first + 12))
        with free_domain() as other:
            assert other != first


def test_the_users_own_domain_holds_one_session_whoever_else_is_heard_there() -> None:
    with free_domain() as free, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as participant:
        participant.bind(("", FIRST_PORT + PORTS_EACH * free + 12))
    own = {"ROS_DOMAIN_ID": str(free)}
    with graph_domain(own) as domain:
        assert domain == str(free)
        running = pytest.raises(InvalidValueError, match=f"ROS_DOMAIN_ID: found {free}, in which a session is running")
        with running, graph_domain({"ROS_DOMAIN_ID": f" {free} "}):
            pass
    with graph_domain(own) as again:
        assert again == domain


@pytest.mark.parametrize("given", ["seven", "-1", "233", "012"])
def test_what_is_no_domain_is_refused_before_a_node_is_started(given: str) -> None:
    refused = pytest.raises(InvalidValueError, match=f"ROS_DOMAIN_ID: found {given}, expected a whole number from 0 to 232")
    with refused, graph_domain({"ROS_DOMAIN_ID": given}):
        pass


def test_a_process_that_is_killed_gives_its_domain_back() -> None:
    with subprocess.Popen([sys.executable, "-c", HOLDS], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as holder:
        assert holder.stdout is not None
        domain = int(holder.stdout.readline())
        assert module._claimed(domain) is None
        holder.send_signal(signal.SIGKILL)
        holder.wait()
    claim = module._claimed(domain)
    assert claim is not None
    claim.close()
