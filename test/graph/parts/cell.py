"""A cell: the whole graph of a recorded session in a namespace, with a seed and stores of its own."""

from typing import NamedTuple

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.session.config import SessionConfig, SessionFolder
from contact_curation.session.node_parameters import session_parameters
from contact_curation.session.state import SessionStores
from contact_curation.storage.stores.information import InformationStore
from contact_curation.storage.stores.tosses import TossStore
from test.graph.parts.graph import Graph

THROWS, TOP = 4, 3
TOPIC = "tagslam/odom/body_cube"
CLOSING = 20.0
"""[s] for a node to end on a busy machine."""

SETTINGS = """
/**/curator: {ros__parameters: {coverage: 1.0}}
/**/trainer: {ros__parameters: {settling_rounds: 1}}
/**/sim_arm: {ros__parameters: {epoch: 1767225600.0}}
/**/throw_designer:
  ros__parameters:
    design.pool: 48
    refinement.generations: 0
    readiness: {least_tosses: 2, most_tosses: 2, largest_loss: 10.0}
    toss_timeout: 120.0
    theta_timeout: 120.0
"""
"""As in the demo: the session depends on neither clock nor load."""


class CellResult(NamedTuple):
    """What a cell has given.

    Attributes:
        throws: as they were commanded and executed, as bytes.
        tosses: frames by id, as bytes.
        rejected: ids of the motions that are no tosses.
        selected: ids, best first.
        version: of the learned parameters that they are ranked at.
    """

    throws: tuple[bytes, ...]
    tosses: dict[str, bytes]
    rejected: tuple[str, ...]
    selected: tuple[str, ...]
    version: str


class Cell:
    """The nodes that `online --record` runs: arm, camera, all stages, dashboard and recorder.

    Args:
        graph: to start them in.
        namespace: of the nodes.
        seed: of everything random.
        run: name of a folder, beside those of other runs.
    """

    def __init__(self, graph: Graph, namespace: str, seed: int, run: str) -> None:
        self._graph = graph
        self.folder = SessionFolder(graph.folder / run / namespace.strip("/"))
        self.folder.make()
        settings = self.folder.root / "settings.yaml"
        settings.write_text(SETTINGS)
        config = SessionConfig(throws=THROWS, top=TOP, seed=seed, rate=0.0, record=self.folder.root, params_file=settings)
        parameters = session_parameters(config, CONTACTNETS_CUBE, self.folder)
        parameters["pose_ingest"]["topic"] = TOPIC
        label = f"{run}_{namespace.strip('/')}"
        self._processes = [
            graph.start(name, {"__ns": namespace}, f"{label}_{name}", **values) for name, values in parameters.items()
        ]
        self._stores = SessionStores(self.folder)

    def is_over(self) -> bool:
        """Whether all throws are made, scored and learned from."""
        state = self._stores.look()
        made = len(state.throws) == THROWS and not (state.awaits_motion or state.awaits_gain)
        return made and state.is_scored and state.is_trained

    def end(self) -> None:
        """Asks the nodes to end; those that listen, last."""
        for processes in (self._processes[:-2], self._processes[-2:]):
            for process in processes:
                process.ask_to_end()
            statuses = [process.wait(CLOSING) for process in processes]
            assert statuses == [0] * len(processes), self._graph.logs()

    def result(self) -> CellResult:
        """What it has given so far."""
        state = self._stores.look()
        with TossStore(self.folder.store("pose_ingest")) as store:
            tosses = {one.toss.toss_id: one.toss.positions.tobytes() for one in store.after(0, 1 << 10)}
        throws = tuple(one.release.tobytes() for made in state.throws for one in (made.commanded, made.executed))
        return CellResult(throws, tosses, tuple(one for one, _ in state.rejected), state.buffer.selected, state.buffer.version)

    def ids_in(self, node: str) -> set[str]:
        """Tosses that the store of a node holds."""
        path = self.folder.store(node)
        if node in ("fisher_scorer", "curator"):
            with InformationStore(path) as informations:
                return {one.information.toss_id for one in informations.after(0, 1 << 10)}
        with TossStore(path) as tosses:
            return {one.toss.toss_id for one in tosses.after(0, 1 << 10)}
