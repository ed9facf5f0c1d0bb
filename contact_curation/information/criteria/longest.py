"""longest: the tosses that last longest, a strong baseline (method.md 0.10)."""

from collections.abc import Sequence

import numpy as np

from contact_curation.information.criteria.criterion import Criterion, RankingConfig, register
from contact_curation.information.pool import Pool
from contact_curation.information.ranking import Selection, modular_selection


def _select(pools: Sequence[Pool], config: RankingConfig) -> Selection:
    durations = np.array([info.duration for info in pools[0].infos])
    return modular_selection(durations, config.top, exact=True)


LONGEST = register(Criterion("longest", "duration of the toss", "s", _select, needs=frozenset()))
