"""An arm that has stopped throwing is started again, some times, and then the session says so and ends."""

from itertools import count
from pathlib import Path
from types import SimpleNamespace

import pytest

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.session import session as session_module
from contact_curation.session.config import SessionConfig, SessionFolder
from contact_curation.session.events import EventLog
from contact_curation.session.node_parameters import session_parameters
from contact_curation.session.session import LONGEST_PAUSE, MOST_STARTS, Session, Standstill
from contact_curation.session.supervisor import ProgramFailedError

TIMEOUT = 15.0
PAUSE = LONGEST_PAUSE + TIMEOUT


def test_while_throws_come_nothing_is_started_again() -> None:
    standstill = Standstill(0.0, TIMEOUT)
    assert not any(standstill.found(number, 0.9 * PAUSE * number) for number in range(10))


def test_without_throws_the_arm_is_started_again_and_a_throw_makes_all_well() -> None:
    standstill = Standstill(0.0, TIMEOUT)
    assert not standstill.found(0, PAUSE - 1.0)
    for round_number in range(1, 5):  # more often than it may be without a throw
        now = 2.0 * PAUSE * round_number
        assert standstill.found(round_number - 1, now)
        assert not standstill.found(round_number, now + 1.0)


def test_when_starting_again_does_not_help_the_session_ends_with_one_line() -> None:
    standstill = Standstill(0.0, TIMEOUT)
    for attempt in range(1, MOST_STARTS + 1):
        assert standstill.found(0, PAUSE * attempt)
        assert not standstill.found(0, PAUSE * attempt + 1.0)
    with pytest.raises(ProgramFailedError, match="found no throw for 780 s after 0 throws"):
        standstill.found(0, PAUSE * (MOST_STARTS + 1))


def test_where_the_designer_said_why_nothing_is_started_again_in_vain() -> None:
    standstill = Standstill(0.0, TIMEOUT)
    assert not standstill.found(3, 1.0, "releases: found 0")
    with pytest.raises(ProgramFailedError, match="found no throw for 195 s after 3 throws: releases: found 0"):
        standstill.found(3, PAUSE + 1.0, "releases: found 0")


def test_an_arm_is_left_alone_while_the_designer_waits_for_images_to_be_rendered() -> None:
    standstill = Standstill(0.0, 612.0)
    assert not standstill.found(1, 0.0)
    assert not standstill.found(1, 612.0 + LONGEST_PAUSE - 1.0)
    assert standstill.found(1, 612.0 + LONGEST_PAUSE)


def test_on_a_machine_that_gives_no_time_an_arm_is_not_started_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    killed, looks = list[str](), count()
    monkeypatch.setattr(session_module, "time", SimpleNamespace(monotonic=lambda: 60.0 * next(looks), sleep=lambda _: None))
    config, folder = SessionConfig(throws=2), SessionFolder(tmp_path)
    folder.make()
    supervisor = SimpleNamespace(look=lambda: None, kill=killed.append)
    with EventLog(folder.events) as events:
        session = Session(config, session_parameters(config, CONTACTNETS_CUBE, folder), folder, events, print)
        session.follow(supervisor, lambda: next(looks) > 100)  # type: ignore[arg-type]  # an hour and more
    assert killed == []
