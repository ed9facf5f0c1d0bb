import pytest

from contact_curation.errors import InvalidValueError
from contact_curation.stages.playback import PlaybackClock

SECOND = 10**9


def test_recorded_time_runs_at_the_rate() -> None:
    clock = PlaybackClock(2.0, paused=False)
    clock.begin(100 * SECOND, 0)
    assert clock.now(3 * SECOND) == 106 * SECOND
    assert clock.wait_ns(108 * SECOND, 3 * SECOND) == SECOND
    assert clock.wait_ns(105 * SECOND, 3 * SECOND) <= 0


def test_time_stands_still_while_paused_and_goes_on_from_there() -> None:
    clock = PlaybackClock(1.0, paused=True)
    clock.begin(0, 0)
    assert clock.wait_ns(SECOND, 50 * SECOND) == float("inf")
    clock.pause(False, 50 * SECOND)
    assert clock.wait_ns(SECOND, 50 * SECOND) == SECOND
    clock.pause(True, 51 * SECOND)
    assert clock.now(99 * SECOND) == SECOND


def test_a_new_rate_changes_what_comes_and_not_what_was() -> None:
    clock = PlaybackClock(1.0, paused=False)
    clock.begin(0, 0)
    clock.set_rate(10.0, 2 * SECOND)
    assert clock.now(3 * SECOND) == 12 * SECOND


@pytest.mark.parametrize("rate", [0.0, -1.0, float("inf"), float("nan")])
def test_time_cannot_run_at_a_rate_that_is_not_positive(rate: float) -> None:
    with pytest.raises(InvalidValueError, match="rate"):
        PlaybackClock(rate, paused=False)
