"""Scoring and curating that die and come back; no node is spun."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from contact_curation.contact.body import CONTACTNETS_CUBE, Body
from contact_curation.contact.evaluation import Estimator
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.loss_config import LossConfig
from contact_curation.contact.parameter_form import Form
from contact_curation.errors import InvalidValueError
from contact_curation.information.curation import curate
from contact_curation.information.ranker import RankingConfig, rank
from contact_curation.information.record import TossInformation
from contact_curation.information.scoring import BegunToss, ScoringConfig, parameters_version
from contact_curation.motion.toss import Toss
from contact_curation.nodes.messages.curated_buffer import buffer_message
from contact_curation.stages.curation import CurationConfig, CurationStage
from contact_curation.stages.records import Cursor, ScorerPosition, stored_records
from contact_curation.stages.scored_theta import ScoredTheta, theta_of_geometry
from contact_curation.stages.scoring import Announcement, ScoringStage, checked_body
from contact_curation.stages.selection import StreamingSelection
from contact_curation.storage.stores.information import InformationStore, packed_information
from test.graph.parts.offline import scored
from test.simulated import simulated_tosses

TOSSES = simulated_tosses(8, seed=11)
FRAMES = {toss.toss_id: "board" for toss in TOSSES}
CUBE = ContactGeometry.of_body(CONTACTNETS_CUBE)
LARGER = replace(CUBE, vertices_normal=CUBE.vertices_normal * 1.01)


@contextmanager
def store(folder: Path) -> Iterator[InformationStore]:
    folder.mkdir(exist_ok=True)
    with InformationStore(folder / "information") as opened:
        yield opened


@contextmanager
def scoring(folder: Path, body: Body = CONTACTNETS_CUBE, config: ScoringConfig | None = None) -> Iterator[ScoringStage]:
    with store(folder) as informations:
        yield ScoringStage(body, config or ScoringConfig(), informations, theta_of_geometry(CUBE))


@contextmanager
def curating(folder: Path, top: int = 3, config: CurationConfig | None = None) -> Iterator[CurationStage]:
    with store(folder) as informations:
        yield CurationStage(RankingConfig(top=top), config or CurationConfig(), informations)


def added(stage: CurationStage, informations: list[TossInformation], first_stamp_ns: int = 0) -> None:
    for place, information in enumerate(informations):
        stage.add(information, first_stamp_ns + place, "board")


def test_a_toss_is_scored_once_however_often_it_comes(tmp_path: Path) -> None:
    with scoring(tmp_path) as stage:
        first = stage.score(TOSSES[:3], FRAMES)
        again = stage.score(TOSSES[:4], FRAMES)
    assert [one.sequence for one in first.new] == [1, 2, 3]
    assert [one.information.toss_id for one in again.new] == [TOSSES[3].toss_id]


def test_a_toss_that_was_begun_is_stored_as_if_it_had_not_been(tmp_path: Path) -> None:
    for folder, ahead in ((tmp_path / "begun", True), (tmp_path / "whole", False)):
        folder.mkdir()
        with scoring(folder) as stage:
            for toss in TOSSES[:2]:
                if ahead:
                    stage.begin(toss)
                stage.score([toss], FRAMES)
            if ahead:
                stage.begin(TOSSES[2])
            assert stage.renew(theta_of_geometry(LARGER))
            stage.score(TOSSES[2:3], FRAMES)
    begun, whole = ([one.information for one in every(tmp_path / name)] for name in ("begun", "whole"))
    assert [packed_information(one) for one in begun] == [packed_information(one) for one in whole]
    assert [one.parameters_version for one in begun] == [one.parameters_version for one in whole]
    assert len(begun) == 3


def unfinished(toss: Toss) -> Toss:
    linear = toss.linear_velocities.copy()
    linear[-1] += 0.01
    return replace(toss, linear_velocities=linear)


@pytest.mark.parametrize("announced", [TOSSES[0], unfinished(TOSSES[0])])
def test_a_toss_that_was_heard_of_when_complete_is_scored_already_unless_another_is_announced(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, announced: Toss
) -> None:
    with scoring(tmp_path) as stage:
        for ahead in (unfinished(TOSSES[0]), TOSSES[0]):
            stage.begin(ahead)
        assert stage.last_sequence == 0
        whole = stage._scorer.score([announced])[0]
        if announced is TOSSES[0]:
            monkeypatch.setattr(BegunToss, "score", None)
        ((_, information, _),) = stage.score([announced], FRAMES).new
    assert isinstance(whole, TossInformation)
    assert packed_information(information) == packed_information(whole)


def every(folder: Path) -> tuple[Announcement, ...]:
    with scoring(folder) as stage:
        return stage.after(0, 10)


def test_what_was_scored_and_not_announced_is_announced_after_a_death(tmp_path: Path) -> None:
    with scoring(tmp_path) as stage:
        batch = stage.score(TOSSES[:3], FRAMES)
        stage.announced(batch.new[:1])
    with scoring(tmp_path) as stage:
        missed = stage.unannounced(10)
    assert [one.sequence for one in missed] == [2, 3]
    assert missed[0].stamped == (int(TOSSES[1].stamps_ns[-1]), "board")
    assert np.array_equal(missed[0].information.factor, batch.new[1].information.factor)


def test_a_new_theta_is_kept_over_a_death_and_starts_over(tmp_path: Path) -> None:
    with scoring(tmp_path) as stage:
        stage.score(TOSSES[:2], FRAMES)
        stage.advance(Cursor(2, TOSSES[1].toss_id))
        before = stage.version
        assert stage.cursor == Cursor(2, TOSSES[1].toss_id)
        assert not stage.renew(theta_of_geometry(CUBE))
        assert stage.renew(theta_of_geometry(LARGER))
        assert stage.cursor == Cursor()
    with scoring(tmp_path) as stage:
        assert stage.version != before
        again = stage.score(TOSSES[:2], FRAMES)
    assert [one.information.parameters_version for one in again.new] == [stage.version] * 2


def test_a_death_amid_the_tosses_at_a_new_theta_makes_no_result_anew(tmp_path: Path) -> None:
    with scoring(tmp_path) as stage:
        stage.score(TOSSES, FRAMES)
        stage.advance(Cursor(8, TOSSES[-1].toss_id))
        assert stage.renew(theta_of_geometry(LARGER))
        stage.score(TOSSES[:3], FRAMES)
    with scoring(tmp_path) as stage:
        assert len(stage.score(TOSSES, FRAMES).new) == 5


def test_the_newest_theta_that_waits_is_known_after_a_death_and_waits_no_more_once_it_is_scored_at(tmp_path: Path) -> None:
    largest = replace(CUBE, vertices_normal=CUBE.vertices_normal * 1.02)
    with scoring(tmp_path) as stage:
        assert stage.postponed is None
        stage.postpone(theta_of_geometry(LARGER))
        stage.postpone(theta_of_geometry(largest))
        with pytest.raises(InvalidValueError):
            stage.postpone(ScoredTheta(theta_of_geometry(CUBE).model, b"nonsense"))
    with scoring(tmp_path) as stage:
        waiting = stage.postponed
        assert waiting is not None
        assert waiting.data == theta_of_geometry(largest).data
        assert stage.renew(waiting)
        assert stage.postponed is None


def test_results_made_in_two_ways_do_not_go_into_one_store(tmp_path: Path) -> None:
    with scoring(tmp_path) as stage:
        stage.score(TOSSES[:1], FRAMES)
    other = ScoringConfig(estimator=Estimator.EMPIRICAL)
    with store(tmp_path) as informations, pytest.raises(InvalidValueError, match="expected gauss-newton"):
        ScoringStage(CONTACTNETS_CUBE, other, informations, theta_of_geometry(CUBE))


def test_results_by_two_losses_or_compressions_do_not_go_into_one_store_however_they_are_computed(tmp_path: Path) -> None:
    config = ScoringConfig(form=Form.RIGID)
    published, otherwise = (replace(config, loss=LossConfig(**changed)) for changed in ({"balanced": False}, {"threads": 1}))
    with scoring(tmp_path, config=config) as stage:
        stage.score(TOSSES[:1], FRAMES)
        stage.advance(Cursor(1, TOSSES[0].toss_id))
        version = stage.version
    with scoring(tmp_path, config=otherwise) as stage:
        assert stage.version == version
    refused = pytest.raises(
        InvalidValueError, match=r"^loss\.balanced: found false, expected true, as in the store, or another"
    )
    with refused, scoring(tmp_path, config=published):
        pass
    coarse = replace(config, compression=replace(config.compression, max_rows=4))
    refused = pytest.raises(InvalidValueError, match=r"^compression\.max_rows: found 4, expected 24, as in the store")
    with refused, scoring(tmp_path, config=coarse):
        pass
    with store(tmp_path) as informations:  # of an earlier version, which did not say its loss
        informations.states.save(stored_records(ScorerPosition(version, Cursor(1, TOSSES[0].toss_id))))
    with scoring(tmp_path, config=published) as stage:
        assert stage.version == version


def test_a_toss_of_another_body_is_refused() -> None:
    with pytest.raises(InvalidValueError, match="found bottle, expected cube"):
        checked_body(replace(TOSSES[0], body="bottle"), CONTACTNETS_CUBE)


def test_the_buffer_is_the_ranking_of_all_that_came_in_any_order(tmp_path: Path) -> None:
    informations = scored(TOSSES)
    with curating(tmp_path) as stage:
        added(stage, informations[::-1])
        buffer = stage.buffer()
    assert buffer is not None
    assert buffer.curation.ranking == curate(informations, RankingConfig(top=3)).ranking
    assert buffer.curation.ranking.criterion == "representative"


def test_the_log_det_of_a_buffer_is_what_its_tosses_added_by_log_det(tmp_path: Path) -> None:
    with curating(tmp_path) as stage:
        stage.rank_by(RankingConfig("log-det", top=3))
        added(stage, scored(TOSSES))
        buffer = stage.buffer()
    assert buffer is not None
    gains = [entry.marginal_gain for entry in buffer.curation.ranking.entries if entry.selected]
    assert buffer.log_det == pytest.approx(sum(gains), rel=1e-9)


def test_a_curator_that_died_has_its_buffer_revision_and_place_back(tmp_path: Path) -> None:
    informations = scored(TOSSES)
    with curating(tmp_path) as stage:
        added(stage, informations, first_stamp_ns=100)
        stage.advance(Cursor(8, TOSSES[-1].toss_id))
        before = stage.buffer()
    with curating(tmp_path) as stage:
        after = stage.buffer()
        assert stage.cursor == Cursor(8, TOSSES[-1].toss_id)
        assert stage.last_stamp_ns(TOSSES[2].toss_id) == 102
    assert before is not None
    assert after is not None
    assert after.curation.ranking == before.curation.ranking
    assert (after.revision, after.newest_stamp_ns, after.frame_id) == (before.revision, 107, "board")


def test_the_revision_counts_changes_of_the_kept_set_alone(tmp_path: Path) -> None:
    informations = scored(TOSSES)
    with curating(tmp_path, top=2) as stage:
        revisions = []
        kept = []
        for information in informations:
            added(stage, [information])
            buffer = stage.buffer()
            assert buffer is not None
            revisions.append(buffer.revision)
            kept.append(buffer.curation.ranking.selected_ids)
    changes = [1] + [int(one != other) for one, other in zip(kept[1:], kept)]
    assert revisions == np.cumsum(changes).tolist()
    assert 0 in changes


def test_thetas_are_never_mixed_and_a_new_one_takes_over_when_it_knows_enough(tmp_path: Path) -> None:
    old, new = scored(TOSSES), scored(TOSSES, LARGER)
    with curating(tmp_path) as stage:
        added(stage, old)
        added(stage, new[:7])  # 7 of 8 are less than 90 %
        before = stage.buffer()
        added(stage, new[7:])
        after = stage.buffer()
    assert before is not None
    assert after is not None
    assert {one.parameters_version for one in before.candidates} == {old[0].parameters_version}
    assert {one.parameters_version for one in after.candidates} == {new[0].parameters_version}
    assert after.curation.ranking == curate(new, RankingConfig(top=3)).ranking


def test_thetas_that_come_faster_than_tosses_are_scored_leave_the_complete_one_ranked(tmp_path: Path) -> None:
    complete = scored(TOSSES)
    with curating(tmp_path) as stage:
        added(stage, complete)
        stage.advance(Cursor(8, TOSSES[-1].toss_id))
        for number in range(1, 5):
            larger = replace(CUBE, vertices_normal=CUBE.vertices_normal * (1.0 + 0.01 * number))
            added(stage, scored(TOSSES[:4], larger))
            stage.advance(Cursor(8 + 4 * number, TOSSES[3].toss_id))
        buffer = stage.buffer()
    with curating(tmp_path) as stage, store(tmp_path) as informations:
        again = stage.buffer()
        assert len(informations.versions) == 2  # what is ranked, and the newest
    assert buffer is not None
    assert again is not None
    assert buffer.candidates[0].parameters_version == complete[0].parameters_version
    assert buffer.seen == 8
    assert again.curation.ranking == buffer.curation.ranking


def test_a_theta_that_comes_back_is_scored_and_ranked_as_a_new_one(tmp_path: Path) -> None:
    thetas = [theta_of_geometry(geometry) for geometry in (CUBE, LARGER, CUBE)]
    versions, buffers, announced = [], [], []
    with scoring(tmp_path / "scorer") as scorer, curating(tmp_path / "curator") as curator:
        for number, theta in enumerate(thetas):
            scorer.renew(theta)
            versions.append(scorer.version)
            batch = scorer.score(TOSSES[: 6 + number], FRAMES)
            announced.append([one.sequence for one in batch.new])
            for one in batch.new:
                curator.add(one.information, *one.stamped)
            curator.advance(Cursor(batch.new[-1].sequence, batch.new[-1].information.toss_id))
            buffers.append(curator.buffer())
    assert announced == [list(range(1, 7)), list(range(7, 14)), list(range(14, 22))]
    assert versions[0] == versions[2] != versions[1]
    assert [one.candidates[0].parameters_version for one in buffers if one] == versions
    assert [one.seen for one in buffers if one] == [6, 7, 8]
    with curating(tmp_path / "curator") as curator:
        again = curator.buffer()
    assert again is not None
    assert again.candidates[0].parameters_version == versions[2]


def test_a_body_that_comes_back_after_restarts_is_scored_and_ranked_as_a_new_one(tmp_path: Path) -> None:
    versions, ranked = [], []
    heavier = replace(CONTACTNETS_CUBE, mass=2.0 * CONTACTNETS_CUBE.mass)
    for body in (CONTACTNETS_CUBE, heavier, CONTACTNETS_CUBE, CONTACTNETS_CUBE):
        with scoring(tmp_path / "scorer", body) as scorer, curating(tmp_path / "curator") as curator:
            batch = scorer.score(TOSSES, FRAMES)
            scorer.advance(Cursor(8, TOSSES[-1].toss_id))
            for one in scorer.after(curator.cursor.sequence, 99):
                curator.add(one.information, *one.stamped)
                curator.advance(Cursor(one.sequence, one.information.toss_id))
            versions.append((scorer.version, len(batch.new)))
            ranked.append(curator.buffer())
    assert [number for _, number in versions] == [8, 8, 8, 0]
    assert versions[0][0] != versions[1][0]
    assert [one.candidates[0].parameters_version for one in ranked if one] == [version for version, _ in versions]


def test_information_of_another_body_in_the_store_is_neither_ranked_nor_waited_for(tmp_path: Path) -> None:
    with curating(tmp_path) as stage:
        added(stage, scored(TOSSES))
    with store(tmp_path) as informations:
        stage = CurationStage(RankingConfig(top=3), CurationConfig(), informations, "brick")
        assert stage.buffer() is None
        for one in scored(TOSSES[:2]):
            stage.add(replace(one, body="brick", toss_id=f"brick-{one.toss_id}"), 1, "board")
        buffer = stage.buffer()
    assert buffer is not None
    assert {one.body for one in buffer.candidates} == {"brick"}
    assert (buffer.seen, buffer.newest_stamp_ns) == (2, 1)


def test_a_curator_that_was_started_with_another_body_by_mistake_is_told_everything_once_more(tmp_path: Path) -> None:
    cursor = Cursor(len(TOSSES), TOSSES[-1].toss_id, "theta")
    found = []
    for body in ("cube", "brick", "cube", "cube"):
        with store(tmp_path) as informations:
            stage = CurationStage(RankingConfig(top=3), CurationConfig(), informations, body)
            found.append(stage.cursor)
            stage.advance(cursor)
    assert found == [Cursor(), Cursor(), Cursor(), cursor]


def test_another_body_on_the_same_store_is_scored_at_its_own_theta_and_not_at_what_was_learned(tmp_path: Path) -> None:
    with scoring(tmp_path) as scorer:
        first = scorer.version
        assert not scorer.keeps_newer
        scorer.renew(theta_of_geometry(LARGER))
        scorer.postpone(theta_of_geometry(replace(CUBE, height=0.01)))
        learned = scorer.version
    with scoring(tmp_path) as scorer:
        assert scorer.version == learned
        assert scorer.keeps_newer
        assert scorer.postponed is not None
    heavier = replace(CONTACTNETS_CUBE, mass=2.0 * CONTACTNETS_CUBE.mass)
    with scoring(tmp_path, heavier) as scorer:
        assert scorer.version == parameters_version(CUBE, heavier)
        assert scorer.postponed is None
    with scoring(tmp_path) as scorer:
        assert scorer.version == first


def test_what_comes_once_more_after_a_death_does_not_bring_an_older_theta_back(tmp_path: Path) -> None:
    old, new = scored(TOSSES), scored(TOSSES, LARGER)
    with curating(tmp_path) as stage:
        added(stage, old[:6])
        stage.advance(Cursor(6, old[5].toss_id))
        added(stage, [*old[6:], *new])  # and dies before the cursor moves
    with curating(tmp_path) as stage:
        added(stage, [*old[6:], *new])
        stage.advance(Cursor(16, new[-1].toss_id))
        buffer = stage.buffer()
    assert buffer is not None
    assert buffer.candidates[0].parameters_version == new[0].parameters_version
    assert buffer.seen == 8


def test_information_made_in_another_way_is_refused_and_the_rest_stays_ranked(tmp_path: Path) -> None:
    informations = scored(TOSSES)
    with curating(tmp_path) as stage:
        added(stage, informations[:5])
        with pytest.raises(InvalidValueError, match="found empirical, expected gauss-newton, as stored for these parameters"):
            stage.add(replace(informations[5], estimator="empirical"), 0, "board")
        added(stage, informations[6:])
        buffer = stage.buffer()
    assert buffer is not None
    assert buffer.seen == 7


def test_another_criterion_ranks_what_is_there_already(tmp_path: Path) -> None:
    informations = scored(TOSSES)
    with curating(tmp_path) as stage:
        added(stage, informations)
        stage.rank_by(RankingConfig(criterion="trace", top=2))
        buffer = stage.buffer()
    assert buffer is not None
    traces = {one.toss_id: one.trace for one in buffer.candidates}
    assert len(buffer.curation.ranking.selected_ids) == 2
    assert buffer.curation.ranking == curate(informations, RankingConfig(criterion="trace", top=2)).ranking
    assert len(traces) == 8


def test_a_streaming_trace_keeps_the_same_tosses_with_bounded_memory(tmp_path: Path) -> None:
    informations = scored(TOSSES)
    config = RankingConfig(criterion="trace", top=3)
    selection = StreamingSelection(config, prior_tosses=4)
    for information in informations:
        selection.add(information)
    assert selection.seen == 8
    assert len(selection.candidates) == 3
    largest = sorted(informations, key=lambda one: one.trace, reverse=True)[:3]
    assert {one.toss_id for one in selection.candidates} == {one.toss_id for one in largest}


def test_a_streaming_log_det_takes_its_prior_from_the_first_tosses(tmp_path: Path) -> None:
    selection = StreamingSelection(RankingConfig("log-det", top=3), prior_tosses=4)
    sizes = []
    for information in scored(TOSSES):
        selection.add(information)
        sizes.append(len(selection.candidates))
    assert sizes[:3] == [1, 2, 3]
    assert selection.seen == 8
    assert 1 <= sizes[-1] <= 3


@pytest.mark.parametrize(("criterion", "bounded"), [("log-det", True), ("trace", False), ("representative", False)])
def test_a_buffer_says_what_is_proven_of_it_against_sets_of_its_size(tmp_path: Path, criterion: str, bounded: bool) -> None:
    with curating(tmp_path) as stage:
        stage.rank_by(RankingConfig(criterion, top=3))
        added(stage, scored(TOSSES))
        buffer = stage.buffer()
    assert buffer is not None
    certificate = buffer.curation.ranking.certificate
    assert buffer_message(buffer).efficiency_bound == (certificate.subset if certificate else 0.0)
    assert (certificate is not None and 0.0 < certificate.subset < 1.0) == bounded


def test_nothing_is_proven_of_a_stream_that_has_let_tosses_go(tmp_path: Path) -> None:
    bounds = []
    with curating(tmp_path, config=CurationConfig(selection="streaming", prior_tosses=4)) as stage:
        stage.rank_by(RankingConfig("log-det", top=3))
        for information in scored(TOSSES):
            added(stage, [information])
            buffer = stage.buffer()
            assert buffer is not None
            bounds.append(buffer_message(buffer).efficiency_bound)
    assert min(bounds[:3]) > 0.0
    assert bounds[3:] == [0.0] * 5


def test_a_streaming_curator_selects_by_the_default_criterion_and_after_a_restart_the_same(tmp_path: Path) -> None:
    config = CurationConfig(selection="streaming", prior_tosses=4)
    buffers = []
    for informations in (scored(TOSSES), []):
        with curating(tmp_path, config=config) as stage:
            added(stage, informations)
            buffers.append(stage.buffer())
    before, after = buffers
    assert before is not None
    assert after is not None
    assert buffer_message(before).criterion == "representative"
    assert (before.seen, len(before.candidates)) == (8, 3)
    assert set(before.curation.ranking.selected_ids) == set(rank(scored(TOSSES), RankingConfig(top=3)).selected_ids)
    assert (after.seen, after.curation.ranking) == (before.seen, before.curation.ranking)


def test_a_stream_cannot_keep_to_every_criterion(tmp_path: Path) -> None:
    config = CurationConfig(selection="streaming")
    with store(tmp_path) as informations, pytest.raises(InvalidValueError, match="trace or log-det or representative"):
        CurationStage(RankingConfig(criterion="orthogonal"), config, informations)


def test_a_selection_that_there_is_no_more_is_refused_with_those_that_there_are() -> None:
    with pytest.raises(InvalidValueError, match="unknown selection sieve: expected one of exact, streaming"):
        CurationConfig(selection="sieve")
