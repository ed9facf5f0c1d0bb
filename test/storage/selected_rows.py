"""Rows of manifests that the tests of exports make up."""

from dataclasses import replace
from typing import Any

from contact_curation.storage.manifest.manifest import ManifestRow
from test.storage.manifest.test_manifest import RANKED


def row(toss_id: str, **changes: Any) -> ManifestRow:
    """A selected toss's, with changes."""
    return replace(RANKED, toss_id=toss_id, **changes)
