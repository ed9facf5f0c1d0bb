"""What designed throws are worth, and how long designing takes.

The worth is the D-efficiency of a batch at the true cube: the geometric mean, over the directions that replayed throws
identify, of the information of the batch per throw, relative to that of an average replayed throw (method.md 5). Planned: each
throw comes out as commanded. Executed: each comes out with method.md 5's noise, geometric mean over several tries. Batches are
drawn at random from releases (data: those of the real tosses 0-399 where they are at hand, else draws of the published
statistics; canonical: normal in the heading frame; raw: the paper's normal in the board's frame), or designed at the truth, at
a theta fitted to 16 random tosses, or at a random initialisation (there without limits on motions: it
predicts few that keep them).

    python -m benchmarks.design.designed_throws [--json] [--seeds N] [--only timing|worth|trust|arm] [--pool N]

Part `arm` has the simulated arm make the throws (benchmarks/design/_by_arm.py).

The fits use real tosses of 0-399 where they are at hand, else tosses thrown in MuJoCo. Everything else is simulated.
"""

import argparse
import json
import os
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks._data import contactnets_folder
from benchmarks.design._by_arm import ByArm, worths_by_arm
from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.loss_config import LossConfig
from contact_curation.contact.models.polytope import PolytopeModel, initial_geometry
from contact_curation.contact.parameter_form import Form
from contact_curation.design.execution_noise import ERRORS, ExecutionNoise
from contact_curation.design.greedy_batch import RefinementConfig, greedy_batch
from contact_curation.design.planner import DesignConfig, Planner
from contact_curation.design.predicted_information import Particle, PredictionConfig, predicted_information, predicted_motions
from contact_curation.design.readiness import spearman
from contact_curation.design.releases import Placement, ReleasePrior, fitted_prior, published_releases, raw_prior
from contact_curation.design.throw import throw_of_state
from contact_curation.geometry.quaternions import Array
from contact_curation.information.record import TossInformation
from contact_curation.information.subspace import identifiable_subspace
from contact_curation.learning.fits.polytope_fit import FitConfig, fit_polytope
from contact_curation.motion.toss import Toss
from contact_curation.motion.transitions import states_of, transitions_of
from contact_curation.simulation.thrown_toss import thrown_toss
from contact_curation.storage.datasets.contactnets import read_contactnets

PARTS = ("timing", "worth", "trust", "arm")
BATCHES = (4, 8, 16)
REFINED = 8
"""Throws of the batch that is also refined."""

NAMES = [f"throw-{number}" for number in range(REFINED)]
KNOWN = 12
"""Tosses that are known when the next throw is timed."""

EXECUTIONS = 16
"""Tries of each batch with noise."""

TRAINING_TOSSES = 16
TRAINING_IDS = range(400)
TIMED_THROWS = 2000
LEARNED_FROM = (0, 4, 8, 16, 32)
UNSEEN = 20
"""Tosses that no theta learned from."""
BODY = CONTACTNETS_CUBE
EXACT = PredictionConfig(thinning=1)
NOISE = ExecutionNoise.expected()


@dataclass(frozen=True)
class Timing:
    """The quickest of some repetitions on `processors`.

    Attributes:
        what: was done.
        seconds: of the wall clock, which other work on the machine makes longer.
        processor_seconds: of all processors together.
        processors: there are.
    """

    what: str
    seconds: float
    processor_seconds: float
    processors: int


@dataclass(frozen=True)
class Worth:
    """D-efficiency of batches of one size made in one way: mean over the seeds, and its 95 % bootstrap interval."""

    how: str
    throws: int
    planned: float
    planned_interval: tuple[float, float]
    executed: float
    executed_interval: tuple[float, float]


@dataclass(frozen=True)
class Gain:
    """What a design is worth relative to the best random column of the same size; ratio of means, paired bootstrap."""

    how: str
    throws: int
    planned: float
    planned_interval: tuple[float, float]
    executed: float
    executed_interval: tuple[float, float]


@dataclass(frozen=True)
class Trust:
    """What the readiness check sees of a theta fitted to so many tosses (0: a random initialisation), quartiles over the seeds.

    Attributes:
        tosses: learned from.
        loss: median loss of tosses that it did not learn from.
        agreement: rank correlation of the reference throws' scores with those of the theta before it in the table.
        truth: the same with those at the true cube, which the check cannot see.
    """

    tosses: int
    loss: tuple[float, float, float]
    agreement: tuple[float, float, float]
    truth: tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class Setting:
    """What all seeds share.

    Attributes:
        truth: the true cube.
        releases: (K, 13) replayed ones.
        tosses: to fit theta to.
        whitening: (P, p) in which the mean information of the replayed throws is the identity.
        particle: makes a theta.
    """

    truth: Particle
    releases: Array
    tosses: tuple[Toss, ...]
    whitening: Array
    loss: LossConfig

    def efficiency(self, states: Array) -> float:
        """D-efficiency of throws (B, 13) that come out like this."""
        information = predicted_information(self.truth, predicted_motions(self.truth, states, EXACT), EXACT)
        total = information.fishers[information.known].sum(axis=0)
        values = np.linalg.eigvalsh(self.whitening.T @ total @ self.whitening) / len(states)
        return float(np.exp(np.log(np.maximum(values, 1e-300)).mean()))

    def worth(self, states: Array, seed: int) -> tuple[float, float]:
        """Planned, and executed."""
        rng = np.random.default_rng([seed, 99])
        tries = []
        errors = rng.standard_normal((EXECUTIONS, len(states), ERRORS))
        for draws in errors:
            tries.append(np.concatenate([NOISE.executions(states[[k]], draws[[k]])[0] for k in range(len(states))]))
        executed = [self.efficiency(one) for one in tries]
        return self.efficiency(states), float(np.exp(np.mean(np.log(executed))))


def setting(loss: LossConfig) -> Setting:
    """With real tosses where they are at hand."""
    truth = Particle(ContactGeometry.of_body(BODY), BODY, loss)
    folder = contactnets_folder()
    tosses = _real(folder) if folder else _thrown(64)
    releases = (
        np.array([states_of(toss, 1.0)[0] for toss in tosses]) if folder else published_releases(400, np.random.default_rng(7))
    )
    information = predicted_information(truth, predicted_motions(truth, releases, EXACT), EXACT)
    subspace = identifiable_subspace(information.fishers.sum(axis=0))
    return Setting(truth, releases, tosses, subspace.per_mean_toss(len(releases)), loss)


def _real(folder: Path) -> tuple[Toss, ...]:
    found = {toss.source: toss for toss in read_contactnets(folder, BODY) if isinstance(toss, Toss)}
    wanted = {str(number) for number in TRAINING_IDS}
    return tuple(toss for source, toss in sorted(found.items()) if Path(source).stem in wanted)


def _thrown(count: int) -> tuple[Toss, ...]:
    releases = published_releases(count, np.random.default_rng(11))
    return tuple(
        thrown_toss(BODY, throw_of_state(f"example-{k}", BODY.name, state), first_stamp_ns=k)
        for k, state in enumerate(releases)
    )


def thetas(shared: Setting, seed: int) -> dict[str, Particle]:
    """The truth, a fit to a few random tosses, and a random initialisation."""
    rng = np.random.default_rng([seed, 1])
    chosen = transitions_of(
        [shared.tosses[k] for k in rng.choice(len(shared.tosses), TRAINING_TOSSES, replace=False)], BODY.length_scale
    )
    pivot = chosen.before[:, :3].mean(axis=0) * np.array([1.0, 1.0, 0.0])
    start = initial_geometry(BODY, Form.PHYSICAL, pivot, rng)
    fit = fit_polytope(PolytopeModel(start, BODY, Form.PHYSICAL), chosen, _fit_config(shared.loss))
    geometries = {"truth": shared.truth.geometry, "fit": fit.model.geometry(), "init": start}
    return {name: Particle(geometry, BODY, shared.loss) for name, geometry in geometries.items()}


def batches_of(shared: Setting, seed: int, pool: int) -> dict[tuple[str, int], Array]:
    """States (B, 13) of throws by the way they were made and their number."""
    rng = np.random.default_rng([seed, 2])
    config = DesignConfig(pool=pool, refinement=RefinementConfig(generations=0))
    prior = fitted_prior(shared.releases)
    random: dict[str, ReleasePrior] = {"canonical": prior, "raw": raw_prior(shared.releases)}
    made: dict[tuple[str, int], Array] = {}
    for throws in BATCHES:
        made["random data", throws] = shared.releases[rng.choice(len(shared.releases), throws, replace=False)]
        for name, source in random.items():
            made[f"random {name}", throws] = source.draw(throws, rng).states(Placement())
    for name, particle in thetas(shared, seed).items():
        planner = Planner([particle], prior, NOISE, config)
        known = planner.known()
        candidates = planner.pool(seed)
        usable = candidates.taken(np.flatnonzero(candidates.usable)) if name != "init" else candidates  # it refuses all
        for throws in BATCHES:
            picked = usable.taken(greedy_batch([particle], known, usable.expected, throws).indices)
            made[f"greedy at {name}", throws] = picked.states
            if name == "fit" and throws == REFINED:
                whole = Planner([particle], prior, NOISE, DesignConfig(pool=pool)).plan(NAMES, known, seed)
                made["greedy and CMA-ES at fit", throws] = np.array([throw.release for throw in whole.throws])
        if name == "fit":
            traces = np.trace(usable.expected[0], axis1=1, axis2=2)
            for throws in BATCHES:
                made["best traces at fit", throws] = usable.states[np.argsort(-traces)[:throws]]
    return made


def worths(shared: Setting, seeds: int, pool: int) -> tuple[list[Worth], list[Gain]]:
    """The table, and the designs against the best random column."""
    values: dict[tuple[str, int], list[tuple[float, float]]] = {}
    for seed in range(seeds):
        for key, states in batches_of(shared, seed, pool).items():
            values.setdefault(key, []).append(shared.worth(states, seed))
        print(f"seed {seed} of {seeds} done", file=sys.stderr, flush=True)
    rng = np.random.default_rng(0)
    draws = rng.integers(seeds, size=(2000, seeds))
    arrays = {key: np.array(pairs) for key, pairs in values.items()}  # (seeds, 2)
    rows = []
    for (how, throws), pairs in arrays.items():
        means, (low, high) = pairs.mean(axis=0), np.percentile(pairs[draws].mean(axis=1), [2.5, 97.5], axis=0)
        rows.append(Worth(how, throws, float(means[0]), (low[0], high[0]), float(means[1]), (low[1], high[1])))
    return rows, [_gain(arrays, how, throws, draws) for how, throws in arrays if not how.startswith("random")]


def _gain(arrays: Mapping[tuple[str, int], Array], how: str, throws: int, draws: NDArray[np.int64]) -> Gain:
    randoms = np.stack([pairs for (name, size), pairs in arrays.items() if size == throws and name.startswith("random")])
    own = arrays[how, throws]
    ratio = own.mean(axis=0) / randoms.mean(axis=1).max(axis=0)
    drawn = own[draws].mean(axis=1) / randoms[:, draws].mean(axis=2).max(axis=0)  # (draws, 2)
    low, high = np.percentile(drawn, [2.5, 97.5], axis=0)
    return Gain(how, throws, float(ratio[0]), (low[0], high[0]), float(ratio[1]), (low[1], high[1]))


def trusts(shared: Setting, seeds: int) -> list[Trust]:
    """As more tosses are learned from."""
    prior = fitted_prior(shared.releases)
    config = DesignConfig(refinement=RefinementConfig(generations=0))
    truth = Planner([shared.truth], prior, NOISE, config).reference_scores()
    found: dict[int, list[tuple[float, float, float]]] = {count: [] for count in LEARNED_FROM}
    for seed in range(seeds):
        rng = np.random.default_rng([seed, 1])
        order = [shared.tosses[k] for k in rng.choice(len(shared.tosses), LEARNED_FROM[-1] + UNSEEN, replace=False)]
        first = transitions_of(order[:1], BODY.length_scale)
        pivot = first.before[:, :3].mean(axis=0) * np.array([1.0, 1.0, 0.0])
        model = PolytopeModel(initial_geometry(BODY, Form.PHYSICAL, pivot, rng), BODY, Form.PHYSICAL)
        before = np.zeros(config.reference)
        for count in LEARNED_FROM:
            if count:
                model = fit_polytope(model, transitions_of(order[:count], BODY.length_scale), _fit_config(shared.loss)).model
            particle = Particle(model.geometry(), BODY, shared.loss)
            infos = particle.scorer.score(order[-UNSEEN:])
            loss = float(np.median([info.mean_loss for info in infos if isinstance(info, TossInformation)]))
            scores = Planner([particle], prior, NOISE, config).reference_scores()
            found[count].append((loss, spearman(scores, before) if count else np.nan, spearman(scores, truth)))
            before = scores
    quartiles = {count: np.percentile(rows, [25, 50, 75], axis=0) for count, rows in found.items()}
    return [Trust(count, *map(_three, rows.T)) for count, rows in quartiles.items()]


def _three(values: Array) -> tuple[float, float, float]:
    low, middle, high = values.tolist()
    return low, middle, high


def _fit_config(loss: LossConfig) -> FitConfig:
    return FitConfig(loss=loss, max_steps=60, tolerance=1e-6)


def timings(loss: LossConfig, repeats: int) -> list[Timing]:
    """Of what a user waits for."""
    particle = Particle(ContactGeometry.of_body(BODY), BODY, loss)
    planner = Planner([particle], config=DesignConfig())
    releases = planner.prior.draw(TIMED_THROWS, np.random.default_rng(0))
    tosses = [thrown_toss(BODY, throw_of_state("known", BODY.name, state)) for state in releases.states(Placement())[:KNOWN]]
    infos = [info for info in particle.scorer.score(tosses) if isinstance(info, TossInformation)]
    known, informed = planner.known([infos]), planner.with_known([infos])

    def judged() -> None:
        planner.evaluator.refusals(releases)
        planner.evaluator.evaluate(releases)

    jobs: dict[str, Callable[[], object]] = {
        f"{TIMED_THROWS} throws: limits of the release, 8 executions each, expected information": judged,
        "next throw from a pool of 256, CMA-ES of 40 generations of 12": lambda: informed.plan(["next"], known, 0),
        "new theta: reference throws and prior information": lambda: Planner([particle], config=DesignConfig()),
    }
    processors = os.cpu_count() or 1
    return [Timing(what, *min(_seconds(job) for _ in range(repeats)), processors) for what, job in jobs.items()]


def _seconds(job: Callable[[], object]) -> tuple[float, float]:
    """Of the wall clock and of all processors."""
    begun, worked = time.perf_counter(), time.process_time()
    job()
    return time.perf_counter() - begun, time.process_time() - worked


def _print(times: Sequence[Timing], rows: Sequence[Worth], gains: Sequence[Gain], trusted: Sequence[Trust]) -> None:
    for timing in times:
        each = timing.processor_seconds / timing.processors
        on = f"s on {timing.processors} processors, {timing.processor_seconds:.2f} s of work, {each:.2f} s each"
        print(f"{timing.seconds:7.2f} {on}: {timing.what}")
    if trusted:
        print("\nwhat the readiness check sees, quartiles over the seeds")
        print(f"{'tosses':>6} {'loss':>24} {'agreement':>24} {'with the truth':>24}")
    for one in trusted:
        cells = [" ".join(f"{value:7.3f}" for value in values) for values in (one.loss, one.agreement, one.truth)]
        print(f"{one.tosses:>6} {cells[0]:>24} {cells[1]:>24} {cells[2]:>24}")
    for title, lines in (("D-efficiency at the truth", rows), ("relative to the best random column", gains)) if rows else ():
        print(f"\n{title}, mean and 95 % interval over the seeds\n{'':<28} {'b':>3} {'planned':>22} {'executed':>22}")
        for line in lines:
            cells = [
                f"{value:6.2f} ({low:.2f} to {high:.2f})"
                for value, (low, high) in ((line.planned, line.planned_interval), (line.executed, line.executed_interval))
            ]
            print(f"{line.how:<28} {line.throws:>3} {cells[0]:>22} {cells[1]:>22}")


def _print_by_arm(rows: Sequence[ByArm]) -> None:
    if rows:
        print(
            "\nD-efficiency at the fit of throws by the arm, and relative to the better random column, median and 95 % interval"
        )
        print(f"{'':<20} {'planned':>22} {'executed':>22} {'gain planned':>22} {'gain executed':>22} {'lost':>5}")
    for row in rows:
        cells = [
            f"{one.value:6.2f} ({one.low:.2f} to {one.high:.2f})"
            for one in (row.planned, row.executed, row.planned_gain, row.executed_gain)
        ]
        print(f"{row.how:<20} {' '.join(f'{cell:>22}' for cell in cells)} {row.lost:>5}")


def main() -> int:
    """Runs the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--pool", type=int, default=256)
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--only", choices=PARTS)
    arguments = parser.parse_args()
    wanted = PARTS if arguments.only is None else (arguments.only,)
    loss = LossConfig()
    times = timings(loss, arguments.repeats) if "timing" in wanted else []
    shared = setting(loss) if set(wanted) & {"worth", "trust", "arm"} else None
    rows, gains = worths(shared, arguments.seeds, arguments.pool) if shared and "worth" in wanted else ([], [])
    trusted = trusts(shared, arguments.seeds) if shared and "trust" in wanted else []
    fits = [thetas(shared, seed)["fit"] for seed in range(arguments.seeds)] if shared and "arm" in wanted else []
    by_arm = worths_by_arm(fits, shared.releases) if shared and fits else []
    if arguments.json:
        parts: dict[str, Sequence[Timing | Worth | Gain | Trust | ByArm]] = {
            "timings": times,
            "worth": rows,
            "gains": gains,
            "trust": trusted,
            "arm": by_arm,
        }
        print(json.dumps({name: [asdict(one) for one in lines] for name, lines in parts.items()}))
    else:
        _print(times, rows, gains, trusted)
        _print_by_arm(by_arm)
    return 0


if __name__ == "__main__":
    sys.exit(main())
