"""Whatever happens to the nodes of a cell, in whatever order: in the end the buffer is what `rank` gives, and nothing is lost.

Hypothesis makes up the histories and shortens those that fail. HISTORIES=100000 runs so many of them, none of which was run
before; the default are a few, always the same.
"""

from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, rule, run_state_machine_as_test

from test.histories import numbers
from test.histories.asked import histories
from test.histories.cell import CRITERIA, NAMES, NUMBERED, SHIFTS_NS, Cell
from test.histories.nodes import in_one_process

SETTINGS = histories("HISTORIES", 30, 40)
IN_MEMORY = Path("/dev/shm")
"""Where stores are written, if there is such a folder: a history commits hundreds of times."""

names, numbered = st.sampled_from(NAMES), st.integers(0, len(NUMBERED) - 1)


@pytest.fixture(autouse=True)
def _in_one_process() -> Iterator[None]:
    with in_one_process():
        yield


class Histories(RuleBasedStateMachine):
    """Each rule is a step of `Cell`."""

    @initialize(exact=st.booleans(), coverage=st.sampled_from((0.5, 0.9, 1.0)))
    def begin(self, exact: bool, coverage: float) -> None:
        self.folder = TemporaryDirectory(dir=IN_MEMORY if IN_MEMORY.is_dir() else None)
        self.cell = Cell(Path(self.folder.name), exact, coverage)
        self.sound = True

    def do(self, what: str, *how: Any) -> None:
        """A step; where one failed there is nothing to be seen in the end."""
        self.sound = False
        getattr(self.cell, what)(*how)
        self.sound = True

    @rule()
    def cut(self) -> None:
        self.do("cut")

    @rule(number=st.integers(0, 7), steps=st.integers(1, 3))
    def go_on(self, number: int, steps: int) -> None:
        self.do("go_on", number, steps)

    @rule(number=st.integers(0, 7), steps=st.integers(4, 40))
    def go_on_for_long(self, number: int, steps: int) -> None:
        self.do("go_on", number, steps)

    @rule(name=names)
    def tick(self, name: str) -> None:
        self.do("tick", name)

    @rule(name=names)
    def kill(self, name: str) -> None:
        self.do("kill", name)

    @rule(name=names, commits=st.integers(1, 12))
    def die_at(self, name: str, commits: int) -> None:
        self.do("die_at", name, commits)

    @rule(name=names)
    def restart(self, name: str) -> None:
        self.do("restart", name)

    @rule(channel=numbered, what=st.sampled_from(("repeat", "reorder", "drop")))
    def disturb(self, channel: int, what: str) -> None:
        self.do(what, channel)

    @rule(number=st.integers(0, numbers.THETAS - 1))
    def publish_theta(self, number: int) -> None:
        self.do("publish_theta", number)

    @rule(top=st.integers(2, 3), criterion=st.sampled_from(CRITERIA))
    def rank_by(self, top: int, criterion: str) -> None:
        self.do("rank_by", top, criterion)

    @rule(coverage=st.sampled_from((0.5, 0.9, 1.0)))
    def cover(self, coverage: float) -> None:
        self.do("cover", coverage)

    @rule(shift=st.integers(0, len(SHIFTS_NS) - 1))
    def set_clock(self, shift: int) -> None:
        self.do("set_clock", shift)

    @rule(made=st.booleans())
    def end_throw(self, made: bool) -> None:
        self.do("end_throw", made)

    @rule()
    def play_again(self) -> None:
        self.do("play_again")

    @rule(name=names)
    def save(self, name: str) -> None:
        self.do("save", name)

    @rule(lost=st.sets(names))
    def lose_power(self, lost: set[str]) -> None:
        self.do("lose_power", tuple(sorted(lost)))

    @rule(name=names)
    def remove(self, name: str) -> None:
        self.do("remove", name)

    def teardown(self) -> None:
        try:
            if self.sound:
                self.cell.come_to_rest()
                self.cell.check()
        finally:
            self.cell.close()
            self.folder.cleanup()


@pytest.fixture
def cell(tmp_path: Path) -> Iterator[Cell]:
    made = Cell(tmp_path, exact=True, coverage=0.9)
    yield made
    made.close()


def test_tosses_that_were_announced_outlive_the_machine(cell: Cell) -> None:
    for _ in range(3):
        cell.cut()
    cell.come_to_rest()
    cell.lose_power(("keeper",))
    cell.come_to_rest()
    cell.check()


def test_after_any_history_the_buffer_is_what_rank_gives_and_nothing_is_lost() -> None:
    run_state_machine_as_test(Histories, settings=SETTINGS)
