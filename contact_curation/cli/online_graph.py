"""The nodes of a session as processes that are kept running, on DDS, in a domain of their own on this machine."""

import os
import sys
from collections.abc import Callable, Mapping
from pathlib import Path

from contact_curation.cli.node_parameters import Parameters
from contact_curation.cli.online_parameters import DASHBOARD, RECORDER, SessionFolder
from contact_curation.cli.supervisor import Incident, Patience, Program, Supervisor

LARGEST_DOMAIN = 101
"""Domains up to this one keep their ports below those that Linux gives out."""

OTHER_RANGES = ("ROS_LOCALHOST_ONLY", "ROS_STATIC_PEERS")
"""Variables that would reach beyond this machine, or confuse, when discovery is on it."""

LISTENERS = 1
"""Stage of the nodes that only listen: they are stopped last, so that they hear how the others end."""

SHARED = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "MALLOC_ARENA_MAX": "2"}
"""Nodes share the machine: threads of one would only wait for each other, and the middleware's many threads would each keep
memory of their own."""


def supervised(
    parameters: Mapping[str, Parameters],
    folder: SessionFolder,
    tell: Callable[[Incident], None],
    patience: Patience | None = None,
) -> Supervisor:
    """The nodes, not started yet.

    Args:
        parameters: by node; they are in `folder.parameters` already.
        folder: of the session.
        tell: called with what happens.
        patience: with them.
    """
    programs = [_program(name, folder.parameters) for name in parameters]
    return Supervisor(programs, graph_environment(os.environ, folder.logs), folder.logs, tell, patience)


def graph_environment(own: Mapping[str, str], logs: Path) -> dict[str, str]:
    """Environment of the nodes: the user's domain and range of discovery where they are set.

    Args:
        own: of this process.
        logs: folder for what ROS logs.
    """
    environment = dict(own)
    environment.setdefault("ROS_DOMAIN_ID", str(os.getpid() % LARGEST_DOMAIN + 1))
    environment.setdefault("ROS_LOG_DIR", str(logs.absolute() / "ros"))
    if "ROS_AUTOMATIC_DISCOVERY_RANGE" not in own:
        environment = {name: value for name, value in environment.items() if name not in OTHER_RANGES}
        environment["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    return {**SHARED, **environment}


def _program(name: str, parameters: Path) -> Program:
    command = (
        sys.executable,
        "-m",
        f"contact_curation.nodes.{name}",
        "--ros-args",
        "--params-file",
        str(parameters.absolute()),
    )
    return Program(name, command, needed=name != DASHBOARD, stage=LISTENERS if name in (DASHBOARD, RECORDER) else 0)
