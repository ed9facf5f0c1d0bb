"""The toss store keeps every toss once, in order, and loses none when its process is killed."""

import os
import signal
import sqlite3
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from contact_curation.errors import InvalidValueError, UnreadableInputError
from contact_curation.storage.provenance import TossProvenance
from contact_curation.storage.stores.information import InformationStore
from contact_curation.storage.stores.record_table import Added
from contact_curation.storage.stores.tosses import JournalPose, TossStore
from test.storage.stored_records import rejected, toss

WRITER = """
import sys
from pathlib import Path
from contact_curation.storage.stores.tosses import TossStore
from test.storage.stored_records import toss
with TossStore(Path(sys.argv[1])) as store:
    number = store.last_sequence
    while True:
        number += 1
        with store.transaction():
            store.add(toss(number))
            store.states.save({"number": str(number).encode()})
        print(number, flush=True)
"""


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "tosses.sqlite"


def test_a_toss_comes_back_as_it_was_stored_with_where_it_came_from(path: Path) -> None:
    provenance = TossProvenance("bag.mcap", "ab" * 32, "/tagslam/odom/body_cube")
    with TossStore(path) as store:
        store.add(toss(1), provenance=provenance)
    with TossStore(path) as store:
        (stored,) = store.get([toss(1).toss_id])
    assert stored.toss.digest() == toss(1).digest()
    assert (stored.sequence, stored.provenance) == (1, provenance)


def test_storing_the_same_toss_again_changes_nothing(path: Path) -> None:
    with TossStore(path) as store:
        assert store.add(toss(1)) == Added(1, True)
        assert store.add(toss(2)) == Added(2, True)
        assert store.add(toss(1), provenance=TossProvenance("another.bag")) == Added(1, False)
        assert store.last_sequence == 2
        assert store.get([toss(1).toss_id])[0].provenance == TossProvenance()


def test_another_toss_under_a_stored_id_is_refused(path: Path) -> None:
    with TossStore(path) as store:
        store.add(toss(1))
        with pytest.raises(InvalidValueError, match="other content"):
            store.add(toss(1, height=0.3))
        assert store.get([toss(1).toss_id])[0].toss.digest() == toss(1).digest()


def test_tosses_come_in_the_order_of_their_sequence(path: Path) -> None:
    with TossStore(path) as store:
        for number in (3, 1, 2):
            store.add(toss(number))
        assert [stored.toss.toss_id for stored in store.after(0, 10)] == [toss(number).toss_id for number in (3, 1, 2)]
        assert [stored.sequence for stored in store.after(1, 1)] == [2]
        assert store.after(3, 10) == ()
        asked = [toss(2).toss_id, "unknown", toss(3).toss_id, toss(2).toss_id]
        assert [stored.sequence for stored in store.get(asked)] == [1, 3]


def test_any_number_of_ids_can_be_asked_for(path: Path) -> None:
    with TossStore(path) as store:
        store.add(toss(7))
        assert len(store.get([f"unknown-{number}" for number in range(2000)] + [toss(7).toss_id])) == 1


def test_an_empty_store_has_no_sequence(path: Path) -> None:
    with TossStore(path) as store:
        assert (store.last_sequence, store.last_rejected_sequence, store.after(0, 5)) == (0, 0, ())
        assert not store.contains(toss(1).toss_id)


@pytest.mark.parametrize("rejected_first", [True, False])
def test_a_toss_that_was_kept_back_once_is_a_toss_as_soon_as_it_comes_whole(path: Path, rejected_first: bool) -> None:
    """As `storage.inputs.inputs` has it for recordings: what was rejected under an id hides no toss of that id."""
    with TossStore(path) as store:
        if rejected_first:
            store.add_rejected(rejected(4))
        assert store.add(toss(4, frames=9)) == Added(1, True)
        if not rejected_first:
            store.add_rejected(rejected(4))
        assert store.contains(toss(4).toss_id)
        assert [one.toss.frames for one in store.after(0, 5)] == [9]


def test_rejected_motions_are_kept_beside_with_their_reasons(path: Path) -> None:
    with TossStore(path) as store:
        assert store.add_rejected(rejected(4), provenance=TossProvenance("a.bag")) == Added(1, True)
        assert store.add_rejected(rejected(4)) == Added(1, False)
        (stored,) = store.rejected_after(0, 10)
        assert stored.rejected.reasons == rejected(4).reasons
        assert stored.rejected.toss.digest() == toss(4).digest()
        assert stored.provenance.input == "a.bag"
        assert not store.contains(toss(4).toss_id)
        assert (store.last_sequence, store.last_rejected_sequence) == (0, 1)


def test_a_transaction_that_fails_leaves_nothing_behind(path: Path) -> None:
    def store_both(store: TossStore) -> None:
        with store.transaction():
            store.states.save({"segmenter": b"after"})
            store.add(toss(1))
            store.add(toss(1, height=0.3))

    with TossStore(path) as store:
        store.states.save({"segmenter": b"before"})
        with pytest.raises(InvalidValueError, match="other content"):
            store_both(store)
        assert (store.last_sequence, store.states.load("segmenter")) == (0, b"before")
        assert store.add(toss(1)).added


def test_a_state_is_replaced_as_a_whole(path: Path) -> None:
    with TossStore(path) as store:
        assert store.states.load("segmenter") is None
        store.states.save({"segmenter": bytes(range(256))})
        store.states.save({"segmenter": b"\x00new"})
        store.states.save({"other": b""})
    with TossStore(path) as store:
        assert store.states.load("segmenter") == b"\x00new"
        assert store.states.load("other") == b""


def pose(number: int) -> JournalPose:
    x, y, z, w, qx, qy, qz = np.random.default_rng(number).normal(size=7).tolist()
    return JournalPose(number * 6_756_757, "map", "body_cube", (x, y, z), (w, qx, qy, qz), number % 2 == 0)


def test_poses_of_the_journal_come_back_bit_for_bit_until_they_are_trimmed(path: Path) -> None:
    poses = [pose(number) for number in range(10)]
    poses[3] = poses[3]._replace(position=(-0.0, 5e-324, 1e308))
    with TossStore(path) as store:
        assert store.append_poses(poses[:6]) == 6
        assert store.append_poses(poses[6:]) == 10
        assert store.append_poses([]) == 10
    with TossStore(path) as store:
        assert [found for _, found in store.poses_since()] == poses
        assert str(store.poses_since()[3][1].position[0]) == "-0.0"
        assert [number for number, _ in store.poses_since(8)] == [9, 10]
        store.trim_poses(8)
        assert [number for number, _ in store.poses_since()] == [9, 10]
        store.trim_poses(10)
        assert store.append_poses(poses[:1]) == 11


def test_a_batch_of_poses_costs_far_less_than_each_on_its_own(path: Path) -> None:
    poses = [pose(number) for number in range(600)]
    with TossStore(path) as store:
        began = time.perf_counter()
        for start in range(0, len(poses), 100):
            store.append_poses(poses[start : start + 100])
        batched = time.perf_counter() - began
        began = time.perf_counter()
        for one in poses:
            store.append_poses([one])
        assert time.perf_counter() - began > 2.0 * batched


def test_other_processes_read_while_a_toss_is_being_stored(path: Path) -> None:
    with TossStore(path) as store, TossStore(path) as reader:
        store.add(toss(1))
        with store.transaction():
            store.add(toss(2))
            assert reader.last_sequence == 1
            assert len(reader.after(0, 10)) == 1
        assert reader.last_sequence == 2


def test_a_reader_that_takes_its_time_does_not_hold_up_the_writer(path: Path) -> None:
    with TossStore(path) as store:
        store.add(toss(1))
        slow = sqlite3.connect(path, isolation_level=None)
        slow.execute("BEGIN")
        assert slow.execute("SELECT count(*) FROM tosses").fetchone() == (1,)
        assert store.add(toss(2)).added
        assert slow.execute("SELECT count(*) FROM tosses").fetchone() == (1,)
        slow.close()


@pytest.mark.parametrize("delay", [0.0, 0.03, 0.1])
def test_a_killed_writer_loses_nothing_that_it_had_stored(path: Path, delay: float) -> None:
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[3])}
    with subprocess.Popen(
        [sys.executable, "-c", WRITER, str(path)], stdout=subprocess.PIPE, text=True, env=environment
    ) as writer:
        assert writer.stdout is not None
        said = [writer.stdout.readline()]
        time.sleep(delay)
        writer.send_signal(signal.SIGKILL)
        said += writer.stdout.readlines()
    announced = [int(line) for line in said if line.endswith("\n")]
    with TossStore(path) as store:
        stored = store.after(0, 100_000)
        assert [found.sequence for found in stored] == list(range(1, len(stored) + 1))
        assert len(announced) <= len(stored) <= len(announced) + 1
        assert store.states.load("number") == str(len(stored)).encode()
        assert all(found.toss.digest() == toss(found.sequence).digest() for found in stored)
        assert store.add(toss(len(stored) + 1)).added


def test_a_file_that_is_no_database_is_refused(path: Path) -> None:
    path.write_bytes(b"something else" * 100)
    with pytest.raises(UnreadableInputError, match="not a database"):
        TossStore(path)
    assert path.read_bytes() == b"something else" * 100


def test_a_database_of_something_else_is_refused_and_left_alone(path: Path) -> None:
    foreign = sqlite3.connect(path)
    foreign.execute("CREATE TABLE theirs (x)")
    foreign.commit()
    foreign.close()
    before = path.read_bytes()
    with pytest.raises(UnreadableInputError, match="something else"):
        TossStore(path)
    assert path.read_bytes() == before


def test_another_kind_of_store_is_refused(path: Path) -> None:
    InformationStore(path).close()
    with pytest.raises(UnreadableInputError, match="expected a toss store"):
        TossStore(path)


def test_a_store_of_a_newer_version_is_refused(path: Path) -> None:
    TossStore(path).close()
    newer = sqlite3.connect(path)
    newer.execute("PRAGMA user_version = 99")
    newer.close()
    with pytest.raises(UnreadableInputError, match="version 99"):
        TossStore(path)


def test_a_folder_that_is_not_there_is_a_clear_error(tmp_path: Path) -> None:
    with pytest.raises(UnreadableInputError, match="nowhere, expected one: make it first"):
        TossStore(tmp_path / "nowhere" / "tosses.sqlite")
