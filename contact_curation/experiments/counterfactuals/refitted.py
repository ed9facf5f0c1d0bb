"""One refit on a random subset of a body's training tosses, and how its model predicts the tosses that judge."""

from dataclasses import dataclass, replace
from functools import cached_property
from time import process_time

import numpy as np

from contact_curation.contact.evaluation import transition_weights
from contact_curation.contact.impulse_noise import ImpulseNoise
from contact_curation.contact.models.polytope import PolytopeModel
from contact_curation.contact.models.rows import Rows
from contact_curation.contact.parameter_form import Form
from contact_curation.errors import ContactCurationError
from contact_curation.experiments.bodies import BOUNCING, bench_of
from contact_curation.experiments.cell import Planned
from contact_curation.experiments.cell_run import FIT, ONE_THREAD, Bench, Row, motion_row
from contact_curation.experiments.counterfactuals.table import NUMBERS
from contact_curation.geometry.quaternions import Array
from contact_curation.information.impacts import as_described
from contact_curation.information.pool import Indices
from contact_curation.learning.evaluation.evaluation import EvaluationConfig, predicted_motions, shape_errors, transition_losses
from contact_curation.learning.fits.refits import RefitConfig, RefitPool
from contact_curation.motion.transitions import Transitions, transitions_of

SPLIT, START = 0, 0
"""Seeds of the division into training and judging tosses, and of theta_0, which all refits of a body share."""


@dataclass(frozen=True)
class Subset(Planned):
    """Random training tosses of a body.

    Attributes:
        body: one of `bodies.BODIES`.
        size: how many tosses.
        draw: number of the draw.
    """

    body: str
    size: int
    draw: int

    def places(self, tosses: int) -> Indices:
        """(size,) places of the drawn tosses among so many, ascending."""
        return np.sort(np.random.default_rng([self.draw, self.size, 11]).choice(tosses, self.size, replace=False))


@dataclass(frozen=True, eq=False)
class Laboratory:
    """What all refits of a body share; made by `of`.

    Attributes:
        bench: training tosses and those that judge.
        pool: the training tosses, ready to be refitted.
        judging: transitions of the tosses that judge.
    """

    bench: Bench
    pool: RefitPool
    judging: Transitions

    @staticmethod
    def of(body: str) -> "Laboratory":
        """Reads or simulates a body's tosses and fits all of those for training.

        Raises:
            ContactCurationError: the tosses are not there or cannot be read.
        """
        bench = bench_of(body, SPLIT)
        origin = origin_of(bench, START, body in BOUNCING)
        training, judging = (
            as_described(transitions_of(tosses, bench.body.length_scale), origin.geometry(), bench.body)
            for tosses in (bench.training, bench.held_out)
        )
        return Laboratory(bench, RefitPool.of(origin, training, RefitConfig(FIT)), judging)

    def prepared(self) -> "Laboratory":
        """The same, with everything made that processes would otherwise make again."""
        self.pool.prepare()
        _ = self.weights
        return self

    @cached_property
    def weights(self) -> Array:
        """(N,) one over the variances of the judging transitions, by the noise of the fit to all."""
        return self._weights_of(self.judging)

    @cached_property
    def training_weights(self) -> Array:
        """(N,) the same of the training transitions."""
        return self._weights_of(self.pool.data)

    def _weights_of(self, data: Transitions) -> Array:
        found = transition_weights(self.pool.model.geometry(), self.bench.body, data.before, data.dt)
        return np.ones(len(data.dt)) if found is None else found

    def row(self, subset: Subset) -> Row:
        """The refit's row; one whose fit or judgement fails says why, and has no outcomes.

        Outcomes: means over the judging tosses of position [% of width], rotation [deg], penetration and loss; vertices off
        the described body's and off those of the fit to all [mm RMS], friction, and how far it is off the fit to all's.
        """
        chosen = subset.places(len(self.bench.training))
        names = " ".join(self.pool.data.toss_ids[place] for place in chosen)
        try:
            return {**self._judged(chosen), "failed": "", "tosses": names}
        except ContactCurationError as error:
            none = dict.fromkeys(NUMBERS, np.nan) | dict.fromkeys(
                ("evaluations", "converged", "fit_seconds", "judge_seconds"), 0.0
            )
            return {**none, "failed": str(error), "tosses": names}

    def _judged(self, chosen: Indices) -> Row:
        began = process_time()
        found = self.pool.refit(chosen)
        fitted = process_time()
        row = motion_row(predicted_motions(found.model, self.bench.held_out, EvaluationConfig(loss=ONE_THREAD)).errors)
        shape, of_all = shape_errors(found.model), shape_errors(self.pool.model)
        assert shape is not None  # of a polytope
        assert of_all is not None
        away = found.model.geometry().vertices_normal - self.pool.model.geometry().vertices_normal
        return {
            **{name: row.get(name, np.nan) for name in ("position", "rotation", "penetration")},
            "not_finite": row["not_finite"],
            "loss": self.held_out_loss(found.model),
            "vertices": shape.vertex_rms_mm,
            "vertices_from_all": 1e3 * self.bench.body.length_scale * float(np.sqrt(np.square(away).sum(axis=1).mean())),
            "friction": shape.friction,
            "friction_from_all": abs(shape.friction - of_all.friction),
            "objective": found.objective,
            "evaluations": float(found.evaluations),
            "converged": float(found.converged),
            "fit_seconds": round(fitted - began, 4),
            "judge_seconds": round(process_time() - fitted, 4),
        }

    def held_out_loss(self, model: PolytopeModel) -> float:
        """Mean loss of the solved judging transitions, each over its variance by the noise of the fit to all."""
        rows = self.judging
        losses, solved = transition_losses(model, Rows(rows.before, rows.after, rows.dt), ONE_THREAD)
        return float((self.weights * losses)[solved].mean())


def origin_of(bench: Bench, seed: int, bounces: bool) -> PolytopeModel:
    """theta_0: the random initialisation with one set of vertices and the usual noise of impacts."""
    geometry = bench.initial_polytope(seed).geometry()
    model = PolytopeModel(
        replace(geometry, vertices_tangent=geometry.vertices_normal, noise=ImpulseNoise()), bench.body, Form.RIGID
    )
    return model.bouncing() if bounces else model
