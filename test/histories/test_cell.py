"""Whatever happens to the nodes of a cell, in whatever order: in the end the buffer is what `rank` gives, and nothing is lost.

HISTORIES=100000 runs so many new histories; the default are a few, always the same.
"""

import itertools
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

from test.histories import numbers
from test.histories.cell import CRITERIA, NAMES, NUMBERED, SHIFTS_NS, Cell
from test.histories.history import Histories, History, try_histories
from test.histories.nodes import in_one_process

IN_MEMORY = Path("/dev/shm")
"""Where stores are written, if there is such a folder: a history commits hundreds of times."""
COVERAGES = (0.5, 0.9, 1.0)
CHANNELS = range(8)
SOME_NAMES = tuple(some for count in range(len(NAMES) + 1) for some in itertools.combinations(NAMES, count))


@contextmanager
def cell_in_memory(exact: bool, coverage: float) -> Iterator[Cell]:
    with TemporaryDirectory(dir=IN_MEMORY if IN_MEMORY.is_dir() else None) as folder:
        cell = Cell(Path(folder), exact, coverage)
        try:
            yield cell
        finally:
            cell.close()


HISTORIES = Histories(
    cell_in_memory,
    ((False, True), COVERAGES),
    (
        ("cut",),
        ("go_on", CHANNELS, range(1, 4)),
        ("go_on", CHANNELS, range(4, 41)),
        ("tick", NAMES),
        ("kill", NAMES),
        ("die_at", NAMES, range(1, 13)),
        ("restart", NAMES),
        ("repeat", NUMBERED),
        ("reorder", NUMBERED),
        ("drop", NUMBERED),
        ("publish_theta", range(numbers.THETAS)),
        ("rank_by", (2, 3), CRITERIA),
        ("cover", COVERAGES),
        ("set_clock", SHIFTS_NS),
        ("end_throw", (False, True)),
        ("play_again",),
        ("save", NAMES),
        ("lose_power", SOME_NAMES),
        ("remove", NAMES),
    ),
    length=40,
)
FAILED: dict[str, History] = {
    "a synced toss outlives the machine": (
        ("begin", True, 0.9),
        *(("cut",),) * 3,
        ("come_to_rest",),
        ("lose_power", ("keeper",)),
    ),
    "a message of a store that is gone comes before those of the next one": (
        ("begin", False, 1.0),
        ("cut",),
        ("remove", "keeper"),
        ("cut",),
    ),
    "a number of the scorer stands for one record, also after the machine died": (
        ("begin", True, 0.5),
        ("publish_theta", 1),
        ("go_on", 4, 24),
        ("cut",),
        ("go_on", 1, 16),
        ("lose_power", ("keeper", "scorer")),
    ),
    "a store is removed while its last message and a question are on their way": (
        ("begin", False, 0.5),
        ("cut",),
        ("remove", "keeper"),
        ("cut",),
        ("tick", "scorer"),
    ),
    "the first message of the next store is lost": (
        ("begin", True, 0.9),
        ("cut",),
        ("remove", "keeper"),
        ("cut",),
        ("reorder", "toss>scorer"),
        ("drop", "toss>scorer"),
    ),
    "two stores are removed, one after the other": (
        ("begin", False, 0.9),
        ("cut",),
        ("lose_power", ("trainer", "designer")),
        ("publish_theta", 1),
        ("go_on", 1, 25),
        ("remove", "keeper"),
        ("remove", "scorer"),
    ),
    "a coverage that rises when most tosses are known at no theta any more": (
        ("begin", True, 0.5),
        *(("cut",),) * 3,
        ("go_on", 6, 40),
        ("go_on", 3, 36),
        ("cover", 0.9),
    ),
    "one theta after the other is scored for half of the tosses": (
        ("begin", True, 1.0),
        *(("cut",),) * 2,
        ("cover", 0.5),
        *(("cut",),) * 4,
        ("reorder", "toss>scorer"),
    ),
    "the same toss has the first number of the next store, at another theta": (
        ("begin", False, 1.0),
        ("publish_theta", 1),
        ("go_on", 3, 23),
        ("cut",),
        ("go_on", 3, 39),
        ("remove", "scorer"),
        ("cover", 0.5),
    ),
    "the machine dies twice": (
        ("begin", False, 0.9),
        *(("cut",),) * 3,
        ("go_on", 2, 38),
        ("lose_power", ("keeper", "scorer", "curator", "designer")),
        ("cut",),
        ("go_on", 5, 33),
        ("lose_power", ("scorer",)),
    ),
}
"""Histories that failed once, by what they showed."""


@pytest.fixture(autouse=True)
def _in_one_process() -> Iterator[None]:
    with in_one_process():
        yield


@pytest.mark.parametrize("shown", FAILED)
def test_a_history_that_failed_once_fails_no_more(shown: str) -> None:
    HISTORIES.play(FAILED[shown])


def test_after_any_history_the_buffer_is_what_rank_gives_and_nothing_is_lost() -> None:
    try_histories(HISTORIES, "HISTORIES", 50)
