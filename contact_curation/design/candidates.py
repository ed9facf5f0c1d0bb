"""Candidate releases: their predicted information, and whether they are safe."""

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.design.execution_noise import DEFAULT_NOISE, ExecutionNoise, NoiseConfig, balanced_draws
from contact_curation.design.posterior import posterior_draws
from contact_curation.design.predicted_information import (
    DEFAULT_PREDICTION,
    Particle,
    PredictedInformation,
    PredictionConfig,
    information_of_executions,
    predicted_motions,
)
from contact_curation.design.releases import Placement, ReleasePrior, Releases
from contact_curation.design.safety import DEFAULT_SAFETY, Feasible, SafetyConfig, SafetySet
from contact_curation.design.throw import throw_of_state
from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array
from contact_curation.information.record import TossInformation

MOST_DRAWS = 64
"""Times the wanted number of releases that are drawn to find enough safe ones."""

PIECE = 64
"""Releases whose executions are predicted together."""

Refusals = tuple[str | None, ...]


@dataclass(frozen=True)
class CandidateConfig:
    """How releases are evaluated.

    Attributes:
        forecast: how motions of candidate throws are predicted.
        safety: limits that a throw must keep.
        noise: execution noise before any throw was measured.
        placement: where throws are released.
        seed: random seed of the executions over which information is averaged.
    """

    forecast: PredictionConfig = DEFAULT_PREDICTION
    safety: SafetyConfig = DEFAULT_SAFETY
    noise: NoiseConfig = DEFAULT_NOISE
    placement: Placement = field(default_factory=Placement)
    seed: int = 0


@dataclass(frozen=True, eq=False)
class Candidates:
    """K releases and their predicted information.

    Attributes:
        releases: themselves.
        states: (K, 13) in SI units, at their place.
        fishers: per particle (K, E, P, P), of E executions of each.
        refusals: why a release may not be thrown; None where it may.
    """

    releases: Releases
    states: Array
    fishers: tuple[Array, ...]
    refusals: Refusals

    @property
    def expected(self) -> tuple[Array, ...]:
        """Per particle (K, P, P), the mean over executions."""
        return tuple(fishers.mean(axis=1) for fishers in self.fishers)

    @property
    def usable(self) -> NDArray[np.bool_]:
        """(K,) whether each release may be thrown."""
        return np.array([refusal is None for refusal in self.refusals])

    def taken(self, indices: Sequence[int] | NDArray[np.int64]) -> "Candidates":
        """The candidates at some indices."""
        chosen = np.asarray(indices, dtype=np.int64)
        return Candidates(
            self.releases.taken(chosen),
            self.states[chosen],
            tuple(one[chosen] for one in self.fishers),
            tuple(self.refusals[index] for index in chosen),
        )

    def repeated(self, executions: int) -> "Candidates":
        """The same with so many executions of each, all of the mean information."""
        means = (np.repeat(one[:, None], executions, axis=1) for one in self.expected)
        return Candidates(self.releases, self.states, tuple(means), self.refusals)

    @staticmethod
    def joined(parts: Sequence["Candidates"]) -> "Candidates":
        """Several sets of candidates as one."""
        return Candidates(
            Releases.joined([part.releases for part in parts]),
            np.concatenate([part.states for part in parts]),
            tuple(np.concatenate(each) for each in zip(*(part.fishers for part in parts), strict=True)),
            tuple(refusal for part in parts for refusal in part.refusals),
        )


OTHER_LIMITS = "they are those of ContactNets' arm and board, --set safety.FIELD=VALUE gives yours"
"""What to do where hardly anything may be thrown."""


def too_few(found: int, pool: int, count: int, refusals: Iterable[str | None]) -> InvalidValueError:
    """The error that fewer releases may be thrown than throws are wanted.

    Args:
        found: releases that may be thrown.
        pool: of so many.
        count: throws.
        refusals: of the others; None is none.
    """
    reasons = [one for one in refusals if one]
    common = Counter(one.partition(":")[0] for one in reasons).most_common(1)
    example = next((f" ({one})" for one in reasons if one.partition(":")[0] == common[0][0]), "")
    expected = f"at least {count}; a larger pool (--set design.pool=N), or other limits: {OTHER_LIMITS}"
    return InvalidValueError("releases that may be thrown", f"{found} of {pool}{example}", expected)


class CandidateEvaluator:
    """Evaluates releases at one or several thetas, with the executions' noise as it is known.

    Args:
        particles: thetas of one body and form, at least one.
        noise: of executions.
        config: how.
        feasible: what the thrower says; None where it can throw anything.
        simulated: told how many throws were simulated, piece by piece.
        moving: per particle, the thetas that executions move by, one each; none to move by its own.

    Raises:
        InvalidValueError: no theta, or thetas of different bodies or forms.
    """

    def __init__(
        self,
        particles: Sequence[Particle],
        noise: ExecutionNoise,
        config: CandidateConfig,
        feasible: Feasible | None = None,
        simulated: Callable[[int], None] = lambda count: None,
        moving: Sequence[Sequence[ContactGeometry]] = (),
    ) -> None:
        self._simulated, self._moving = simulated, moving or [()] * len(particles)
        self.particles = tuple(_alike(particles))
        self.config = config
        self.noise = noise
        self.safety = SafetySet(self.particles[0].body, config.safety, noise, feasible)

    def with_noise(self, noise: ExecutionNoise) -> "CandidateEvaluator":
        """The same evaluator with another execution noise."""
        return CandidateEvaluator(self.particles, noise, self.config, self.safety.feasible, self._simulated)

    def afresh(self, executions: int, known: Sequence[Sequence[TossInformation]]) -> "CandidateEvaluator":
        """The same evaluator with so many other executions, by which no throw was chosen.

        Each moves by a theta of its own, drawn from those that known tosses, given per particle, leave open.
        """
        seed = self.config.seed + 1
        config = replace(self.config, forecast=replace(self.config.forecast, executions=executions), seed=seed)
        moving = [posterior_draws(*one, executions, seed) for one in zip(self.particles, known, strict=True)]
        return CandidateEvaluator(self.particles, self.noise, config, self.safety.feasible, self._simulated, moving)

    def draw_safe(self, prior: ReleasePrior, count: int, rng: np.random.Generator) -> Releases:
        """Draws releases until so many may be thrown, by what they show themselves.

        Raises:
            InvalidValueError: hardly any may be; the limit that refused most is named.
        """
        safe: list[Releases] = []
        found, refused, example = 0, Counter[str](), dict[str, str]()
        for _ in range(MOST_DRAWS):
            drawn = prior.draw(max(count - found, 32), rng)
            refusals = self.refusals(drawn)
            good = [index for index, refusal in enumerate(refusals) if refusal is None]
            for refusal in (one for one in refusals if one):
                refused[refusal.partition(":")[0]] += 1
                example.setdefault(refusal.partition(":")[0], refusal)
            safe.append(drawn.taken(good))
            found += len(good)
            if found >= count:
                return Releases.joined(safe).taken(np.arange(count))
        limits = ", ".join(f"{name} {times} times" for name, times in refused.most_common(3))
        said = f"{found} of {found + refused.total()} (refused by {limits}; e.g. {example[refused.most_common(1)[0][0]]})"
        raise InvalidValueError("safe releases", said, f"{count}; other limits: {OTHER_LIMITS}")

    def refusals(self, releases: Releases) -> Refusals:
        """Why releases may not be thrown, by what they show themselves."""
        return self.safety.refusals(releases.states(self.config.placement))

    def thrower_refusals(self, states: Array) -> Refusals:
        """Why the thrower cannot make releases (K, 13). It may take its time, so that only those that are wanted are asked."""
        name = self.particles[0].body.name
        return self.safety.thrower_refusals([throw_of_state(f"candidate-{k}", name, state) for k, state in enumerate(states)])

    def last_refusals(self, states: Array) -> Refusals:
        """Why releases (K, 13) that are wanted may not be thrown, by many executions of each and by what the thrower says."""
        found = list(self.motion_refusals(states))
        sound = [index for index, refusal in enumerate(found) if refusal is None]
        for index, answer in zip(sound, self.thrower_refusals(states[sound])):
            found[index] = answer
        return tuple(found)

    def evaluate(self, releases: Releases, executions: int | None = None) -> Candidates:
        """Predicts the information of releases; unsafe ones, and ones that do not come to rest, are refused.

        Args:
            releases: to judge.
            executions: of each, as many as the forecast's by default; the first of them are the same for any even number.
        """
        draws = self._draws(executions)
        states = releases.states(self.config.placement)
        pieces = [states[first : first + PIECE] for first in range(0, len(states), PIECE)]
        refusals: list[str | None] = []
        fishers: list[list[Array]] = [[] for _ in self.particles]
        for piece in pieces:
            parts = self._judged(piece, draws)
            refusals += parts[1]
            for whole, part in zip(fishers, parts[0]):
                whole.append(part.fishers)
        return Candidates(releases, states, tuple(np.concatenate(parts) for parts in fishers), tuple(refusals))

    def _draws(self, executions: int | None = None) -> Array:
        """(E, 12) the same for every release."""
        return balanced_draws(executions or self.config.forecast.executions, np.random.default_rng(self.config.seed))

    def _judged(self, states: Array, draws: Array) -> tuple[list[PredictedInformation], list[str | None]]:
        """Predicted information of a few releases (K, 13) per particle, and why each may not be thrown."""
        config, executions = self.config.forecast, len(draws)
        executed = self.noise.executions(states, draws).reshape(-1, 13)
        informations: list[PredictedInformation] = []
        refusals: list[str | None] = [None] * len(states)
        for particle, moving in zip(self.particles, self._moving, strict=True):
            motions = predicted_motions(particle, executed, config, moving)
            self._simulated(len(executed))
            informations.append(information_of_executions(particle, motions, executions, config))
            found = self.safety.of_motions(particle, motions, executions, config)
            unknown = (None if known else "motion: cannot be predicted" for known in informations[-1].known)
            refusals = [first or second or third for first, second, third in zip(refusals, found, unknown)]
        return informations, refusals

    def described_refusals(self, states: Array) -> Refusals:
        """Why releases (K, 13) may not be thrown, by where they lead if the body is as described; theta is not asked."""
        body, config = self.particles[0].body, self.config.forecast
        described = Particle(ContactGeometry.of_body(body).rigid(), body, self.particles[0].loss)
        executed = self.noise.executions(states, self._draws()).reshape(-1, 13)
        motions = predicted_motions(described, executed, config)
        return self.safety.of_motions(described, motions, config.executions, config)

    def motion_refusals(self, states: Array) -> Refusals:
        """Why releases (K, 13) may not be thrown, by many executions of each."""
        each = [self.safety.motion_refusals(particle, states, self.config.forecast) for particle in self.particles]
        return tuple(next((refusal for refusal in column if refusal), None) for column in zip(*each))


def _alike(particles: Sequence[Particle]) -> Sequence[Particle]:
    if not particles:
        raise InvalidValueError("thetas to design at", "none", "at least one")
    kinds = {(one.body.name, one.scorer.form.form.value, one.scorer.form.size) for one in particles}
    if len(kinds) > 1:
        raise InvalidValueError("thetas to design at", sorted(kinds), "one body, form and number of parameters")
    return particles
