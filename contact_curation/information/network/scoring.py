"""Computes the information of tosses about networks: traces exactly, everything else through a sketch (method.md 2.7).

One forward pass over a toss and a backward pass per score give, without any gradient by a weight: per block the trace of the
Fisher sum, by ghost norms; per transition a sketched gradient, from which the factor comes; and the toss's own score, where a
folder takes it. Parameters outside the networks, such as those of the polytope inside a deep model, have exact columns of their
own before the sketched ones, or are all there is.

Tosses are taken one at a time, and random directions are drawn by toss id, so that no digit depends on the company. Where a
memory is given, as for a GPU, as many transitions as fit into it are evaluated together, whosever they are, and a long toss in
pieces; the numbers stay the same up to rounding. Random numbers, the sketch and the impulses come from the CPU on any device.
"""

from collections.abc import Iterator, Sequence
from functools import cached_property
from hashlib import sha256
from itertools import groupby, pairwise
from typing import NamedTuple

import numpy as np
import scipy.linalg
import torch
from numpy.typing import NDArray

from contact_curation.contact.evaluation import Estimator
from contact_curation.contact.models.explicit_parameters import ExplicitParameters
from contact_curation.contact.models.model import Model, Rows
from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array
from contact_curation.information.factors import Compression, factor_of_fisher, signed
from contact_curation.information.model_version import model_version
from contact_curation.information.network.config import Device, NetworkConfig, network_config_for
from contact_curation.information.network.forward_pass import (
    Draws,
    ForwardPass,
    Slopes,
    forward_pass,
    frozen_copy,
    leading_slopes,
)
from contact_curation.information.network.score_folder import ScoreFolder
from contact_curation.information.network.sketch import (
    NetworkSketch,
    ghost_norms,
    network_sketch,
    reference_rows,
    summed_gradient,
)
from contact_curation.information.pool import sheared
from contact_curation.information.record import ParameterBlock, TossInformation
from contact_curation.information.scoring import STORED, NotScored, ScoringConfig
from contact_curation.motion.toss import Toss
from contact_curation.motion.transitions import transitions_of

OUTPUT_WEIGHTS = (4.0, 4.0, 1.0)
"""Of gaps, gaps one frame later and Jacobians: tilt moves gaps by the place on the board, Jacobians by the body's own size."""


WORKING_COPIES = 4
"""How often the numbers of `NetworkScorer.bytes_each` are in memory at the peak, at most: measured twice, and as much again."""


class _Piece(NamedTuple):
    """Transitions of one toss that follow each other.

    Attributes:
        toss: the K-th one.
        place: K.
        rows: the transitions.
        first: number of the first one in the toss.
    """

    toss: Toss
    place: int
    rows: Rows
    first: int

    @property
    def size(self) -> int:
        return len(self.rows.dt)


class _Scores(NamedTuple):
    """n scores of each of b transitions of one toss.

    Attributes:
        rows: (n, b, P) in the record's columns.
        traces: (blocks,) their squared lengths per block.
        gradient: (W,) their sum by all weights of the networks; empty where nobody wants it.
    """

    rows: Array
    traces: Array
    gradient: Array


class _Scored(NamedTuple):
    """What one forward pass says about the transitions of one piece.

    Attributes:
        losses, solved, misfits: (b,) as of `ForwardPass`.
        scores: of the log-likelihood.
        information: of the estimator.
    """

    losses: Array
    solved: NDArray[np.bool_]
    misfits: Array
    scores: _Scores
    information: _Scores


class NetworkScorer:
    """Scores tosses of one body at one theta of a model in torch; holds nothing but its arguments and what follows from them.

    Args:
        model: is copied, and may go on learning.
        config: estimator, influence bound, compression and loss.
        network: what is peculiar to networks; None for what is usual for the model.
        folder: takes each toss's exact score by the networks' weights, under the toss's digest.
        device: where the networks are evaluated.
        jobs: number of processes that share the device.

    Raises:
        InvalidValueError: weights that are not finite, or the explicit parameters alone are wanted of a model that has none.
    """

    def __init__(
        self,
        model: Model,
        config: ScoringConfig,
        network: NetworkConfig | None = None,
        folder: ScoreFolder | None = None,
        device: Device | None = None,
        jobs: int = 1,
    ) -> None:
        if not all(bool(torch.isfinite(value).all()) for value in model.parameters()):
            raise InvalidValueError(f"parameters of {model.kind}", "a value that is not finite", "finite numbers")
        self.device, self.jobs = device or Device(), jobs
        self.model, self.config = frozen_copy(model).to(self.device.name), config
        self.network = network or network_config_for(model.kind)
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
        found = [(piece.place, one) for pieces in self._together(tosses) for piece, one in self._losses(pieces)]
        return tuple(np.concatenate([losses for _, losses in own]) for _, own in groupby(found, key=lambda each: each[0]))

    def begin(self, toss: Toss, earlier: object = None) -> None:
        """Nothing: the random directions of a toss are drawn for all its transitions."""

    def score(self, tosses: Sequence[Toss]) -> tuple[TossInformation | NotScored, ...]:
        """The information of each toss, in the order given.

        Raises:
            InvalidValueError: a toss of another body.
        """
        found = ((piece.place, one) for pieces in self._together(tosses) for piece, one in self._scored(pieces))
        return tuple(
            self._record(tosses[place], [one for _, one in own]) for place, own in groupby(found, key=lambda each: each[0])
        )

    @cached_property
    def bytes_each(self) -> int:
        """About how much memory a transition needs while it is scored [bytes]."""
        one = reference_rows(self.model.body, self.model.place(), np.random.default_rng(0)).take([0])
        found = forward_pass(self.model, one, self.config.loss)
        streams = sum(trace.inputs.numel() + trace.outputs.numel() for trace in found.tape)
        slopes = found.directions_size * sum(output.numel() for output in found.outputs)
        columns = self.network.draws * (self._sketch.columns if self._sketch else 0)
        return 8 * WORKING_COPIES * (streams + slopes + columns)

    def _together(self, tosses: Sequence[Toss]) -> Iterator[list[_Piece]]:
        """The transitions of tosses in their order, in pieces, as they are evaluated together."""
        most = max(1, self.device.memory * 10**6 // (self.bytes_each * self.jobs)) if self.device.memory else 0
        waiting: list[_Piece] = []
        for place, toss in enumerate(tosses):
            for piece in self._pieces(place, toss, most):
                if waiting and sum(one.size for one in waiting) + piece.size > most:
                    yield waiting
                    waiting = []
                waiting.append(piece)
        if waiting:
            yield waiting

    def _pieces(self, place: int, toss: Toss, most: int) -> Iterator[_Piece]:
        """The transitions of a toss in pieces of at most so many; 0 for all."""
        if toss.body != self.model.body.name:
            raise InvalidValueError(f"body of toss {toss.toss_id}", toss.body, self.model.body.name)
        found = transitions_of([toss], self.model.body.length_scale)
        rows, size = Rows(found.before, found.after, found.dt), len(found.dt)
        for first in range(0, size, most or size):
            yield _Piece(toss, place, rows.take(slice(first, first + (most or size))), first)

    def _forward(self, pieces: Sequence[_Piece]) -> ForwardPass:
        rows = Rows(*(np.concatenate(each) for each in zip(*(piece.rows for piece in pieces), strict=True)))
        return forward_pass(self.model, rows, self.config.loss)

    def _losses(self, pieces: Sequence[_Piece]) -> Iterator[tuple[_Piece, Array]]:
        found = self._forward(pieces)
        for piece, span in zip(pieces, _spans(pieces), strict=True):
            yield piece, found.losses[span][found.solved[span]]

    def _scored(self, pieces: Sequence[_Piece]) -> Iterator[tuple[_Piece, _Scored]]:
        found = self._forward(pieces)
        influence = self._influence(found)
        scores = self._scores(found, found.score_slopes(influence), pieces, keep=self._folder is not None)
        information = scores
        if self.config.estimator is Estimator.GAUSS_NEWTON:
            information = self._scores(found, self._profile(found, influence, pieces), pieces)
        for piece, span, *both in zip(pieces, _spans(pieces), scores, information, strict=True):
            yield piece, _Scored(found.losses[span], found.solved[span], found.misfits[span], *both)

    def _record(self, toss: Toss, pieces: Sequence[_Scored]) -> TossInformation | NotScored:
        losses, solved, misfits = (np.concatenate(each) for each in list(zip(*pieces, strict=True))[:3])
        if not solved.any():
            return NotScored(toss.toss_id, f"0 of {solved.size} transitions solved, worst residual {misfits.max():.3g}")
        scores, information = (_joined(each) for each in list(zip(*pieces, strict=True))[3:])
        if self._folder is not None and scores.gradient.size:
            self._folder.write(toss.digest(), self.version, scores.gradient.astype(np.float32))
        factor = factor_of_rows(information.rows.reshape(-1, information.rows.shape[2]), self.config.compression)
        return TossInformation(
            toss_id=toss.toss_id,
            body=toss.body,
            model=self.model.kind,
            parameters_version=self.version,
            estimator=self.config.estimator.value,
            influence_bound=self.config.influence_bound,
            blocks=self.blocks,
            transitions=int(solved.size),
            not_scored=int(solved.size - solved.sum()),
            duration=toss.duration,
            mean_loss=float(losses[solved].mean()),
            block_traces=information.traces,
            score_sum=scores.rows[0].sum(axis=0),
            factor=factor.astype(STORED),
            centroid=self._centroid(toss),
            tilt_axes=np.zeros((0, 3)) if self._explicit is None else self._explicit.tilt_axes,
        )

    def _centroid(self, toss: Toss) -> Array:
        return np.asarray(toss.positions.mean(axis=0) / self.model.body.length_scale)

    def _influence(self, found: ForwardPass) -> Array:
        """(B,) by what each score is scaled (method.md 2.1); 0 for what is not solved."""
        losses = np.where(found.solved, found.losses, 0.0)
        bounded = np.minimum(1.0, self.config.influence_bound / np.maximum(losses, np.finfo(float).tiny))
        return np.where(found.solved, bounded, 0.0)

    def _profile(self, found: ForwardPass, influence: Array, pieces: Sequence[_Piece]) -> Slopes:
        """Slopes (n, B, ...) whose outer products sum to the Gauss-Newton matrix, or do so on average."""
        size = found.directions_size
        units = torch.eye(size, dtype=torch.float64, device=self.model.device)
        slopes = found.profile_slopes(units[:, None].expand(-1, len(found.losses), -1), influence)
        if self._sketch is None or found.impulses is None:
            return slopes
        drawn = [self._draws(piece, size) for piece in pieces]
        return leading_slopes(slopes, OUTPUT_WEIGHTS, Draws(*(np.concatenate(each) for each in zip(*drawn, strict=True))))

    def _draws(self, piece: _Piece, residuals: int) -> Draws:
        """Random numbers of a piece: some of its toss's, which follow from the toss's id."""
        digest = sha256(f"{self.network.seed}/{piece.toss.toss_id}".encode()).digest()
        rng = np.random.default_rng(int.from_bytes(digest[:16]))
        drawn = Draws.of(rng, piece.toss.frames - 1, residuals, self.network.draws)
        return Draws(*(each[piece.first : piece.first + piece.size] for each in drawn))

    def _scores(self, found: ForwardPass, slopes: Slopes, pieces: Sequence[_Piece], keep: bool = False) -> list[_Scores]:
        """Scores of each piece, from slopes (n, B, ...) by the model's outputs; `keep` wants the sums by the weights, too."""
        parts = []
        if self._explicit is not None:
            parts.append(self._explicit_scores(self._explicit, found, slopes, pieces))
        if self._sketch is not None:
            draws = [self._network_scores(self._sketch, found, one, pieces, keep) for one in zip(*slopes, strict=True)]
            parts.append([_stacked(each) for each in zip(*draws, strict=True)])
        return [
            _Scores(
                np.concatenate([part.rows for part in each], axis=2),
                np.concatenate([part.traces for part in each]),
                each[-1].gradient,
            )
            for each in zip(*parts, strict=True)
        ]

    def _explicit_scores(
        self, explicit: ExplicitParameters, found: ForwardPass, slopes: Slopes, pieces: Sequence[_Piece]
    ) -> list[_Scores]:
        centroids = np.concatenate([np.tile(self._centroid(piece.toss), (piece.size, 1)) for piece in pieces])
        rows = explicit_scores(explicit, found, slopes, centroids)
        parts, blocks = [rows[:, span] for span in _spans(pieces)], explicit_blocks(explicit)
        traces = [[float(np.square(part[..., block.start : block.stop]).sum()) for block in blocks] for part in parts]
        return [_Scores(*each, np.zeros(0)) for each in zip(parts, map(np.array, traces), strict=True)]

    def _network_scores(
        self, sketch: NetworkSketch, found: ForwardPass, slopes: Slopes, pieces: Sequence[_Piece], keep: bool
    ) -> list[_Scores]:
        """The same by the networks' weights, from slopes (B, ...); rows are (1, b, P)."""
        deltas, spans = found.deltas(slopes), _spans(pieces)
        norms = [ghost_norms(*pair).cpu() for pair in zip(found.tape, deltas, strict=True)]
        rows, firsts = sketch.rows(found.tape, deltas).cpu().numpy(), np.cumsum([0, *self._layers.values()])[:-1]
        return [
            _Scores(
                rows[None, span],
                np.add.reduceat(np.array([float(each[span].sum()) for each in norms]), firsts),
                summed_gradient(found.tape, deltas, span).cpu().numpy() if keep else np.zeros(0),
            )
            for span in spans
        ]

    @cached_property
    def _sketch(self) -> NetworkSketch | None:
        none = self.network.physical_only or not self._layers
        return None if none else network_sketch(frozen_copy(self.model).cpu(), self.network.sketch).to(self.model.device)


def _spans(pieces: Sequence[_Piece]) -> list[slice]:
    """Where the transitions of each piece are among those of all."""
    edges = np.cumsum([0, *(piece.size for piece in pieces)]).tolist()
    return [slice(*span) for span in pairwise(edges)]


def _stacked(scores: Sequence[_Scores]) -> _Scores:
    """One score after the other of the same transitions."""
    rows, traces, gradients = zip(*scores, strict=True)
    return _Scores(np.concatenate(rows), np.sum(traces, axis=0), gradients[0])


def _joined(pieces: Sequence[_Scores]) -> _Scores:
    """The scores of all transitions of a toss."""
    rows, traces, gradients = zip(*pieces, strict=True)
    return _Scores(np.concatenate(rows, axis=1), np.sum(traces, axis=0), np.sum(gradients, axis=0))


def explicit_blocks(explicit: ExplicitParameters) -> tuple[ParameterBlock, ...]:
    """The runs of the explicit parameters, the first columns of a record."""
    edges = np.cumsum([0, *(block.size for block in explicit.blocks)]).tolist()
    return tuple(ParameterBlock(block.name, *span) for block, span in zip(explicit.blocks, pairwise(edges)))


def explicit_scores(explicit: ExplicitParameters, found: ForwardPass, slopes: Slopes, centroids: Array) -> Array:
    """Scores (n, B, P) by the explicit parameters, the ground's tilt taken about `centroids` (B, 3), or (1, 3) for all."""
    rows, axes = explicit.scores(found.rows, found.frames, slopes), explicit.tilt_axes
    if not axes.size:
        return rows
    shifts = np.array([axes @ (centroid - explicit.pivot) for centroid in centroids])
    return sheared(rows, explicit_blocks(explicit), shifts)


def _network_blocks(sketch: NetworkSketch, layers: dict[str, int], start: int) -> tuple[ParameterBlock, ...]:
    columns = np.cumsum([start, *(layer.columns for layer in sketch.layers)]).tolist()
    edges = np.cumsum([0, *layers.values()]).tolist()
    return tuple(ParameterBlock(name, columns[first], columns[last]) for name, (first, last) in zip(layers, pairwise(edges)))


def factor_of_rows(rows: Array, compression: Compression) -> Array:
    """The smallest factor (R, P) of F = G^T G from rows G (N, P), scores in many columns, without forming F.

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
    return signed((vectors[:, kept].T @ rows)[::-1])
