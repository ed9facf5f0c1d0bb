"""The experiments by name: which cells each has, by default and when it only has to be seen to work (method.md 1.12)."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from enum import StrEnum
from itertools import product

from contact_curation.contact.models.registry import DEFAULT_MODEL
from contact_curation.errors import InvalidValueError
from contact_curation.experiments.cell import ALL, Cell, Protocol
from contact_curation.experiments.cell_run import Bench, Row, run_cell
from contact_curation.experiments.coverage import CalibrationCell, calibration_rows
from contact_curation.experiments.faults import Fault
from contact_curation.experiments.rules import OURS
from contact_curation.experiments.theorem import TheoremCell, theorem_rows
from contact_curation.experiments.thrown.cell import ARMS, FIRM, ThrowsCell


class Experiment(StrEnum):
    """What can be reproduced."""

    DATASET_QUALITY = "dataset-quality"
    FUNCTIONALS = "functionals"
    ROBUSTNESS = "robustness"
    DESIGNED_THROWS = "designed-throws"
    THEOREM = "theorem"
    CALIBRATION = "calibration"


type LearningCell = Cell | TheoremCell | CalibrationCell
type AnyCell = LearningCell | ThrowsCell


@dataclass(frozen=True)
class ExperimentConfig:
    """What is run; of what an experiment does not have, nothing is read.

    Attributes:
        rules: compared; of `designed-throws` ways of choosing throws.
        sizes: of the selected sets, or of the tosses that are fitted to, or numbers of throws.
        seeds: how many, from 0 on.
        model, protocol, steps: as in `Cell`.
        shares: of bad tosses, beside none.
        faults: which.
        resamples: of the bootstrap of `calibration`.
        worlds: that throws of `designed-throws` land in.
        restitution: whether its learners have one.
    """

    rules: tuple[str, ...] = ()
    sizes: tuple[int, ...] = (4, 8, 16, 32, 64)
    seeds: int = 10
    model: str = DEFAULT_MODEL
    protocol: str = Protocol.EXACT.value
    steps: int = 0
    shares: tuple[float, ...] = (0.05,)
    faults: tuple[str, ...] = tuple(Fault)
    resamples: int = 48
    worlds: tuple[str, ...] = (FIRM,)
    restitution: bool = False

    def __post_init__(self) -> None:
        if self.seeds < 1 or not self.sizes:
            raise InvalidValueError("seeds and sizes", f"{self.seeds} and {len(self.sizes)}", "at least one of each")


QUALITY_RULES = ("random", "longest", "trace-static", "trace", "min-eig", "log-det", "orthogonal", OURS)
DEFAULTS: dict[Experiment, ExperimentConfig] = {
    Experiment.DATASET_QUALITY: ExperimentConfig(QUALITY_RULES, (4, 8, 16, 32, 64, ALL)),
    Experiment.FUNCTIONALS: ExperimentConfig(("trace", "min-eig", "orthogonal-literal", "orthogonal", "log-det")),
    Experiment.ROBUSTNESS: ExperimentConfig(("random", "longest", "trace", "log-det", OURS), (16,)),
    Experiment.DESIGNED_THROWS: ExperimentConfig(ARMS, (6, 8, 12, 16), 20),
    Experiment.THEOREM: ExperimentConfig(("random", "longest", "trace", "log-det", OURS), (8, 16, 32, 64, 128, 256), 5),
    Experiment.CALIBRATION: ExperimentConfig((), (64,), 1),
}


def cells_of(experiment: Experiment, config: ExperimentConfig) -> tuple[AnyCell, ...]:
    """The cells, seed by seed, so that what is done when it is stopped is a whole experiment of fewer seeds."""
    return tuple(cell for seed in range(config.seeds) for cell in MAKERS[experiment](config, seed))


def rows_of_cell(cell: LearningCell, bench: Bench) -> tuple[Row, ...]:
    """The rows of one cell, at least one; those of a `ThrowsCell` are in `experiments.thrown.designed_throws`.

    Raises:
        ContactCurationError: the tosses are too few for it, or the training failed.
    """
    match cell:
        case Cell():
            return (run_cell(cell, bench),)
        case TheoremCell():
            return theorem_rows(cell, bench)
        case CalibrationCell():
            return calibration_rows(cell, bench)


def _clean(config: ExperimentConfig, rule: str, size: int, seed: int) -> Cell:
    return Cell(rule, size, seed, config.model, config.protocol, config.steps)


def _quality(config: ExperimentConfig, seed: int) -> Iterator[AnyCell]:
    for size, rule in product([size for size in config.sizes if size != ALL], config.rules):
        yield _clean(config, rule, size, seed)
    if ALL in config.sizes:
        yield _clean(config, "all", ALL, seed)


def _robustness(config: ExperimentConfig, seed: int) -> Iterator[AnyCell]:
    """Clean pools, then every fault and share, with the gates and without."""
    for size, rule in product(config.sizes, config.rules):
        clean = _clean(config, rule, size, seed)
        yield clean
        for gated, share, fault in product((True, False), config.shares, config.faults):
            yield replace(clean, fault=fault, share=share, gated=gated)


def _throws(config: ExperimentConfig, seed: int) -> Iterator[AnyCell]:
    judged = tuple(sorted(set(config.sizes)))
    for world, rule in product(config.worlds, config.rules):
        yield ThrowsCell(rule, judged, seed, config.protocol, config.steps, config.model, world, config.restitution)


def _theorem(config: ExperimentConfig, seed: int) -> Iterator[AnyCell]:
    for rule in config.rules:
        yield TheoremCell(rule, config.sizes, seed)


def _calibration(config: ExperimentConfig, seed: int) -> Iterator[AnyCell]:
    for size in config.sizes:
        yield CalibrationCell(size, seed, config.resamples)


MAKERS: dict[Experiment, Callable[[ExperimentConfig, int], Iterator[AnyCell]]] = {
    Experiment.DATASET_QUALITY: _quality,
    Experiment.FUNCTIONALS: _quality,
    Experiment.ROBUSTNESS: _robustness,
    Experiment.DESIGNED_THROWS: _throws,
    Experiment.THEOREM: _theorem,
    Experiment.CALIBRATION: _calibration,
}


QUICK_STEPS = 4
"""Gradient steps of the budgeted protocol where it only has to be seen to work."""


def quick(config: ExperimentConfig) -> ExperimentConfig:
    """The same experiment so small that it takes seconds: every rule and one fault, once."""
    sizes = (2, ALL) if ALL in config.sizes else (2,)
    return replace(config, sizes=sizes, seeds=min(config.seeds, 2), faults=config.faults[:1], resamples=2)
