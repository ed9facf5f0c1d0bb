"""What is asked of a session, and where its things lie."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from math import inf
from pathlib import Path

from contact_curation.contact.body import CONTACTNETS_CUBE, Body
from contact_curation.errors import InvalidValueError, UnknownNameError
from contact_curation.files import lock

CAMERAS = ("poses", "rendered")


@dataclass(frozen=True)
class SessionConfig:
    """What is asked for; None where it is left to the nodes.

    Attributes:
        throws: end after so many throws (default: go on until Ctrl-C).
        camera: what the simulated camera sends: tracked poses, or images with tags.
        dashboard: serve the dashboard to a browser; its address is printed.
        stay: serve the dashboard until Ctrl-C, also when the throws are over.
        record: keep the session in this folder: bag, model, report, logs.
        resume: go on with the session that is in the folder of --record.
        body_file: describes the body; None for ContactNets' cube.
        top: how many tosses are selected (default 32).
        criterion: by what the best tosses are selected (default representative).
        seed: of everything random (default 0).
        rate: simulated seconds per second; 0: as fast as possible (default 1).
        evaluate_on: recordings that are never trained on, to evaluate the model on (default none).
        params_file: parameters of the nodes, a file like contact_curation/config/nodes.yaml.
    """

    throws: int | None = None
    camera: str = CAMERAS[0]
    dashboard: bool = False
    stay: bool = False
    record: Path | None = None
    resume: bool = False
    body_file: Path | None = None
    top: int | None = None
    criterion: str | None = None
    seed: int | None = None
    rate: float | None = None
    evaluate_on: tuple[Path, ...] = ()
    params_file: Path | None = None

    def __post_init__(self) -> None:
        least = {"throws": (self.throws, 1), "top": (self.top, 1), "seed": (self.seed, 0)}
        for name, (value, bound) in least.items():
            if value is not None and value < bound:
                raise InvalidValueError(name, value, f"a whole number of at least {bound}")
        if self.rate is not None and not 0.0 <= self.rate < inf:
            raise InvalidValueError("rate", self.rate, "a number of at least 0")
        if self.camera not in CAMERAS:
            raise UnknownNameError("camera", self.camera, CAMERAS)
        if self.resume and self.record is None:
            raise InvalidValueError("resume", "no --record DIR", "the folder of the session that is to go on")

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

    def make(self, *, resume: bool = False) -> None:
        """Makes the folders.

        Args:
            resume: whether they hold a session that goes on.

        Raises:
            InvalidValueError: there is a session already, or none to go on with, or they cannot be made.
        """
        if resume and not self.events.exists():
            raise InvalidValueError("--record", self.root, "a folder with a session in it, for --resume goes on with one")
        if not resume and (self.events.exists() or self.bag.exists()):
            expected = "a folder without a session in it: name a new one, or remove that, or go on with it (--resume)"
            raise InvalidValueError("--record", self.root, expected)
        try:
            for folder in (self.logs, self.stores, self.figures):
                folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InvalidValueError("--record", self.root, f"a folder that can be made ({error.strerror})") from error

    @contextmanager
    def claimed(self) -> Iterator[None]:
        """Makes this process the only one that runs a session in the folder.

        Raises:
            InvalidValueError: another one does.
        """
        descriptor = os.open(self.root, os.O_RDONLY)
        if not lock(descriptor):
            os.close(descriptor)
            running = f"{self.root}, in which a session is running"
            raise InvalidValueError("--record", running, "a new folder, or that of a session that has ended")
        try:
            yield
        finally:
            os.close(descriptor)
