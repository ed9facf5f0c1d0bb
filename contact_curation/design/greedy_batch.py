"""Chooses a batch of throws: greedy picks from a pool of releases by their information gain, then refined (method.md 1.10, 5).

    next throw = argmax over pool of mean_theta [ logdet(A + E[F(x)]) - logdet A ],  A = A0 + selected tosses + throws so far

The gain is monotone and submodular, so that greedy reaches (1 - 1/e) of the best batch from the pool. The gain that a throw is
said to have, and that it is refined by, is the mean over its executions e of logdet(A + F(x, e)) - logdet A: a throw that meets
the board with one unknown corner or another tells of one of them, where E[F] counts both. What is known already is
to the throws what A0 is to tosses: in coordinates where A is the identity a pool of throws is ranked like a pool of tosses,
with the same lazy queue. Place and heading of throws are not designed: every motion and toss counts about its own centroid.

Each throw of the batch is then moved from where the pool had it to where it adds more, by CMA-ES (Hansen 2016; package
`cmaes`), with what is known and all the other throws given. The objective is not smooth, because contacts come and go, and has
9 numbers: an evolution strategy needs neither gradient nor tuning. A throw stays where it was unless a better one was found, so
that the batch's value never falls.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from contact_curation.configs import check_positive, set_whole_numbers
from contact_curation.design.candidates import CandidateEvaluator, Candidates
from contact_curation.design.predicted_information import Particle
from contact_curation.design.releases import Releases
from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array
from contact_curation.information.accumulated import Accumulated
from contact_curation.information.criteria.log_det import select_by_log_det
from contact_curation.information.pool import Pool
from contact_curation.information.record import TossInformation
from contact_curation.information.subspace import identifiable_subspace

if TYPE_CHECKING:
    from cmaes import CMA  # type: ignore[import-untyped]  # its wheel has no py.typed

JITTER = 1e-13
"""Added to the diagonal as a share of the trace, so that a singular matrix has a Cholesky factor."""


@dataclass(frozen=True, eq=False)
class Picked:
    """A greedy batch.

    Attributes:
        indices: (B,) in the pool, in the order of selection.
        gains: (B,) what each added when it was picked, mean log-det over the particles.
    """

    indices: NDArray[np.int64]
    gains: Array


def prior_coordinates(fishers: Array, share: float) -> Array:
    """(P, p) C with C^T A0 C = I where A0 is a share of the mean of (K, P, P) on what they identify (method.md 1.6).

    Raises:
        InvalidValueError: no throw tells anything.
    """
    return np.asarray(identifiable_subspace(fishers.mean(axis=0)).whitening / np.sqrt(share))


def accumulated(coordinates: Array, known: Sequence[TossInformation]) -> Accumulated:
    """The accumulated information of tosses, each about its own centroid.

    Raises:
        InvalidValueError: a toss was scored by other parameters.
    """
    state = Accumulated.prior_only(coordinates)
    for info in known:
        if info.parameters != len(coordinates):
            raise InvalidValueError(f"parameters of toss {info.toss_id}", info.parameters, f"{len(coordinates)}")
        state = state.joined(np.asarray(info.factor, dtype=float)[None])
    return state


def with_fishers(state: Accumulated, fishers: Array) -> Accumulated:
    """The accumulated information with that of throws (B, P, P) added."""
    added = state.coordinates.T @ fishers.sum(axis=0) @ state.coordinates
    return Accumulated(state.coordinates, state.matrix + 0.5 * (added + added.T))


def gains(states: Sequence[Accumulated], fishers: Sequence[Array]) -> Array:
    """(K,) mean over particles and executions of what each throw would add in log-det.

    Args:
        states: per particle, what is known.
        fishers: per particle, (K, P, P) of throws, or (K, E, P, P) of executions of each.
    """
    each = []
    for state, matrices in zip(states, fishers, strict=True):
        own = state.half_inverse.T @ matrices @ state.half_inverse
        added = np.linalg.slogdet(np.eye(state.dimension) + 0.5 * (own + own.swapaxes(-1, -2)))[1]
        each.append(added if added.ndim == 1 else added.mean(axis=1))
    return np.asarray(np.mean(each, axis=0))


def greedy_batch(particles: Sequence[Particle], states: Sequence[Accumulated], fishers: Sequence[Array], count: int) -> Picked:
    """The greedy batch from a pool.

    Args:
        particles: thetas.
        states: per particle, what is known.
        fishers: per particle, expected information (K, P, P) of the pool's throws.
        count: of throws; fewer where the pool has fewer.
    """
    pools = [_pool(particle, matrices) for particle, matrices in zip(particles, fishers, strict=True)]
    selection = select_by_log_det(pools, [state.half_inverse for state in states], count)
    indices = selection.order[: selection.count]
    return Picked(indices, selection.gains[indices])


def _pool(particle: Particle, fishers: Array) -> Pool:
    """Throws as the tosses they would be, all with their centroids in one place."""
    scorer = particle.scorer
    size = scorer.form.size
    traces = np.trace(fishers, axis1=1, axis2=2)
    roots = np.linalg.cholesky(fishers + (JITTER * traces + np.finfo(float).tiny)[:, None, None] * np.eye(size))
    infos = tuple(
        TossInformation(
            toss_id=f"{number:09d}",
            body=particle.body.name,
            model="polytope",
            parameters_version=scorer.version,
            estimator=scorer.config.estimator.value,
            influence_bound=np.inf,
            blocks=scorer.blocks,
            transitions=1,
            not_scored=0,
            duration=0.0,
            mean_loss=0.0,
            block_traces=np.array([np.trace(fisher[b.start : b.stop, b.start : b.stop]) for b in scorer.blocks]),
            score_sum=np.zeros(size),
            factor=root.T,
            centroid=np.zeros(3),
            tilt_axes=scorer.form.tilt_axes,
        )
        for number, (fisher, root) in enumerate(zip(fishers, roots))
    )
    return Pool(infos, np.zeros(3))


COORDINATES = 9
LEAST_GAIN = 1e-9
"""A throw moves only for more than this in log-det."""


@dataclass(frozen=True)
class RefinementConfig:
    """How the throws of a batch are refined.

    Attributes:
        generations: generations of the search for each throw; 0 leaves throws where they are.
        population: candidates in each generation.
        step: initial standard deviation of the search, in units of refinement.scales.
        scales: scale of each coordinate: height [m], speed along and up [m/s], spin (3) [rad/s] and turn (3) [rad].
        tries: how often an infeasible candidate is re-drawn.
        executions: simulated executions of each candidate over which information is averaged; an even number.
    """

    generations: int = 40
    population: int = 12
    step: float = 0.5
    scales: tuple[float, ...] = (0.016, 0.085, 0.16, 1.5, 1.5, 1.5, 0.4, 0.4, 0.4)
    tries: int = 5
    executions: int = 4

    def __post_init__(self) -> None:
        set_whole_numbers(self, ("generations",), prefix="refinement.")
        set_whole_numbers(self, ("population",), 4, prefix="refinement.")
        set_whole_numbers(self, ("tries",), 1, prefix="refinement.")
        if self.executions < 2 or self.executions % 2:
            raise InvalidValueError("refinement.executions", self.executions, "an even number of at least 2")
        check_positive(self, ("step",), "refinement.")
        if len(self.scales) != COORDINATES or not all(np.isfinite(scale) and scale > 0.0 for scale in self.scales):
            raise InvalidValueError("refinement.scales", self.scales, f"{COORDINATES} positive numbers")


DEFAULT_REFINEMENT = RefinementConfig()


def refined(
    evaluator: CandidateEvaluator, states: Sequence[Accumulated], batch: Candidates, config: RefinementConfig, seed: int
) -> Candidates:
    """A batch at least as good as the given one, about it.

    Args:
        evaluator: judges moves.
        states: per particle, what is known without the batch.
        batch: throws that may be made.
        config: how.
        seed: of the moves.
    """
    for place in range(len(batch.states)) if config.generations else ():
        others = np.delete(np.arange(len(batch.states)), place)
        given = [with_fishers(state, fishers[others]) for state, fishers in zip(states, batch.expected, strict=True)]
        own_seed = int(np.random.default_rng([seed, place]).integers(2**31 - 1))
        better = _moved(evaluator, given, batch.taken([place]), config, own_seed)
        batch = _replaced(batch, place, better)
    return batch


def _moved(
    evaluator: CandidateEvaluator, given: Sequence[Accumulated], throw: Candidates, config: RefinementConfig, seed: int
) -> Candidates:
    """One throw, moved to the best place that was found and may be thrown from."""
    from cmaes import CMA  # it takes a second to import, and all nodes know what a throw is

    strategy = CMA(np.zeros(COORDINATES), config.step, seed=seed, population_size=config.population)
    start = evaluator.evaluate(throw.releases, config.executions)
    found, best_gain = [start], float(gains(given, start.fishers)[0])
    for _ in range(config.generations):
        moves = np.array([strategy.ask() for _ in range(config.population)])
        candidates = _judged(evaluator, throw.releases, moves, config, strategy)
        values = np.where(candidates.usable, gains(given, candidates.fishers), -np.inf)
        while values.max() > best_gain + LEAST_GAIN:
            winner = int(values.argmax())
            if evaluator.thrower_refusals(candidates.states[[winner]])[0] is None:
                found.append(candidates.taken([winner]))
                best_gain = float(values[winner])
            else:
                values[winner] = -np.inf
        worst = float(np.min(values, where=np.isfinite(values), initial=0.0)) - 1.0
        strategy.tell([(move, -value) for move, value in zip(moves, np.maximum(values, worst).tolist())])
        if strategy.should_stop():
            break
    while len(found) > 1 and evaluator.motion_refusals(found[-1].states)[0]:  # by many executions, from the best down
        found.pop()
    return _better(evaluator, given, throw, found[-1]) if len(found) > 1 else throw


def _better(evaluator: CandidateEvaluator, given: Sequence[Accumulated], throw: Candidates, moved: Candidates) -> Candidates:
    """The better one of two by all executions."""
    judged = evaluator.evaluate(moved.releases)
    better = judged.usable[0] and gains(given, judged.fishers)[0] > gains(given, throw.fishers)[0] + LEAST_GAIN
    return judged if better else throw


def _judged(
    evaluator: CandidateEvaluator, base: Releases, moves: Array, config: RefinementConfig, strategy: "CMA"
) -> Candidates:
    """The moved releases; `moves` (B, 9) that may not be thrown are drawn again, in place, and the last try stands."""
    refusals = list(evaluator.refusals(_moved_releases(base, moves, config)))
    for _ in range(config.tries):
        refused = [index for index, refusal in enumerate(refusals) if refusal is not None]
        if not refused:
            break
        for index in refused:
            moves[index] = strategy.ask()
        again = evaluator.refusals(_moved_releases(base, moves[refused], config))
        for index, refusal in zip(refused, again):
            refusals[index] = refusal
    judged = evaluator.evaluate(_moved_releases(base, moves, config), config.executions)
    merged = tuple(first or second for first, second in zip(refusals, judged.refusals))
    return Candidates(judged.releases, judged.states, judged.fishers, merged)


def _moved_releases(base: Releases, moves: Array, config: RefinementConfig) -> Releases:
    return base.taken(np.zeros(len(moves), dtype=np.int64)).moved(moves * np.array(config.scales))


def _replaced(batch: Candidates, place: int, throw: Candidates) -> Candidates:
    order = [len(batch.states) if index == place else index for index in range(len(batch.states))]
    return Candidates.joined([batch, throw]).taken(order)
