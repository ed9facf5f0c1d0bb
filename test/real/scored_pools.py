"""The information of ContactNets' tosses, computed once per theta, estimator and form; and the dense matrices of a pool."""

from functools import cache

import numpy as np

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.contact.evaluation import Estimator
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.parameter_form import Form
from contact_curation.geometry.quaternions import Array
from contact_curation.information.pool import Indices, Pool, pool_of
from contact_curation.information.record import TossInformation
from contact_curation.information.scoring import Scorer, ScoringConfig
from contact_curation.motion.toss import Toss

TRUE = ContactGeometry.of_body(CONTACTNETS_CUBE)


@cache
def scored_pool(
    tosses: tuple[Toss, ...], estimator: Estimator, form: Form = Form.PHYSICAL, geometry: ContactGeometry = TRUE
) -> Pool:
    """All tosses at one theta; every one of them is scored."""
    scorer = Scorer(geometry, CONTACTNETS_CUBE, ScoringConfig(estimator, form=form))
    infos = [info for info in scorer.score(tosses) if isinstance(info, TossInformation)]
    assert len(infos) == len(tosses)
    return pool_of(infos)


def fishers_in(pool: Pool, coordinates: Array, indices: Indices | None = None) -> Array:
    """(K, p, p) information of each toss, or of some, in the given coordinates (P, p), about the pool's pivot."""
    rows = pool.stacked(np.arange(len(pool)) if indices is None else indices) @ coordinates  # (K, R, p)
    return np.asarray(rows.swapaxes(1, 2) @ rows)
