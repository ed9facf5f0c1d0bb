"""Scores ContactNets' tosses for a network: how fast exact traces are, and how near sketch and draws come to the exact thing.

Each network is trained for some steps on tosses 0 to 399 first, unless a checkpoint is given. Times are by the clock and by the
processor, which a busy machine disturbs less. The accuracy of the sketch is that of method.md 6, check 15: 50 tosses, inner
products of their scores relative to the scores' lengths, and Spearman's correlation of their leverages in the pool's leading
directions, against gradients by all weights. Transitions that hold the last 1e-4 of the trace, or are more than 1500, are left
out of that comparison, exact and sketched.

    python -m benchmarks.selection.network_information [--json] [--model deep ...] [--params CHECKPOINT] [--steps N]
                                                       [--threads N] [--tosses N] [--device cuda] [--times]

With a device, records are timed on the CPU and on it, and the ratio of the times by the clock is printed.
"""

import argparse
import json
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from itertools import product
from pathlib import Path

import numpy as np
import torch
from scipy.stats import spearmanr

from benchmarks._data import contactnets_folder
from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.contact.evaluation import Estimator
from contact_curation.contact.loss_config import DEFAULT_LOSS
from contact_curation.contact.models.end_to_end import EndToEndModel
from contact_curation.contact.models.model import Model, Rows
from contact_curation.geometry.quaternions import Array
from contact_curation.information.network.config import CPU, Device, NetworkConfig, SketchConfig, network_config_for
from contact_curation.information.network.forward_pass import forward_pass, frozen_copy
from contact_curation.information.network.scoring import NetworkScorer, explicit_scores
from contact_curation.information.network.sketch import ghost_norms, network_sketch
from contact_curation.information.record import TossInformation
from contact_curation.information.scoring import ScoringConfig
from contact_curation.information.subspace import LEADING_DIRECTIONS
from contact_curation.learning.training.protocols import budgeted
from contact_curation.learning.training.training import new_training
from contact_curation.motion.toss import Toss
from contact_curation.motion.transitions import transitions_of
from contact_curation.storage.checkpoint_file import read_model
from contact_curation.storage.datasets.contactnets import contactnets_files, read_contactnets_toss

BODY = CONTACTNETS_CUBE
NETWORKS = ("deep", "deepvertex", "end_to_end")
TRAINING_TOSSES = 400
COMPARED_TOSSES, COMPARED_TRANSITIONS, COMPARED_TRACE = 50, 1500, 0.9999
SKETCHES = ((0, 16), (12, 4), (16, 4), (16, 8), (24, 8), (24, 24), (16, 32))
"""Leading and random rows."""

DRAWS = (1, 2, 4, 6, 8)


@dataclass(frozen=True)
class Timing:
    """One way to score tosses at one theta.

    Attributes:
        model: whose.
        what: is computed.
        device: where.
        transitions: of the tosses.
        threads: of torch on the CPU.
        seconds, cpu_seconds: by the clock and by the processor.
        trace_deviation: largest of the tosses' traces from those of the CPU, relative.
    """

    model: str
    what: str
    device: str
    transitions: int
    threads: int
    seconds: float
    cpu_seconds: float
    trace_deviation: float = 0.0


@dataclass(frozen=True)
class Sketched:
    """A sketch against gradients by all weights.

    Attributes:
        model: whose.
        leading, random: rows of each projection.
        columns: numbers per transition.
        inner_products: root mean square error of those of two tosses' scores, in the scores' lengths.
        worst: the largest of these.
        transitions: root mean square error of those of two transitions' scores.
        leverages: Spearman's correlation over the tosses.
    """

    model: str
    leading: int
    random: int
    columns: int
    inner_products: float
    worst: float
    transitions: float
    leverages: float


@dataclass(frozen=True)
class Drawn:
    """Traces of Gauss-Newton matrices from a few backward passes, by two seeds.

    Attributes:
        model: whose.
        draws: per transition.
        deviation: standard deviation of a toss's trace, as a share of it (root mean square over the tosses).
        agreement: Spearman's correlation of the two rankings.
        seconds: processor's, per 1000 transitions.
    """

    model: str
    draws: int
    deviation: float
    agreement: float
    seconds: float


def main() -> int:
    """Prints tables, or JSON."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--json", action="store_true", help="print JSON instead of tables")
    parser.add_argument("--model", nargs="+", choices=NETWORKS, default=NETWORKS)
    parser.add_argument("--params", type=Path, help="a checkpoint of the one model, instead of training")
    parser.add_argument("--steps", type=int, default=400, help="of training (default 400)")
    parser.add_argument("--threads", type=int, default=2, help="of torch (default 2)")
    parser.add_argument("--tosses", type=int, default=100, help="for what takes longer than exact traces (default 100)")
    parser.add_argument("--device", default=CPU, help="where records are timed, too (default cpu)")
    parser.add_argument("--times", action="store_true", help="without the accuracy of sketches and draws")
    arguments = parser.parse_args()
    devices = tuple(dict.fromkeys((Device(), Device(arguments.device))))
    folder = contactnets_folder()
    if folder is None:
        return 0
    torch.set_num_threads(arguments.threads)
    tosses = tuple(read_contactnets_toss(file, BODY) for file in contactnets_files(folder))
    found: dict[str, list[Timing | Sketched | Drawn]] = {"timings": [], "sketches": [], "draws": []}
    for name in arguments.model:
        model = network(name, tosses, arguments.params, arguments.steps)
        found["timings"] += timings(model, tosses, arguments.tosses, arguments.threads, devices)
        if arguments.times:
            continue
        found["sketches"] += sketches(model, tosses[:COMPARED_TOSSES])
        if not isinstance(model, EndToEndModel):
            found["draws"] += draws(model, tosses[: arguments.tosses])
    if arguments.json:
        print(json.dumps({name: [asdict(row) for row in rows] for name, rows in found.items()}, indent=2))
    else:
        for rows in found.values():
            print_table(rows)
        print_ratios([row for row in found["timings"] if isinstance(row, Timing)])
    return 0


def network(kind: str, tosses: Sequence[Toss], params: Path | None, steps: int) -> Model:
    """A trained network."""
    if params is None:
        training = new_training(
            kind, BODY, transitions_of(tosses[:TRAINING_TOSSES], BODY.length_scale), None, budgeted(kind), 0
        )
        training.advance(steps)
        model = training.model
    else:
        model = read_model(params, BODY)
    return model


def timings(model: Model, tosses: Sequence[Toss], some: int, threads: int, devices: Sequence[Device]) -> list[Timing]:
    """Exact traces of all tosses, and whole records of some on each device."""
    usual = network_config_for(model.kind)

    def timed(what: str, device: Device, given: Sequence[Toss], work: Callable[[Sequence[Toss]], object]) -> Timing:
        work(given[:1])  # starts a GPU
        clock, processor = time.perf_counter(), time.process_time()
        work(given)
        seconds, count = time.perf_counter() - clock, sum(toss.frames - 1 for toss in given)
        return Timing(model.kind, what, device.name, count, threads, seconds, time.process_time() - processor)

    rows, traces = [timed("exact traces", Device(), tosses, partial(exact_traces, model))], dict[str, Array]()

    def records(given: Sequence[Toss], estimator: Estimator, device: Device) -> None:
        traces[device.name] = np.array([info.trace for info in scored(model, given, estimator, usual, device)])

    for estimator, device in product(Estimator, devices):
        row = timed(f"records, {estimator.value}", device, tosses[:some], partial(records, estimator=estimator, device=device))
        deviation = float(np.abs(traces[device.name] / traces[CPU] - 1.0).max())
        rows.append(replace(row, trace_deviation=deviation))
    return rows


def exact_traces(model: Model, tosses: Sequence[Toss]) -> list[Array]:
    """Per toss (T,) the squared length of every transition's score by all parameters."""
    frozen = frozen_copy(model)
    explicit = model.explicit_parameters()
    found = []
    for toss in tosses:
        rows = transitions_of([toss], BODY.length_scale)
        passed = forward_pass(frozen, Rows(rows.before, rows.after, rows.dt), DEFAULT_LOSS)
        slopes = passed.score_slopes(passed.solved.astype(float))
        deltas = passed.deltas(tuple(slope[0] for slope in slopes))
        total = np.sum([ghost_norms(*pair).numpy() for pair in zip(passed.tape, deltas, strict=True)], axis=0)
        if explicit is not None:
            total = total + np.square(explicit_scores(explicit, passed, slopes, rows.before[None, :, :3].mean(axis=1))[0]).sum(
                axis=1
            )
        found.append(total)
    return found


def scored(
    model: Model, tosses: Sequence[Toss], estimator: Estimator, config: NetworkConfig, device: Device | None = None
) -> list[TossInformation]:
    """Records of tosses."""
    found = NetworkScorer(model, ScoringConfig(estimator=estimator), config, device=device).score(tosses)
    return [info for info in found if isinstance(info, TossInformation)]


def sketches(model: Model, tosses: Sequence[Toss]) -> list[Sketched]:
    """Sketches of several sizes against the gradients themselves."""
    frozen = frozen_copy(model)
    rows = transitions_of(tosses, BODY.length_scale)
    passed = forward_pass(frozen, Rows(rows.before, rows.after, rows.dt), DEFAULT_LOSS)
    deltas = passed.deltas(tuple(slope[0] for slope in passed.score_slopes(passed.solved.astype(float))))
    norms = np.sum([ghost_norms(*pair).numpy() for pair in zip(passed.tape, deltas, strict=True)], axis=0)
    order = np.argsort(-norms)
    enough = 1 + int(np.searchsorted(np.cumsum(norms[order]), COMPARED_TRACE * norms.sum()))
    chosen = np.sort(order[: min(enough, COMPARED_TRANSITIONS)])
    tape = [trace._replace(inputs=trace.inputs.detach()[chosen]) for trace in passed.tape]
    slopes = [each[chosen] for each in deltas]
    exact = np.zeros((len(chosen), len(chosen)))
    for trace, by_outputs in zip(tape, slopes, strict=True):
        gradients = (by_outputs.mT @ trace.inputs).flatten(1)
        biases = by_outputs[:, : trace.primal].sum(dim=1)
        exact += (gradients @ gradients.mT + biases @ biases.mT).numpy()
    owner = np.equal.outer(np.arange(len(tosses)), rows.toss_index[chosen]).astype(float)  # (K, N)
    found = []
    for leading, random in SKETCHES:
        config = SketchConfig(leading, random)
        columns = network_sketch(frozen, config).rows(tape, slopes).numpy()
        found.append(compared(model.kind, config, exact, columns, owner))
    return found


def compared(model: str, config: SketchConfig, exact: Array, columns: Array, owner: Array) -> Sketched:
    """How near sketched scores (N, C) come to the exact Gram matrix (N, N); owner (K, N) says which toss a score is of."""
    sketched = columns @ columns.T
    by_toss = relative_errors(owner @ exact @ owner.T, owner @ sketched @ owner.T)
    pairs = relative_errors(exact, sketched)[np.triu_indices(len(exact), 1)]
    agreement = spearmanr(owner @ leverages(exact), owner @ leverages(sketched)).statistic
    root_mean_square, worst = float(np.sqrt(np.square(by_toss).mean())), float(np.abs(by_toss).max())
    return Sketched(
        model, config.leading, config.random, columns.shape[1], root_mean_square, worst,
        float(np.sqrt(np.square(pairs).mean())), float(agreement),
    )  # fmt: skip


def relative_errors(exact: Array, sketched: Array) -> Array:
    """Errors of inner products, in the lengths of the two."""
    lengths = np.sqrt(np.diag(exact))
    return np.asarray((sketched - exact) / np.outer(lengths, lengths))


def leverages(gram: Array) -> Array:
    """Of each score in the leading directions of all."""
    _, vectors = np.linalg.eigh(gram)
    return np.asarray(np.square(vectors[:, -LEADING_DIRECTIONS:]).sum(axis=1))


def draws(model: Model, tosses: Sequence[Toss]) -> list[Drawn]:
    """How much Gauss-Newton traces vary with the random directions."""
    found = []
    for count in DRAWS:
        processor = time.process_time()
        one, other = (
            np.array([info.trace for info in scored(model, tosses, Estimator.GAUSS_NEWTON, NetworkConfig(count, seed))])
            for seed in (0, 1)
        )
        seconds = (time.process_time() - processor) / 2.0
        deviation = float(np.sqrt(np.square((one - other) / (one + other)).mean() * 2.0))
        per_thousand = 1000.0 * seconds / sum(toss.frames - 1 for toss in tosses)
        found.append(Drawn(model.kind, count, deviation, float(spearmanr(one, other).statistic), per_thousand))
    return found


def print_table(rows: Sequence[Timing | Sketched | Drawn]) -> None:
    """For people."""
    if not rows:
        return
    names = list(asdict(rows[0]))
    print("  ".join(f"{name:>22}" for name in names))
    for row in rows:
        print("  ".join(f"{value:>22.4g}" if isinstance(value, float) else f"{value:>22}" for value in asdict(row).values()))
    print()


def print_ratios(rows: Sequence[Timing]) -> None:
    """How many times as fast a device is as the CPU."""
    on_cpu = {(row.model, row.what): row.seconds for row in rows if row.device == CPU}
    for row in rows:
        if row.device != CPU:
            times = on_cpu[row.model, row.what] / row.seconds
            print(f"{row.model}, {row.what}: {row.device} is {times:.1f} times as fast as the CPU")


if __name__ == "__main__":
    sys.exit(main())
