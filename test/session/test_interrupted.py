"""A session that was interrupted says so, and does not blame the ranking of its bag for other tosses."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.loss_config import DEFAULT_LOSS
from contact_curation.contact.models.polytope import PolytopeModel
from contact_curation.contact.parameter_form import Form
from contact_curation.learning.evaluation.misfit import sliding_of
from contact_curation.learning.uncertainty.parameters import KnownConfig, known
from contact_curation.motion.transitions import transitions_of
from contact_curation.pipeline.learned_model import LearnedModel
from contact_curation.session import learned, report
from contact_curation.session.config import SessionConfig, SessionFolder
from contact_curation.session.state import SessionState
from contact_curation.session.summary import SessionSummary, summary_of
from contact_curation.stages.records import BufferRecord
from contact_curation.storage.stores.tosses import TossStore
from test.simulated import simulated_tosses


class Ranked:
    """Stands for the ranking of a bag."""

    selected_ids = ids = ("a", "b")

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
    _, what = replayed(replace(summary, selected=("b", "c", "a")), tmp_path, monkeypatch)
    assert "a, b; it finds no sound toss c in the bag, as after a kill" in what


def test_the_same_tosses_in_the_same_order_are_the_same(
    summary: SessionSummary, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert replayed(replace(summary, selected=("a", "b")), tmp_path, monkeypatch)[0]


def test_a_buffer_that_was_selected_from_fewer_tosses_than_are_scored_is_not_the_last_one() -> None:
    state = SessionState(tosses=("a", "b"), scored=2, ranked=2, buffer=BufferRecord(seen=1))
    assert not state.is_scored
    assert replace(state, buffer=BufferRecord(seen=2)).is_scored


def test_the_friction_interval_is_of_what_the_model_learned_from_and_not_of_a_later_selection(tmp_path: Path) -> None:
    tosses = simulated_tosses(5, seed=3)
    ids = tuple(toss.toss_id for toss in tosses)
    folder = SessionFolder(tmp_path)
    folder.make()
    with TossStore(folder.store("pose_ingest")) as store:
        for toss in tosses:
            store.add(toss)
    model = PolytopeModel(ContactGeometry.of_body(CONTACTNETS_CUBE), CONTACTNETS_CUBE, Form.RIGID)
    trained = LearnedModel(model, fitted_to=frozenset(ids[:3]), learned_from=frozenset(ids[:4]))
    state = SessionState(tosses=ids, buffer=BufferRecord(selected=ids[3:]))
    found = learned._parameters(trained, folder, state, ())
    scale = CONTACTNETS_CUBE.length_scale
    slid = sliding_of((*tosses[:3], *tosses[4:]), CONTACTNETS_CUBE)
    fitted, others = transitions_of(tosses[:3], scale), transitions_of(tosses[4:], scale)
    expected = known(model, fitted, others, KnownConfig(DEFAULT_LOSS), slid)
    assert found is not None
    assert found.tosses == 3
    assert found.friction_interval == next(one.interval for one in expected.parameters if one.name == "friction")


def test_more_tosses_than_throws_are_said_as_such() -> None:
    """A throw that a kill cut off is not made, but its toss counts."""
    said = str(learned.LearnedSummary(0.2, None, 0.18, 1.0, tosses=8, throws=7))
    assert said.endswith("from 8 tosses of 7 throws")
