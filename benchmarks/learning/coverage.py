"""How often 95 % intervals of friction and vertices hold the truth, over simulated worlds that are not the model's.

MuJoCo throws a cube, a slab of 120 x 80 x 50 mm and an irregular body of ten vertices, with contacts of 2 to 8 ms that leave
with 0.12 to 0.5 of their speed; in one world, as a check, the body is the model's own, rigid and without restitution. A tracker
with the noise of ContactNets' rig sees them at 148 Hz. Models learn from 4, 8 or 16 random tosses as `train` does, but from
one random initialisation, with a restitution and without; four other tosses tell the noise. Beside the interval
(`learning.uncertainty`) stands that of 1.96 deviations of the sandwich, which knows of no misfit.

    python -m benchmarks.learning.coverage [--worlds rigid_cube ...] [--sizes 4 8 16] [--seeds 10] [--published]
        [--save ROWS.jsonl]

With --published the loss has the published weights. With --save rows are kept, and those that are there already are not made
again.
"""

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
import torch

from benchmarks._saved_rows import Row, SavedRows
from benchmarks.data.thrown_bodies import release, uniform
from contact_curation.contact.body import CONTACTNETS_CUBE, Body
from contact_curation.contact.geometry_parameters import INITIAL_RESTITUTION, UPWARD, ContactGeometry
from contact_curation.contact.impulse_noise import ImpulseNoise
from contact_curation.contact.loss_config import LossConfig
from contact_curation.contact.models.polytope import PolytopeModel, initial_geometry
from contact_curation.contact.parameter_form import Form
from contact_curation.contact.rollout import rollout
from contact_curation.design.throw import throw_of_state
from contact_curation.experiments.cell_run import FIT, ONE_THREAD
from contact_curation.geometry import quaternions
from contact_curation.geometry.polytopes import box
from contact_curation.geometry.quaternions import Array
from contact_curation.information.impacts import as_described
from contact_curation.learning.evaluation.misfit import sliding_of
from contact_curation.learning.fits.exact_fit import optimum
from contact_curation.learning.fits.held_fit import fit_held
from contact_curation.learning.uncertainty.bounce import bounce_of
from contact_curation.learning.uncertainty.parameters import KnownConfig, known
from contact_curation.motion.pose_noise import RIG_NOISE
from contact_curation.motion.smoothing import kinematics
from contact_curation.motion.survey.sliding import Sliding
from contact_curation.motion.toss import NANOSECONDS, Toss
from contact_curation.motion.transitions import Transitions, transitions_of
from contact_curation.simulation.thrown_toss import DEFAULT_THROWN, ThrownTossConfig, thrown_toss
from contact_curation.simulation.world import WorldConfig

TURN_NOISE = float(np.radians(0.024))
"""Of ContactNets' rig [rad]."""

LARGEST, OTHERS = 16, 4
"""Tosses that may be learned from, and that tell the noise."""

PUBLISHED_LOSS = replace(ONE_THREAD, balanced=False)
"""The default before the weights of the loss were balanced (docs/explanation/models.md)."""

NORMAL = 1.96
ARMS = ("plain", "restitution")


IRREGULAR = 0.001 * np.array([[52, 3, -31], [-48, 20, -33], [5, -50, -30], [10, 44, -28], [60, -12, 14], [-55, -22, 10],
                             [4, 57, 12], [-8, -48, 22], [20, 8, 42], [-26, 12, 38]])  # fmt: skip


@dataclass(frozen=True, eq=False)
class World:
    """A body and what its contacts are like; None for the model's own, rigid and without restitution.

    A frame of its tracker lasts `frame_period` [s].
    """

    body: Body
    contacts: WorldConfig | None
    frame_period: float = DEFAULT_THROWN.frame_period

    def tosses(self, count: int, seed: int, noise: float = 1.0) -> tuple[Toss, ...]:
        """As a tracker with so many times the noise of ContactNets' rig sees them."""
        rng = np.random.default_rng(seed)
        return tuple(_tracked(self._thrown(release(self.body, rng), k), rng, noise) for k in range(count))

    def _thrown(self, state: Array, number: int) -> Toss:
        throw = throw_of_state(f"{number}", self.body.name, state, 0.0, "")
        if self.contacts is not None:
            config = ThrownTossConfig(self.frame_period, world=self.contacts)
            return thrown_toss(self.body, throw, config, 10 * number * NANOSECONDS)
        first = thrown_toss(self.body, throw, ThrownTossConfig(self.frame_period), 10 * number * NANOSECONDS)
        scales = np.array([self.body.length_scale] * 3 + [1.0] * 4 + [self.body.length_scale] * 3 + [1.0] * 3)
        rolled = rollout(
            ContactGeometry.of_body(self.body).rigid(), self.body, state[None] / scales, first.frames, first.frame_period
        )
        states = rolled.states * scales
        return replace(
            first,
            positions=states[:, :3],
            orientations_wxyz=states[:, 3:7],
            linear_velocities=states[:, 7:10],
            angular_velocities=states[:, 10:],
        )


def _tracked(toss: Toss, rng: np.random.Generator, noise: float) -> Toss:
    positions = toss.positions + noise * RIG_NOISE * rng.standard_normal((toss.frames, 3))
    turns = quaternions.exp(noise * TURN_NOISE * rng.standard_normal((toss.frames, 3)))
    orientations = quaternions.multiply(toss.orientations_wxyz, turns)
    rates = kinematics(toss.stamps_ns, positions, orientations)
    return replace(
        toss,
        positions=positions,
        orientations_wxyz=orientations,
        linear_velocities=rates.linear_velocities,
        angular_velocities=rates.angular_velocities,
    )


def contacts(milliseconds: float, damping_ratio: float) -> WorldConfig:
    """Of so long a time constant."""
    seconds = 0.001 * milliseconds
    return WorldConfig(min(0.001, 0.1 * damping_ratio * seconds), seconds, damping_ratio)


SLAB = uniform("slab", [box([0.06, 0.04, 0.025]).vertices], 770.0, 0.25).body
STONE = uniform("stone", [IRREGULAR], 900.0, 0.2).body

WORLDS = {
    "rigid_cube": World(CONTACTNETS_CUBE, None),
    "cube_2ms": World(CONTACTNETS_CUBE, contacts(2.0, 1.0)),
    "cube_8ms_bouncing": World(CONTACTNETS_CUBE, contacts(8.0, 0.4)),
    "slab_4ms": World(SLAB, contacts(4.0, 1.0)),
    "slab_2ms_bouncing": World(SLAB, contacts(2.0, 0.2)),
    "stone_4ms_bouncing": World(STONE, contacts(4.0, 0.4)),
}


def fitted(body: Body, data: Transitions, seed: int, bounces: bool, loss: LossConfig = ONE_THREAD) -> PolytopeModel:
    """The optimum, from a random shape over a level ground, as `train` fits from one start."""
    pivot = np.array([*data.before[:, :2].mean(axis=0), 0.0])
    drawn = initial_geometry(body, Form.RIGID, pivot, np.random.default_rng([seed, 1]))
    friction = float(np.linalg.norm(drawn.tangents[0]))
    start = replace(
        drawn,
        normal=UPWARD,
        tangents=friction * np.eye(2, 3),
        height=0.0,
        noise=ImpulseNoise(),
        restitution=INITIAL_RESTITUTION if bounces else None,
    )
    origin, seen = PolytopeModel(start, body, Form.RIGID), data
    data = as_described(data, start, body)
    if bounces:
        return optimum(origin, data, loss, 0.0, seen=seen).model
    return fit_held(origin, data, replace(FIT, loss=loss, renewals=3)).model


def row_of(
    model: PolytopeModel, data: Transitions, others: Transitions, slid: Sliding | None, loss: LossConfig = ONE_THREAD
) -> Row:
    """What is said of friction and vertices, and how many intervals hold the truth."""
    found = known(model, data, others, KnownConfig(loss), slid)
    by_name = {one.name: one for one in found.parameters}
    vertices = [one for one in found.parameters if one.name.startswith("vertices")]
    errors = np.abs([one.value for one in vertices] - 1e3 * model.body.vertices.ravel())
    friction = by_name["friction"]
    error = friction.value - model.body.friction
    row: Row = {"friction": friction.value, "friction_error": error / model.body.friction}
    row |= {"friction_interval": friction.interval / model.body.friction, "friction_held": bool(abs(error) < friction.interval)}
    row |= {"friction_held_by_sandwich": bool(abs(error) < NORMAL * friction.sandwich), "vertices_mm": float(np.median(errors))}
    row |= {"vertex_interval_mm": float(np.median([one.interval for one in vertices]))}
    row |= {"vertices_held": float(np.mean(errors < [one.interval for one in vertices]))}
    row |= {"vertices_held_by_sandwich": float(np.mean(errors < [NORMAL * one.sandwich for one in vertices]))}
    told = bounce_of(model, data, loss)
    row |= {"bounce_told": bool(told and told.missing)}
    bounce = by_name.get("restitution")
    return row | {"restitution": bounce.value if bounce else 0.0, "restitution_interval": bounce.interval if bounce else 0.0}


def rows_of(key: Row, loss: LossConfig) -> list[Row]:
    """Both fits of a world, a size and a seed."""
    world = WORLDS[key["world"]]
    tosses = world.tosses(LARGEST + OTHERS, 1000 * key["seed"])
    data, others = (transitions_of(part, world.body.length_scale) for part in (tosses[: key["size"]], tosses[LARGEST:]))
    slid = sliding_of((*tosses[: key["size"]], *tosses[LARGEST:]), world.body)
    models = {arm: fitted(world.body, data, key["seed"], arm == ARMS[1], loss) for arm in ARMS}
    return [{**key, "arm": arm, **row_of(model, data, others, slid, loss)} for arm, model in models.items()]


def print_table(rows: Sequence[Row]) -> None:
    """Shares of intervals that hold the truth [%], and medians of errors and of intervals."""
    shares = ("friction_held", "friction_held_by_sandwich", "vertices_held", "vertices_held_by_sandwich", "bounce_told")
    medians = ("friction_error", "friction_interval", "vertices_mm", "vertex_interval_mm", "restitution")
    print(f"{'world':20}{'tosses':>7} {'fit':12}{'seeds':>6}" + "".join(f"{name:>27}" for name in (*shares, *medians)))
    for world in (*WORLDS, "all"):
        for size, arm in sorted({(row["size"], row["arm"]) for row in rows}):
            own = [row for row in rows if (row["size"], row["arm"]) == (size, arm) and world in (row["world"], "all")]
            if own:
                values = [100.0 * np.mean([row[name] for row in own]) for name in shares]
                values += [np.median([row[name] for row in own]) for name in medians]
                cells = "".join(f"{value:27.3g}" for value in values)
                print(f"{world:20}{size:7} {arm:12}{len(own):6}{cells}")


def main() -> int:
    """Runs the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--worlds", nargs="+", choices=tuple(WORLDS), default=list(WORLDS))
    parser.add_argument("--sizes", nargs="+", type=int, default=[4, 8, LARGEST])
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--published", action="store_true", help="with the published weights of the loss")
    parser.add_argument("--save", type=Path)
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    saved, rows = SavedRows(arguments.save), list[Row]()
    loss = PUBLISHED_LOSS if arguments.published else ONE_THREAD
    for seed in range(arguments.seeds):
        for world in arguments.worlds:
            for size in arguments.sizes:
                key: Row = {"world": world, "size": size, "seed": seed, "balanced": loss.balanced}
                rows += saved.of(key, partial(rows_of, key, loss))
    print_table(rows)
    return 0


if __name__ == "__main__":
    sys.exit(main())
