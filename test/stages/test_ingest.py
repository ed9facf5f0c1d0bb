"""An ingest that dies anywhere loses nothing and doubles nothing."""

from itertools import batched
from pathlib import Path

import numpy as np
import pytest

from contact_curation.motion.pose_stream import FramePose
from contact_curation.stages.ingest import Arrival, IngestJournal
from contact_curation.storage.stores.tosses import TossStore
from test.graph.parts.measured import fresh_ingest, measured_of, tosses_in

MESSAGES = 1000
"""Five or six tosses, one of them with a tracking outlier."""


def arrivals_of(measured: tuple[FramePose, ...]) -> list[Arrival]:
    return [Arrival("/odom", 1000 + k, one) for k, one in enumerate(measured)]


def open_journal(path: Path, configuration: str = "as it is") -> tuple[TossStore, IngestJournal]:
    store = TossStore(path)
    return store, IngestJournal(fresh_ingest(), store, configuration, "/odom")


@pytest.mark.parametrize("seed", range(4))
def test_tosses_are_the_same_however_often_it_dies(golden_bag: Path, tmp_path: Path, seed: int) -> None:
    measured = measured_of(golden_bag)[:MESSAGES]
    draw = np.random.default_rng(seed)
    store, journal = open_journal(tmp_path / "store")
    for batch in batched(arrivals_of(measured), 7):
        # what the publisher sends again is known by its time of publication
        journal.take([one for one in batch if one.published_ns > journal.newest.get("/odom", 0)])
        if draw.random() < 0.2:
            store.close()  # nothing else is done at a death
            store, journal = open_journal(tmp_path / "store")
            assert journal.newest == {"/odom": batch[-1].published_ns}
    kept = [stored.toss for stored in store.after(0, 100)]
    assert [toss.digest() for toss in kept] == [toss.digest() for toss in tosses_in(measured)]
    assert len(kept) > 3
    assert store.last_rejected_sequence == 1
    store.close()


def test_a_batch_that_was_not_finished_leaves_no_trace(
    golden_bag: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    measured = measured_of(golden_bag)[:MESSAGES]
    store, journal = open_journal(tmp_path / "store")
    journal.take(arrivals_of(measured)[:300])
    monkeypatch.setattr(store, "append_poses", lambda poses: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        journal.take(arrivals_of(measured)[300:])
    store.close()
    store, journal = open_journal(tmp_path / "store")
    assert journal.newest == {"/odom": 1299}
    journal.take(arrivals_of(measured)[300:])
    assert [one.toss.digest() for one in store.after(0, 100)] == [toss.digest() for toss in tosses_in(measured)]
    store.close()


def test_what_was_stored_and_not_announced_is_announced_after_a_death(golden_bag: Path, tmp_path: Path) -> None:
    measured = measured_of(golden_bag)[:MESSAGES]
    store, journal = open_journal(tmp_path / "store")
    happened = journal.take(arrivals_of(measured))
    assert len(happened.tosses) >= 2
    journal.announced(happened.tosses[0].sequence, 0)
    store.close()
    store, journal = open_journal(tmp_path / "store")
    missed, _ = journal.unannounced()
    assert [one.sequence for one in missed] == [one.sequence for one in happened.tosses[1:]]
    store.close()


def test_the_state_of_another_configuration_is_not_taken_up(golden_bag: Path, tmp_path: Path) -> None:
    measured = measured_of(golden_bag)[:MESSAGES]
    store, journal = open_journal(tmp_path / "store")
    journal.take(arrivals_of(measured)[:200])
    store.close()
    store, journal = open_journal(tmp_path / "store", "another")
    assert journal.newest == {}
    journal.take(arrivals_of(measured))
    assert [one.toss.digest() for one in store.after(0, 100)] == [toss.digest() for toss in tosses_in(measured)]
    store.close()


def test_another_toss_under_a_known_id_is_a_conflict_and_the_first_stays(golden_bag: Path, tmp_path: Path) -> None:
    measured = measured_of(golden_bag)[:700]
    store, journal = open_journal(tmp_path / "store")
    journal.take(arrivals_of(measured))
    first = store.after(0, 100)[0].toss
    moved = tuple(
        FramePose(
            one.stamp_ns,
            one.parent,
            one.child,
            one.pose._replace(position=(one.pose.position[0] + 1e-6, *one.pose.position[1:])),
            one.static,
        )
        if one.child == "body_cube"
        else one
        for one in measured
    )
    happened = IngestJournal(fresh_ingest(), store, "another", "/odom").take(arrivals_of(moved))
    assert any("other content" in line for line in happened.conflicts)
    assert store.after(0, 100)[0].toss.digest() == first.digest()
    store.close()
