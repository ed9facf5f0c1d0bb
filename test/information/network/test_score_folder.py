"""Exact toss scores in files: their inner products, vectors with the same ones, and selections by these."""

from pathlib import Path

import numpy as np
import pytest

from contact_curation.contact.evaluation import Estimator
from contact_curation.errors import InvalidValueError
from contact_curation.information.criteria.orthogonal import select_orthogonal, toss_scores
from contact_curation.information.network import score_folder
from contact_curation.information.network.config import NetworkConfig, SketchConfig
from contact_curation.information.network.score_folder import ScoreFolder, coordinates_of
from contact_curation.information.network.scoring import NetworkScorer
from contact_curation.information.pool import pool_of
from contact_curation.information.record import TossInformation
from contact_curation.information.scoring import ScoringConfig
from test.information import pools
from test.information.network_cases import long_scores, network, rows_of, tosses


def test_the_gram_matrix_is_that_of_all_scores_however_many_are_read_at_a_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scores = np.random.default_rng(0).standard_normal((7, 50)).astype(np.float32)
    for k, score in enumerate(scores):
        ScoreFolder(tmp_path).write(f"digest-{k}", "version", score)
        ScoreFolder(tmp_path).write(f"digest-{k}", "another version", -3.0 * score)
    monkeypatch.setattr(score_folder, "CHUNK", 3)
    digests = [f"digest-{k}" for k in (4, 0, 1, 2, 3, 6, 5)]
    gram = ScoreFolder(tmp_path).gram(digests, "version")
    ordered = scores[[4, 0, 1, 2, 3, 6, 5]].astype(float)
    np.testing.assert_allclose(gram, ordered @ ordered.T, rtol=1e-5, atol=1e-5)
    np.testing.assert_allclose(coordinates_of(gram) @ coordinates_of(gram).T, gram, atol=1e-10)


def test_orthogonal_selection_by_coordinates_is_that_by_the_scores() -> None:
    scores = np.random.default_rng(1).standard_normal((9, 40))
    for variant in ("pivoted", "max-cosine", "literal"):
        one, other = (select_orthogonal(rows, 5, variant) for rows in (scores, coordinates_of(scores @ scores.T)))
        np.testing.assert_array_equal(one.order, other.order)
        np.testing.assert_allclose(one.gains, other.gains, atol=1e-9)


@pytest.mark.slow
def test_a_networks_toss_scores_are_exact_whatever_the_sketch(tmp_path: Path) -> None:
    model, config = network("deep"), ScoringConfig(estimator=Estimator.EMPIRICAL)
    rough = NetworkConfig(sketch=SketchConfig(leading=0, random=1))
    given = sorted(tosses(3), key=lambda toss: toss.toss_id)
    scorer = NetworkScorer(model, config, rough, ScoreFolder(tmp_path))
    infos = [info for info in scorer.score(given) if isinstance(info, TossInformation)]
    gram = ScoreFolder(tmp_path).gram([toss.digest() for toss in given], scorer.version)
    each = [long_scores(model, rows_of([toss])) for toss in given]
    long = np.stack([np.concatenate([scores.sum(axis=0) for scores in by_network.values()]) for by_network in each])
    np.testing.assert_allclose(gram, long @ long.T, rtol=1e-4, atol=1e-5 * gram.max())
    pool = pool_of(infos, network_scores=coordinates_of(gram))
    physical = pool_of(infos).toss_scores[:, :52]
    found = toss_scores(pool)
    np.testing.assert_allclose(found @ found.T, physical @ physical.T + gram, rtol=1e-9)


def test_scores_of_other_tosses_are_refused() -> None:
    infos = pools.tosses(3, parameters=4, rows=2, seed=0)
    with pytest.raises(InvalidValueError, match="network scores"):
        pool_of(infos, network_scores=np.zeros((len(infos) + 1, 3)))
