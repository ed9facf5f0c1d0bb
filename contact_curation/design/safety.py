"""Which throws may be made: limits that hold for all but one in a hundred executions (method.md 5).

What a release itself shows (speed, spin, height, energy, apex, distance to the board) is checked on many executions, for any
number of throws at once. What only its motion shows (time of flight, where it rests, what it comes near) is checked on
rollouts, at theta; both with the same noise of execution. Every refusal names the limit, what was found and what was expected.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from contact_curation.configs import check_not_negative, check_positive, set_whole_numbers
from contact_curation.contact.body import Body
from contact_curation.design.execution_noise import ERRORS, ExecutionNoise
from contact_curation.design.predicted_information import (
    DEFAULT_PREDICTION,
    Motions,
    Particle,
    PredictionConfig,
    predicted_motions,
)
from contact_curation.design.throw import Throw
from contact_curation.errors import InvalidValueError
from contact_curation.geometry import quaternions
from contact_curation.geometry.quaternions import Array

Feasible = Callable[[Sequence[Throw]], Sequence[str | None]]
"""What a thrower says of throws: None, or in one line why it cannot make one."""

PIECE = 128
"""Throws whose executions are looked at together."""


@dataclass(frozen=True)
class SafetyConfig:
    """Limits of throws; the defaults are those of method.md 5 and of ContactNets' board.

    Attributes:
        largest_speed: largest speed at release [m/s].
        largest_spin: largest angular speed at release [rad/s].
        lowest_release: smallest height of the body's centre at release [m].
        highest_release: largest height of the body's centre at release [m].
        largest_energy: largest kinetic energy at release [J].
        highest_apex: largest height of the body's centre in flight [m].
        least_clearance: smallest distance from the lowest vertex to the board at release [m].
        shortest_flight: shortest time from release to contact, so that the tracker sees the flight [s].
        board_half_width: the body's centre comes to rest within this of the board's middle, in x and in y [m].
        keep_out_place: x and y of the axis of a cylinder around the thrower [m].
        keep_out_radius: radius of that cylinder, which the body's centre does not enter after the first contact [m]; 0 for no
            cylinder.
        share: share of the simulated executions that may violate each limit.
        executions: simulated executions that are checked at release.
        motions: simulated executions whose whole motion is checked.
        seed: random seed of the executions.
    """

    largest_speed: float = 1.4
    largest_spin: float = 11.0
    lowest_release: float = 0.09
    highest_release: float = 0.24
    largest_energy: float = 0.41
    highest_apex: float = 0.30
    least_clearance: float = 0.01
    shortest_flight: float = 0.03
    board_half_width: float = 0.35
    keep_out_place: tuple[float, float] = (-0.307, -0.5)
    keep_out_radius: float = 0.25
    share: float = 0.01
    executions: int = 200
    motions: int = 200
    seed: int = 0

    def __post_init__(self) -> None:
        check_positive(self, (
            "largest_speed", "largest_spin", "lowest_release", "highest_release", "largest_energy", "highest_apex",
            "board_half_width",
        ), "safety.")  # fmt: skip
        check_not_negative(self, ("least_clearance", "shortest_flight", "keep_out_radius"), "safety.")
        if self.lowest_release >= self.highest_release:
            raise InvalidValueError("safety.lowest_release", self.lowest_release, f"less than {self.highest_release}")
        if np.shape(self.keep_out_place) != (2,) or not np.isfinite(self.keep_out_place).all():
            raise InvalidValueError("safety.keep_out_place", self.keep_out_place, "2 finite numbers [m]")
        if not 0.0 <= self.share < 1.0:
            raise InvalidValueError("safety.share", self.share, "a share in [0, 1)")
        set_whole_numbers(self, ("executions", "motions"), 1, prefix="safety.")


DEFAULT_SAFETY = SafetyConfig()


@dataclass(frozen=True)
class _Limit:
    """One limit, as numbers of executions: they keep it while lowest <= value <= highest; `missing` says that there is none."""

    name: str
    unit: str
    lowest: float = -np.inf
    highest: float = np.inf
    missing: str = "none"

    def refusal(self, values: Array, share: float) -> str | None:
        """Why executions with these values are too often outside; None when they are not."""
        outside = ~((values >= self.lowest) & (values <= self.highest))  # a value that is not a number is outside
        if outside.mean() <= share:
            return None
        value = float(np.median(values[outside]))  # not a number where one of them is none
        expected = f"at least {self.lowest:.4g}" if value < self.lowest else f"at most {self.highest:.4g}"
        found = self.missing if np.isnan(value) else f"{value:.4g} {self.unit}"
        return f"{self.name}: found {found} in {outside.mean():.1%} of executions, expected {expected}"


@dataclass(frozen=True, eq=False)
class SafetySet:
    """The throws of a body that may be made.

    Attributes:
        body: that is thrown, as described.
        config: limits.
        noise: of executions.
        feasible: asked last, of what is safe by itself; None where any throw can be made.
    """

    body: Body
    config: SafetyConfig
    noise: ExecutionNoise
    feasible: Feasible | None = None

    def refusals(self, states: Array) -> tuple[str | None, ...]:
        """Why releases (K, 13) in SI units may not be made, by what they show themselves; None for those that may."""
        draws = np.random.default_rng(self.config.seed).standard_normal((self.config.executions, ERRORS))
        found: list[str | None] = []
        for first in range(0, len(states), PIECE):
            executed = self.noise.executions(states[first : first + PIECE], draws)
            found += self._worst(_release_limits(self.config), _release_values(self.body, executed))
        return tuple(found)

    def motion_refusals(
        self, particle: Particle, states: Array, config: PredictionConfig = DEFAULT_PREDICTION
    ) -> tuple[str | None, ...]:
        """Why releases (K, 13) may not be made, by where they lead at theta; None for those that may."""
        draws = np.random.default_rng(self.config.seed).standard_normal((self.config.motions, ERRORS))
        found: list[str | None] = []
        for state in states:
            executed = self.noise.executions(state[None], draws)[0]
            found += self.of_motions(particle, predicted_motions(particle, executed, config), self.config.motions, config)
        return tuple(found)

    def of_motions(
        self, particle: Particle, motions: Motions, executions: int, config: PredictionConfig = DEFAULT_PREDICTION
    ) -> tuple[str | None, ...]:
        """As `motion_refusals`, of throws with the motions of some executions of each at hand, one throw after the other."""
        values = [each.reshape(-1, executions) for each in _motion_values(self, particle, motions, config)]
        return tuple(self._worst(_motion_limits(self.config, config), values))

    def thrower_refusals(self, throws: Sequence[Throw]) -> tuple[str | None, ...]:
        """Why the thrower cannot make releases.

        Raises:
            InvalidValueError: it answers for another number of throws.
        """
        if self.feasible is None or not throws:
            return (None,) * len(throws)
        answers = tuple(self.feasible(throws))
        if len(answers) != len(throws):
            raise InvalidValueError("answers of the thrower", len(answers), f"{len(throws)}, one for each throw")
        return answers

    def _worst(self, limits: Sequence[_Limit], values: Sequence[Array]) -> list[str | None]:
        """The first refusal of each throw; values (K, E), one array per limit."""
        each = [[limit.refusal(row, self.config.share) for row in rows] for limit, rows in zip(limits, values, strict=True)]
        return [next((refusal for refusal in column if refusal), None) for column in zip(*each)]


def _release_limits(config: SafetyConfig) -> tuple[_Limit, ...]:
    return (
        _Limit("speed", "m/s", highest=config.largest_speed),
        _Limit("spin", "rad/s", highest=config.largest_spin),
        _Limit("release height", "m", config.lowest_release, config.highest_release),
        _Limit("energy", "J", highest=config.largest_energy),
        _Limit("apex", "m", highest=config.highest_apex),
        _Limit("clearance", "m", config.least_clearance),
    )


def _release_values(body: Body, executed: Array) -> tuple[Array, ...]:
    """What `_release_limits` are about, each (K, E)."""
    speeds, spins = (np.linalg.norm(executed[..., k : k + 3], axis=-1) for k in (7, 10))
    heights, up = executed[..., 2], np.maximum(executed[..., 9], 0.0)
    turning = np.einsum("...i,ij,...j->...", executed[..., 10:], body.inertia, executed[..., 10:])
    energy = 0.5 * (body.mass * speeds**2 + turning)
    down_in_body = quaternions.to_matrix(executed[..., 3:7])[..., 2, :]  # the board's z axis in the body's frame
    lowest = heights + (down_in_body @ body.vertices.T).min(axis=-1)
    return speeds, spins, heights, energy, heights + up**2 / (2.0 * body.gravity), lowest


def _motion_limits(config: SafetyConfig, forecast: PredictionConfig) -> tuple[_Limit, ...]:
    none = f"none within {forecast.longest:g} s (--set forecast.longest=SECONDS)"  # e.g. no rest of a body that rolls
    return (
        _Limit("flight", "s", config.shortest_flight, missing=none),
        _Limit("rest", "m from the board's middle", highest=config.board_half_width, missing=none),
        _Limit("distance to the thrower", "m", config.keep_out_radius),
    )


def _motion_values(safety: SafetySet, particle: Particle, motions: Motions, config: PredictionConfig) -> tuple[Array, ...]:
    """What `_motion_limits` are about, each (N,); not a number where the model gives no motion or the body never rests."""
    places = motions.states[:, :, :2] * particle.body.length_scale  # (N, T, 2)
    touched = np.nan_to_num(particle.geometry.gaps(motions.states), nan=np.inf).min(axis=2) < config.touching
    flight = np.where(touched.any(axis=1), touched.argmax(axis=1) * config.frame_period, np.nan)
    last = places[np.arange(len(places)), motions.frames - 1]
    rest = np.where(motions.rested & motions.finite, np.abs(last).max(axis=1), np.nan)
    landed = np.logical_or.accumulate(touched, axis=1) & motions.within()
    away = np.linalg.norm(places - np.asarray(safety.config.keep_out_place), axis=2)
    nearest = np.where(landed, away, np.inf).min(axis=1)
    return flight, rest, nearest
