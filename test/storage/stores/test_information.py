"""The information store keeps one record per toss and parameters version."""

from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

from contact_curation.errors import InvalidValueError
from contact_curation.information.record import TossInformation
from contact_curation.storage.stores import information as information_store
from contact_curation.storage.stores.information import InformationStore
from contact_curation.storage.stores.record_table import Added
from test.storage.stored_records import information


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "information.sqlite"


def assert_equal(found: TossInformation, expected: TossInformation) -> None:
    for field in fields(TossInformation):
        one, other = getattr(found, field.name), getattr(expected, field.name)
        if isinstance(other, np.ndarray):
            assert one.shape == other.shape
            assert one.tobytes() == other.tobytes()
        else:
            assert one == other


@pytest.mark.parametrize("bound", [float("inf"), 0.25])
@pytest.mark.parametrize("number", [1, 2])
def test_a_record_comes_back_as_it_was_stored(path: Path, number: int, bound: float) -> None:
    with InformationStore(path) as store:
        store.add(information(number, bound=bound))
    with InformationStore(path) as store:
        (stored,) = store.after(0, 10)
        assert_equal(stored.information, information(number, bound=bound))
        by_key = store.get(information(number).toss_id, "v1")
        assert by_key is not None
        assert by_key.sequence == 1
        assert store.get(information(number).toss_id, "v2") is None


def test_a_toss_has_one_record_per_version_and_the_first_stays(path: Path) -> None:
    with InformationStore(path) as store:
        assert store.add(information(1, "v1")) == Added(1, True)
        assert store.add(information(1, "v2")) == Added(2, True)
        assert store.add(information(1, "v1")) == Added(1, False)
        assert store.last_sequence == 2


def test_a_record_made_in_another_way_is_refused(path: Path) -> None:
    with InformationStore(path) as store:
        store.add(information(1))
        with pytest.raises(InvalidValueError, match="estimator"):
            store.add(information(1, estimator="gauss-newton"))
        with pytest.raises(InvalidValueError, match="influence_bound"):
            store.add(information(1, bound=0.5))


def test_a_version_streams_in_order_page_by_page(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(information_store, "PAGE", 3)
    with InformationStore(path) as store:
        for number in range(8):
            store.add(information(number, "v1"))
            store.add(information(number, "v2"))
        found = list(store.all_of("v2"))
        assert [stored.information.toss_id for stored in found] == [information(number).toss_id for number in range(8)]
        assert [stored.sequence for stored in store.after(3, 2)] == [4, 5]
        assert store.after((1 << 64) - 1, 2) == ()


def test_only_the_newest_versions_are_kept_and_sequence_numbers_are_never_given_again(path: Path) -> None:
    with InformationStore(path) as store:
        for version in ("c", "a", "b"):
            store.add(information(1, version))
        assert list(store.versions) == ["c", "a", "b"]
        assert store.keep_newest_versions() == ("c",)
        assert list(store.versions) == ["a", "b"]
        assert store.keep_newest_versions() == ()
        assert store.keep_newest_versions(1) == ("a",)
        assert store.add(information(2, "b")).sequence == 4
        with pytest.raises(InvalidValueError, match="at least 1"):
            store.keep_newest_versions(0)
    with InformationStore(path) as store:
        assert store.last_sequence == 4


def test_numpy_numbers_in_the_plain_fields_are_stored_as_numbers(path: Path) -> None:
    record = information(1)
    values = {field.name: getattr(record, field.name) for field in fields(record)}
    values.update(transitions=np.int64(80), duration=np.float64(0.6))
    with InformationStore(path) as store:
        store.add(TossInformation(**values))
        assert_equal(store.after(0, 1)[0].information, record)
