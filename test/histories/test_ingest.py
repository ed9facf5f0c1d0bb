"""Poses that come in any portions, at any stamps, and an ingest that dies: its tosses are those of one that lives.

INGEST_HISTORIES says how many histories; the default are a few, always the same.
"""

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from unittest.mock import patch

from contact_curation.motion.pose_stream import FramePose
from contact_curation.motion.toss import NANOSECONDS
from contact_curation.stages.ingest import Arrival, IngestJournal
from contact_curation.storage.stores.tosses import TossStore
from test.graph.parts.measured import fresh_ingest, tosses_in
from test.histories.history import Histories, try_histories
from test.motion.streams import Throw, board_in_map, in_map, stream

IN_MEMORY = Path("/dev/shm")
TOPIC = "/odom"
PAUSE_NS = 5 * NANOSECONDS
SHIFTS_NS = (-3600 * NANOSECONDS, -NANOSECONDS, NANOSECONDS // 2, 3600 * NANOSECONDS)


@cache
def thrown(number: int) -> tuple[FramePose, ...]:
    """The poses of a throw, after those of the throws before it."""
    throw = Throw(velocity=(0.9 - 0.1 * number, 0.3, 0.3), spin=3.0 + number)
    return tuple(in_map(stream(throw, start_ns=(number + 1) * PAUSE_NS)))


class Publisher:
    """Of poses, which sends again whatever its journal does not know to be safe, and perhaps more.

    Args:
        folder: for the journal's store.
    """

    def __init__(self, folder: Path) -> None:
        self._path = folder / "tosses.sqlite"
        self.sent: list[Arrival] = []
        self.taken = 0
        self.later_ns = self.throws = 0
        self.open()
        self.send([board_in_map()])

    def open(self) -> None:
        self.store = TossStore(self._path)
        self.journal = IngestJournal(fresh_ingest(), self.store, "as it is", TOPIC)

    def send(self, measured: list[FramePose]) -> None:
        self.sent += [Arrival(TOPIC, 1000 + len(self.sent) + place, one) for place, one in enumerate(measured)]

    def throw(self) -> None:
        poses = thrown(self.throws % 4)
        self.throws += 1
        self.send([replace(one, stamp_ns=one.stamp_ns + self.later_ns) for one in poses])

    def take(self, count: int) -> None:
        """Some of what was sent arrives."""
        self.journal.take(self.sent[self.taken : self.taken + count])
        self.taken = min(self.taken + count, len(self.sent))

    def die(self, again: int) -> None:
        """It dies, and the publisher sends some once more: what is safe is known by its time of publication."""
        self.store.close()
        self.open()
        safe = self.journal.newest.get(TOPIC, 0)
        assert safe == (self.sent[self.taken - 1].published_ns if self.taken else 0)
        repeated = self.sent[max(self.taken - again, 0) : self.taken]
        assert [one for one in repeated if one.published_ns > safe] == []

    def die_within(self, count: int) -> None:
        """It dies before a batch is permanent, which arrives once more."""
        with patch.object(self.store, "append_poses", side_effect=InterruptedError), suppress(InterruptedError):
            self.journal.take(self.sent[self.taken : self.taken + count])
            self.taken = min(self.taken + count, len(self.sent))  # none of them had to be written down
        self.store.close()
        self.open()

    def set_clock(self, shift_ns: int) -> None:
        """Stamps jump, by themselves or with a pose in the air."""
        self.later_ns += shift_ns

    def finish(self) -> None:
        """All arrives, and the tosses are those that an undisturbed ingest cuts; of two with one id the first."""
        self.take(len(self.sent))
        expected: dict[str, str] = {}
        for toss in tosses_in(tuple(one.measured for one in self.sent if isinstance(one.measured, FramePose))):
            expected.setdefault(toss.toss_id, toss.digest())
        kept = self.store.after(0, 1 << 20)
        assert [(one.toss.toss_id, one.toss.digest()) for one in kept] == list(expected.items())
        assert [one.sequence for one in kept] == list(range(1, len(kept) + 1))
        missed, _ = self.journal.unannounced()
        assert [one.sequence for one in missed] == [one.sequence for one in kept[: len(missed)]]


@contextmanager
def publisher_in_memory() -> Iterator[Publisher]:
    with TemporaryDirectory(dir=IN_MEMORY if IN_MEMORY.is_dir() else None) as folder:
        publisher = Publisher(Path(folder))
        try:
            yield publisher
        finally:
            publisher.store.close()


HISTORIES = Histories(
    publisher_in_memory,
    (),
    (
        ("throw",),
        ("take", range(1, 301)),
        ("die", range(401)),
        ("die_within", range(1, 301)),
        ("set_clock", SHIFTS_NS),
    ),
    length=25,
)


def test_after_any_history_of_an_ingest_its_tosses_are_those_of_one_that_nobody_disturbed() -> None:
    try_histories(HISTORIES, "INGEST_HISTORIES", 20)
