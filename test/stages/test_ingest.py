"""An ingest that dies anywhere loses nothing and doubles nothing."""

from dataclasses import replace
from itertools import batched, pairwise
from pathlib import Path

import numpy as np
import pytest

from contact_curation.geometry.scalars import IDENTITY, ScalarPose
from contact_curation.motion.ingest import TossIngest
from contact_curation.motion.pose_stream import FramePose
from contact_curation.stages.ingest import Arrival, IngestJournal
from contact_curation.stages.records import IngestSnapshot, load_record
from contact_curation.storage.stores.tosses import TossStore
from test.graph.parts.measured import fresh_ingest, measured_of, tosses_in
from test.lost_machine import Disk

MESSAGES = 1000
"""Five or six tosses, one of them with a tracking outlier."""


def arrivals_of(measured: tuple[FramePose, ...]) -> list[Arrival]:
    return [Arrival("/odom", 1000 + k, one) for k, one in enumerate(measured)]


def open_journal(path: Path, configuration: str = "as it is") -> tuple[TossStore, IngestJournal]:
    store = TossStore(path)
    return store, IngestJournal(fresh_ingest(), store, configuration, "/odom")


def jittering(measured: tuple[FramePose, ...]) -> tuple[FramePose, ...]:
    """The same, stamped up to 2 ms late."""
    draw = np.random.default_rng(0)
    return tuple(one if one.static else replace(one, stamp_ns=one.stamp_ns + int(draw.integers(2_000_000))) for one in measured)


@pytest.mark.slow
@pytest.mark.parametrize("late", [False, True])
@pytest.mark.parametrize("seed", range(4))
def test_tosses_are_the_same_however_often_it_dies(golden_bag: Path, tmp_path: Path, seed: int, late: bool) -> None:
    measured = measured_of(golden_bag)[:MESSAGES]
    measured = jittering(measured) if late else measured
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


def test_a_toss_waits_for_no_snapshot(golden_bag: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("contact_curation.stages.ingest.JOURNAL_LENGTH", 1)
    measured, saved = measured_of(golden_bag)[:MESSAGES], 0
    store, journal = open_journal(tmp_path / "store")
    for arrival in arrivals_of(measured):
        before = store.states.load(IngestSnapshot.KEY)
        happened = journal.take([arrival])
        changed = store.states.load(IngestSnapshot.KEY) != before
        saved += changed
        assert not (changed and (happened.tosses or happened.rejected))
    assert saved > 100
    assert store.last_sequence > 3
    store.close()


def test_the_larger_a_state_is_the_more_seldom_it_is_saved(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each save writes all remembered transforms: with an arm at 500 Hz, saves took longer than measurements to come."""
    monkeypatch.setattr("contact_curation.stages.ingest.JOURNAL_LENGTH", 16)
    saved, snapshot = list[int](), TossIngest.snapshot

    def counted(ingest: TossIngest) -> dict[str, object]:
        saved.append(ingest.size)
        return snapshot(ingest)

    monkeypatch.setattr(TossIngest, "snapshot", counted)
    store, journal = open_journal(tmp_path / "store")
    moving = [FramePose(2_000_000 * k, "world", "body_surface", IDENTITY) for k in range(2000)]
    for batch in batched(arrivals_of(tuple(moving)), 8):
        journal.take(list(batch))
    assert len(saved) > 3
    assert sum(saved) < 3 * len(moving)
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


def test_a_toss_that_was_announced_is_there_after_the_machine_died(golden_bag: Path, tmp_path: Path) -> None:
    measured = measured_of(golden_bag)[:MESSAGES]
    with Disk().watched() as disk:
        store, journal = open_journal(tmp_path / "store")
        happened = journal.take(arrivals_of(measured))
        assert len(happened.tosses) >= 2
        for suffix, content in disk.left(tmp_path / "store").items():
            (tmp_path / f"left{suffix}").write_bytes(content)
        with TossStore(tmp_path / "left") as left:
            assert [one.toss.digest() for one in left.after(0, 100)] == [one.toss.digest() for one in happened.tosses]
        store.close()


def test_the_state_of_another_configuration_is_not_taken_up(golden_bag: Path, tmp_path: Path) -> None:
    measured = measured_of(golden_bag)[:MESSAGES]
    store, journal = open_journal(tmp_path / "store")
    journal.take(arrivals_of(measured)[:200])
    store.close()
    store, journal = open_journal(tmp_path / "store", "another")
    assert journal.newest == {}
    assert journal.others == 1
    journal.take(arrivals_of(measured))
    assert [one.toss.digest() for one in store.after(0, 100)] == [toss.digest() for toss in tosses_in(measured)]
    store.close()
    for configuration, others in (("another", 0), ("a third", len(tosses_in(measured)))):
        store, journal = open_journal(tmp_path / "store", configuration)
        assert journal.others == others
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


def beside_a_robot(measured: tuple[FramePose, ...], links: int = 30) -> list[FramePose]:
    """The same, with a robot's links between every two poses; the first leads to the room that nothing else hangs on."""
    names = ["room", *(f"link_{number}" for number in range(links))]
    mixed: list[FramePose] = []
    for one in measured:
        mixed.append(one)
        if not one.static:
            moved = ScalarPose((0.0, 0.0, 1e-9 * one.stamp_ns % 1.0), (1.0, 0.0, 0.0, 0.0))
            mixed += [FramePose(one.stamp_ns, parent, child, moved) for parent, child in pairwise(names)]
    return mixed


def test_the_links_of_a_robot_change_no_toss_are_not_written_down_and_a_death_among_them_loses_nothing(
    golden_bag: Path, tmp_path: Path
) -> None:
    measured = measured_of(golden_bag)[:MESSAGES]
    store, journal = open_journal(tmp_path / "store")
    longest = 0
    for number, batch in enumerate(batched(arrivals_of(tuple(beside_a_robot(measured))), 700)):
        journal.take(batch)
        longest = max(longest, len(store.poses_since()))
        assert not any(pose.child.startswith("link_") for _, pose in store.poses_since())
        if number % 7 == 3:
            store.close()
            store, journal = open_journal(tmp_path / "store")
    assert [one.toss.digest() for one in store.after(0, 100)] == [toss.digest() for toss in tosses_in(measured)]
    snapshot = load_record(store.states.load, IngestSnapshot)
    assert snapshot is not None
    assert "link_3" not in str(snapshot.ingest)
    assert longest < MESSAGES
    store.close()


def test_a_moving_robot_that_holds_the_board_is_written_down_from_the_moment_it_matters(
    golden_bag: Path, tmp_path: Path
) -> None:
    """The board stands on the last of the robot's links, which is said only after the links have been heard for a while."""
    measured = measured_of(golden_bag)[:MESSAGES]
    fixed = [one for one in measured if one.static]
    poses = [one for one in measured if not one.static]
    arm = [FramePose(one.stamp_ns, poses[0].parent, "arm", IDENTITY) for one in poses]
    boards = [replace(one, parent="arm") for one in fixed if one.child == "body_surface"]
    others = [one for one in fixed if one.child != "body_surface"]
    mixed = [*others, *arm[:100], *boards, *(one for pair in zip(arm[100:], poses[100:], strict=True) for one in pair)]
    expected = tosses_in(tuple(mixed))
    assert len(expected) > 3
    store, journal = open_journal(tmp_path / "store")
    for batch in batched(arrivals_of(tuple(mixed)), 90):
        journal.take(batch)
        store.close()
        store, journal = open_journal(tmp_path / "store")
    assert [one.toss.digest() for one in store.after(0, 100)] == [toss.digest() for toss in expected]
    store.close()
