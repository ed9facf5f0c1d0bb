"""The selected rows of a manifest, best first."""

from pathlib import Path

import pytest

from contact_curation.errors import InvalidValueError
from contact_curation.storage.export.selected import selected_rows
from contact_curation.storage.manifest.manifest import Manifest
from test.storage.manifest.test_manifest import RUN
from test.storage.selected_rows import row


def test_a_manifest_that_selected_nothing_is_an_error() -> None:
    manifest = Manifest(RUN, (row("a", selected=False),))
    with pytest.raises(InvalidValueError, match=r"selected tosses of m.csv: found none of 1, expected at least one"):
        selected_rows(manifest, Path("m.csv"))


def test_rows_are_in_the_order_of_their_ranks() -> None:
    manifest = Manifest(RUN, tuple(row(f"toss-{rank}", rank=rank) for rank in (3, 1, 2)))
    assert list(selected_rows(manifest, Path("m"))) == ["toss-1", "toss-2", "toss-3"]
