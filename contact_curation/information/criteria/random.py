"""random: a shuffle that depends on the ids and the seed only, the baseline of all others."""

from collections.abc import Sequence

import numpy as np

from contact_curation.information.criteria.criterion import Criterion, RankingConfig, register
from contact_curation.information.pool import Pool
from contact_curation.information.ranking import Selection, modular_selection


def _select(pools: Sequence[Pool], config: RankingConfig) -> Selection:
    tosses = len(pools[0])
    shuffled = (1.0 + np.random.default_rng(config.seed).permutation(tosses)) / tosses  # (K,) different, from 0 to 1
    return modular_selection(shuffled, config.top, exact=True)


RANDOM = register(Criterion("random", "random number", "", _select, needs=frozenset()))
