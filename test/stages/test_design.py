"""The designer without its node: when it trusts theta, which toss belongs to which throw, and what a restart finds."""

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from contact_curation.contact.parameter_form import Form
from contact_curation.design.designer import Designer, DesignerConfig
from contact_curation.design.predicted_information import Particle
from contact_curation.design.readiness import ReadinessConfig
from contact_curation.design.throw import Throw, ThrowKind, ThrowState
from contact_curation.errors import InvalidValueError
from contact_curation.information.record import TossInformation
from contact_curation.information.scoring import Scorer, ScoringConfig
from contact_curation.simulation.thrown_toss import thrown_toss
from contact_curation.stages.design import DesignStage, RankedBuffer, TrainerRest
from contact_curation.storage.stores.state import StateStore
from test.design.cases import CUBE, LOSS, PARTICLE, SMALL, TRUE, other_theta
from test.simulated import simulated_tosses

CONFIG = DesignerConfig(SMALL, ReadinessConfig(least_tosses=2, least_agreement=-1.0), LOSS)
TRUSTING = replace(CONFIG, readiness=ReadinessConfig(enabled=False))
NEARLY = other_theta(1.001, 0.181)
SECOND = 1_000_000_000


@pytest.fixture
def states(tmp_path: Path) -> Iterator[StateStore]:
    with StateStore(tmp_path / "throws.sqlite") as store:
        yield store


def information(throw: Throw, stamp_ns: int, theta: Particle = PARTICLE) -> tuple[TossInformation, int]:
    """The information of the throw's toss, and its last stamp, where it was released at `stamp_ns`."""
    toss = thrown_toss(CUBE, throw, first_stamp_ns=stamp_ns)
    found = theta.scorer.score([toss])[0]
    assert isinstance(found, TossInformation)
    return found, int(toss.stamps_ns[-1])


def thrown(stage: DesignStage, stamp_ns: int) -> Throw:
    """Makes the next throw, exactly as commanded."""
    proposal = stage.propose()
    stage.begin(proposal)
    stage.finish(proposal.throw, stamp_ns)
    return proposal.throw


def known(stage: DesignStage, count: int, seed: int = 0) -> list[TossInformation]:
    """Tosses that are scored and kept."""
    infos = [info for info in PARTICLE.scorer.score(simulated_tosses(count, seed)) if isinstance(info, TossInformation)]
    for number, info in enumerate(infos):
        stage.add(info, number)
    stage.select(RankedBuffer(tuple(info.toss_id for info in infos)))
    return infos


def test_without_theta_throws_explore_each_unlike_those_before(states: StateStore) -> None:
    stage = DesignStage(CUBE, CONFIG, states)
    first = thrown(stage, SECOND)
    proposal = stage.propose()
    assert proposal.exploration == "parameters: found none, expected model_parameters"
    assert (first.expected_information, first.parameters_version) == (0.0, "")
    assert proposal.throw.throw_id == "cube-throw-1"
    assert np.abs(proposal.throw.orientation_wxyz - first.orientation_wxyz).max() > 0.05


def test_theta_is_trusted_when_tosses_fit_it_and_the_theta_before_it_was_like_it(states: StateStore) -> None:
    stage = DesignStage(CUBE, CONFIG, states)
    assert stage.renew(NEARLY.geometry)
    known(stage, 3)
    assert stage.distrust() == "tosses: found 0, expected at least 2"  # they were scored at another theta
    for info in NEARLY.scorer.score(simulated_tosses(3, 0)):
        assert isinstance(info, TossInformation)
        stage.add(info, 5)
    assert stage.distrust() == "thetas: found 1, expected two that agree"
    assert stage.renew(TRUE)
    assert not stage.renew(TRUE)
    assert stage.distrust() is None
    proposal = stage.propose()
    assert proposal.exploration is None
    assert proposal.throw.parameters_version == PARTICLE.version
    assert proposal.throw.expected_information > 0.0


def test_thetas_are_compared_by_the_same_reference_throws_after_a_restart_with_others(states: StateStore) -> None:
    known(stage := DesignStage(CUBE, CONFIG, states, TRUE), 3)
    assert stage.distrust() == "thetas: found 1, expected two that agree"
    again = DesignStage(CUBE, replace(CONFIG, planner=replace(SMALL, reference=16)), states)
    again.renew(NEARLY.geometry)
    infos = [info for info in NEARLY.scorer.score(simulated_tosses(3, 0)) if isinstance(info, TossInformation)]
    for info in infos:
        again.add(info, 5)
    again.select(RankedBuffer(tuple(info.toss_id for info in infos)))
    assert again.distrust() == "thetas: found 1, expected two that agree"
    again.renew(TRUE)
    known(again, 3)
    assert again.distrust() is None


def test_a_theta_of_another_body_is_forgotten(states: StateStore) -> None:
    DesignStage(CUBE, CONFIG, states).renew(NEARLY.geometry)
    assert DesignStage(CUBE, CONFIG, states).version == NEARLY.version
    given = [DesignStage(CUBE, CONFIG, states, geometry) for geometry in (TRUE, NEARLY.geometry, None)]
    assert [(one.version, one.keeps_newer) for one in given] == [(NEARLY.version, new) for new in (True, False, False)]
    assert DesignStage(replace(CUBE, mass=2.0 * CUBE.mass), CONFIG, states).version == ""


def test_what_theta_learned_from_does_not_count_as_predicted(states: StateStore) -> None:
    stage = DesignStage(CUBE, CONFIG, states, TRUE)
    stage.renew(NEARLY.geometry)
    infos = known(stage, 3)
    for info in infos:  # the same tosses at the theta that learned from them
        stage.add(replace(info, parameters_version=NEARLY.version, mean_loss=0.001), 5)
    stage.select(RankedBuffer(tuple(info.toss_id for info in infos)))
    assert stage.distrust() == "thetas: found 1, expected two that agree"
    strange = replace(infos[0], toss_id="strange", mean_loss=7.0, parameters_version="some first theta")
    for number in range(4):
        one = replace(strange, toss_id=f"strange-{number}")
        stage.add(one, 10 + number)
        stage.add(replace(one, parameters_version=NEARLY.version, mean_loss=0.001), 10 + number)
    stage.select(RankedBuffer(tuple(f"strange-{number}" for number in range(4))))
    assert stage.distrust() == "loss: found a median of 7, expected at most 0.15"
    again = DesignStage(CUBE, CONFIG, states)
    for number in range(4):  # all that a scorer still has after a restart
        again.add(
            replace(strange, toss_id=f"strange-{number}", parameters_version=NEARLY.version, mean_loss=0.001), 10 + number
        )
    again.select(RankedBuffer(tuple(f"strange-{number}" for number in range(4))))
    assert again.distrust() == "loss: found a median of 7, expected at most 0.15"


def test_a_rejected_motion_ends_the_wait_of_the_throw_that_it_began_with_and_of_no_other(states: StateStore) -> None:
    stage = DesignStage(CUBE, TRUSTING, states, TRUE)
    thrown(stage, SECOND)
    waits = []
    for first_ns, reason in ((SECOND // 2, "carried"), (SECOND + 7_000_000, "depth: found 9 mm"), (2 * SECOND, "still")):
        stage.reject(first_ns, (reason,))
        waits.append(stage.awaits_toss)
    assert waits == [True, False, False]
    assert stage.reports[0].detail == "rejected: depth: found 9 mm"
    assert stage.reports[0].state is ThrowState.EXECUTED
    again = DesignStage(CUBE, TRUSTING, states)
    assert not again.awaits_toss
    proposal = again.propose()
    again.begin(proposal)
    again.reject(3 * SECOND, ("gap: found 0.1 s",))  # of the throw under way: nobody has told yet when it left
    again.finish(proposal.throw, 3 * SECOND)
    assert again.reports[1].detail == "rejected: gap: found 0.1 s"


def test_a_toss_behind_a_rejected_motion_is_still_the_throws(states: StateStore) -> None:
    stage = DesignStage(CUBE, TRUSTING, states, TRUE)
    throw = thrown(stage, SECOND)
    stage.reject(SECOND, ("gap: found 0.1 s",))
    info, stamp_ns = information(throw, SECOND)
    stage.add(info, stamp_ns)
    assert (stage.reports[0].state, stage.reports[0].toss_id, stage.reports[0].detail) == (ThrowState.SCORED, info.toss_id, "")


def test_a_theta_at_which_nothing_comes_to_rest_is_not_followed_but_said(states: StateStore) -> None:
    stage = DesignStage(CUBE, TRUSTING, states, other_theta(1.0, 1e-3).geometry)
    proposal = stage.propose()
    assert proposal.exploration is not None
    assert "releases that may be thrown: found 0" in proposal.exploration
    assert proposal.throw.expected_information == 0.0


def test_proposals_repeat_by_seed_and_state(states: StateStore) -> None:
    stage = DesignStage(CUBE, TRUSTING, states, TRUE)
    one, other, third = (stage.propose(seed).throw.to_mapping() for seed in (7, 7, 8))
    assert one == other != third
    assert one["throw_id"] == "cube-throw-0-7"


def test_the_first_toss_behind_a_throw_is_the_throws_whenever_it_is_heard_of(states: StateStore) -> None:
    stage = DesignStage(CUBE, TRUSTING, states, TRUE)
    old = known(stage, 2)
    throw = thrown(stage, SECOND)
    assert stage.awaits_toss
    stage.add(old[0], 3)  # an old one, scored again
    assert stage.awaits_toss
    info, stamp_ns = information(throw, SECOND)
    stage.select(RankedBuffer((*(one.toss_id for one in old), info.toss_id)))  # the curator heard of it first
    stage.add(info, stamp_ns)
    made = stage.throws[-1]
    assert made.toss_id == info.toss_id
    assert made.realised is not None
    assert 0.7 < made.realised.ratio < 1.3
    proposal = stage.propose()
    stage.begin(proposal)
    early, early_ns = information(proposal.throw, 20 * SECOND)
    stage.add(early, early_ns)  # scored before the thrower said that it was thrown
    stage.finish(proposal.throw, 20 * SECOND)
    assert stage.throws[-1].toss_id == early.toss_id


def test_a_toss_that_comes_late_is_not_the_next_throws(states: StateStore) -> None:
    stage = DesignStage(CUBE, TRUSTING, states, TRUE)
    first = thrown(stage, SECOND)
    thrown(stage, 20 * SECOND)  # nobody waited for the first one's toss
    late, late_ns = information(first, SECOND)
    stage.add(late, late_ns)
    assert [made.toss_id for made in stage.throws] == [late.toss_id, ""]


def test_a_toss_that_is_scored_before_its_throw_is_told_of_is_not_an_earlier_throws(states: StateStore) -> None:
    stage = DesignStage(CUBE, TRUSTING, states, TRUE)
    thrown(stage, SECOND)  # its toss was lost
    proposal = stage.propose()
    stage.begin(proposal)
    info, stamp_ns = information(proposal.throw, 20 * SECOND)
    stage.add(info, stamp_ns)
    assert [made.toss_id for made in stage.throws] == [""]
    stage.finish(proposal.throw, 20 * SECOND)
    assert [made.toss_id for made in stage.throws] == ["", info.toss_id]


def test_a_toss_that_comes_late_has_a_gain_and_lowers_what_the_next_throw_was_planned_to_gain(states: StateStore) -> None:
    stage = DesignStage(CUBE, TRUSTING, states, TRUE)
    late, last = thrown(stage, SECOND), thrown(stage, 5 * SECOND)  # the second one planned without the toss of the first
    for throw, released_ns in ((late, SECOND), (last, 5 * SECOND)):
        stage.add(*information(throw, released_ns))
    ratios = [made.realised.ratio for made in stage.throws if made.realised]
    assert [0.7 < ratio < 1.3 for ratio in ratios] == [True, True]
    assert stage.reports[0].planned == pytest.approx(late.expected_information, rel=1e-9)
    assert stage.reports[1].planned < 0.5 * last.expected_information


def test_a_throw_is_told_of_from_its_command_to_its_gain(states: StateStore) -> None:
    stage = DesignStage(CUBE, TRUSTING, states, TRUE)
    proposal = stage.propose()
    told = [stage.begin(proposal)]
    stage.finish(proposal.throw, 7 * SECOND)
    told += stage.reports
    info, stamp_ns = information(proposal.throw, 7 * SECOND)
    stage.add(info, stamp_ns)
    told += stage.reports
    assert [one.state for one in told] == [ThrowState.COMMANDED, ThrowState.EXECUTED, ThrowState.SCORED]
    assert [one.toss_id for one in told] == ["", "", info.toss_id]
    assert [one.released_ns for one in told] == [0, 7 * SECOND, 7 * SECOND]
    assert {one.kind for one in told} == {ThrowKind.DESIGNED}
    assert [one.planned for one in told] == pytest.approx([proposal.throw.expected_information] * 3, rel=1e-9)
    assert [math.isnan(one.realised) for one in told] == [True, True, False]
    assert told[-1].realised == stage.throws[-1].realised.realised  # type: ignore[union-attr]


def test_a_throw_that_was_not_made_is_told_with_the_reason_and_one_of_exploration_with_its_own(states: StateStore) -> None:
    stage = DesignStage(CUBE, CONFIG, states)
    proposal = stage.propose()
    begun = stage.begin(proposal)
    assert (begun.kind, begun.planned, begun.detail) == (ThrowKind.EXPLORATION, 0.0, proposal.exploration)
    report = stage.abandon("joint 4 is too fast")
    assert (report.state, report.detail) == (ThrowState.NOT_MADE, "joint 4 is too fast")
    assert report.commanded.throw_id == "cube-throw-0"
    assert stage.propose().throw.throw_id == "cube-throw-1"
    thrown(stage, SECOND)
    assert stage.reports[-1].detail == "parameters: found none, expected model_parameters"
    assert len(stage.reports) == 1
    with pytest.raises(InvalidValueError, match="throw under way: found none"):
        stage.abandon("again")


def test_another_throw_than_the_commanded_one_is_refused(states: StateStore) -> None:
    stage = DesignStage(CUBE, CONFIG, states)
    proposal = stage.propose()
    stage.begin(proposal)
    with pytest.raises(InvalidValueError, match="executed throw: found other, expected cube-throw-0"):
        stage.finish(replace(proposal.throw, throw_id="other"), SECOND)
    assert stage.abandon("it made another").state is ThrowState.NOT_MADE


@pytest.mark.parametrize(
    ("change", "line"),
    [
        (lambda throw: {"position": 1e3 * throw.position}, "executed position"),
        (lambda throw: {"linear_velocity": np.array([1e308, -1e308, 1e308])}, "executed velocity"),
        (lambda throw: {"angular_velocity": throw.angular_velocity + np.array([0.0, 0.0, 90.0])}, "executed spin: found 90"),
        (lambda throw: {"body": "brick"}, "body of executed throw cube-throw-0: found brick, expected cube"),
    ],
)  # fmt: skip
def test_what_cannot_have_become_of_a_throw_is_refused_and_teaches_nothing_about_the_thrower(
    change: Callable[[Throw], dict[str, Any]], line: str, states: StateStore
) -> None:
    stage = DesignStage(CUBE, TRUSTING, states, TRUE)
    proposal = stage.propose()
    stage.begin(proposal)
    with pytest.raises(InvalidValueError, match=line):
        stage.finish(replace(proposal.throw, **change(proposal.throw)), SECOND)
    assert stage.abandon("no such throw").state is ThrowState.NOT_MADE
    assert stage.propose().exploration is None


def test_a_designed_throw_has_a_gain_though_its_toss_is_scored_at_a_newer_theta_only(states: StateStore) -> None:
    stage = DesignStage(CUBE, TRUSTING, states, NEARLY.geometry)
    throw = thrown(stage, SECOND)
    assert throw.parameters_version == NEARLY.version
    info, stamp_ns = information(throw, SECOND)  # at the true theta, of which the stage has not heard yet
    stage.add(info, stamp_ns)
    assert stage.throws[-1].toss_id == info.toss_id
    assert stage.throws[-1].realised is None
    stage.renew(TRUE)
    realised = stage.throws[0].realised
    assert realised is not None
    assert realised.planned != throw.expected_information  # forecast anew
    assert 0.7 < realised.ratio < 1.3
    assert stage.reports[-1].planned == realised.planned


def test_while_tosses_are_scored_again_throws_are_planned_where_all_of_them_are_known(states: StateStore) -> None:
    stage = DesignStage(CUBE, TRUSTING, states, TRUE)
    known(stage, 6)
    stage.renew(NEARLY.geometry)
    assert stage.version == NEARLY.version
    assert stage.propose().throw.parameters_version == PARTICLE.version
    again = [info for info in NEARLY.scorer.score(simulated_tosses(6, 0)) if isinstance(info, TossInformation)]
    for number, info in enumerate(again[:5]):
        stage.add(info, number)
    assert stage.propose().throw.parameters_version == PARTICLE.version
    stage.add(again[5], 5)
    assert stage.propose().throw.parameters_version == NEARLY.version


def test_what_is_known_lowers_what_is_planned(states: StateStore) -> None:
    stage = DesignStage(CUBE, TRUSTING, states, TRUE)
    before = stage.propose(1).throw.expected_information
    known(stage, 6)
    assert stage.propose(1).throw.expected_information < 0.5 * before


def test_a_stage_that_comes_back_knows_its_throws_theta_and_numbers(states: StateStore) -> None:
    stage = DesignStage(CUBE, TRUSTING, states, TRUE)
    stage.renew(NEARLY.geometry)
    throw = thrown(stage, SECOND)
    stage.add(*information(throw, SECOND, NEARLY))
    lost = stage.propose()
    stage.begin(lost)  # and killed while the throw is under way
    again = DesignStage(CUBE, TRUSTING, states)
    assert [one.state for one in again.reports] == [ThrowState.SCORED, ThrowState.NOT_MADE]
    assert again.reports[-1].commanded.to_mapping() == lost.throw.to_mapping()
    assert again.reports[-1].detail == "the designer died while it was under way; whether it was made is not known"
    assert again.version == NEARLY.version
    assert [made.toss_id for made in again.throws] == [made.toss_id for made in stage.throws]
    assert again.throws[-1].realised == stage.throws[-1].realised
    assert again.throws[-1].commanded.to_mapping() == throw.to_mapping()
    assert again.propose().throw.throw_id == "cube-throw-2"
    assert again.ratio == stage.ratio


def test_information_that_was_made_in_another_way_ends_a_proposal_in_one_line(states: StateStore) -> None:
    stage = DesignStage(CUBE, TRUSTING, states, TRUE)
    info = known(stage, 1)[0]
    stage.add(replace(info, estimator="empirical"), 3)
    with pytest.raises(InvalidValueError, match=r"estimator of toss .*: found empirical, expected gauss-newton"):
        stage.propose()


def test_information_of_old_thetas_is_forgotten(states: StateStore) -> None:
    stage = DesignStage(CUBE, TRUSTING, states, TRUE)
    info = known(stage, 1)[0]
    before = stage.propose(1).throw.expected_information
    for version in ("a", "b", "c"):
        stage.add(replace(info, parameters_version=version), 3)
    assert stage.propose(1).throw.expected_information == before


def test_it_is_up_to_date_when_the_trainer_rests_on_a_buffer_with_all_tosses_and_its_theta_has_come(states: StateStore) -> None:
    stage = DesignStage(CUBE, CONFIG, states)
    first, second = (info for info in PARTICLE.scorer.score(simulated_tosses(2, 0)) if isinstance(info, TossInformation))

    def up_to_date() -> bool:
        return stage.is_up_to_date

    def ranked(version: str, revision: int, seen: int, newest_ns: int) -> None:
        stage.select(RankedBuffer((first.toss_id,), revision, version, seen, newest_ns))

    assert up_to_date()  # nothing is known
    stage.add(replace(first, parameters_version="described"), 5)
    ranked("described", 1, 1, 5)
    assert not up_to_date()  # the trainer may be about to begin
    stage.rest(TrainerRest(1, 5, ""))
    assert up_to_date()  # one toss is too few to learn from
    stage.add(replace(second, parameters_version="described"), 9)
    ranked("described", 2, 2, 9)
    assert not up_to_date()
    stage.rest(TrainerRest(2, 9, PARTICLE.version))
    stage.renew(TRUE)
    assert not up_to_date()  # nothing is scored at it
    ranked(PARTICLE.version, 3, 1, 9)
    stage.rest(TrainerRest(3, 9, PARTICLE.version))
    stage.add(first, 5)
    assert not up_to_date()
    stage.add(second, 9)
    assert not up_to_date()  # of the buffer's tosses one is missing
    ranked(PARTICLE.version, 3, 2, 9)
    assert up_to_date()
    stage.rest(TrainerRest())  # it trains
    assert not up_to_date()


@pytest.mark.parametrize("form", [Form.RIGID, Form.PHYSICAL])
def test_a_theta_as_a_user_writes_it_is_designed_with_as_it_is_scored(form: Form) -> None:
    particle = Designer(CUBE, replace(CONFIG, form=form)).particle(TRUE)
    assert particle.scorer.form.form is form
    assert particle.version == Scorer(TRUE, CUBE, ScoringConfig(form=form, loss=LOSS)).version
