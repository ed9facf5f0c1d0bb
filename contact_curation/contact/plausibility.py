"""Whether the numbers of a body fit together, by physics: a value in another unit is off by a power of ten that shows.

density     of mass in the hull's volume: from a foam's 5 to osmium's 22,600 kg/m^3
inertia     mass within R of the centre of mass has moments of at most m R^2, and a hull filled evenly has I_hull
friction    Coulomb coefficients of dry pairs are 0.05 to 1.5
scale       the unit of length of the loss is near half the edge of a cube of the hull's volume
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array

LIGHTEST, LIGHT, HEAVIEST = 1.0, 5.0, 25_000.0
"""[kg/m^3] lighter than air, lighter than foam, and denser than any metal."""

WIDEST = 3.0
"""[m] of what is tossed."""

LEAST_INERTIA = 1e-3
"""Share of the moments that the hull would have if it were filled evenly."""

LARGEST_FRICTION, LARGE_FRICTION = 5.0, 1.5
FARTHEST_SCALE, FAR_SCALE = 50.0, 5.0
"""Times the scale derived from the body, or as much less."""

ROUNDING = 1e-6

LENGTHS = {"mm": 1e-3, "cm": 1e-2, "inches": 0.0254}
INERTIAS = {"kg mm^2": 1e-6, "kg cm^2": 1e-4, "g mm^2": 1e-9, "g cm^2": 1e-7}


class BodyNumbers(NamedTuple):
    """A body, as far as its numbers must fit together; SI units.

    Attributes:
        vertices: (V, 3) about the centre of mass.
        mass, inertia, friction, length_scale, gravity: as of `contact.body.Body`.
        volume: of the hull.
        hull_inertia: (3, 3) about the centre of mass, of the hull filled evenly with the mass.
    """

    vertices: Array
    mass: float
    inertia: Array
    friction: float
    length_scale: float
    gravity: float
    volume: float
    hull_inertia: Array


def derived_scale(volume: float) -> float:
    """The length scale of a body that names none: half the edge of a cube of the hull's volume [m]."""
    return 0.5 * float(np.cbrt(volume))


def implausible(body: BodyNumbers) -> tuple[str, ...]:
    """What is odd about a body, one line each.

    Raises:
        InvalidValueError: what no body can be, with the unit that is likely meant.
    """
    return (*_of_density(body), *_of_inertia(body), *_of_friction(body), *_of_scale(body), *_of_gravity(body))


def check_lengths(vertices: Array, density: float) -> None:
    """Refuses vertices (V, 3) that cannot be in metres, of a body of this density [kg/m^3].

    Raises:
        InvalidValueError: it is wider than what is tossed, or lighter than air.
    """
    width = _width(vertices)
    if width > WIDEST or density < LIGHTEST:
        found = f"a body {width:.3g} m wide" + (f" of {density:.2g} kg/m^3, lighter than air" if density < LIGHTEST else "")
        raise InvalidValueError("vertices", found, f"metres{_length_unit(width, density)}")


def _of_density(body: BodyNumbers) -> Iterator[str]:
    density = body.mass / body.volume
    check_lengths(body.vertices, density)
    if _origin_outside(body.vertices, ROUNDING * _width(body.vertices)):
        found = "the centre of mass, their origin, lies outside of their hull"
        raise InvalidValueError("vertices", found, "vertices about it, or about another point with center_of_mass")
    if density > HEAVIEST:
        found = f"{body.mass:g} kg in {1e3 * body.volume:.3g} litres, {density:.3g} kg/m^3, denser than any metal"
        in_grams = LIGHT < 1e-3 * density < HEAVIEST
        why = f": is it in grams ({1e-3 * body.mass:g} kg)?" if in_grams else ": in which unit is it, or are the vertices?"
        raise InvalidValueError("mass", found, f"kilograms{why}")
    if density < LIGHT:
        yield f"mass: {body.mass:g} kg in {1e3 * body.volume:.3g} litres is {density:.2g} kg/m^3, lighter than foam"


def _length_unit(width: float, density: float) -> str:
    fitting = [unit for unit, metres in LENGTHS.items() if width * metres < 1.0 and LIGHT < density / metres**3 < HEAVIEST]
    return f": are they in {fitting[0]}?" if fitting else ": in which unit are they, or the mass?"


def _of_inertia(body: BodyNumbers) -> Iterator[str]:
    moments, filled = np.linalg.eigvalsh(body.inertia), np.linalg.eigvalsh(body.hull_inertia)
    reach = float(np.linalg.norm(body.vertices, axis=1).max())
    largest = body.mass * reach**2
    share = moments.max() / filled.max()
    if moments.max() > largest * (1.0 + ROUNDING) or moments.min() < LEAST_INERTIA * filled.min():
        bound = f"{body.mass:g} kg within {1e3 * reach:.0f} mm of the centre of mass" + (
            f" has at most {largest:.2g}" if share > 1.0 else f", spread evenly, has {filled.min():.2g} to {filled.max():.2g}"
        )
        units = [unit for unit, si in INERTIAS.items() if 0.1 < share * si < 3.0]
        question = f": is it in {units[0]}?" if units else ": in which unit is it?"
        found = f"moments of {_listed(moments)}, but {bound}"
        raise InvalidValueError("inertia", found, f"kg m^2{question}")
    if moments.min() < 0.05 * filled.min():
        yield f"inertia: moments of {_listed(moments)} kg m^2 are small; evenly spread mass has {_listed(filled)}"


def _of_friction(body: BodyNumbers) -> Iterator[str]:
    mu = body.friction
    if mu > LARGEST_FRICTION:
        angle = f"degrees (tan {mu:g} = {np.tan(np.radians(mu)):.2g}) or " if mu < 60.0 else ""
        percent = f"in {angle}percent ({0.01 * mu:g})"
        raise InvalidValueError("friction", f"{mu:g}", f"a coefficient, mostly 0.05 to {LARGE_FRICTION:g}: is it {percent}?")
    if mu > LARGE_FRICTION:
        yield f"friction: {mu:g} is large; a coefficient is mostly 0.05 to {LARGE_FRICTION:g}"


def _of_scale(body: BodyNumbers) -> Iterator[str]:
    scale, usual = body.length_scale, derived_scale(body.volume)
    off = max(scale / usual, usual / scale)
    if off > FARTHEST_SCALE:
        found = f"{scale:g} m for a body {_width(body.vertices):.3g} m wide"
        units = [unit for unit, metres in LENGTHS.items() if 0.2 < scale * metres / usual < 5.0]
        question = f": is it in {units[0]} ({LENGTHS[units[0]] * scale:g} m)?" if units else ""
        raise InvalidValueError("length_scale", found, f"metres, about {usual:.3g}{question}")
    if off > FAR_SCALE:
        yield f"length_scale: {scale:g} m is far from {usual:.3g} m, half the edge of a cube of the body's volume"


def _of_gravity(body: BodyNumbers) -> Iterator[str]:
    gravity = body.gravity
    if not 0.1 < gravity < 100.0:
        question = ": is it in mm/s^2?" if 9000.0 < gravity < 11000.0 else ": it is 9.81 on Earth"
        raise InvalidValueError("gravity", f"{gravity:g}", f"m/s^2{question}")
    if not 9.7 < gravity < 9.9:
        yield f"gravity: {gravity:g} m/s^2 is not that of the Earth"


def _origin_outside(vertices: Array, tolerance: float) -> bool:
    from scipy.spatial import ConvexHull  # takes a quarter of a second to import

    return float(ConvexHull(vertices).equations[:, 3].max()) > tolerance


def _width(vertices: Array) -> float:
    return float(np.ptp(vertices, axis=0).max())


def _listed(moments: Array) -> str:
    return " to ".join(f"{value:.2g}" for value in sorted({float(moments.min()), float(moments.max())}))
