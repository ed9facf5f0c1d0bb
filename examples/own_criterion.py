"""A criterion of one's own: tosses are selected by their Fisher information per second.

    python examples/own_criterion.py session.mcap [more.mcap ...]

A criterion gets the same tosses once per theta, and gives back a score for each. As soon as it is registered, `cc.rank` and the
nodes know it by its name; docs/explanation/criteria.md says what else it can have.
"""

import sys
from collections.abc import Sequence

import numpy as np

import contact_curation as cc
from contact_curation.information.criteria.criterion import Criterion, RankingConfig, register
from contact_curation.information.pool import Pool
from contact_curation.information.ranking import Selection, modular_selection


def select(pools: Sequence[Pool], config: RankingConfig) -> Selection:
    """Trace of the Fisher matrix [characteristic units] over duration [s], mean over the thetas."""
    rates = [[info.trace / info.duration for info in pool.infos] for pool in pools]
    return modular_selection(np.mean(rates, axis=0), config.top)


register(Criterion("trace-rate", "Fisher information per second", "1/s", select))

tosses = cc.read(sys.argv[1:])
ours, theirs = cc.rank(tosses, top=5, criterion="trace-rate"), cc.rank(tosses, top=5, criterion="trace")
print(ours)
print(f"selected by both: {len(set(ours.selected_ids) & set(theirs.selected_ids))} of 5")
