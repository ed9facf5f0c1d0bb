"""The nodes of a session as processes that are kept running, on DDS, in a domain of their own on this machine.

Unless the user's environment says how far ROS reaches, nothing outside this machine does. Discovery on LOCALHOST is not enough:
Fast DDS is then still bound to all interfaces, and takes what comes to its ports. A profile binds it to the loopback interface.
"""

import os
import sys
from collections.abc import Callable, Mapping
from pathlib import Path

from contact_curation.session.config import SessionFolder
from contact_curation.session.free_domain import VARIABLE
from contact_curation.session.node_parameters import DASHBOARD, RECORDER
from contact_curation.session.parameter_files import Parameters
from contact_curation.session.supervisor import Incident, Program, Supervisor

RANGE, PEERS, RMW = "ROS_AUTOMATIC_DISCOVERY_RANGE", "ROS_STATIC_PEERS", "RMW_IMPLEMENTATION"
OTHER_RANGES = ("ROS_LOCALHOST_ONLY", PEERS)
"""Variables that would reach beyond this machine, or confuse, when discovery is on it."""

FAST_DDS = ("rmw_fastrtps_cpp", "rmw_fastrtps_dynamic_cpp")
"""The first is Jazzy's default."""

PROFILES = ("FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE")
"""Variables that Fast DDS 2 and 3 take the name of a file with profiles from."""

LOOPBACK = Path(__file__).resolve().parents[1] / "config" / "loopback.xml"
"""Fast DDS's profile of participants that speak UDP on the loopback interface alone. On its own Fast DDS prefers shared memory,
which a killed process leaves behind with what it had locked, so that others stand still (docs/reliability.md)."""

LISTENERS = 1
"""Stage of the nodes that only listen: they are stopped last, so that they hear how the others end."""

SHARED = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "MALLOC_ARENA_MAX": "2"}
"""Nodes share the machine: threads of one would only wait for each other, and the middleware's many threads would each keep
memory of their own."""


def supervised(
    parameters: Mapping[str, Parameters],
    folder: SessionFolder,
    domain: int | str,
    tell: Callable[[Incident], None],
) -> Supervisor:
    """The nodes, not started yet.

    Args:
        parameters: by node; they are in `folder.parameters` already.
        folder: of the session.
        domain: of ROS.
        tell: called with what happens.
    """
    programs = [_program(name, folder.parameters) for name in parameters]
    return Supervisor(programs, graph_environment(os.environ, folder.logs, domain), folder.logs, tell)


def graph_environment(own: Mapping[str, str], logs: Path, domain: int | str) -> dict[str, str]:
    """Environment of the nodes.

    Args:
        own: of this process.
        logs: folder for what ROS logs.
        domain: of ROS.
    """
    environment = {**own, VARIABLE: str(domain)}
    environment.setdefault("ROS_LOG_DIR", str(logs.absolute() / "ros"))
    return {**SHARED, **within_this_machine(environment)}


def within_this_machine(own: Mapping[str, str]) -> dict[str, str]:
    """An environment in which ROS is reached from this machine only, unless `own` asks for more, or has a Fast DDS profile.

    Another middleware than Fast DDS is told LOCALHOST, and binds its sockets as it does then.
    """
    if RANGE in own and (own[RANGE] != "LOCALHOST" or PEERS in own):
        return dict(own)
    environment = {name: value for name, value in own.items() if name not in OTHER_RANGES}
    middleware = own.get(RMW, FAST_DDS[0])
    if middleware not in FAST_DDS or any(name in own for name in PROFILES):
        return {**environment, RANGE: "LOCALHOST"}
    # Where LOCALHOST is asked for, rmw_fastrtps adds a transport on all interfaces to those of the profile.
    return {**environment, RMW: middleware, RANGE: "SYSTEM_DEFAULT", **dict.fromkeys(PROFILES, str(LOOPBACK))}


def _program(name: str, parameters: Path) -> Program:
    listens = name in (DASHBOARD, RECORDER)
    return Program(name, node_command(name, parameters), needed=name != DASHBOARD, stage=LISTENERS if listens else 0)


def node_command(name: str, parameters: Path) -> tuple[str, ...]:
    """The command line of a node whose parameters are in a file."""
    return (*node_program(name), "--ros-args", "--params-file", str(parameters.absolute()))


def node_program(name: str) -> tuple[str, ...]:
    """The program of a node. Nothing is imported from the current folder, which may hold somebody else's recordings."""
    return (sys.executable, "-P", "-m", f"contact_curation.nodes.{name}")
