"""A recording replayed through the nodes as processes; what they find is read from their stores, for only nodes know ROS."""

import json
import os
import time
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from contact_curation.errors import ContactCurationError
from contact_curation.session.free_domain import graph_domain
from contact_curation.session.graph import graph_environment, node_command
from contact_curation.session.parameter_files import write_node_parameters
from contact_curation.session.supervisor import Incident, Program, Supervisor
from contact_curation.storage.stores.information import InformationStore
from contact_curation.storage.stores.state import StateStore
from contact_curation.storage.stores.tosses import TossStore

PAGE = 64
"""Records read from a store at a time."""

POLL = 0.2
"""[s] between looks into the stores."""

PATIENCE = 60.0
"""[s] without anything new after which the nodes are stopped."""


class DemoFailedError(ContactCurationError):
    """The demo did not show what it should."""


@dataclass(frozen=True)
class Recording:
    """What is shown.

    Attributes:
        bag: the recording.
        rate: how many times faster than it was recorded.
        top: how many tosses are kept.
    """

    bag: Path
    rate: float
    top: int


@dataclass(frozen=True)
class NodesRanking:
    """What the nodes found.

    Attributes:
        kept: ids in the curator's order.
        rejected: reasons by id.
        traces: of the scored tosses by id.
    """

    kept: list[str]
    rejected: dict[str, list[str]]
    traces: dict[str, float]


def rank_by_nodes(recording: Recording, expected: Sequence[dict[str, Any]], logs: Path, folder: Path) -> NodesRanking:
    """Replays the recording through the nodes until they have found what is expected, or nothing new comes.

    Args:
        recording: what is replayed.
        expected: rows of the library's manifest.
        logs: folder for what the nodes say.
        folder: for their stores.

    Raises:
        ProgramFailedError: a node cannot be kept running.
    """
    stores = {name: folder / f"{name}.sqlite" for name in ("pose_ingest", "fisher_scorer", "curator")}
    parameters: dict[str, dict[str, Any]] = {name: {"store": str(path)} for name, path in stores.items()}
    parameters["pose_ingest"]["rules_of"] = str(recording.bag.resolve())
    parameters["curator"]["top"] = recording.top
    parameters["player"] = {"bag": str(recording.bag.resolve()), "rate": recording.rate, "wait_for": PATIENCE, "stay": True}
    told = folder / "parameters.yaml"
    write_node_parameters(told, parameters)
    programs = [Program(name, node_command(name, told)) for name in parameters]
    with ExitStack() as running:
        domain = running.enter_context(graph_domain(os.environ))
        environment = graph_environment(os.environ, logs, domain)
        supervisor = running.enter_context(Supervisor(programs, environment, logs, _tell))
        supervisor.start()
        watch = _Watch(stores)
        while not watch.finished(expected):
            supervisor.look()
            time.sleep(POLL)
        return watch.found()


def _tell(incident: Incident) -> None:
    """Of a node that died and is started again; what it keeps is on disk."""
    if incident.what == "died":
        print(f"   {incident.program} died ({incident.detail})", flush=True)


class _Watch:
    """Follows the nodes by what they store, and tells of it.

    Args:
        stores: by node.
    """

    def __init__(self, stores: dict[str, Path]) -> None:
        self._stores = stores
        self._rejected: dict[str, list[str]] = {}
        self._traces: dict[str, float] = {}
        self._last_information = 0
        self._last_rejected = 0
        self._kept: list[str] = []
        self._news = self._told = time.monotonic()

    def finished(self, expected: Sequence[dict[str, Any]]) -> bool:
        """Looks into the stores; whether all tosses that the library found have come through, or nothing has for long."""
        if self._look():
            self._news = time.monotonic()
            self._tell()
        elif time.monotonic() - self._news > PATIENCE:
            return True
        through = len(self._traces) + len(self._rejected) >= len(expected)
        return through and self._kept == [row["toss_id"] for row in expected if row["kept"]]

    def found(self) -> NodesRanking:
        return NodesRanking(self._kept, self._rejected, self._traces)

    def _look(self) -> bool:
        """Whether anything is new."""
        before = (len(self._rejected), len(self._traces), self._kept)
        if self._stores["pose_ingest"].exists():
            with TossStore(self._stores["pose_ingest"]) as tosses:
                for stored in tosses.rejected_after(self._last_rejected, PAGE):
                    self._rejected[stored.rejected.toss.toss_id] = list(stored.rejected.reasons)
                    self._last_rejected = stored.sequence
        if self._stores["curator"].exists():
            with InformationStore(self._stores["curator"]) as informations:
                for one in informations.after(self._last_information, PAGE):
                    self._traces[one.information.toss_id] = one.information.trace
                    self._last_information = one.sequence
        state = self._stores["curator"].with_name("curator.sqlite.state")
        if state.exists():
            with StateStore(state) as states:
                self._kept = json.loads(states.load("buffer") or b'{"kept": []}')["kept"]
        return before != (len(self._rejected), len(self._traces), self._kept)

    def _tell(self) -> None:
        """Where it stands, not more than once a second."""
        if time.monotonic() - self._told < 1.0:
            return
        self._told = time.monotonic()
        best = f", best {self._kept[0]}" if self._kept else ""
        print(
            f"   {len(self._traces):4d} scored, {len(self._rejected):3d} kept back, {len(self._kept):3d} in the buffer{best}",
            flush=True,
        )
