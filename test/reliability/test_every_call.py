"""Every call that changes a file fails in turn: the old file or the new one, one line, and a restart goes on."""

import pytest

from test.reliability.every_call import FAILURES, under_shim
from test.reliability.programs import PROGRAMS
from test.reliability.shim import Action

QUICK = ("recorder",)
"""Which the default tests look at, a call in 24."""

EACH = 9
"""Of the slow tests: each ninth call of every program. `python -m test.reliability.every_call` takes them all."""


@pytest.mark.parametrize("name", QUICK)
def test_a_call_that_fails_here_and_there_loses_nothing(name: str) -> None:
    assert under_shim([name], every=48, actions=(Action.FULL, Action.KILLED))[name].defects == []


@pytest.mark.slow
@pytest.mark.parametrize("name", PROGRAMS)
def test_no_call_that_fails_loses_anything(name: str) -> None:
    tally = under_shim([name], every=EACH, actions=FAILURES)[name]
    assert tally.tried == len(FAILURES) * len(range(0, tally.calls, EACH)) > 0
    assert tally.defects == []
