"""Throws for tests of the arm: like those that were made, and one in the middle of what it can do."""

import numpy as np

from contact_curation.design.releases import PUBLISHED_PRIOR, Placement
from contact_curation.design.throw import Throw, throw_of_state

PLAIN = Throw(
    throw_id="plain",
    body="cube",
    position=np.array([-0.307, 0.0, 0.16]),
    orientation_wxyz=np.array([1.0, 0.0, 0.0, 0.0]),
    linear_velocity=np.array([1.0, 0.0, 0.0]),
    angular_velocity=np.array([0.0, 2.0, 0.0]),
)


def random_throws(count: int, seed: int) -> list[Throw]:
    """Throws like the published ones, from where the thrower stands by default."""
    states = PUBLISHED_PRIOR.draw(count, np.random.default_rng(seed)).states(Placement())
    return [throw_of_state(f"random{k}", "cube", state) for k, state in enumerate(states)]
