"""How sure vertices are, from the tosses' information alone."""

from dataclasses import replace

import numpy as np
import pytest

from contact_curation.contact.evaluation import Estimator
from contact_curation.contact.models.polytope import PolytopeModel
from contact_curation.contact.parameter_form import Form
from contact_curation.dashboard.vertex_uncertainty import PRIOR_DEVIATION, noise_variance, vertex_uncertainty
from contact_curation.errors import InvalidValueError
from contact_curation.information.pool import pool_of
from contact_curation.learning.uncertainty.parameters import KnownConfig, known
from contact_curation.motion.transitions import transitions_of
from test.dashboard.sessions import BODY, Scored, scored

COUNT = 24


@pytest.fixture(scope="module")
def made() -> Scored:
    return scored(COUNT)


def test_with_nothing_kept_a_vertex_is_as_unsure_as_the_initialisation(made: Scored) -> None:
    assert vertex_uncertainty(made.pool, ()).half_axes == pytest.approx(np.full((8, 3), PRIOR_DEVIATION))
    assert KnownConfig().vertices == PRIOR_DEVIATION


def test_every_toss_more_makes_every_vertex_surer_where_the_noise_stays(made: Scored, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("contact_curation.dashboard.vertex_uncertainty.noise_variance", lambda pool, kept: 0.01)
    volumes = [vertex_uncertainty(made.pool, made.pool.ids[:count]).half_axes.prod(axis=1) for count in range(5)]
    assert (np.diff(volumes, axis=0) <= 1e-12).all()


def test_axes_are_right_handed_frames_and_longest_last(made: Scored) -> None:
    uncertainty = vertex_uncertainty(made.pool, made.pool.ids[:4])
    assert np.linalg.det(uncertainty.directions) == pytest.approx(np.ones(8))
    assert (np.diff(uncertainty.half_axes, axis=1) >= 0.0).all()
    assert uncertainty.largest == pytest.approx(uncertainty.half_axes.max(axis=1))


def test_it_is_the_cramer_rao_bound_that_is_known_of_the_tosses_themselves(made: Scored) -> None:
    kept = sorted(made.pool.ids)[:12]
    by_id = {toss.toss_id: toss for toss in made.tosses}
    assert made.theta.geometry is not None
    model = PolytopeModel(made.theta.geometry, BODY, Form.PHYSICAL)
    fitted = transitions_of([by_id[one] for one in kept], BODY.length_scale)
    others = transitions_of([by_id[one] for one in made.pool.ids if one not in kept], BODY.length_scale)
    exact = known(model, fitted, others, KnownConfig())
    deviations = np.array([one.cramer_rao for one in exact.parameters[:24]]).reshape(8, 3)
    ours = vertex_uncertainty(made.pool, kept)
    covariances = np.einsum("vij,vj,vkj->vik", ours.directions, ours.half_axes**2, ours.directions)
    shown = 1e3 * BODY.length_scale * np.sqrt(np.einsum("vii->vi", covariances))
    scale = np.sqrt(noise_variance(made.pool, kept) / exact.noise_variance)
    assert shown == pytest.approx(deviations * scale, rel=0.15)
    assert 0.2 < scale < 5.0


def test_information_that_is_not_of_this_kind_is_refused(made: Scored) -> None:
    empirical = pool_of(replace(one, estimator=Estimator.EMPIRICAL) for one in made.informations)
    with pytest.raises(InvalidValueError, match="model polytope with estimator empirical, expected a polytope's"):
        vertex_uncertainty(empirical, ())
