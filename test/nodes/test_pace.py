import pytest

from contact_curation.errors import InvalidValueError
from contact_curation.nodes.ros.pace import Pace

SECOND = 10**9


def test_recorded_time_runs_at_the_rate() -> None:
    pace = Pace(2.0, paused=False)
    pace.begin(100 * SECOND, 0)
    assert pace.now(3 * SECOND) == 106 * SECOND
    assert pace.wait_ns(108 * SECOND, 3 * SECOND) == SECOND
    assert pace.wait_ns(105 * SECOND, 3 * SECOND) <= 0


def test_time_stands_still_while_paused_and_goes_on_from_there() -> None:
    pace = Pace(1.0, paused=True)
    pace.begin(0, 0)
    assert pace.wait_ns(SECOND, 50 * SECOND) == float("inf")
    pace.pause(False, 50 * SECOND)
    assert pace.wait_ns(SECOND, 50 * SECOND) == SECOND
    pace.pause(True, 51 * SECOND)
    assert pace.now(99 * SECOND) == SECOND


def test_a_new_rate_changes_what_comes_and_not_what_was() -> None:
    pace = Pace(1.0, paused=False)
    pace.begin(0, 0)
    pace.set_rate(10.0, 2 * SECOND)
    assert pace.now(3 * SECOND) == 12 * SECOND


@pytest.mark.parametrize("rate", [0.0, -1.0, float("inf"), float("nan")])
def test_time_cannot_run_at_a_rate_that_is_not_positive(rate: float) -> None:
    with pytest.raises(InvalidValueError, match="rate"):
        Pace(rate, paused=False)
