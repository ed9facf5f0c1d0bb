from pathlib import Path

import pytest

from contact_curation.errors import UnreadableInputError
from contact_curation.storage.stores.state import StateStore
from contact_curation.storage.stores.tosses import TossStore


def test_values_come_back_after_the_store_was_opened_again(tmp_path: Path) -> None:
    with StateStore(tmp_path / "states") as store:
        store.save({"one": b"\0\xff", "two": b""})
        store.save({"one": b"newer"})
    with StateStore(tmp_path / "states") as store:
        assert (store.load("one"), store.load("two"), store.load("three")) == (b"newer", b"", None)


def test_a_file_of_another_kind_is_refused(tmp_path: Path) -> None:
    TossStore(tmp_path / "tosses").close()
    with pytest.raises(UnreadableInputError, match="expected a state store"):
        StateStore(tmp_path / "tosses")
