"""Computes the information of tosses: transitions are scored at one theta and summed into a Fisher matrix, stored as a factor.

This is the only place where motion meets contact. The ground's tilt is taken about each toss's own centroid, so that no number
depends on where the board's origin lies; `pool` brings them to a common pivot.
"""

import hashlib
from collections.abc import Sequence
from dataclasses import astuple, dataclass, field, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from contact_curation.contact.body import Body
from contact_curation.contact.evaluation import Estimator, FisherSums, SolveStatus, fisher_sums, transition_weights
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.loss_config import DEFAULT_LOSS, MODERATE_FRICTION, LossConfig
from contact_curation.contact.parameter_form import Form, ParameterForm, parameter_form
from contact_curation.contact.partial_sums import PartialSums
from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array
from contact_curation.information.factors import Compression, factors_of_fishers
from contact_curation.information.impacts import as_described
from contact_curation.information.pool import about_centroids
from contact_curation.information.record import ParameterBlock, Rows, TossInformation
from contact_curation.motion.toss import Toss
from contact_curation.motion.transitions import Transitions, transitions_of

STORED = np.float32
"""Of a factor's numbers, the most of what stays of a toss: half the room, and no selected set of the real tosses changes by it
(`benchmarks.selection.rank_compression`). Rounded once, here, so that whoever ranks, in any process, ranks the same numbers."""


FAR = 1024.0
"""Characteristic lengths: a multiple of it is taken off positions so far from the ground's pivot, whose lever on the tilt would
round off all else. Nearer ones keep their digits."""


@dataclass(frozen=True)
class ScoringConfig:
    """How tosses are scored.

    Asked for the physical or the rigid form, a theta that has learned the noise of impacts is taken in the rigid one, and one
    with two sets of vertices in the physical one. One as described has the usual noise in the rigid form.

    Attributes:
        estimator: which Fisher matrix is estimated.
        influence_bound: losses above this bound count as the bound; inf for no bound.
        form: parameterisation of theta.
        compression: how many rows of each toss's factor are stored.
        loss: weights, cone and solver.
    """

    estimator: Estimator = Estimator.GAUSS_NEWTON
    influence_bound: float = np.inf
    form: Form = Form.PHYSICAL
    compression: Compression = field(default_factory=Compression)
    loss: LossConfig = DEFAULT_LOSS

    def __post_init__(self) -> None:
        if not self.influence_bound > 0.0:
            raise InvalidValueError("scoring.influence_bound", self.influence_bound, "a positive number")


@dataclass(frozen=True)
class NotScored:
    """A toss that carries no information because no transition of it could be scored.

    Attributes:
        toss_id: which.
        reason: one line.
    """

    toss_id: str
    reason: str


def parameters_version(geometry: ContactGeometry, body: Body) -> str:
    """A digest of theta and of the body's constants: equal numbers, equal version."""
    state = hashlib.sha256()
    noise = () if geometry.noise is None else astuple(geometry.noise)
    bounce = () if geometry.restitution is None else (geometry.restitution,)
    constants = np.array([*bounce, *noise, geometry.height, body.mass, body.gravity, body.length_scale])
    parts = (
        geometry.vertices_normal,
        geometry.normal,
        geometry.vertices_tangent,
        geometry.tangents,
        geometry.pivot,
        body.inertia,
    )
    for part in (*parts, constants):
        state.update(np.ascontiguousarray(part).tobytes())
    if geometry.is_rigid and body.gyroscopic_inertia is not None:
        state.update(b"precesses")  # what was scored before spins did is not mixed with it
    if geometry.is_rigid:
        state.update(b"balanced, over noise")  # nor what was scored with other weights or transitions
        if body.friction > MODERATE_FRICTION:
            state.update(np.float64(body.friction).tobytes())  # which the weights and the velocities follow
    return state.hexdigest()[:16]


def scored_geometry(geometry: ContactGeometry, form: Form) -> ContactGeometry:
    """The geometry as it is scored: a theta of the rigid form where that is wanted, and it has one set of vertices."""
    return geometry.rigid() if form is Form.RIGID and not geometry.has_own_friction_vertices else geometry


class _Summed(NamedTuple):
    """Sums over one toss in its form: Fisher diagonal (P,), score sum (P,), factor (R, P), centroid (3,)."""

    diagonal: Array
    score_sum: Array
    factor: Rows
    centroid: Array


class Scorer:
    """Scores tosses of one body at one theta; holds nothing but its arguments and what follows from them."""

    def __init__(self, geometry: ContactGeometry, body: Body, config: ScoringConfig) -> None:
        geometry = scored_geometry(geometry, config.form)
        form = config.form if config.form is Form.CONTACTNETS else Form.RIGID if geometry.is_rigid else Form.PHYSICAL
        self.geometry = geometry
        self.body = body
        self.config = config
        self.form: ParameterForm = parameter_form(geometry, form)
        self.version = parameters_version(geometry, body)
        edges = np.cumsum([0, *(block.size for block in self.form.blocks)]).tolist()
        self.blocks = tuple(ParameterBlock(block.name, *span) for block, span in zip(self.form.blocks, pairwise(edges)))

    def losses(self, tosses: Sequence[Toss]) -> tuple[Array, ...]:
        """Losses (N,) of all scored transitions of each of `tosses`, for choosing an influence bound."""
        rows = self._rows(tosses)
        sums = self._sums(rows, None)
        solved = sums.status == SolveStatus.SOLVED
        return tuple(sums.losses[part][solved[part]] for part in (slice(*ends) for ends in pairwise(rows.starts)))

    def score(self, tosses: Sequence[Toss]) -> tuple[TossInformation | NotScored, ...]:
        """The information of each toss, in the order given.

        Raises:
            InvalidValueError: no toss, or a toss of another body.
        """
        rows = self._rows(tosses)
        return self._informations(tosses, rows, self._sums(rows, self.config.estimator))

    def begin(self, toss: Toss, earlier: "BegunToss | None" = None) -> "BegunToss | None":
        """Scores all transitions but the last of a toss whose last velocities are not known yet; None where it has too few.

        Args:
            toss: the motion so far.
            earlier: less of it, of which nothing is scored again.
        """
        rows = self._rows([toss])
        if len(rows.dt) < 2:
            return None
        if earlier is not None and earlier.leads_to(rows):
            sums, weights = earlier.sums, earlier.weights[:-1]
        else:
            config = self.config
            sums = PartialSums(self.geometry, self.body, config.estimator, config.influence_bound, config.loss)
            weights = np.empty(0)
        new, scored = slice(len(weights), None), slice(len(weights), -1)
        given = transition_weights(self.geometry, self.body, rows.before[new], rows.dt[new])
        weights = np.append(weights, np.ones(len(rows.dt[new])) if given is None else given)
        added = sums.added(rows.before[scored], rows.after[scored], rows.dt[scored], weights[scored])
        return BegunToss(self, rows, weights, added)

    def _informations(
        self, tosses: Sequence[Toss], rows: Transitions, sums: FisherSums
    ) -> tuple[TossInformation | NotScored, ...]:
        """What the sums over their transitions say of tosses."""
        centroids = np.array([toss.positions.mean(axis=0) / self.body.length_scale for toss in tosses])
        fishers = self.form.chart.T @ sums.fishers @ self.form.chart  # one product per toss: the same digits in any batch
        score_sums = np.stack([row @ self.form.chart for row in sums.score_sums])
        if self.form.tilt_axes.size:
            shifts = (centroids - self._far_off(tosses) - self.geometry.pivot) @ self.form.tilt_axes.T
            fishers, score_sums = about_centroids(fishers, score_sums, self.blocks, shifts)
        factors = factors_of_fishers(0.5 * (fishers + fishers.transpose(0, 2, 1)), self.config.compression)
        stored = [factor.astype(STORED) for factor in factors]
        return tuple(
            self._information(toss, k, rows, sums, _Summed(np.diagonal(fishers[k]), score_sums[k], stored[k], centroids[k]))
            for k, toss in enumerate(tosses)
        )

    def _rows(self, tosses: Sequence[Toss]) -> Transitions:
        for toss in tosses:
            if toss.body != self.body.name:
                raise InvalidValueError(f"body of toss {toss.toss_id}", toss.body, self.body.name)
        rows = as_described(transitions_of(tosses, self.body.length_scale), self.geometry, self.body)
        far = np.repeat(np.pad(self._far_off(tosses), ((0, 0), (0, 10))), np.diff(rows.starts), axis=0)
        return replace(rows, before=rows.before - far, after=rows.after - far) if far.any() else rows

    def _far_off(self, tosses: Sequence[Toss]) -> Array:
        """(K, 3) along the ground, what is taken off the positions of each toss [characteristic lengths]."""
        axes = self.form.tilt_axes.reshape(-1, 3)
        first = np.array([toss.positions[0] / self.body.length_scale for toss in tosses])
        return FAR * np.rint((first - self.geometry.pivot) @ axes.T / FAR) @ axes

    def _sums(self, rows: Transitions, estimator: Estimator | None) -> FisherSums:
        return fisher_sums(
            self.geometry,
            self.body,
            rows.before,
            rows.after,
            rows.dt,
            rows.starts,
            estimator or Estimator.EMPIRICAL,
            np.inf if estimator is None else self.config.influence_bound,
            self.config.loss,
        )

    def _information(
        self, toss: Toss, k: int, rows: Transitions, sums: FisherSums, summed: "_Summed"
    ) -> TossInformation | NotScored:
        own = slice(int(rows.starts[k]), int(rows.starts[k + 1]))
        solved = sums.status[own] == SolveStatus.SOLVED
        if not solved.any():
            return NotScored(
                toss.toss_id, f"0 of {solved.size} transitions solved, worst residual {sums.residuals[own].max():.3g}"
            )
        return TossInformation(
            toss_id=toss.toss_id,
            body=toss.body,
            model="polytope",
            parameters_version=self.version,
            estimator=self.config.estimator.value,
            influence_bound=self.config.influence_bound,
            blocks=self.blocks,
            transitions=int(solved.size),
            not_scored=int(solved.size - solved.sum()),
            duration=toss.duration,
            mean_loss=float(sums.losses[own][solved].mean()),
            block_traces=np.array([summed.diagonal[block.start : block.stop].sum() for block in self.blocks]),
            score_sum=summed.score_sum,
            factor=summed.factor,
            centroid=summed.centroid,
            tilt_axes=self.form.tilt_axes,
        )


@dataclass(frozen=True, eq=False)
class BegunToss:
    """A toss of which all transitions but the last are scored.

    Attributes:
        scorer: at whose theta.
        rows: its N transitions, the last with other velocities at its end than the toss will have.
        weights: (N,) of their losses; the last velocities have no part in them.
        sums: over the first N - 1.
    """

    scorer: Scorer
    rows: Transitions
    weights: Array
    sums: PartialSums

    def score(self, toss: Toss) -> TossInformation | NotScored:
        """The same bits as `Scorer.score` of the complete toss; if it is another one, it is scored from the beginning."""
        rows = self.scorer._rows([toss])
        if not self._begins(rows):
            return self.scorer.score([toss])[0]
        last = slice(-1, None)
        sums = self.sums.added(rows.before[last], rows.after[last], rows.dt[last], self.weights[last])
        return self.scorer._informations([toss], rows, sums.total())[0]

    def fits(self, toss: Toss) -> bool:
        """Whether a toss is the same but for its last velocities; InvalidValueError if it is one of another body."""
        return self._begins(self.scorer._rows([toss]))

    def leads_to(self, rows: Transitions) -> bool:
        """Whether the transitions of a toss begin with those that are scored, and two or more follow."""
        scored = slice(len(self.weights) - 1)
        known, found = ((each.before[scored], each.after[scored], each.dt[scored]) for each in (self.rows, rows))
        return all(map(np.array_equal, known, found)) and len(rows.dt) > len(self.weights)

    def _begins(self, rows: Transitions) -> bool:
        known, found = ((each.before, each.after[:-1], each.dt) for each in (self.rows, rows))
        return all(map(np.array_equal, known, found))
