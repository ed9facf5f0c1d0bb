"""The bag of a running session: can be read at any time, and continued after its writer was killed.

MCAP is written from front to back, so a file that was cut cannot be continued in place. Its content is copied into a new file,
which then takes its name; until then the old file stays. Publishers of latched topics then send their messages again; these are
recognised by their time of publication.
"""

from array import array
from bisect import bisect_left
from pathlib import Path
from types import TracebackType
from typing import Self

from contact_curation.storage.bags.reader import BagReader
from contact_curation.storage.bags.records import OfferedQos, RawMessage
from contact_curation.storage.bags.writer import BagWriter

REMEMBERED = 1 << 20
"""Number of times of publication that are remembered per latched topic; publishers keep fewer messages."""


class SessionBag:
    """Records messages; use it as a context manager.

    Args:
        path: `*.mcap`; an existing bag is continued.

    Raises:
        InvalidValueError: `path` cannot be written, or another process writes it.
        UnreadableInputError: the existing file is not a bag.
    """

    def __init__(self, path: Path) -> None:
        self._known: dict[str, _Recent] = {}
        self.written = 0
        self.losses: tuple[str, ...] = ()
        self._writer = BagWriter(path, over_readers=True)
        try:
            if path.exists():
                self._copy(path)
            self._writer.appear()
        except BaseException:
            self._writer.discard()
            raise

    def write(self, message: RawMessage, qos: OfferedQos) -> bool:
        """Adds a message byte for byte; returns False for a message of a latched topic that the bag contains already."""
        if qos.latched and not self._known.setdefault(message.topic, _Recent()).add(message.publish_time_ns):
            return False
        self._writer.write_raw(
            message.topic,
            message.type,
            message.schema,
            message.data,
            message.log_time_ns,
            qos=qos,
            schema_encoding=message.schema_encoding,
            type_hash=message.type_hash,
            publish_time_ns=message.publish_time_ns,
        )
        self.written += 1
        return True

    def flush(self) -> None:
        """Passes what was written to the operating system, so that it survives a kill of this process."""
        self._writer.flush()

    def close(self) -> None:
        """Completes the bag with its index."""
        self._writer.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()

    def _copy(self, path: Path) -> None:
        with BagReader(path) as before:
            offered = {info.name: before.qos(info.name) for info in before.topics}
            for message in before.raw_messages():
                self.write(message, offered[message.topic])
            self.losses = before.losses


class _Recent:
    """The newest times of publication on a topic, sorted; eight bytes each, because a session may run for days."""

    def __init__(self) -> None:
        self._times = array("q")

    def add(self, time_ns: int) -> bool:
        """Adds a time [ns]; returns whether it is new."""
        place = bisect_left(self._times, time_ns)
        if self._times[place : place + 1] == array("q", (time_ns,)):
            return False
        self._times.insert(place, time_ns)
        if len(self._times) > 2 * REMEMBERED:
            del self._times[:REMEMBERED]
        return True
