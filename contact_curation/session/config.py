"""What is asked of a session, and where its things lie."""

from dataclasses import dataclass
from pathlib import Path

from contact_curation.contact.body import CONTACTNETS_CUBE, Body
from contact_curation.errors import InvalidValueError

CAMERAS = ("poses", "rendered")


@dataclass(frozen=True)
class SessionConfig:
    """What is asked for; None where it is left to the nodes.

    Attributes:
        throws: ends after so many; 0: goes on.
        camera: what the simulated camera tells.
        dashboard: whether it is served.
        stay: whether the dashboard is served until Ctrl-C, when the throws are over.
        record: folder that keeps the session; None for none.
        body_file: describes the body; None for ContactNets' cube.
        top: how many tosses are selected.
        criterion: by which.
        seed: of all that is random.
        rate: simulated seconds a second; 0: as fast as possible.
        held_out: recordings that the model is evaluated on.
        params_file: parameters of the nodes.
    """

    throws: int = 0
    camera: str = CAMERAS[0]
    dashboard: bool = False
    stay: bool = False
    record: Path | None = None
    body_file: Path | None = None
    top: int | None = None
    criterion: str | None = None
    seed: int | None = None
    rate: float | None = None
    held_out: tuple[Path, ...] = ()
    params_file: Path | None = None

    @property
    def rendered(self) -> bool:
        """Whether images are rendered, and the tags in them detected."""
        return self.camera == "rendered"

    def body(self) -> Body:
        """The body that is thrown.

        Raises:
            ContactCurationError: the file describes none.
        """
        return Body.from_file(self.body_file) if self.body_file else CONTACTNETS_CUBE


class SessionFolder:
    """Where the things of a session lie.

    Args:
        root: the folder; made when there is none.
    """

    def __init__(self, root: Path) -> None:
        self.root = root
        self.bag = root / "session.mcap"
        self.recording = root / "session.rrd"
        self.checkpoint = root / "checkpoint.safetensors"
        self.manifest = root / "manifest.parquet"
        self.events = root / "events.jsonl"
        self.summary = root / "session.json"
        self.report = root / "report.html"
        self.parameters = root / "parameters.yaml"
        self.tag_map = root / "tag_map.yaml"
        self.logs = root / "logs"
        self.stores = root / "stores"
        self.figures = root / "figures"
        self.ranking_figure = self.figures / "ranking.png"
        self.dashboard = self.stores / "dashboard.json"

    def store(self, node: str) -> Path:
        """The store of a node."""
        return self.stores / f"{node}.sqlite"

    def make(self) -> None:
        """Makes the folders.

        Raises:
            InvalidValueError: there is a session already, or they cannot be made.
        """
        if self.events.exists() or self.bag.exists():
            raise InvalidValueError("--record", self.root, "a folder without a session in it")
        try:
            for folder in (self.logs, self.stores, self.figures):
                folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InvalidValueError("--record", self.root, f"a folder that can be made ({error.strerror})") from error
