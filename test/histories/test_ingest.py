"""Poses that come in any portions, at any stamps, and an ingest that dies: its tosses are those of one that lives.

INGEST_HISTORIES says how many histories; the default are a few, always the same.
"""

from contextlib import suppress
from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from unittest.mock import patch

from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, rule, run_state_machine_as_test

from contact_curation.motion.pose_stream import FramePose
from contact_curation.motion.toss import NANOSECONDS
from contact_curation.stages.ingest import Arrival, IngestJournal
from contact_curation.storage.stores.tosses import TossStore
from test.graph.parts.measured import fresh_ingest, tosses_in
from test.histories.asked import histories
from test.motion.streams import Throw, board_in_map, in_map, stream

SETTINGS = histories("INGEST_HISTORIES", 20, 25)
IN_MEMORY = Path("/dev/shm")
TOPIC = "/odom"
PAUSE_NS = 5 * NANOSECONDS
SHIFTS_NS = (-3600 * NANOSECONDS, -NANOSECONDS, NANOSECONDS // 2, 3600 * NANOSECONDS)


@cache
def thrown(number: int) -> tuple[FramePose, ...]:
    """The poses of a throw, after those of the throws before it."""
    throw = Throw(velocity=(0.9 - 0.1 * number, 0.3, 0.3), spin=3.0 + number)
    return tuple(in_map(stream(throw, start_ns=(number + 1) * PAUSE_NS)))


class Histories(RuleBasedStateMachine):
    """What may happen to a journal; a publisher sends again whatever is not known to be safe, and perhaps more."""

    @initialize()
    def begin(self) -> None:
        self.folder = TemporaryDirectory(dir=IN_MEMORY if IN_MEMORY.is_dir() else None)
        self.sent: list[Arrival] = []
        self.taken = 0
        self.later_ns = self.throws = 0
        self.sound = True
        self.open()
        self.send([board_in_map()])

    def open(self) -> None:
        self.store = TossStore(Path(self.folder.name) / "tosses.sqlite")
        self.journal = IngestJournal(fresh_ingest(), self.store, "as it is", TOPIC)

    def send(self, measured: list[FramePose]) -> None:
        self.sent += [Arrival(TOPIC, 1000 + len(self.sent) + place, one) for place, one in enumerate(measured)]

    @rule()
    def throw(self) -> None:
        poses = thrown(self.throws % 4)
        self.throws += 1
        self.send([replace(one, stamp_ns=one.stamp_ns + self.later_ns) for one in poses])

    @rule(count=st.integers(1, 300))
    def take(self, count: int) -> None:
        """Some of what was sent arrives."""
        self.sound = False
        self.journal.take(self.sent[self.taken : self.taken + count])
        self.taken = min(self.taken + count, len(self.sent))
        self.sound = True

    @rule(again=st.integers(0, 400))
    def die(self, again: int) -> None:
        """It dies, and the publisher sends some once more: what is safe is known by its time of publication."""
        self.sound = False
        self.store.close()
        self.open()
        safe = self.journal.newest.get(TOPIC, 0)
        assert safe == (self.sent[self.taken - 1].published_ns if self.taken else 0)
        repeated = self.sent[max(self.taken - again, 0) : self.taken]
        assert [one for one in repeated if one.published_ns > safe] == []
        self.sound = True

    @rule(count=st.integers(1, 300))
    def die_within(self, count: int) -> None:
        """It dies before a batch is permanent, which arrives once more."""
        self.sound = False
        with patch.object(self.store, "append_poses", side_effect=InterruptedError), suppress(InterruptedError):
            self.journal.take(self.sent[self.taken : self.taken + count])
            self.taken = min(self.taken + count, len(self.sent))  # none of them had to be written down
        self.store.close()
        self.open()
        self.sound = True

    @rule(shift=st.sampled_from(SHIFTS_NS))
    def set_clock(self, shift: int) -> None:
        """Stamps jump, by themselves or with a pose in the air."""
        self.later_ns += shift

    def teardown(self) -> None:
        try:
            if self.sound:
                self.take(len(self.sent))
                self.check()
        finally:
            self.store.close()
            self.folder.cleanup()

    def check(self) -> None:
        """What one that nobody disturbed cuts of the same poses; of two tosses with one id the first."""
        expected: dict[str, str] = {}
        for toss in tosses_in(tuple(one.measured for one in self.sent if isinstance(one.measured, FramePose))):
            expected.setdefault(toss.toss_id, toss.digest())
        kept = self.store.after(0, 1 << 20)
        assert [(one.toss.toss_id, one.toss.digest()) for one in kept] == list(expected.items())
        assert [one.sequence for one in kept] == list(range(1, len(kept) + 1))
        missed, _ = self.journal.unannounced()
        assert [one.sequence for one in missed] == [one.sequence for one in kept[: len(missed)]]


def test_after_any_history_of_an_ingest_its_tosses_are_those_of_one_that_nobody_disturbed() -> None:
    run_state_machine_as_test(Histories, settings=SETTINGS)
