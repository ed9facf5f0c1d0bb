"""Histories are the same for the same number, and shortened to what makes them fail."""

from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from test.histories.history import Histories, try_histories


class Counter:
    def __init__(self, start: int) -> None:
        self.count = start

    def add(self, number: int) -> None:
        self.count += number

    def rest(self) -> None:
        """Does nothing."""

    def finish(self) -> None:
        assert self.count < 7


@contextmanager
def counter(start: int) -> Iterator[Counter]:
    yield Counter(start)


COUNTERS = Histories(counter, ((0, 1),), (("add", range(1, 4)), ("rest",)), length=12)


def test_a_number_always_gives_the_same_history_and_another_one_a_different_one() -> None:
    histories = [COUNTERS.history(number) for number in range(50)]
    assert histories == [COUNTERS.history(number) for number in range(50)]
    assert len(set(histories)) > 40
    assert {step[0] for history in histories for step in history} == {"begin", "add", "rest"}


def test_a_history_that_fails_is_shortened_to_steps_that_it_all_needs() -> None:
    long = (("begin", 0), ("rest",), *((("add", 3), ("rest",)) * 4))
    assert COUNTERS.fails(long)
    assert COUNTERS.shortened(long) == (("begin", 0), *(("add", 3),) * 3)


def test_what_failed_is_said_in_its_shortest_form() -> None:
    with pytest.raises(AssertionError, match=r"(?s)history \d+ fails.*\('begin', .*\('add'") as raised:
        try_histories(COUNTERS, "NO_SUCH_VARIABLE", 50)
    assert "rest" not in str(raised.value)
