"""The three ways to learn a body from tosses that are compared, each from a start as described and from random ones.

- `ours`: the exact fit of a polytope with one set of vertices and learned noise of impacts; intervals are those of `evaluate`
- `sysid`: a box and its contacts by the least squares of `mujoco.sysid`; intervals are those of its `calculate_intervals`
- `cmaes`: the same box on the same residuals by CMA-ES; no intervals

A `-cold` start is drawn as the published initialisation; `sysid` begins at STARTS of them, the others at one. Contacts begin as
MuJoCo's defaults.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from contact_curation.contact.body import Body
from contact_curation.contact.models.polytope import PolytopeModel
from contact_curation.experiments.cell_run import FIT, ONE_THREAD, Bench, Row
from contact_curation.experiments.counterfactuals.refitted import origin_of
from contact_curation.geometry.quaternions import Array
from contact_curation.information.impacts import as_described
from contact_curation.learning.evaluation.rebounds import rebound_of
from contact_curation.learning.fits.exact_fit import with_rebound
from contact_curation.learning.fits.held_fit import fit_held
from contact_curation.learning.uncertainty.parameters import KnownConfig, KnownParameter, known
from contact_curation.motion.toss import Toss
from contact_curation.motion.transitions import transitions_of
from contact_curation.simulation.identification.box import Identified, IdentifiedBox
from contact_curation.simulation.identification.by_cmaes import CmaesConfig, by_cmaes
from contact_curation.simulation.identification.by_sysid import by_sysid
from contact_curation.simulation.world import MUJOCO_DEFAULTS

STARTS, COLD_SPREAD = 3, 0.3
"""Random starts of sysid, and the spread of the first generation of CMA-ES from a random start."""


class Task(NamedTuple):
    """What a fitter is given.

    Attributes:
        bench: the body as described, and the tosses that judge, from which none learns.
        tosses: to learn from.
        seed: of random starts.
        bounces: whether ours has a restitution.
    """

    bench: Bench
    tosses: tuple[Toss, ...]
    seed: int
    bounces: bool

    def start(self, number: int) -> PolytopeModel:
        """A random start of ours."""
        return origin_of(self.bench, self.seed + 1000 * number, self.bounces)

    def polytope(self, body: Body, bounces: bool = False) -> PolytopeModel:
        """A body as a model of ours, on level ground."""
        start = origin_of(self.bench, self.seed, bounces)
        vertices, tangents = body.scaled_vertices, body.friction * np.eye(2, 3)
        geometry = replace(start.geometry(), vertices_normal=vertices, vertices_tangent=vertices, tangents=tangents)
        return PolytopeModel(geometry, start.body, start.form)


class Learned(NamedTuple):
    """What a fitter found.

    Attributes:
        model: as ours.
        contact: time constant [s] and damping ratio of MuJoCo's contacts; None of ours.
        evaluations: steps of ours, or how often all windows were simulated.
        said: by what `intervals` finds the intervals, which takes no time of the fit.
    """

    model: PolytopeModel
    contact: tuple[float, float] | None
    evaluations: int
    said: Callable[[], Row]


def ours(task: Task, cold: bool) -> Learned:
    """See the module."""
    data = transitions_of(task.tosses, task.bench.body.length_scale)
    start = task.start(0) if cold else task.polytope(task.bench.body, task.bounces)
    start, fit = with_rebound(start, FIT, rebound_of(data, task.bench.body) if task.bounces else None)
    found = fit_held(start, as_described(data, start.geometry(), task.bench.body), fit)

    def said() -> Row:
        others = transitions_of(task.bench.held_out, task.bench.body.length_scale)
        return _said_by_ours(known(found.model, data, others, KnownConfig(ONE_THREAD)).parameters, task.bench.body)

    return Learned(found.model, None, found.steps, said)


def sysid(task: Task, cold: bool) -> Learned:
    """See the module."""
    numbers = range(STARTS) if cold else range(1)
    return _of_box(task, by_sysid(task.bench.body, task.tosses, [_box(task, number, cold) for number in numbers]))


def cmaes(task: Task, cold: bool) -> Learned:
    """See the module."""
    config = CmaesConfig(spread=COLD_SPREAD, seed=task.seed) if cold else CmaesConfig(seed=task.seed)
    return _of_box(task, by_cmaes(task.bench.body, task.tosses, _box(task, 0, cold), config))


def _box(task: Task, number: int, cold: bool) -> IdentifiedBox:
    """Where the identification of a box begins."""
    described = replace(IdentifiedBox.described(task.bench.body), contact_time=MUJOCO_DEFAULTS.contact_time)
    if not cold:
        return described
    drawn = task.start(number).geometry()
    half = task.bench.body.length_scale * np.abs(drawn.vertices_normal).mean(axis=0)
    return replace(described, half_extents=half, friction=float(np.linalg.norm(drawn.tangents[0])))


def _of_box(task: Task, found: Identified) -> Learned:
    box, body = found.box, task.bench.body
    contact = box.contact_time, box.damping_ratio
    return Learned(task.polytope(box.of(body)), contact, found.evaluations, lambda: _said_of_box(found, body))


def _said_by_ours(parameters: tuple[KnownParameter, ...], body: Body) -> Row:
    corners = [each for each in parameters if each.name.startswith("vertices_normal")]
    (friction,) = [each for each in parameters if each.name.partition("[")[0] == "friction"]
    off = np.array([each.value for each in corners]) - 1e3 * body.vertices.ravel()
    return _said(off, np.array([each.interval for each in corners]), friction.value - body.friction, friction.interval)


def _said_of_box(found: Identified, body: Body) -> Row:
    """Of a box the half widths are of logarithms."""
    if not np.isfinite(found.half_widths[:4]).all():
        return {}
    away = found.box.vector[:4] - IdentifiedBox.described(body).vector[:4]
    sizes = np.array([*(1e3 * found.box.half_extents), found.box.friction])
    widths = found.half_widths[:4]
    return _said(sizes[:3] * away[:3], sizes[:3] * widths[:3], sizes[3] * away[3], sizes[3] * widths[3])


def _said(off: Array, widths: Array, friction_off: float, friction_width: float) -> Row:
    """How many 95 % intervals of the shape [mm] and of friction hold what is described, and how wide they are."""
    return {
        "shape_held": float(np.mean(np.abs(off) <= widths)),
        "shape_half_width": float(np.median(widths)),
        "friction_held": float(abs(friction_off) <= friction_width),
        "friction_half_width": float(friction_width),
    }


FITTERS: dict[str, Callable[[Task, bool], Learned]] = {"ours": ours, "sysid": sysid, "cmaes": cmaes}
COLD = "-cold"
RULES = tuple(name + start for start in ("", COLD) for name in FITTERS)
