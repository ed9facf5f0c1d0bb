"""Ingest that can be interrupted at any time: measurements and the tosses from them are stored in one transaction.

Measurements are written down in small batches, with the tosses they completed, in one transaction. After a kill the last saved
state is restored and the measurements since then are taken in again, which gives the same state, bit for bit. What the
publisher sends once more is known by its time of publication and skipped.
"""

import hashlib
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from contact_curation.errors import InvalidValueError
from contact_curation.geometry.scalars import ScalarPose
from contact_curation.motion.ingest import IngestEvent, TossIngest
from contact_curation.motion.pose_stream import BadPose, FramePose
from contact_curation.motion.toss import NANOSECONDS, Rejected, Toss
from contact_curation.stages.records import AnnouncedTosses, IngestPosition, IngestSnapshot, load_record, stored_records
from contact_curation.storage.provenance import TossProvenance
from contact_curation.storage.stores.tosses import JournalPose, StoredRejected, StoredToss, TossStore

JOURNAL_LENGTH = 512
"""Measurements after which the state is saved and the journal emptied, at the next one that is of no toss and ends none. A
state of more poses is saved after as many measurements as it has poses, or to save it takes longer than they take to come."""

LONGEST_JOURNAL = 8192
"""The same, toss or not."""

MOST_AHEAD_NS = 1_000_000_000
"""Of the present; what is known to a later time was published by a clock that has been set back since."""

PAGE = 64


class Arrival(NamedTuple):
    """A measurement as it arrived.

    Attributes:
        topic: that it came on.
        published_ns: when it was published, by the middleware's clock.
        measured: what it says.
    """

    topic: str
    published_ns: int
    measured: FramePose | BadPose


class Happened(NamedTuple):
    """The tosses and rejected motions from a batch of measurements.

    Attributes:
        bad: measurements that could not be used.
        tosses: new in the store.
        rejected: new in the store.
        conflicts: what the store refused: another toss is there under the same id.
    """

    bad: tuple[BadPose, ...]
    tosses: tuple[StoredToss, ...]
    rejected: tuple[StoredRejected, ...]
    conflicts: tuple[str, ...]


def published_before(newest: Mapping[str, int], now_ns: int) -> tuple[dict[str, int], str]:
    """Of times of publication those that are not ahead of the present, and a warning where a clock was set back since."""
    past = {topic: published_ns for topic, published_ns in newest.items() if published_ns <= now_ns + MOST_AHEAD_NS}
    ahead = (max(newest.values(), default=0) - now_ns) / NANOSECONDS
    warning = f"the clock was set back: found poses published {ahead:.0f} s ahead; all that comes is new"
    return past, "" if len(past) == len(newest) else warning


class IngestJournal:
    """A `TossIngest` and the store that it continues from.

    Args:
        ingest: fresh.
        store: with the state of an earlier run, if there was one.
        configuration: everything the ingest was made of, in words; the state of another configuration is not taken up.
        topic: with the body's poses, for the tosses' provenance.

    Attributes:
        others: how many tosses the store holds, where the last run had another configuration; else 0.
    """

    def __init__(self, ingest: TossIngest, store: TossStore, configuration: str, topic: str) -> None:
        self._ingest = ingest
        self._store = store
        self._configuration = hashlib.sha256(configuration.encode()).hexdigest()
        self._provenance = TossProvenance(topic=topic)
        self._newest: dict[str, int] = {}
        self._journaled = 0
        self._saved = 0
        self._last = 0
        self.others = 0
        self._restore()
        store.reach_disk()  # what was stored and not announced will be

    @property
    def newest(self) -> dict[str, int]:
        """Per topic the time of publication of the newest measurement that is safe [ns]."""
        return dict(self._newest)

    def take(self, arrivals: Sequence[Arrival]) -> Happened:
        """Takes in measurements; when it returns, they and what came of them are permanent.

        Whoever hears of a toss relies on it, and nobody can make it again: it is on the disk before anybody does.
        """
        events: list[IngestEvent] = []
        before = self._ingest.needed_frames
        with self._store.transaction():
            for arrival in arrivals:
                self._newest[arrival.topic] = arrival.published_ns
                events += self._ingest.push(arrival.measured)
            needed = self._ingest.needed_frames
            measured = [one.measured for one in arrivals if isinstance(one.measured, FramePose)]
            self._write_down([one for one in measured if one.static or one.child in needed])
            happened = self._stored(events)
            ended = bool(happened.tosses or happened.rejected)  # whoever waits for these waits for no snapshot
            longest = LONGEST_JOURNAL if ended or self._ingest.tossing else JOURNAL_LENGTH
            if needed != before or self._journaled >= max(longest, self._saved):
                self._save()  # if needed: the state has what these frames did before they were needed
        if ended:
            self._store.reach_disk()
        return happened

    def expected(self) -> Toss | None:
        """The toss that the next measurement completes, but for its last velocities and the gates; None while there is none."""
        return self._ingest.expected()

    def nearing_end(self) -> Toss | None:
        """The toss so far, once, when the body has rested for half the time that ends a toss; else None."""
        return self._ingest.nearing_end()

    def sync_ahead(self) -> None:
        """Brings to the disk what is stored so far, so that little waits for it when the expected toss is complete."""
        self._store.reach_disk()

    def unannounced(self) -> tuple[tuple[StoredToss, ...], tuple[StoredRejected, ...]]:
        """A page of what is stored and was perhaps never announced, because of a kill."""
        known = self._announced()
        return self._store.after(known.tosses, PAGE), self._store.rejected_after(known.rejected, PAGE)

    def announced(self, tosses: int, rejected: int) -> None:
        """Remembers up to which sequence numbers everything was announced."""
        known = self._announced()
        self._keep(AnnouncedTosses(max(known.tosses, tosses), max(known.rejected, rejected)))

    def _announced(self) -> AnnouncedTosses:
        return load_record(self._store.states.load, AnnouncedTosses) or AnnouncedTosses()

    def _keep(self, record: AnnouncedTosses | IngestPosition | IngestSnapshot) -> None:
        self._store.states.save(stored_records(record))

    def _write_down(self, poses: Sequence[FramePose]) -> None:
        if poses:
            self._last = self._store.append_poses([_journal_pose(pose) for pose in poses])
            self._journaled += len(poses)
        self._keep(IngestPosition(self._configuration, self._newest))

    def _save(self) -> None:
        self._keep(IngestSnapshot(self._configuration, self._last, self._ingest.snapshot()))
        self._store.trim_poses(self._last)
        self._journaled, self._saved = 0, self._ingest.size

    def _restore(self) -> None:
        """Takes up where an earlier run stopped; the tosses that come out once more are in the store already."""
        position = load_record(self._store.states.load, IngestPosition)
        if position is None or position.configuration != self._configuration:
            self.others = 0 if position is None else self._store.last_sequence
            self._forget()
            return
        self._newest = dict(position.newest)
        snapshot = load_record(self._store.states.load, IngestSnapshot)
        if snapshot is not None and snapshot.configuration == self._configuration:
            self._ingest.restore(dict(snapshot.ingest))
            self._last = snapshot.after
        for sequence, pose in self._store.poses_since(self._last):
            self._ingest.push(_frame_pose(pose))
            self._last, self._journaled = sequence, self._journaled + 1

    def _forget(self) -> None:
        journal = self._store.poses_since()
        if journal:
            self._store.trim_poses(journal[-1][0])
            self._last = journal[-1][0]

    def _stored(self, events: Sequence[IngestEvent]) -> Happened:
        tosses: list[StoredToss] = []
        rejected: list[StoredRejected] = []
        conflicts: list[str] = []
        provenance = self._provenance
        for event in events:
            try:
                if isinstance(event, Toss):
                    sequence, new = self._store.add(event, provenance=provenance)
                    tosses += [StoredToss(sequence, event, provenance)] * new
                elif isinstance(event, Rejected):
                    sequence, new = self._store.add_rejected(event, provenance=provenance)
                    rejected += [StoredRejected(sequence, event, provenance)] * new
            except InvalidValueError as error:
                conflicts.append(str(error))
        bad = tuple(event for event in events if isinstance(event, BadPose))
        return Happened(bad, tuple(tosses), tuple(rejected), tuple(conflicts))


def _journal_pose(pose: FramePose) -> JournalPose:
    return JournalPose(pose.stamp_ns, pose.parent, pose.child, pose.pose.position, pose.pose.orientation_wxyz, pose.static)


def _frame_pose(pose: JournalPose) -> FramePose:
    return FramePose(pose.stamp_ns, pose.parent, pose.child, ScalarPose(pose.position, pose.orientation_wxyz), pose.static)
