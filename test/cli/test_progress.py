"""Long work says how much is done, how fast, and how long the rest takes."""

import sys

import pytest

from contact_curation.cli import progress
from contact_curation.cli.progress import Progress, in_words


class Clock:
    """A clock that the test moves."""

    def __init__(self) -> None:
        self.now = 100.0

    def monotonic(self) -> float:
        return self.now


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    made = Clock()
    monkeypatch.setattr(progress, "time", made)
    return made


def test_a_line_says_the_rate_and_how_long_the_rest_takes(clock: Clock, capsys: pytest.CaptureFixture[str]) -> None:
    with Progress("training", "steps", total=100, done=20) as bar:
        clock.now += 20.0
        bar.advance(40, "loss 0.1")
    assert capsys.readouterr().err == "training: 60 of 100 steps, 2 steps/s, 20 s left, loss 0.1\n"


def test_where_nobody_knows_the_total_the_share_says_how_long_it_takes(
    clock: Clock, capsys: pytest.CaptureFixture[str]
) -> None:
    with Progress("reading", "tosses") as bar:
        clock.now += 20.0
        bar.advance(10)
        clock.now += 40.0
        bar.advance(5, note="1 of 4 recordings", share=0.25)
        clock.now += 60.0
        bar.advance(15)
    assert capsys.readouterr().err.splitlines() == [
        "reading: 10 tosses, 0.5 tosses/s",
        "reading: 15 tosses, 0.25 tosses/s, 3 min left, 1 of 4 recordings",
        "reading: 30 tosses, 0.25 tosses/s, 6 min left, 1 of 4 recordings",
    ]


def test_a_bar_on_a_terminal_has_them_too(
    clock: Clock, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    with Progress("reading", "tosses") as bar:
        clock.now += 10.0
        bar.advance(5, share=0.5)
        assert "10 s left" in str(bar._bar)


@pytest.mark.parametrize(("seconds", "words"), [(0.2, "0 s"), (59.0, "59 s"), (90.0, "2 min"), (5400.0, "1.5 h")])
def test_times_are_in_words(seconds: float, words: str) -> None:
    assert in_words(seconds) == words
