"""Where a session stands, read from what its nodes keep on disk: the command line knows no ROS.

A node stores before it announces, so that what is read here is never ahead of what a restarted node would know.
"""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from contact_curation.contact.body import Body
from contact_curation.errors import UnreadableInputError
from contact_curation.files import read_bounded
from contact_curation.learning.checkpoints.safetensors_bytes import LARGEST_BYTES, unpack
from contact_curation.session.node_settings import SessionFolder
from contact_curation.storage.stores.information import InformationStore
from contact_curation.storage.stores.state import StateStore
from contact_curation.storage.stores.tosses import TossStore

PAGE = 64
"""Records read from a store at a time."""


@dataclass(frozen=True)
class ThrowMade:
    """A throw that the designer had made.

    Attributes:
        throw_id: its name.
        warm_up: why it was no designed one; None when it was.
        after_ns: its toss ends later than this.
        toss_id: its toss; empty until it was scored.
        planned: gain in log-det; None in warm-up.
        realised: gain of its toss; None until it is known, and in warm-up.
    """

    throw_id: str
    warm_up: str | None
    after_ns: int
    toss_id: str
    planned: float | None
    realised: float | None


@dataclass(frozen=True)
class KeptBack:
    """A motion that the gates rejected.

    Attributes:
        toss_id: unique.
        reasons: at least one.
        last_ns: stamp of its last frame.
    """

    toss_id: str
    reasons: tuple[str, ...]
    last_ns: int


@dataclass(frozen=True)
class Training:
    """Where the trainer is.

    Attributes:
        running: whether it is in the middle of a round.
        round: number of the round, from 1.
        tosses_seen: by the curator when the round began.
        settling: how many rounds since a toss was new.
        toss_ids: that it trains on.
        gradient_steps: taken so far.
    """

    running: bool
    round: int
    tosses_seen: int
    settling: int
    toss_ids: tuple[str, ...]
    gradient_steps: int


@dataclass(frozen=True)
class Standing:
    """Where a session is.

    Attributes:
        throws: that were made, in order.
        tosses: ids of those that passed the gates.
        kept_back: motions that did not.
        kept: ids of the buffer, best first.
        version: of the theta that the buffer is ranked at; empty without one.
        ranked: how many tosses the curator knows at that theta.
        scored: how many the scorer does.
        training: None before the first round.
    """

    throws: tuple[ThrowMade, ...] = ()
    tosses: tuple[str, ...] = ()
    kept_back: tuple[KeptBack, ...] = ()
    kept: tuple[str, ...] = ()
    version: str = ""
    ranked: int = 0
    scored: int = 0
    training: Training | None = None


class SessionStores:
    """Follows the stores of a session; what does not change is read once.

    Args:
        folder: of the session.
        body: that is thrown.
    """

    def __init__(self, folder: SessionFolder, body: Body) -> None:
        self._folder = folder
        self._body = body
        self._tosses: list[str] = []
        self._kept_back: list[KeptBack] = []
        self._last_toss = self._last_kept_back = 0

    def look(self) -> Standing:
        """Where it is now.

        Raises:
            UnreadableInputError: a file is not what its node writes.
        """
        self._look_for_tosses()
        kept, version = self._buffer()
        return Standing(
            throws=self._throws(),
            tosses=tuple(self._tosses),
            kept_back=tuple(self._kept_back),
            kept=kept,
            version=version,
            ranked=_count(self._folder.store("curator"), version),
            scored=_count(self._folder.store("fisher_scorer"), version),
            training=self._training(),
        )

    def trained_version(self) -> str:
        """Of the theta in the checkpoint; empty without one. Takes a second the first time, to import torch."""
        if not self._folder.checkpoint.exists():
            return ""
        from contact_curation.information.model_version import model_version
        from contact_curation.storage.checkpoint_file import read_model

        return model_version(read_model(self._folder.checkpoint, self._body))

    def _look_for_tosses(self) -> None:
        path = self._folder.store("pose_ingest")
        if not path.exists():
            return
        with TossStore(path) as store:
            while page := store.after(self._last_toss, PAGE):
                self._tosses += [one.toss.toss_id for one in page]
                self._last_toss = page[-1].sequence
            while rejected := store.rejected_after(self._last_kept_back, PAGE):
                for one in rejected:
                    toss, reasons = one.rejected.toss, one.rejected.reasons
                    self._kept_back.append(KeptBack(toss.toss_id, tuple(reasons), int(toss.stamps_ns[-1])))
                self._last_kept_back = rejected[-1].sequence

    def _throws(self) -> tuple[ThrowMade, ...]:
        return tuple(_throw(entry) for entry in _state(self._folder.store("throw_designer"), "throws", []))

    def _buffer(self) -> tuple[tuple[str, ...], str]:
        """Kept ids and the theta they are ranked at."""
        buffer = _state(_beside(self._folder.store("curator")), "buffer", {"kept": [], "version": ""})
        return tuple(buffer["kept"]), str(buffer["version"])

    def _training(self) -> Training | None:
        path = self._folder.checkpoint
        if not path.exists():
            return None
        documents = unpack(read_bounded(path, LARGEST_BYTES, "a checkpoint"), path).documents
        try:
            counters, told = documents["training"]["counters"], json.loads(documents["notes"]["round"])
            return Training(
                running=counters["state"] == "running",
                round=int(told["number"]),
                tosses_seen=int(told["tosses_seen"]),
                settling=int(told["settling"]),
                toss_ids=tuple(told["toss_ids"]),
                gradient_steps=int(counters["gradient_steps"]),
            )
        except (KeyError, TypeError, ValueError) as error:
            raise UnreadableInputError(path, f"found no round in it ({error!r}), expected a trainer's checkpoint") from error


def _throw(entry: dict[str, Any]) -> ThrowMade:
    realised, warm_up = entry["realised"], entry.get("warm_up")
    planned = realised["planned"] if realised else float(entry["commanded"]["expected_information"])
    return ThrowMade(
        throw_id=str(entry["commanded"]["throw_id"]),
        warm_up=warm_up,
        after_ns=int(entry["after_ns"]),
        toss_id=str(entry["toss_id"]),
        planned=None if warm_up else float(planned),
        realised=float(realised["realised"]) if realised else None,
    )


def _state(path: Path, key: str, default: Any) -> Any:
    """A JSON document of a state store that may not be there yet."""
    if not path.exists():
        return default
    with StateStore(path) as store:
        value = store.load(key)
    return default if value is None else json.loads(value)


def _count(path: Path, version: str) -> int:
    """Records at a theta."""
    if not version or not path.exists():
        return 0
    with InformationStore(path) as store:
        return store.count(version)


def _beside(path: Path) -> Path:
    """The state store beside a store."""
    return path.with_name(f"{path.name}.state")
