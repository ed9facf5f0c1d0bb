"""The planner's table of postures takes a second: made once for all tests of the arm."""

import pytest

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.sim.throw_motion import ThrowPlanner


@pytest.fixture(scope="session")
def planner() -> ThrowPlanner:
    return ThrowPlanner(CONTACTNETS_CUBE)
