"""Throws of a pool that meet the board in as many ways as can be, for a theta that cannot be trusted yet (METHOD 2.4)."""

from collections.abc import Sequence

import numpy as np

from contact_curation.design.exploration import features_of, impact_features, spread
from contact_curation.design.planner import Plan, Planner
from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array
from contact_curation.information.accumulated import Accumulated


def warm_up_plan(
    planner: Planner, names: Sequence[str], known: Sequence[Accumulated], seed: int, thrown: Sequence[Array] = ()
) -> Plan:
    """Throws that first touch the board differently from each other and from those before.

    Neither choice nor limits ask theta; only the gains that the plan names do.

    Args:
        planner: draws and judges releases.
        names: of the throws.
        known: what is known, for the gains.
        seed: of the pool.
        thrown: releases (13,) in SI units of throws before.

    Raises:
        InvalidValueError: fewer releases may be thrown than throws are wanted.
    """
    body = planner.particles[0].body
    releases = planner.outlook.safe(planner.prior, planner.config.pool, np.random.default_rng(seed))
    states = releases.states(planner.config.outlook.placement)
    refusals = planner.outlook.described_refusals(states)
    fine = np.array([index for index, refusal in enumerate(refusals) if refusal is None], dtype=np.int64)
    features, seen = impact_features(body, states), features_of(body, thrown)
    while True:
        if len(fine) < len(names):
            raise InvalidValueError("releases that may be thrown", f"{len(fine)} of {len(states)}", f"{len(names)}")
        picked = fine[spread(features[fine], len(names), seen, seed)]
        answers = planner.outlook.thrower_refusals(states[picked])
        refused = [index for index, answer in zip(picked, answers) if answer]
        if not refused:
            break
        fine = fine[~np.isin(fine, refused)]
    return planner.planned(names, planner.outlook.candidates(releases.taken(picked)), known, refusals)
