"""A recording replayed through the nodes as processes; what they find is read from their records."""

import os
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

from contact_curation.session.free_domain import graph_domain
from contact_curation.session.graph import graph_environment, node_command
from contact_curation.session.parameter_files import Parameters, write_node_parameters
from contact_curation.session.state import PAGE, FollowedRecord, FollowedTosses
from contact_curation.session.supervisor import Incident, Program, Supervisor
from contact_curation.stages.records import BufferRecord
from contact_curation.storage.stores.information import InformationStore

POLL = 0.2
"""[s] between looks into the stores."""

PATIENCE = 60.0
"""[s] without anything new after which the nodes are stopped."""


@dataclass(frozen=True)
class Recording:
    """What is replayed.

    Attributes:
        bag: the recording.
        rate: how many times faster than it was recorded.
        top: how many tosses are selected.
    """

    bag: Path
    rate: float
    top: int


@dataclass(frozen=True)
class NodesRanking:
    """What the nodes found.

    Attributes:
        selected: ids in the curator's order.
        rejected: reasons by id.
        traces: of the scored tosses by id.
    """

    selected: tuple[str, ...]
    rejected: Mapping[str, tuple[str, ...]]
    traces: Mapping[str, float]


def rank_by_nodes(
    recording: Recording, tosses: int, selected: Sequence[str], logs: Path, folder: Path, say: Callable[[str], None]
) -> NodesRanking:
    """Replays the recording through the nodes until they have found what is expected, or nothing new comes.

    Args:
        recording: what is replayed.
        tosses: how many there are in it, those that the gates reject included.
        selected: those that are expected in the buffer, in its order.
        logs: folder for what the nodes say.
        folder: for their stores.
        say: told one line now and then.

    Raises:
        ProgramFailedError: a node cannot be kept running.
    """
    stores = {name: folder / f"{name}.sqlite" for name in ("pose_ingest", "fisher_scorer", "curator")}
    bag = str(recording.bag.resolve())
    parameters: dict[str, Parameters] = {name: {"store": str(path)} for name, path in stores.items()}
    parameters["pose_ingest"]["rules_of"] = bag
    parameters["curator"]["top"] = recording.top
    parameters["player"] = {"bag": bag, "rate": recording.rate, "wait_for": PATIENCE, "stay": True}
    told = folder / "parameters.yaml"
    write_node_parameters(told, parameters)

    def tell(incident: Incident) -> None:
        if incident.what == "died":  # it is started again, and what it keeps is on disk
            say(f"{incident.program} died ({incident.detail})")

    with ExitStack() as running:
        domain = running.enter_context(graph_domain(os.environ))
        programs = [Program(name, node_command(name, told)) for name in parameters]
        environment = graph_environment(os.environ, logs, domain)
        supervisor = running.enter_context(Supervisor(programs, environment, logs, tell))
        supervisor.start()
        nodes = _Nodes(stores["pose_ingest"], stores["curator"])
        last = nodes.look()
        news = said = time.monotonic()
        while time.monotonic() - news <= PATIENCE:
            supervisor.look()
            time.sleep(POLL)
            found = nodes.look()
            if len(found.traces) + len(found.rejected) >= tosses and found.selected == tuple(selected):
                return found
            if found != last:
                last, news = found, time.monotonic()
                if news - said >= 1.0:
                    said = news
                    say(_line(found))
        return last


class _Nodes:
    """Follows the nodes by what they store.

    Args:
        ingest: store of pose_ingest.
        curator: of the curator.
    """

    def __init__(self, ingest: Path, curator: Path) -> None:
        self._tosses = FollowedTosses(ingest)
        self._buffer = FollowedRecord(curator, BufferRecord(), InformationStore)
        self._curator = curator
        self._traces: dict[str, float] = {}
        self._last = 0

    def look(self) -> NodesRanking:
        """What they have found so far."""
        self._tosses.look()
        if self._curator.exists():
            with InformationStore(self._curator) as informations:
                for one in informations.after(self._last, PAGE):
                    self._traces[one.information.toss_id] = one.information.trace
                    self._last = one.sequence
        return NodesRanking(self._buffer.look().selected, dict(self._tosses.rejected), dict(self._traces))


def _line(found: NodesRanking) -> str:
    """Where they stand."""
    best = f", best {found.selected[0]}" if found.selected else ""
    counts = f"{len(found.traces):4d} scored, {len(found.rejected):3d} rejected, {len(found.selected):3d} in the buffer"
    return counts + best
