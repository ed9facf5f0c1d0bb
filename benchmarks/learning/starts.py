"""Whether exact fits of any body reach the minimum that a start at the truth reaches, from one start and from several.

Bodies of 6 to 16 vertices near an ellipsoid, all corners of their hull, of even density, are thrown in our own simulation and
tracked with the noise of ContactNets' rig. They are described with vertices that are off by some share of their size. Fits
begin at random shapes about this description (theta_0 of `train`), and with several starts also at it, and at it perturbed.
Reached is a minimum at most 1 % above the one that the fit from the true shape has, of the same sum with equal variances.
Errors of the shape are after the best matching of vertices, and as Hausdorff distance of the hulls.

    python -m benchmarks.learning.starts [--bodies 20] [--tosses 200] [--starts 1 4] [--off 0.05]
"""

import argparse
import sys
from dataclasses import dataclass, replace

import numpy as np
import torch
from scipy.spatial import ConvexHull

from contact_curation.contact.body import Body
from contact_curation.contact.geometry_parameters import UPWARD, ContactGeometry
from contact_curation.contact.models.polytope import PolytopeModel, initial_geometry
from contact_curation.contact.parameter_form import Form
from contact_curation.experiments.cell_run import ONE_THREAD
from contact_curation.geometry.quaternions import Array
from contact_curation.geometry.solids.mass_properties import of_hull
from contact_curation.learning.evaluation.shape_errors import hull_distance, matched_distances
from contact_curation.learning.fits.exact_fit import lowest_minimum
from contact_curation.learning.fits.held_fit import HeldFitConfig, fit_held
from contact_curation.motion.transitions import Transitions, transitions_of
from test.simulated import RIG_NOISE, simulated_tosses

RADII, DENSITY, FRICTION = (0.06, 0.05, 0.04), 900.0, 0.2
"""Half axes of the ellipsoid [m], density [kg/m^3] and friction."""

REACHED = 1.01


@dataclass(frozen=True)
class Reach:
    """A minimum relative to the one from the truth, and errors of its shape [mm]."""

    relative: float
    vertices_mm: float
    hull_mm: float


def body_of(number: int) -> Body:
    """A random body."""
    rng = np.random.default_rng([number, 20])
    count = int(rng.integers(6, 17))
    while True:
        directions = rng.standard_normal((count, 3))
        corners = np.array(RADII) * directions / np.linalg.norm(directions, axis=1)[:, None]
        hull = ConvexHull(corners)
        if len(hull.vertices) == count and hull.volume > 0.3 * np.prod(RADII) * 4.19:
            break
    unit = of_hull(corners)
    vertices = corners - unit.center
    size = float(np.linalg.norm(vertices, axis=1).mean() / np.sqrt(3.0))
    return Body(f"body_{number}", vertices, DENSITY * unit.mass, DENSITY * unit.inertia, FRICTION, size)


def start_at(vertices: Array, origin: PolytopeModel) -> PolytopeModel:
    """A model with vertices (V, 3) [characteristic lengths] over the ground of another."""
    return PolytopeModel(
        replace(origin.geometry(), vertices_normal=vertices, vertices_tangent=vertices), origin.body, Form.RIGID
    )


def reached(true: Body, described: Body, data: Transitions, starts: list[int]) -> list[Reach]:
    """Of each number of starts."""
    pivot = np.array([*data.before[:, :2].mean(axis=0), 0.0])
    drawn = initial_geometry(described, Form.RIGID, pivot, np.random.default_rng(0))
    friction = float(np.linalg.norm(drawn.tangents[0]))
    level = replace(drawn, normal=UPWARD, tangents=friction * np.eye(2, 3), height=0.0)
    origin, config = PolytopeModel(level, described, Form.RIGID), HeldFitConfig(loss=ONE_THREAD, renewals=0)
    truth = fit_held(start_at(true.scaled_vertices, origin), data, config, origin)
    found = []
    for count in starts:
        end = lowest_minimum(origin, data, config, count)
        vertices = end.model.geometry().vertices_normal
        in_mm = 1e3 * true.length_scale
        rms = float(np.sqrt(np.square(matched_distances(vertices, true.scaled_vertices)).mean()))
        relative = end.objective / truth.objective
        found.append(Reach(relative, in_mm * rms, in_mm * hull_distance(vertices, true.scaled_vertices)))
    return found


def main() -> int:
    """Prints a line for each body, and how many reached it."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--bodies", type=int, default=20)
    parser.add_argument("--tosses", type=int, default=200)
    parser.add_argument("--starts", nargs="+", type=int, default=[1, 4])
    parser.add_argument("--off", type=float, default=0.05, help="error of the described vertices [characteristic lengths]")
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    found: list[list[Reach]] = []
    for number in range(arguments.bodies):
        true = body_of(number)
        rng = np.random.default_rng([number, 21])
        vertices = true.vertices + arguments.off * true.length_scale * rng.standard_normal(true.vertices.shape)
        described = replace(true, vertices=vertices)
        geometry = ContactGeometry.of_body(true).rigid()
        tosses = simulated_tosses(arguments.tosses, number, RIG_NOISE, body=true, geometry=geometry)
        found.append(reached(true, described, transitions_of(tosses, true.length_scale), arguments.starts))
        each = "; ".join(
            f"{count} starts: {one.relative:.3f}, vertices {one.vertices_mm:.2f} mm, hull {one.hull_mm:.2f} mm"
            for count, one in zip(arguments.starts, found[-1], strict=True)
        )
        print(f"{true.name}, {len(vertices)} vertices: {each}", flush=True)
    for place, count in enumerate(arguments.starts):
        good = sum(one[place].relative <= REACHED for one in found)
        print(f"{count} starts: {good} of {len(found)} within 1 % of the minimum from the truth")
    return 0


if __name__ == "__main__":
    sys.exit(main())
