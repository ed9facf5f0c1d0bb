"""Computes the information of tosses about networks: traces exactly, everything else through a sketch (method.md 2.7).

One forward pass over a toss and a backward pass per score give, without any gradient by a weight: per block the trace of the
Fisher sum, by ghost norms; per transition a sketched gradient, from which the factor comes; and the toss's own score, where a
folder takes it. Parameters outside the networks, such as those of the polytope inside a deep model, have exact columns of their
own before the sketched ones, or are all there is.

Tosses are taken one at a time, and random directions are drawn by toss id, so that no digit depends on the company.
"""

from collections.abc import Sequence
from functools import cached_property
from hashlib import sha256
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import scipy.linalg
import torch

from contact_curation.contact.evaluation import Estimator
from contact_curation.contact.models.explicit_parameters import ExplicitParameters
from contact_curation.contact.models.model import Model, Rows
from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array
from contact_curation.information.factors import Compression, Factor, factor_of_fisher
from contact_curation.information.model_version import model_version
from contact_curation.information.network.config import NetworkConfig, network_config_for
from contact_curation.information.network.forward_pass import (
    ForwardPass,
    Slopes,
    forward_pass,
    frozen_copy,
    leading_slopes,
)
from contact_curation.information.network.score_folder import ScoreFolder
from contact_curation.information.network.sketch import NetworkSketch, ghost_norms, network_sketch, summed_gradient
from contact_curation.information.pool import sheared
from contact_curation.information.record import ParameterBlock, TossInformation
from contact_curation.information.scoring import STORED, NotScored, ScoringConfig
from contact_curation.motion.toss import Toss
from contact_curation.motion.transitions import transitions_of

OUTPUT_WEIGHTS = (4.0, 4.0, 1.0)
"""Of gaps, gaps one frame later and Jacobians: tilt moves gaps by the place on the board, Jacobians by the body's own size."""


class _Scores(NamedTuple):
    """n scores of each of B transitions: in the record's columns (n B, P), and their squared lengths per block (blocks,)."""

    rows: Array
    traces: Array


class NetworkScorer:
    """Scores tosses of one body at one theta of a model in torch; holds nothing but its arguments and what follows from them.

    Args:
        model: is copied, and may go on learning.
        config: estimator, influence bound, compression and loss.
        network: what is peculiar to networks; None for what is usual for the model.
        folder: takes each toss's exact score by the networks' weights, under the toss's digest.

    Raises:
        InvalidValueError: weights that are not finite, or the explicit parameters alone are wanted of a model that has none.
    """

    def __init__(
        self,
        model: Model,
        config: ScoringConfig,
        network: NetworkConfig | None = None,
        folder: ScoreFolder | None = None,
    ) -> None:
        if not all(bool(torch.isfinite(value).all()) for value in model.parameters()):
            raise InvalidValueError(f"parameters of {model.kind}", "a value that is not finite", "finite numbers")
        self.model, self.config, self.network = frozen_copy(model), config, network or network_config_for(model.kind)
        self.version = model_version(model)
        self._folder = folder
        self._explicit = self.model.explicit_parameters()
        if self.network.physical_only and self._explicit is None:
            expected = "deep, or another model with parameters outside its networks"
            raise InvalidValueError("physical block of model", model.kind, expected)
        self._layers = {name: len(network.linear) for name, network in self.model.networks.items()}

    @cached_property
    def blocks(self) -> tuple[ParameterBlock, ...]:
        """The explicit parameters', then a sketched one per network."""
        own = () if self._explicit is None else explicit_blocks(self._explicit)
        if self._sketch is None:
            return own
        return (*own, *_network_blocks(self._sketch, self._layers, own[-1].stop if own else 0))

    def losses(self, tosses: Sequence[Toss]) -> tuple[Array, ...]:
        """Losses (N,) of all scored transitions of each of `tosses`, for choosing an influence bound."""
        passes = [self._forward(toss) for toss in tosses]
        return tuple(found.losses[found.solved] for found in passes)

    def score(self, tosses: Sequence[Toss]) -> tuple[TossInformation | NotScored, ...]:
        """The information of each toss, in the order given.

        Raises:
            InvalidValueError: a toss of another body.
        """
        return tuple(self._score(toss) for toss in tosses)

    def _forward(self, toss: Toss) -> ForwardPass:
        if toss.body != self.model.body.name:
            raise InvalidValueError(f"body of toss {toss.toss_id}", toss.body, self.model.body.name)
        rows = transitions_of([toss], self.model.body.length_scale)
        return forward_pass(self.model, Rows(rows.before, rows.after, rows.dt), self.config.loss)

    def _score(self, toss: Toss) -> TossInformation | NotScored:
        found = self._forward(toss)
        if not found.solved.any():
            worst = found.misfits.max()
            return NotScored(toss.toss_id, f"0 of {found.solved.size} transitions solved, worst residual {worst:.3g}")
        centroid = toss.positions.mean(axis=0) / self.model.body.length_scale
        influence = self._influence(found)
        scores = self._scores(found, found.score_slopes(influence), centroid, toss.digest() if self._folder else None)
        information = scores
        if self.config.estimator is Estimator.GAUSS_NEWTON:
            information = self._scores(found, self._profile(found, influence, toss.toss_id), centroid)
        factor = factor_of_rows(information.rows, self.config.compression)
        return TossInformation(
            toss_id=toss.toss_id,
            body=toss.body,
            model=self.model.kind,
            parameters_version=self.version,
            estimator=self.config.estimator.value,
            influence_bound=self.config.influence_bound,
            blocks=self.blocks,
            transitions=int(found.solved.size),
            not_scored=int(found.solved.size - found.solved.sum()),
            duration=toss.duration,
            mean_loss=float(found.losses[found.solved].mean()),
            block_traces=information.traces,
            score_sum=scores.rows.sum(axis=0),
            factor=factor.rows.astype(STORED),
            centroid=centroid,
            tilt_axes=np.zeros((0, 3)) if self._explicit is None else self._explicit.tilt_axes,
        )

    def _influence(self, found: ForwardPass) -> Array:
        """(B,) by what each score is scaled (method.md 2.1); 0 for what is not solved."""
        losses = np.where(found.solved, found.losses, 0.0)
        bounded = np.minimum(1.0, self.config.influence_bound / np.maximum(losses, np.finfo(float).tiny))
        return np.where(found.solved, bounded, 0.0)

    def _profile(self, found: ForwardPass, influence: Array, toss_id: str) -> Slopes:
        """Slopes (n, B, ...) whose outer products sum to the Gauss-Newton matrix, or do so on average."""
        units = torch.eye(found.directions_size, dtype=torch.float64)[:, None].expand(-1, len(found.losses), -1)
        slopes = found.profile_slopes(units, influence)
        if self._sketch is None or found.impulses is None:
            return slopes
        digest = sha256(f"{self.network.seed}/{toss_id}".encode()).digest()
        rng = np.random.default_rng(int.from_bytes(digest[:16]))
        return leading_slopes(slopes, self.network.draws, OUTPUT_WEIGHTS, rng)

    def _scores(self, found: ForwardPass, slopes: Slopes, centroid: Array, keep_as: str | None = None) -> _Scores:
        """Scores from slopes (n, B, ...) by the model's outputs; the networks' sum goes to the folder as `keep_as`."""
        parts = []
        if self._explicit is not None:
            own = explicit_scores(self._explicit, found, slopes, centroid).reshape(-1, self._explicit.size)
            traces = [float(np.square(own[:, block.start : block.stop]).sum()) for block in explicit_blocks(self._explicit)]
            parts.append(_Scores(own, np.array(traces)))
        if self._sketch is not None:
            each = [self._network_scores(self._sketch, found, one, keep_as) for one in zip(*slopes, strict=True)]
            parts.append(_Scores(np.concatenate([one.rows for one in each]), np.sum([one.traces for one in each], axis=0)))
        return _Scores(np.concatenate([part.rows for part in parts], axis=1), np.concatenate([part.traces for part in parts]))

    def _network_scores(self, sketch: NetworkSketch, found: ForwardPass, slopes: Slopes, keep_as: str | None) -> _Scores:
        """The same by the networks' weights, from slopes (B, ...)."""
        deltas = found.deltas(slopes)
        norms = np.array([float(ghost_norms(*pair).sum()) for pair in zip(found.tape, deltas, strict=True)])
        if self._folder is not None and keep_as is not None:
            score = summed_gradient(found.tape, deltas).numpy().astype(np.float32)
            self._folder.write(keep_as, self.version, score)
        firsts = np.cumsum([0, *self._layers.values()])[:-1]
        return _Scores(sketch.rows(found.tape, deltas).numpy(), np.add.reduceat(norms, firsts))

    @cached_property
    def _sketch(self) -> NetworkSketch | None:
        none = self.network.physical_only or not self._layers
        return None if none else network_sketch(self.model, self.network.sketch)


def explicit_blocks(explicit: ExplicitParameters) -> tuple[ParameterBlock, ...]:
    """The runs of the explicit parameters, the first columns of a record."""
    edges = np.cumsum([0, *(block.size for block in explicit.blocks)]).tolist()
    return tuple(ParameterBlock(block.name, *span) for block, span in zip(explicit.blocks, pairwise(edges)))


def explicit_scores(explicit: ExplicitParameters, found: ForwardPass, slopes: Slopes, centroid: Array) -> Array:
    """Scores (n, B, P) by the explicit parameters, the ground's tilt taken about `centroid` (3,)."""
    rows, axes = explicit.scores(found.rows, found.frames, slopes), explicit.tilt_axes
    return sheared(rows, explicit_blocks(explicit), axes @ (centroid - explicit.pivot)) if axes.size else rows


def _network_blocks(sketch: NetworkSketch, layers: dict[str, int], start: int) -> tuple[ParameterBlock, ...]:
    columns = np.cumsum([start, *(layer.columns for layer in sketch.layers)]).tolist()
    edges = np.cumsum([0, *layers.values()]).tolist()
    return tuple(ParameterBlock(name, columns[first], columns[last]) for name, (first, last) in zip(layers, pairwise(edges)))


def factor_of_rows(rows: Array, compression: Compression) -> Factor:
    """The smallest factor of F = G^T G from rows G (N, P), scores in many columns, without forming F; see `factors.Factor`.

    G G^T and F have the same non-zero eigenvalues, and with G G^T = U diag(lambda) U^T the rows U^T G are those of `factors`:
    orthogonal, strongest first, of length sqrt(lambda).
    """
    count, columns = rows.shape
    if count >= columns:
        return factor_of_fisher(rows.T @ rows, compression)
    gram = rows @ rows.T
    first = max(count - compression.max_rows, 0)
    values, vectors = scipy.linalg.eigh(gram, subset_by_index=(first, count - 1)) if count else (np.zeros(0), gram)
    kept = values > compression.cut * max(float(values.max(initial=0.0)), 0.0)
    found = (vectors[:, kept].T @ rows)[::-1]
    strongest = found[np.arange(len(found)), np.abs(found).argmax(axis=1)] if len(found) else np.zeros(0)
    found = found * np.where(strongest < 0.0, -1.0, 1.0)[:, None]
    total = float(np.trace(gram))
    return Factor(np.ascontiguousarray(found), float(values[kept].sum()) / total if total > 0.0 else 1.0)
