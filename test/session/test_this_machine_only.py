"""What a session starts is reached from this machine only, unless its user says otherwise."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import pytest

from contact_curation.session.free_domain import free_domain
from contact_curation.session.graph import PEERS, PROFILES, RANGE, RMW, graph_environment, node_command, within_this_machine
from contact_curation.session.parameter_files import Parameters, write_node_parameters
from contact_curation.session.supervisor import Patience, Program, Supervisor
from test.dashboard.live.test_serving import free_port
from test.listeners import beyond_loopback, listeners_of

LONG = 90.0
"""[s]"""

SEES = """
import sys, time
import rclpy
rclpy.init()
node = rclpy.create_node("onlooker")
end = time.monotonic() + float(sys.argv[1])
while time.monotonic() < end and not set(sys.argv[2:]) <= set(node.get_node_names()):
    rclpy.spin_once(node, timeout_sec=0.1)
print(*node.get_node_names())
"""


@contextmanager
def running(folder: Path, parameters: Mapping[str, Parameters], environment: Mapping[str, str]) -> Iterator[dict[str, int]]:
    """Nodes, as a session starts them; gives their process ids by name."""
    told = folder / "parameters.yaml"
    write_node_parameters(told, dict(parameters))
    processes: dict[str, int] = {}
    programs = [Program(name, node_command(name, told)) for name in parameters]
    started = Supervisor(programs, environment, folder, lambda one: processes.update({one.program: one.pid}), Patience())
    with started as supervisor:
        supervisor.start()
        yield processes


def nodes_seen(environment: Mapping[str, str], wanted: set[str], **changes: str) -> set[str]:
    """Names of the nodes that a program with this environment sees, once it sees those that are wanted."""
    command = [sys.executable, "-c", SEES, str(LONG), *wanted]
    done = subprocess.run(command, env={**environment, **changes}, capture_output=True, text=True, check=True)
    return set(done.stdout.split())


@pytest.mark.slow
def test_a_graph_with_its_dashboard_listens_on_loopback_alone_and_is_seen_by_the_tools_of_this_machine(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in (RANGE, PEERS, RMW, *PROFILES):
        monkeypatch.delenv(name, raising=False)
    ports = {"web_port": free_port(), "grpc_port": free_port()}
    parameters: dict[str, Parameters] = {"curator": {"store": str(tmp_path / "buffer.sqlite")}, "dashboard": dict(ports)}
    with free_domain() as domain, running(tmp_path, parameters, graph_environment(os.environ, tmp_path, domain)) as processes:
        users = {**os.environ, "ROS_DOMAIN_ID": str(domain)}
        assert nodes_seen(users, {"curator", "dashboard"}, **{RANGE: "LOCALHOST"}) >= {"curator", "dashboard"}
        assert nodes_seen(users, {"curator", "dashboard"}, **{RANGE: "SUBNET"}) >= {"curator", "dashboard"}
        end = time.monotonic() + LONG
        while {one.port for one in listeners_of(processes.values())}.isdisjoint({ports["web_port"]}):
            assert time.monotonic() < end, (tmp_path / "dashboard.log").read_text()
            time.sleep(0.1)
        found = listeners_of(processes.values())
        assert {one.protocol for one in found} >= {"tcp", "udp"}
        assert {one.port for one in found} >= set(ports.values())
        assert beyond_loopback(found) == []


def test_what_the_user_says_of_ros_is_left_as_it_is() -> None:
    for own in ({RANGE: "SUBNET"}, {RANGE: "LOCALHOST", PEERS: "10.0.0.2"}, {RANGE: "OFF"}):
        assert within_this_machine(own) == own
    cyclone = within_this_machine({RMW: "rmw_cyclonedds_cpp"})
    assert cyclone == {RMW: "rmw_cyclonedds_cpp", RANGE: "LOCALHOST"}
    profiled = within_this_machine({PROFILES[0]: "mine.xml", "ROS_LOCALHOST_ONLY": "1"})
    assert profiled == {PROFILES[0]: "mine.xml", RANGE: "LOCALHOST"}
    asked = within_this_machine({RANGE: "LOCALHOST"})
    assert asked == within_this_machine({})


def test_a_node_imports_nothing_from_the_current_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    ran = tmp_path / "ran"
    for module in ("yaml", "numpy", "rclpy"):
        (tmp_path / f"{module}.py").write_text(f"open({str(ran)!r}, 'w').close()")
    told = tmp_path / "parameters.yaml"
    write_node_parameters(told, {"curator": {"store": str(tmp_path / "buffer.sqlite")}})
    monkeypatch.chdir(tmp_path)
    with free_domain() as domain:
        environment = graph_environment(os.environ, tmp_path, domain)
        with subprocess.Popen(node_command("curator", told), env=environment, stderr=subprocess.PIPE, text=True) as node:
            assert node.stderr is not None
            assert "assuming ContactNets' cube" in node.stderr.readline()
            node.send_signal(signal.SIGINT)
            assert node.wait(30.0) == 0
    assert not ran.exists()
