"""The kept rows of a manifest, best first."""

from pathlib import Path

import pytest

from contact_curation.errors import InvalidValueError
from contact_curation.storage.export.selected import kept_rows
from contact_curation.storage.manifest.manifest import Manifest
from test.storage.kept_rows import row
from test.storage.manifest.test_manifest import RUN


def test_a_manifest_that_kept_nothing_is_an_error() -> None:
    manifest = Manifest(RUN, (row("a", kept=False),))
    with pytest.raises(InvalidValueError, match=r"kept tosses of m.csv: found none of 1, expected at least one"):
        kept_rows(manifest, Path("m.csv"))


def test_rows_are_in_the_order_of_their_ranks() -> None:
    manifest = Manifest(RUN, tuple(row(f"toss-{rank}", rank=rank) for rank in (3, 1, 2)))
    assert list(kept_rows(manifest, Path("m"))) == ["toss-1", "toss-2", "toss-3"]
