"""A toss becomes information about a network: traces exactly, everything else through a sketch (METHOD 2.7).

One forward pass over a toss and a backward pass per score give, without any gradient by a weight: per block the trace of the
Fisher sum, by ghost norms; per transition a sketched gradient, from which the factor comes; and the toss's own score, where a
folder takes it. The polytope inside a deep model has exact columns of its own before the sketched ones, or is all there is.

Tosses are taken one at a time, and random directions are drawn by toss id, so that no digit depends on the company.
"""

from collections.abc import Sequence
from functools import cached_property
from hashlib import sha256
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import torch

from contact_curation.contact.evaluation import Estimator
from contact_curation.contact.models.deep import DeepModel
from contact_curation.contact.models.end_to_end import EndToEndModel
from contact_curation.contact.models.model import Rows
from contact_curation.contact.models.stream_network import StreamNetwork
from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array
from contact_curation.information.model_version import model_version
from contact_curation.information.network.config import NetworkConfig, network_config_for
from contact_curation.information.network.forward_pass import ForwardPass, NetworkModel, Slopes, forward_pass, frozen_copy
from contact_curation.information.network.ghost_norms import ghost_norms, summed_gradient
from contact_curation.information.network.leading_slopes import leading_slopes
from contact_curation.information.network.physical_scores import PhysicalScores
from contact_curation.information.network.row_factors import factor_of_rows
from contact_curation.information.network.score_folder import ScoreFolder
from contact_curation.information.network.sketch import NetworkSketch, network_sketch
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
    """Scores tosses of one body at one theta of a network; holds nothing but its arguments and what follows from them.

    Args:
        model: is copied, and may go on learning.
        config: estimator, influence bound, compression and loss.
        network: what is peculiar to networks; None for what is usual for the model.
        folder: takes each toss's exact score by the networks' weights, under the toss's digest.

    Raises:
        InvalidValueError: weights that are not finite, or the polytope alone is wanted of a model that has none to learn.
    """

    def __init__(
        self,
        model: NetworkModel,
        config: ScoringConfig,
        network: NetworkConfig | None = None,
        folder: ScoreFolder | None = None,
    ) -> None:
        if not all(bool(torch.isfinite(value).all()) for value in model.parameters()):
            raise InvalidValueError(f"parameters of {model.kind.value}", "a value that is not finite", "finite numbers")
        self.model, self.config, self.network = frozen_copy(model), config, network or network_config_for(model.kind)
        self.version = model_version(model)
        self._folder = folder
        self._physical = PhysicalScores.of(model.polytope) if isinstance(model, DeepModel) else None
        if self.network.physical_only and self._physical is None:
            raise InvalidValueError("physical block of model", model.kind.value, "deep, the only network with one")
        self._layers = _layers_of_networks(self.model)

    @cached_property
    def blocks(self) -> tuple[ParameterBlock, ...]:
        """The polytope's, then a sketched one per network."""
        own = () if self._physical is None else self._physical.blocks
        if self._sketch is None:
            return own
        return (*own, *_network_blocks(self._sketch, self._layers, own[-1].stop if own else 0))

    def losses(self, tosses: Sequence[Toss]) -> tuple[Array, ...]:
        """Losses (N,) of all scored transitions of each of `tosses`, for choosing an influence bound."""
        passes = [self._forward(toss) for toss in tosses]
        return tuple(found.losses[found.solved] for found in passes)

    def score(self, tosses: Sequence[Toss]) -> tuple[TossInformation | NotScored, ...]:
        """What each toss teaches, in the order given.

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
            model=self.model.kind.value,
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
            tilt_axes=np.zeros((0, 3)) if self._physical is None else self._physical.form.tilt_axes,
        )

    def _influence(self, found: ForwardPass) -> Array:
        """(B,) by what each score is scaled (METHOD 2.1); 0 for what is not solved."""
        losses = np.where(found.solved, found.losses, 0.0)
        bounded = np.minimum(1.0, self.config.influence_bound / np.maximum(losses, np.finfo(float).tiny))
        return np.where(found.solved, bounded, 0.0)

    def _profile(self, found: ForwardPass, influence: Array, toss_id: str) -> Slopes:
        """Slopes (n, B, ...) whose outer products sum to the Gauss-Newton matrix, or do so on average."""
        units = torch.eye(found.directions_size, dtype=torch.float64)[:, None].expand(-1, len(found.losses), -1)
        slopes = found.profile_slopes(units, influence)
        if self.network.physical_only or isinstance(self.model, EndToEndModel):
            return slopes
        digest = sha256(f"{self.network.seed}/{toss_id}".encode()).digest()
        rng = np.random.default_rng(int.from_bytes(digest[:16]))
        return leading_slopes(slopes, self.network.draws, OUTPUT_WEIGHTS, rng)

    def _scores(self, found: ForwardPass, slopes: Slopes, centroid: Array, keep_as: str | None = None) -> _Scores:
        """Scores from slopes (n, B, ...) by what the model says; the networks' sum goes to the folder as `keep_as`."""
        parts = []
        if self._physical is not None:
            own = self._physical.rows(found.frames, slopes, centroid).reshape(-1, self._physical.form.size)
            traces = [float(np.square(own[:, block.start : block.stop]).sum()) for block in self._physical.blocks]
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
        return None if self.network.physical_only else network_sketch(self.model, self.network.sketch)


def _layers_of_networks(model: NetworkModel) -> dict[str, int]:
    """How many layers each network of a model puts on a tape, in the order of the tape."""
    return {name: len(module.linear) for name, module in model.named_children() if isinstance(module, StreamNetwork)}


def _network_blocks(sketch: NetworkSketch, layers: dict[str, int], start: int) -> tuple[ParameterBlock, ...]:
    columns = np.cumsum([start, *(layer.columns for layer in sketch.layers)]).tolist()
    edges = np.cumsum([0, *layers.values()]).tolist()
    return tuple(ParameterBlock(name, columns[first], columns[last]) for name, (first, last) in zip(layers, pairwise(edges)))
