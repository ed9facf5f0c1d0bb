"""Time that counts only while someone works, by a clock of the test's own."""

import pytest

from contact_curation.stages.simulated_time import AwakeClock


class Steady:
    def __init__(self) -> None:
        self.time = 100.0

    def __call__(self) -> float:
        return self.time


def test_time_passes_as_on_the_steady_clock_while_ticks_come_often() -> None:
    steady = Steady()
    clock = AwakeClock(steady, longest=0.1)
    for _ in range(50):
        steady.time += 0.03
        clock.tick()
    assert clock.now() == pytest.approx(1.5)
    steady.time += 0.04
    assert clock.now() == pytest.approx(1.54)


def test_a_standstill_counts_no_more_than_its_share_and_time_never_goes_back() -> None:
    steady = Steady()
    clock = AwakeClock(steady, longest=0.1)
    steady.time += 60.0
    asleep = clock.now()
    assert asleep == pytest.approx(0.1)
    assert clock.tick() == pytest.approx(asleep)
    steady.time += 0.05
    assert clock.now() == pytest.approx(0.15)
