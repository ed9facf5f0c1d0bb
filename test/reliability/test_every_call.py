"""Every call that changes a file fails in turn: the old file or the new one, one line, and a restart goes on."""

import pytest

from test.reliability.every_call import FAILURES, under_shim
from test.reliability.programs import PROGRAMS
from test.reliability.shim import Action

QUICK = ("recorder", "score")
"""Which the default tests look at, a call in five."""


@pytest.mark.parametrize("name", QUICK)
def test_a_call_that_fails_here_and_there_loses_nothing(name: str) -> None:
    assert under_shim([name], every=5, actions=(Action.FULL, Action.KILLED))[name].defects == []


@pytest.mark.slow
@pytest.mark.parametrize("name", PROGRAMS)
def test_no_call_that_fails_loses_anything(name: str) -> None:
    tally = under_shim([name], actions=FAILURES)[name]
    assert tally.tried == len(FAILURES) * tally.calls > 0
    assert tally.defects == []
