"""The headers of goals and results of ExecuteThrow: what is stale, of another board, or not told when is refused."""

import numpy as np
import pytest

from contact_curation.design.throw import Throw
from contact_curation.errors import InvalidValueError
from contact_curation.motion.toss import NANOSECONDS
from contact_curation.nodes.messages.headers import Stamped
from contact_curation.nodes.messages.throw import commanded_throw_of, executed_throw_of, throw_message

THROW = Throw("t", "cube", np.zeros(3), np.eye(4)[0], np.ones(3), np.zeros(3))
NOW_NS, OLDEST = 1000 * NANOSECONDS, 60.0


def message(seconds: float, frame: str = "board") -> object:
    return throw_message(THROW, Stamped(round(seconds * NANOSECONDS), frame))


@pytest.mark.parametrize("seconds", [0.0, 940.0, 999.9, 1000.0, 1060.0])
@pytest.mark.parametrize("frame", ["board", ""])
def test_a_goal_of_now_or_without_a_stamp_is_taken(seconds: float, frame: str) -> None:
    assert commanded_throw_of(message(seconds, frame), "board", NOW_NS, OLDEST).throw_id == "t"


@pytest.mark.parametrize(("seconds", "found"), [(1.0, "999.0 s ago"), (939.9, "60.1 s ago"), (1060.1, "60.1 s ahead")])
def test_a_stale_goal_is_refused_in_one_line(seconds: float, found: str) -> None:
    with pytest.raises(InvalidValueError, match=rf"stamp of the goal: found {found}, expected at most 60 s from now"):
        commanded_throw_of(message(seconds), "board", NOW_NS, OLDEST)
    commanded_throw_of(message(seconds), "board", NOW_NS, 0.0)


def test_a_throw_in_another_frame_is_refused_on_both_sides() -> None:
    line = "frame of throw t: found camera, expected board, or an empty one"
    with pytest.raises(InvalidValueError, match=line):
        commanded_throw_of(message(1000.0, "camera"), "board", NOW_NS, OLDEST)
    with pytest.raises(InvalidValueError, match=line):
        executed_throw_of(message(1000.0, "camera"), "board")


def test_a_result_says_when_the_body_was_released() -> None:
    assert executed_throw_of(message(12.5), "board")[1] == 12.5 * NANOSECONDS
    for seconds, found in ((0.0, "0"), (-4.5, "-4.5")):
        with pytest.raises(InvalidValueError, match=f"stamp of the executed throw: found {found}, expected the time of the"):
            executed_throw_of(message(seconds), "board")
