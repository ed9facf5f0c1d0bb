"""Stores whose bits flip, that were cut, are read-only or have two writers: said in a line, and nothing is deleted."""

import shutil
import sqlite3
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from contact_curation.errors import ContactCurationError, UnreadableInputError
from contact_curation.storage.stores.information import InformationStore
from contact_curation.storage.stores.sqlite import Store
from contact_curation.storage.stores.state import StateStore
from contact_curation.storage.stores.tosses import JournalPose, TossStore
from test.storage.stored_records import information, toss
from test.storage.written_bags import rollback_journal

FLIPS = 120
"""Bits of a file that are tried."""
PAGE = 4096

type Content = object


def filled_tosses(path: Path) -> None:
    with TossStore(path) as store:
        for number in range(3):
            store.add(toss(number, frames=40))
        store.append_poses([JournalPose(k, "board", "cube", (0.1, 0.2, 0.3 + k), (1.0, 0.0, 0.0, 0.0)) for k in range(30)])
        store.states.save({"newest": b'{"a": 1}'})


def filled_information(path: Path) -> None:
    with InformationStore(path) as store:
        for number in range(3):
            store.add(information(number))
        store.states.save({"cursor": b'{"a": 1}'})


def filled_states(path: Path) -> None:
    with StateStore(path) as store:
        store.save({f"state {number}": bytes(range(200)) for number in range(40)})


def tosses(path: Path) -> Content:
    with TossStore(path) as store:
        store.claim()
        kept = [(one.sequence, one.toss.toss_id, one.toss.digest(), one.provenance) for one in store.after(0, 100)]
        return kept, store.poses_since(), store.states.load("newest")


def informations(path: Path) -> Content:
    with InformationStore(path) as store:
        store.claim()
        kept = [(one.sequence, one.information.toss_id, one.information.factor.tobytes()) for one in store.after(0, 100)]
        return kept, store.versions, store.states.load("cursor")


def states(path: Path) -> Content:
    with StateStore(path) as store:
        store.claim()
        return store.all()


KINDS = pytest.mark.parametrize(
    ("fill", "read"),
    [(filled_tosses, tosses), (filled_information, informations), (filled_states, states)],
    ids=["tosses", "information", "states"],
)
type Fill = Callable[[Path], None]
type Read = Callable[[Path], Content]


@KINDS
def test_a_bit_that_flips_anywhere_is_said_or_changes_nothing(tmp_path: Path, fill: Fill, read: Read) -> None:
    whole, path = tmp_path / "whole", tmp_path / "store"
    fill(whole)
    expected, data = read(whole), whole.read_bytes()
    draw = np.random.default_rng(7)
    places = draw.integers(0, len(data), FLIPS)
    places[: len(data) // PAGE] = np.arange(len(data) // PAGE) * PAGE + draw.integers(0, PAGE, len(data) // PAGE)  # each page
    said = 0
    for place, bit in zip(places.tolist(), draw.integers(0, 8, FLIPS).tolist(), strict=True):
        path.write_bytes(data[:place] + bytes([data[place] ^ 1 << bit]) + data[place + 1 :])
        try:
            assert read(path) == expected, f"bit {bit} of byte {place}"
        except ContactCurationError:
            said += 1
    assert said > FLIPS // 12  # many pages are half empty


@KINDS
@pytest.mark.parametrize("kept", [0.1, 0.5, 0.99])
def test_a_store_that_was_cut_is_said_and_left_alone(tmp_path: Path, fill: Fill, read: Read, kept: float) -> None:
    path = tmp_path / "store"
    fill(path)
    cut = path.read_bytes()[: int(kept * path.stat().st_size)]
    path.write_bytes(cut)
    with pytest.raises(UnreadableInputError):
        read(path)
    assert path.read_bytes() == cut


WRITER = """
import sys
from pathlib import Path
from contact_curation.storage.stores.state import StateStore
with StateStore(Path(sys.argv[1])) as store:
    store.claim()
    print("claimed", flush=True)
    sys.stdin.read()
"""


def test_a_store_has_one_writer_and_any_number_of_readers_and_is_free_after_a_kill(tmp_path: Path) -> None:
    path = tmp_path / "store"
    command = [sys.executable, "-c", WRITER, str(path)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as writer:
        assert writer.stdout is not None
        assert writer.stdout.readline() == "claimed\n"
        with StateStore(path) as store:
            assert store.load("nothing") is None
            with pytest.raises(UnreadableInputError, match="is written by another process"):
                store.claim()
        writer.kill()
    with StateStore(path) as store:
        store.claim()
        store.save({"a": b"b"})


def test_a_read_only_store_is_said(tmp_path: Path) -> None:
    path = tmp_path / "store"
    filled_states(path)
    before = path.read_bytes()
    connection = sqlite3.connect(f"file:{path}?mode=ro&immutable=1", uri=True)
    with StateStore(path) as store:
        store._store._connection, kept = connection, store._store._connection
        with pytest.raises(UnreadableInputError, match="readonly"):
            store.save({"a": b"b"})
        store._store._connection = kept
    connection.close()
    assert path.read_bytes() == before


def test_a_store_without_its_log_is_what_it_was_at_the_last_checkpoint(tmp_path: Path) -> None:
    path, copied = tmp_path / "store", tmp_path / "copied"
    with StateStore(path) as store:
        store.save({"early": b"1"})
        store._store.rows("PRAGMA wal_checkpoint(TRUNCATE)")
        store.save({"late": b"2"})
        shutil.copy(path, copied)
    with StateStore(copied) as store:
        store.claim()
        assert store.all() == [("early", b"1")]


@pytest.mark.parametrize("kind", [TossStore, InformationStore, StateStore])
def test_a_claim_ends_with_the_store(tmp_path: Path, kind: Callable[[Path], Store]) -> None:
    for _ in range(2):
        with kind(tmp_path / "store") as store:
            store.claim()


@pytest.mark.parametrize(("fill", "kind"), [(filled_tosses, TossStore), (filled_states, StateStore)])
def test_a_journal_that_names_another_file_is_refused(
    tmp_path: Path, fill: Callable[[Path], None], kind: Callable[[Path], object]
) -> None:
    path, theirs = tmp_path / "store.sqlite", tmp_path / "thesis.txt"
    fill(path)
    theirs.write_text("three years")
    Path(f"{path}-journal").write_bytes(rollback_journal(path, theirs))
    with pytest.raises(UnreadableInputError, match="-journal: names another file"):
        kind(path)
    assert theirs.read_text() == "three years"
