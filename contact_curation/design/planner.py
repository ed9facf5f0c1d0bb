"""The throws to make next: a safe pool, the greedy batch from it, refined.

Everything follows from the thetas, what is known, the noise as it was learned and the seed; the same four give the same throws.

Beside it stand the plans that designed throws are compared with: throws at random, and the paper's, the best of many by the
trace of each alone.
"""

import hashlib
from collections import Counter
from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from contact_curation.configs import check_positive, set_whole_numbers
from contact_curation.design.candidates import CandidateConfig, CandidateEvaluator, Candidates, too_few
from contact_curation.design.execution_noise import ExecutionNoise
from contact_curation.design.greedy_batch import (
    DEFAULT_REFINEMENT,
    RefinementConfig,
    accumulated,
    gains,
    greedy_batch,
    prior_coordinates,
    refined,
    with_fishers,
)
from contact_curation.design.predicted_information import Particle
from contact_curation.design.releases import PUBLISHED_PRIOR, ReleasePrior, Releases
from contact_curation.design.safety import Feasible
from contact_curation.design.throw import Throw, throw_of_state
from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array
from contact_curation.information.accumulated import Accumulated
from contact_curation.information.record import TossInformation
from contact_curation.information.ties import descending

STATED = 32
"""Executions over which the gain of a planned throw is stated."""

FINALISTS_EACH = 16
"""Of a pool for many throws there are at least so many finalists for each."""


@dataclass(frozen=True)
class DesignConfig:
    """How throws are designed.

    Attributes:
        pool: number of safe candidate throws.
        sieve: simulated executions of each candidate in the first stage, which finds the finalists; an even number.
        finalists: number of candidates that are evaluated with all executions.
        reference: number of reference throws. Their mean information, times `share`, is the prior information A0, and the
            readiness check compares thetas on them.
        share: delta: the prior information A0 is this share of the mean information of the reference throws (method.md 1.6).
        candidates: how releases are evaluated.
        refinement: how chosen throws are refined.
    """

    pool: int = 256
    sieve: int = 2
    finalists: int = 64
    reference: int = 64
    share: float = 1e-3
    candidates: CandidateConfig = field(default_factory=CandidateConfig)
    refinement: RefinementConfig = DEFAULT_REFINEMENT

    def __post_init__(self) -> None:
        set_whole_numbers(self, ("pool", "finalists", "reference"), 1, prefix="design.")
        if self.sieve < 2 or self.sieve % 2:
            raise InvalidValueError("design.sieve", self.sieve, "an even number of at least 2")
        check_positive(self, ("share",), "design.")

    def simulations(self, count: int) -> int:
        """How many throws the design of so many simulates at each theta, if no search ends early and no batch is refused."""
        each, search = self.candidates.forecast.executions, self.refinement
        finalists = min(self.pool, max(self.finalists, FINALISTS_EACH * count))
        moves = count * search.generations * search.population * search.executions
        return (self.reference + finalists) * each + self.pool * self.sieve + moves + count * STATED


@dataclass(frozen=True, eq=False)
class Plan:
    """Throws to make, best first.

    Attributes:
        throws: with the gain of each given those before it.
        refused: releases of the pool that may not be thrown, by the limit.
        pool: how many were looked at.
    """

    throws: tuple[Throw, ...]
    refused: Counter[str]
    pool: int

    @property
    def expected(self) -> float:
        """Gain of all of them, mean log-det over the particles."""
        return sum(throw.expected_information for throw in self.throws)


class Planner:
    """Plans throws of one body at one or several thetas.

    Args:
        particles: thetas.
        prior: where releases are drawn from.
        noise: of executions.
        config: how.
        feasible: what the thrower says; None where it can throw anything.
        simulated: told how many throws were simulated, piece by piece.

    Raises:
        InvalidValueError: thetas that do not go together, or no release may be thrown.
    """

    def __init__(
        self,
        particles: Sequence[Particle],
        prior: ReleasePrior = PUBLISHED_PRIOR,
        noise: ExecutionNoise | None = None,
        config: DesignConfig | None = None,
        feasible: Feasible | None = None,
        simulated: Callable[[int], None] = lambda count: None,
    ) -> None:
        self.config = config or DesignConfig()
        self.prior = prior
        how = self.config.candidates
        self.evaluator = CandidateEvaluator(particles, noise or ExecutionNoise.expected(how.noise), how, feasible, simulated)
        self._reference = self.evaluator.with_noise(ExecutionNoise.expected(how.noise)).evaluate(self._referred())
        self._informations: Sequence[Sequence[TossInformation]] = [()] * len(self.particles)
        self._coordinates = [prior_coordinates(fishers, self.config.share) for fishers in self._reference.expected]

    def with_noise(self, noise: ExecutionNoise) -> "Planner":
        """The same with other noise of executions; A0 stays what it was, so that gains can be compared."""
        planner = copy(self)
        planner.evaluator = self.evaluator.with_noise(noise)
        return planner

    def with_known(self, informations: Sequence[Sequence[TossInformation]]) -> "Planner":
        """The same for gains by what known tosses, given per particle, leave open of theta."""
        planner = copy(self)
        planner._informations = informations
        return planner

    @property
    def particles(self) -> tuple[Particle, ...]:
        """The parameter particles."""
        return self.evaluator.particles

    @property
    def version(self) -> str:
        """Version of the parameter particles."""
        return "+".join(particle.version for particle in self.particles)

    def known(self, informations: Sequence[Sequence[TossInformation]] = ()) -> tuple[Accumulated, ...]:
        """The accumulated information: A0 and the tosses.

        Args:
            informations: per particle, the information of the selected tosses; empty without tosses.

        Raises:
            InvalidValueError: not once per particle, or scored at another theta or by another estimator.
        """
        each = informations or [()] * len(self.particles)
        if len(each) != len(self.particles):
            raise InvalidValueError("known tosses", f"scored at {len(each)} thetas", f"at {len(self.particles)}")
        for particle, infos in zip(self.particles, each):
            for info in infos:
                _check_comparable(particle, info)
        return tuple(accumulated(coordinates, infos) for coordinates, infos in zip(self._coordinates, each))

    def plan(self, names: Sequence[str], known: Sequence[Accumulated], seed: int) -> Plan:
        """Throws by these names, chosen together.

        Raises:
            InvalidValueError: fewer releases may be thrown than throws are wanted.
        """
        candidates = self.finalists(seed, known, len(names))
        batch = self._checked_batch(candidates, known, len(names))
        if batch is None:  # the thrower, or many executions, left too few of them
            candidates = self.pool(seed)
            batch = self._checked_batch(candidates, known, len(names))
        if batch is None:
            raise self._too_few(candidates, len(names))
        batch = refined(self.evaluator, known, batch, self.config.refinement, seed)
        stated = self.forecast(batch.releases)
        stated = stated.taken(greedy_batch(self.particles, known, stated.expected, len(names)).indices)  # best first
        return self.planned(names, stated, known, candidates.refusals)

    def planned(
        self, names: Sequence[str], stated: Candidates, known: Sequence[Accumulated], refusals: Sequence[str | None] = ()
    ) -> Plan:
        """The plan to make a batch in its order, with what `forecast` says of it."""
        throws = []
        for index, name in enumerate(names):
            gain = float(gains(known, [fishers[[index]] for fishers in stated.fishers])[0])
            body = self.particles[0].body.name
            throws.append(throw_of_state(name, body, stated.states[index], gain, self.version))
            known = [with_fishers(state, fishers[[index]]) for state, fishers in zip(known, stated.expected)]
        refused = Counter(refusal.partition(":")[0] for refusal in refusals if refusal)
        return Plan(tuple(throws), refused, self.config.pool)

    def forecast(self, releases: Releases) -> Candidates:
        """What releases are said to add, over executions that chose none of them, each at a theta that tosses leave open."""
        return self.evaluator.afresh(STATED, self._informations).evaluate(releases)

    def pool(self, seed: int) -> Candidates:
        """Candidate releases and their predicted information."""
        return self.evaluator.evaluate(self._drawn(seed))

    def finalists(self, seed: int, known: Sequence[Accumulated], count: int) -> Candidates:
        """The candidates that are evaluated with all executions (successive halving, Jamieson and Talwalkar 2016).

        A few executions of each release say which come into question: those that add most alone and, where several throws are
        wanted, those that add most to the greedy batch that these few executions would give. Those that are refused stay.

        Args:
            seed: of the pool.
            known: what is known.
            count: of throws that are wanted.
        """
        first = self.evaluator.evaluate(self._drawn(seed), self.config.sieve)
        usable = np.flatnonzero(first.usable)
        wanted = max(self.config.finalists, FINALISTS_EACH * count)
        if len(usable) > wanted:
            usable = usable[self._promising([one[usable] for one in first.expected], known, count, wanted)]
        if not len(usable):
            return first
        last = self.evaluator.evaluate(first.releases.taken(usable))
        refused = first.taken(np.flatnonzero(~first.usable)).repeated(self.config.candidates.forecast.executions)
        return Candidates.joined([last, refused])

    def _promising(self, fishers: Sequence[Array], known: Sequence[Accumulated], count: int, wanted: int) -> NDArray[np.int64]:
        """Indices of about as many as are wanted, in their order."""
        alone = np.argsort(-gains(known, fishers), kind="stable")
        if count == 1:
            return np.sort(alone[:wanted])
        batch = greedy_batch(self.particles, known, fishers, count).indices
        given = [with_fishers(state, one[batch]) for state, one in zip(known, fishers)]
        beside = np.argsort(-gains(given, fishers), kind="stable")
        return np.unique(np.concatenate([alone[: wanted // 2], batch, beside[: wanted // 2]]))

    def _drawn(self, seed: int) -> Releases:
        return self.evaluator.draw_safe(self.prior, self.config.pool, np.random.default_rng(seed))

    def reference_scores(self) -> Array:
        """(R,) information of each reference release at the first theta, relative to their mean; for the readiness check.

        The trace, whitened: of all measures tried it agrees best between thetas that are near each other.
        """
        coordinates = self._coordinates[0]
        whitened = np.einsum("pi,kpq,qi->k", coordinates, self._reference.expected[0], coordinates, optimize=True)
        return np.asarray(whitened * self.config.share / coordinates.shape[1])

    @property
    def reference_digest(self) -> str:
        """Digest of the reference releases; scores of other ones do not compare."""
        return hashlib.sha256(self._reference.states.tobytes()).hexdigest()[:16]

    def _checked_batch(self, candidates: Candidates, known: Sequence[Accumulated], count: int) -> Candidates | None:
        """The greedy batch of those that keep the limits by many executions, too, and that the thrower can make."""
        usable = candidates.taken(np.flatnonzero(candidates.usable))
        while len(usable.states) >= count:
            picked = greedy_batch(self.particles, known, usable.expected, count)
            refusals = self.evaluator.last_refusals(usable.states[picked.indices])
            refused = [int(index) for index, refusal in zip(picked.indices, refusals) if refusal]
            if not refused:
                return usable.taken(picked.indices)
            usable = usable.taken(np.delete(np.arange(len(usable.states)), refused))
        return None

    def _too_few(self, candidates: Candidates, count: int) -> InvalidValueError:
        usable = candidates.taken(np.flatnonzero(candidates.usable))
        refusals = [*candidates.refusals, *self.evaluator.last_refusals(usable.states)]
        found = sum(refusal is None for refusal in refusals[len(candidates.states) :])
        return too_few(found, len(candidates.states), count, refusals)

    def _referred(self) -> Releases:
        """Releases of the prior, the same at every theta and noise; not all of them need be safe to throw."""
        return self.prior.draw(self.config.reference, np.random.default_rng(self.config.candidates.seed))


def _check_comparable(particle: Particle, info: TossInformation) -> None:
    scorer = particle.scorer
    own = {"parameters_version": scorer.version, "estimator": scorer.config.estimator.value, "blocks": scorer.blocks}
    for name, value in own.items():
        if getattr(info, name) != value:
            raise InvalidValueError(f"{name} of toss {info.toss_id}", getattr(info, name), f"{value}")


def random_plan(planner: Planner, names: Sequence[str], known: Sequence[Accumulated], seed: int) -> Plan:
    """The first throws of the pool that may be made; errors as `Planner.plan`."""
    candidates = planner.pool(seed)
    return _first(planner, names, known, candidates, -np.arange(len(candidates.states), dtype=float))


def top_trace_plan(planner: Planner, names: Sequence[str], known: Sequence[Accumulated], seed: int) -> Plan:
    """The throws of the largest trace each, summed over the particles (Algorithm 2 of the paper); errors as `Planner.plan`.

    By the Gauss-Newton matrix: by the empirical one that the paper takes, throws that the model itself predicted would be
    ranked by rounding errors (method.md 0.4).
    """
    candidates = planner.pool(seed)
    traces = np.sum([np.trace(fishers, axis1=1, axis2=2) for fishers in candidates.expected], axis=0)
    return _first(planner, names, known, candidates, traces)


def _first(planner: Planner, names: Sequence[str], known: Sequence[Accumulated], candidates: Candidates, scores: Array) -> Plan:
    """The safe throws of the largest scores."""
    picked: list[int] = []
    for index in descending(scores):
        if len(picked) == len(names):
            break
        if candidates.refusals[index] is None and planner.evaluator.last_refusals(candidates.states[[index]])[0] is None:
            picked.append(int(index))
    if len(picked) < len(names):
        raise too_few(len(picked), len(scores), len(names), candidates.refusals)
    return planner.planned(names, planner.forecast(candidates.releases.taken(picked)), known, candidates.refusals)
