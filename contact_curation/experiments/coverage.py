"""Predicted against actual error of the parameters, over bootstrap resamples of the tosses (method.md 2.8, check 6.16)."""

from dataclasses import asdict, dataclass

import numpy as np

from contact_curation.errors import InvalidValueError
from contact_curation.experiments.cell import Planned
from contact_curation.experiments.cell_run import FIT, ONE_THREAD, Bench, Row
from contact_curation.geometry.quaternions import Array
from contact_curation.learning.fits.held_fit import fit_held
from contact_curation.learning.fits.polytope_fit import FitConfig, fit_polytope
from contact_curation.learning.uncertainty.coverage import Calibration, calibration
from contact_curation.learning.uncertainty.parameters import KnownConfig
from contact_curation.motion.transitions import transitions_of

SAID = ("sandwich", "cramer_rao", "naive")
"""Standard deviations that are said (`learning.uncertainty.parameters`)."""

LOW, HIGH = 0.7, 1.4
"""Between them a deviation found is what was said of it."""


@dataclass(frozen=True)
class CalibrationCell(Planned):
    """One fit, and its resamples.

    Attributes:
        size: tosses, drawn at random.
        seed: of the draw, the initial parameters and the bootstrap.
        resamples: at least 2.
    """

    KIND = "calibration"

    size: int
    seed: int
    resamples: int

    def __post_init__(self) -> None:
        if self.size < 1 or self.resamples < 2:
            found = f"{self.size} tosses, {self.resamples} resamples"
            raise InvalidValueError("calibration", found, "at least 1 toss and 2 resamples")

    @property
    def fields(self) -> Row:
        """What its rows begin with."""
        return {name: float(value) for name, value in asdict(self).items()}


def calibration_rows(cell: CalibrationCell, bench: Bench) -> tuple[Row, ...]:
    """A row per kind of parameter: the deviation found, and over it each of those said; 1 is perfect."""
    if cell.size > len(bench.training):
        raise InvalidValueError("tosses to resample", len(bench.training), f"at least {cell.size}")
    chosen = np.random.default_rng(cell.seed).choice(len(bench.training), cell.size, replace=False)
    scale = bench.body.length_scale
    data = transitions_of([bench.training[place] for place in np.sort(chosen)], scale)
    begun = fit_held(bench.initial_polytope(cell.seed), data, FIT).model
    model = fit_polytope(begun, data, FitConfig(ONE_THREAD)).model
    others = transitions_of(bench.held_out, scale)
    found = calibration(model, data, others, cell.resamples, cell.seed, KnownConfig(ONE_THREAD))
    names = dict.fromkeys(kind_of(parameter.name) for parameter in found.known.parameters)
    return tuple(_row(name, found) for name in names)


def kind_of(name: str) -> str:
    """`vertices_normal[2][0]` is of the kind `vertices_normal`; heights of vertices are a kind of their own."""
    kind = name.partition("[")[0]
    return "vertex heights" if kind == "vertices_normal" and name.endswith("[2]") else kind


def deviations_said(found: Calibration, said: str) -> Array:
    """(P,) standard deviations in the parameters' units, one of those of SAID."""
    return np.array([getattr(parameter, said) for parameter in found.known.parameters])


def count_within(ratios: Array) -> int:
    """How many deviations are what was said of them."""
    return int(np.count_nonzero((ratios > LOW) & (ratios < HIGH)))


def _row(kind: str, found: Calibration) -> Row:
    parameters = found.known.parameters
    places = [k for k, parameter in enumerate(parameters) if kind_of(parameter.name) == kind]
    row: Row = {"parameters": kind, "unit": parameters[places[0]].unit, "found": float(np.median(found.bootstrap[places]))}
    for said in SAID:
        ratios = found.bootstrap[places] / deviations_said(found, said)[places]
        row[said] = float(np.median(ratios))
        row[f"{said}_within"] = count_within(ratios) / ratios.size
    return row
