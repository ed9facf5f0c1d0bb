"""When the next throw of an automatic loop is due, by a clock of the test's own."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from contact_curation.errors import InvalidValueError
from contact_curation.stages.design import DesignStage
from contact_curation.stages.records import ThrowLogRecord, load_record
from contact_curation.stages.throw_loop import LoopConfig, ThrowLoop
from contact_curation.storage.stores.state import StateStore
from test.design.cases import CUBE, TRUE
from test.stages.test_design import SECOND, TRUSTING, information

CONFIG = LoopConfig(max_throws=3, toss_timeout=10.0, retry_period=2.0)


class Steady:
    def __init__(self) -> None:
        self.time = 0.0

    def __call__(self) -> float:
        return self.time


@pytest.fixture
def states(tmp_path: Path) -> Iterator[StateStore]:
    with StateStore(tmp_path / "throws.sqlite") as store:
        yield store


def test_a_throw_is_due_when_the_toss_of_the_one_before_came_or_does_not_come(states: StateStore) -> None:
    steady, stage = Steady(), DesignStage(CUBE, TRUSTING, states, TRUE)
    loop = ThrowLoop(stage, CONFIG, steady)
    assert [loop.due(), loop.due()] == [True, False]  # once, until the throw has ended
    proposal = loop.next()
    stage.begin(proposal)
    assert [one.state.value for one in loop.finish(proposal.throw, 1_000_000_000)] == ["executed"]
    assert not loop.due()
    steady.time = 10.0
    assert loop.due()
    proposal = loop.next()
    stage.begin(proposal)
    loop.finish(proposal.throw, 20_000_000_000)
    stage.reject(20_000_000_000, ("gap: found 3",))
    assert loop.due()
    proposal = loop.next()
    stage.begin(proposal)
    loop.finish(proposal.throw, 40_000_000_000)
    steady.time = 1000.0
    assert not loop.due()  # three were made


def test_after_a_throw_that_was_not_made_there_is_a_pause(states: StateStore) -> None:
    steady, stage = Steady(), DesignStage(CUBE, TRUSTING, states, TRUE)
    loop = ThrowLoop(stage, CONFIG, steady)
    assert loop.due()
    stage.begin(loop.next())
    assert [one.detail for one in loop.abandon("joint 4 is too fast")] == ["joint 4 is too fast"]
    assert not loop.due()
    steady.time = 2.0
    assert loop.due()


def test_why_there_is_no_throw_is_kept_for_whoever_supervises_until_there_is_one(
    states: StateStore, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(_: DesignStage) -> None:
        raise InvalidValueError("releases", 0, "some")

    steady, stage = Steady(), DesignStage(CUBE, TRUSTING, states, TRUE)
    loop = ThrowLoop(stage, CONFIG, steady)
    assert loop.due()
    with monkeypatch.context() as broken:
        broken.setattr(DesignStage, "propose", fails)
        with pytest.raises(InvalidValueError, match="releases: found 0"):
            loop.next()
    record = load_record(states.load, ThrowLogRecord)
    assert record is not None
    assert record.no_throw == "releases: found 0, expected some"
    assert not loop.due()
    steady.time = 2.0
    assert loop.due()
    stage.begin(loop.next())
    record = load_record(states.load, ThrowLogRecord)
    assert record is not None
    assert record.no_throw == ""


@pytest.mark.parametrize(
    ("rate", "toss", "goal"), [(1.0, 15.0, 60.0), (0.5, 30.0, 120.0), (2.0, 15.0, 60.0), (0.0, 15.0, 60.0)]
)
def test_timeouts_grow_with_a_simulation_in_slow_motion_and_never_shrink_since_machines_may_be_busy(
    rate: float, toss: float, goal: float
) -> None:
    found = LoopConfig().at_rate(rate)
    assert (found.toss_timeout, found.goal_timeout) == (toss, goal)


def test_with_a_time_for_theta_the_next_throw_waits_until_all_is_learned_or_that_time_is_over(states: StateStore) -> None:
    steady, stage = Steady(), DesignStage(CUBE, TRUSTING, states, TRUE)
    loop = ThrowLoop(stage, replace(CONFIG, theta_timeout=60.0), steady)
    assert loop.due()  # nothing is known that could be learned from
    proposal = loop.next()
    stage.begin(proposal)
    loop.finish(proposal.throw, SECOND)
    stage.add(*information(proposal.throw, SECOND))
    assert not stage.awaits_toss
    assert not loop.due()  # nobody says that it was learned from
    steady.time = 69.9
    assert not loop.due()
    steady.time = 70.0
    assert loop.due()
