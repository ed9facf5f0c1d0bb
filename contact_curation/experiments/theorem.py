"""The paper's theorem over k: how near the information of k tosses is to the pool's (method.md 1.9, E11 to E14).

Three weights of the selected tosses' information: 1, the plain sum; K / k; and, for tosses that are drawn with probabilities
that grow with their leverage, one over that probability (Horvitz and Thompson 1952).
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from contact_curation.contact.evaluation import Estimator
from contact_curation.contact.models.polytope import PolytopeModel
from contact_curation.contact.parameter_form import Form
from contact_curation.errors import InvalidValueError, UnknownNameError
from contact_curation.experiments.cell import Cell, Planned
from contact_curation.experiments.cell_run import ONE_THREAD, Bench, Row, pool_of_cell
from contact_curation.experiments.rules import RULES
from contact_curation.geometry.quaternions import Array
from contact_curation.information.diagnostics import SpectralDistance, spectral_distance
from contact_curation.information.pool import Pool, pool_of
from contact_curation.information.ranker import RankingConfig, rank_particles
from contact_curation.information.record import TossInformation
from contact_curation.information.scoring import ScoringConfig
from contact_curation.information.subspace import IdentifiableSubspace, pool_subspace
from contact_curation.learning.training.curated import toss_scorer


@dataclass(frozen=True)
class TheoremCell(Planned):
    """One rule's sets, at the fit to all training tosses.

    Attributes:
        rule: one of `RULES`.
        sizes: k; those above the pool's size are left out.
        seed: of the pool and the draws.
    """

    KIND = "theorem"

    rule: str
    sizes: tuple[int, ...]
    seed: int

    def __post_init__(self) -> None:
        if self.rule not in RULES:
            raise UnknownNameError("rule", self.rule, RULES)
        if min(self.sizes) < 1:
            raise InvalidValueError("--sizes", min(self.sizes), "at least 1")

    @property
    def fields(self) -> Row:
        """What its rows begin with."""
        return {"rule": self.rule, "seed": float(self.seed)}


def theorem_rows(cell: TheoremCell, bench: Bench) -> tuple[Row, ...]:
    """A row per size and weight: smallest and largest eigenvalue relative to the pool's, and epsilon."""
    pool = _scored(cell, bench)
    subspace = pool_subspace(pool)
    sizes = [size for size in cell.sizes if size <= len(pool)]
    return tuple(row for size in sizes for row in _rows(cell, pool, subspace, size))


def _scored(cell: TheoremCell, bench: Bench) -> Pool:
    """Gauss-Newton information, whatever the rule ranks by: one judge for all."""
    tosses = pool_of_cell(Cell(cell.rule, 1, cell.seed), bench).tosses
    model = PolytopeModel(bench.reference, bench.body, Form.PHYSICAL)
    scores = toss_scorer(ScoringConfig(Estimator.GAUSS_NEWTON, loss=ONE_THREAD), "log-det")(model, tosses)
    return pool_of(one for one in scores if isinstance(one, TossInformation))


def _rows(cell: TheoremCell, pool: Pool, subspace: IdentifiableSubspace, size: int) -> Iterator[Row]:
    selected = rank_particles([pool], RULES[cell.rule].ranking(size, cell.seed)).selected_ids
    yield _row(size, "plain", spectral_distance(pool, subspace, selected))
    yield _row(size, "rescaled", spectral_distance(pool, subspace, selected, len(pool) / len(selected)))
    if cell.rule == "random":
        chances = _chances(pool, size)
        drawn = np.flatnonzero(np.random.default_rng([cell.seed, size]).random(len(pool)) < chances)
        names = [pool.ids[place] for place in drawn]
        yield _row(size, "drawn by leverage, re-weighted", spectral_distance(pool, subspace, names, 1.0 / chances[drawn]))


def _chances(pool: Pool, size: int) -> Array:
    """(K,) probabilities that sum to about `size`, in proportion to the leverages as far as 1 allows."""
    scores = {entry.toss_id: entry.score for entry in rank_particles([pool], RankingConfig("leverage", top=1)).entries}
    leverages = np.array([scores[name] for name in pool.ids])
    return np.asarray(np.minimum(size * leverages / leverages.sum(), 1.0))


def _row(size: int, weights: str, distance: SpectralDistance) -> Row:
    values = distance.eigenvalues
    return {
        "size": float(size),
        "weights": weights,
        "smallest": float(values[0]),
        "largest": float(values[-1]),
        "epsilon": distance.epsilon,
    }
