"""The ranking of a session's bag is by what its curator ranked by, named or not."""

from pathlib import Path
from typing import Any

import pytest

from contact_curation.session.config import SessionFolder
from contact_curation.session.report import rank_command


@pytest.mark.parametrize(
    ("curator", "criterion"),
    [
        ({}, None),
        ({"selection": "exact", "criterion": "representative"}, "representative"),
        ({"selection": "streaming"}, "log-det"),
        ({"selection": "streaming", "criterion": "representative"}, "log-det"),
        ({"selection": "streaming", "criterion": "trace"}, "trace"),
    ],
)
def test_what_stood_in_for_the_default_is_named(tmp_path: Path, curator: dict[str, Any], criterion: str | None) -> None:
    parameters = {"pose_ingest": {}, "fisher_scorer": {}, "curator": curator}
    words = rank_command(SessionFolder(tmp_path), parameters, None, tmp_path / "ranking.png")
    named = words[words.index("--criterion") + 1] if "--criterion" in words else None
    assert named == criterion
