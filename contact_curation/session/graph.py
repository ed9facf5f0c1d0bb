"""The nodes of a session as processes that are kept running, on DDS, in a domain of their own on this machine."""

import os
import sys
from collections.abc import Callable, Mapping
from pathlib import Path

from contact_curation.session.config import SessionFolder
from contact_curation.session.free_domain import VARIABLE
from contact_curation.session.node_parameters import DASHBOARD, RECORDER
from contact_curation.session.parameter_files import Parameters
from contact_curation.session.supervisor import Incident, Patience, Program, Supervisor

OTHER_RANGES = ("ROS_LOCALHOST_ONLY", "ROS_STATIC_PEERS")
"""Variables that would reach beyond this machine, or confuse, when discovery is on it."""

LOOPBACK = Path(__file__).parents[1] / "config" / "loopback.xml"
"""Fast DDS's profile of participants that speak UDP on the loopback interface alone. On its own Fast DDS prefers shared memory,
which a killed process leaves behind with what it had locked, so that others stand still (docs/reliability.md)."""

PROFILES = ("FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE")
"""Variables that name such a file."""

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
    patience: Patience | None = None,
) -> Supervisor:
    """The nodes, not started yet.

    Args:
        parameters: by node; they are in `folder.parameters` already.
        folder: of the session.
        domain: of ROS.
        tell: called with what happens.
        patience: with them.
    """
    programs = [_program(name, folder.parameters) for name in parameters]
    return Supervisor(programs, graph_environment(os.environ, folder.logs, domain), folder.logs, tell, patience)


def graph_environment(own: Mapping[str, str], logs: Path, domain: int | str) -> dict[str, str]:
    """Environment of the nodes: the user's range of discovery where it is set.

    Args:
        own: of this process.
        logs: folder for what ROS logs.
        domain: of ROS.
    """
    environment = {**own, VARIABLE: str(domain)}
    environment.setdefault("ROS_LOG_DIR", str(logs.absolute() / "ros"))
    if "ROS_AUTOMATIC_DISCOVERY_RANGE" not in own:
        environment = {name: value for name, value in environment.items() if name not in OTHER_RANGES}
        environment.update(_this_machine(own))
    return {**SHARED, **environment}


def _this_machine(own: Mapping[str, str]) -> dict[str, str]:
    """What keeps the middleware on this machine.

    With LOCALHOST rmw_fastrtps sets the transports itself, shared memory among them, whatever a profile says. So the profile
    does it, where there is no other one and the middleware is the one that reads it.
    """
    if any(name in own for name in PROFILES) or "fastrtps" not in own.get("RMW_IMPLEMENTATION", "rmw_fastrtps_cpp"):
        return {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    return {"ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET", PROFILES[0]: str(LOOPBACK)}


def _program(name: str, parameters: Path) -> Program:
    listens = name in (DASHBOARD, RECORDER)
    return Program(name, node_command(name, parameters), needed=name != DASHBOARD, stage=LISTENERS if listens else 0)


def node_command(name: str, parameters: Path) -> tuple[str, ...]:
    """The command line of a node whose parameters are in a file."""
    return (sys.executable, "-m", f"contact_curation.nodes.{name}", "--ros-args", "--params-file", str(parameters.absolute()))
