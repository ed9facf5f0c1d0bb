"""The state of a session: the records of its stages, read from their stores.

A stage stores before it announces, so that what is read here is never ahead of what a restarted one would know.
"""

from dataclasses import dataclass
from pathlib import Path

from contact_curation.session.config import SessionFolder
from contact_curation.stages.records import (
    BufferRecord,
    ServedDashboard,
    ThrowLogRecord,
    ThrowRecord,
    TrainingRecord,
    read_record,
    record_of,
)
from contact_curation.storage.stores.information import InformationStore
from contact_curation.storage.stores.state import StateStore
from contact_curation.storage.stores.tosses import TossStore

PAGE = 64
"""Records read from a store at a time."""


@dataclass(frozen=True)
class SessionState:
    """The state of a session.

    Attributes:
        throws: that were made, in order.
        no_throw: why the designer has commanded none since; empty where that is not why.
        tosses: ids of those that passed the gates.
        rejected: reasons by id, of the motions that did not.
        buffer: as published last.
        ranked: how many tosses the curator knows at the buffer's theta.
        scored: how many the scorer does.
        training: where the trainer is.
        dashboard: address that it is served at; empty where it is not, or not yet.
    """

    throws: tuple[ThrowRecord, ...] = ()
    no_throw: str = ""
    tosses: tuple[str, ...] = ()
    rejected: tuple[tuple[str, tuple[str, ...]], ...] = ()
    buffer: BufferRecord = BufferRecord()  # noqa: RUF009  (frozen)
    ranked: int = 0
    scored: int = 0
    training: TrainingRecord = TrainingRecord()  # noqa: RUF009  (frozen)
    dashboard: str = ""

    @property
    def awaits_motion(self) -> bool:
        """Whether nothing has come of the last throw so far; with earlier ones nobody waits."""
        return bool(self.throws) and self.throws[-1].awaits_motion

    @property
    def awaits_gain(self) -> bool:
        """Whether the last throw's toss was scored, and its gain is not known so far."""
        return bool(self.throws) and self.throws[-1].awaits_gain

    @property
    def is_scored(self) -> bool:
        """Whether every toss was scored at one theta, and the buffer was selected from all of them."""
        return self.scored == self.ranked == self.buffer.seen == len(self.tosses)

    @property
    def is_trained(self) -> bool:
        """Whether nothing is left to train on of this buffer, and it is ranked at the theta that was trained last."""
        training, buffer = self.training, self.buffer
        considered = (training.revision, training.tosses_seen) == (buffer.revision, buffer.seen)
        return considered and not training.running and training.version in ("", buffer.version)


class SessionStores:
    """Follows the stores of a session; what does not change is read once.

    Args:
        folder: of the session.
    """

    def __init__(self, folder: SessionFolder) -> None:
        self._folder = folder
        self._tosses = FollowedTosses(folder.store("pose_ingest"))
        self._throws = FollowedRecord(folder.store("throw_designer"), ThrowLogRecord())
        self._buffer = FollowedRecord(folder.store("curator"), BufferRecord(), InformationStore)
        self._training = FollowedRecord(folder.store("trainer"), TrainingRecord(), TossStore)
        self._dashboard = ""

    def look(self) -> SessionState:
        """Where it is now.

        Raises:
            UnreadableInputError: a file is not what its node writes.
        """
        self._tosses.look()
        throws, buffer = self._throws.look(), self._buffer.look()
        return SessionState(
            throws=throws.made,
            no_throw=throws.no_throw,
            tosses=tuple(self._tosses.ids),
            rejected=tuple(self._tosses.rejected.items()),
            buffer=buffer,
            ranked=_count(self._folder.store("curator"), buffer.version),
            scored=_count(self._folder.store("fisher_scorer"), buffer.version),
            training=self._training.look(),
            dashboard=self._address(),
        )

    def _address(self) -> str:
        served = None if self._dashboard else read_record(self._folder.dashboard, ServedDashboard)
        self._dashboard = self._dashboard if served is None else served.address
        return self._dashboard


class FollowedRecord[R]:
    """The newest record of a kind in a store that may not be there yet; the same object until it changes.

    Args:
        path: of the store.
        default: until there is one.
        store: of which kind the store is.
    """

    def __init__(self, path: Path, default: R, store: type[StateStore | TossStore | InformationStore] = StateStore) -> None:
        self._path, self._store = path, store
        self._record, self._data = default, b""

    def look(self) -> R:
        """The newest.

        Raises:
            UnreadableInputError: it is none.
        """
        kind = type(self._record)
        if not self._path.exists():
            return self._record
        with self._store(self._path) as store:
            data = store.states.load(kind.KEY)  # type: ignore[attr-defined]
        if data is not None and data != self._data:
            self._record, self._data = record_of(kind, data, self._path), data
        return self._record


class FollowedTosses:
    """The tosses of a store that may not be there yet.

    Args:
        path: of the store.

    Attributes:
        ids: of those that passed the gates.
        rejected: reasons by id, of the motions that did not.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._last_toss = self._last_rejected = 0
        self.ids: list[str] = []
        self.rejected: dict[str, tuple[str, ...]] = {}

    def look(self) -> None:
        """Reads what is new."""
        if not self._path.exists():
            return
        with TossStore(self._path) as store:
            while page := store.after(self._last_toss, PAGE):
                self.ids += [one.toss.toss_id for one in page]
                self._last_toss = page[-1].sequence
            while rejected := store.rejected_after(self._last_rejected, PAGE):
                self.rejected |= {one.rejected.toss.toss_id: tuple(one.rejected.reasons) for one in rejected}
                self._last_rejected = rejected[-1].sequence


def _count(path: Path, version: str) -> int:
    """Records at a theta."""
    if not version or not path.exists():
        return 0
    with InformationStore(path) as store:
        return store.count(version)
