"""A session that was interrupted says so, and does not blame the ranking of its bag for other tosses."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from contact_curation.session import report
from contact_curation.session.config import SessionConfig, SessionFolder
from contact_curation.session.state import SessionState
from contact_curation.session.summary import SessionSummary, summary_of
from contact_curation.stages.records import BufferRecord


class Ranked:
    """Stands for the ranking of a bag."""

    selected_ids = ("a", "b")

    def evidence(self) -> Any:
        return SimpleNamespace()

    def save(self, path: Path, *, overwrite: bool) -> None:
        path.touch()

    save_figure = save


@pytest.fixture
def summary(tmp_path: Path) -> SessionSummary:
    return summary_of(SessionConfig(), SessionState(), SessionFolder(tmp_path), {}, 12.0, settled=True)


def replayed(summary: SessionSummary, folder: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[bool, str]:
    monkeypatch.setattr(report, "rank_tosses", lambda *_: Ranked())
    monkeypatch.setattr(report, "offline_ranking", lambda *_: None)
    made = SessionFolder(folder)
    made.make()
    _, replay = report._replayed(SessionConfig(), made, {}, summary)
    return replay.same, replay.replay


def test_where_it_had_not_come_to_rest_other_tosses_are_no_fault(
    summary: SessionSummary, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    interrupted = replace(summary, settled=False, selected=("b",))
    same, what = replayed(interrupted, tmp_path, monkeypatch)
    assert not same
    assert what.startswith("the session was interrupted before its last tosses were scored and trained on")
    assert "interrupted before everything was scored" in dict(interrupted.facts())["time"]


def test_where_it_had_other_tosses_are_named_and_the_same_ones_are_counted(
    summary: SessionSummary, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    same, what = replayed(replace(summary, selected=("b",)), tmp_path, monkeypatch)
    assert (same, what) == (False, "rank gives other tosses than the session: a, b")
    assert "interrupted" not in dict(summary.facts())["time"]


def test_the_same_tosses_in_the_same_order_are_the_same(
    summary: SessionSummary, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert replayed(replace(summary, selected=("a", "b")), tmp_path, monkeypatch)[0]


def test_a_buffer_that_was_selected_from_fewer_tosses_than_are_scored_is_not_the_last_one() -> None:
    state = SessionState(tosses=("a", "b"), scored=2, ranked=2, buffer=BufferRecord(seen=1))
    assert not state.is_scored
    assert replace(state, buffer=BufferRecord(seen=2)).is_scored
