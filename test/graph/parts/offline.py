"""What the library, without ROS, makes of a recording."""

from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.parameter_form import Form
from contact_curation.information.curation import Curation, curate
from contact_curation.information.ranker import RankingConfig
from contact_curation.information.record import TossInformation
from contact_curation.information.scoring import Scorer, ScoringConfig
from contact_curation.motion.toss import Toss
from contact_curation.storage.inputs.inputs import open_inputs


@cache
def tosses_of(bag: Path) -> tuple[Toss, ...]:
    return tuple(item for item in open_inputs([bag], CONTACTNETS_CUBE) if isinstance(item, Toss))


def scored(tosses: Sequence[Toss], geometry: ContactGeometry | None = None) -> list[TossInformation]:
    scorer = Scorer(geometry or ContactGeometry.of_body(CONTACTNETS_CUBE), CONTACTNETS_CUBE, ScoringConfig(form=Form.RIGID))
    return [one for one in scorer.score(tosses) if isinstance(one, TossInformation)]


def curated(bag: Path, top: int, geometry: ContactGeometry | None = None) -> Curation:
    return curate(scored(tosses_of(bag), geometry), RankingConfig(top=top))


def assert_same_buffer(message: Any, curation: Curation) -> None:
    """The same tosses in the same order with the same numbers to 1e-9."""
    kept = [entry for entry in curation.ranking.entries if entry.selected]
    assert list(message.toss_ids) == [entry.toss_id for entry in kept]
    np.testing.assert_allclose(message.scores, [entry.score for entry in kept], rtol=1e-9)
    np.testing.assert_allclose(message.marginal_gains, [entry.marginal_gain for entry in kept], rtol=1e-9)
    np.testing.assert_allclose(message.epsilon, curation.epsilon, rtol=1e-7)
