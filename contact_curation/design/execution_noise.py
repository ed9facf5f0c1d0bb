"""Execution noise: how executed throws differ from commanded ones, estimated from throws (method.md 5).

The error of an execution has 12 numbers in the heading frame of the command: place (3) [m], turn (3) [rad], velocity (3) [m/s]
and spin (3) [rad/s]. Each is taken in units of what is expected of it, which for the velocity grows with the speed; in these
units errors are normal. Their mean and covariance begin at zero and one and move to what was measured, as many throws as the
beginning counts for (a normal-inverse-Wishart posterior's mean).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from contact_curation.configs import check_not_negative, check_positive
from contact_curation.design.releases import headings
from contact_curation.errors import InvalidValueError
from contact_curation.geometry import quaternions
from contact_curation.geometry.quaternions import Array

ERRORS = 12


@dataclass(frozen=True)
class NoiseConfig:
    """What errors are expected before any throw was measured: standard deviations, method.md 5's by default.

    Attributes:
        position: standard deviation of the release position [m].
        turn: standard deviation of the release orientation about each axis [rad].
        speed: standard deviation of the release velocity, as a share of the speed.
        velocity: standard deviation of the release velocity that does not depend on the speed [m/s].
        spin: standard deviation of the angular velocity at release [rad/s].
        bias_counts: weight of the prior mean, zero bias, as a number of throws.
        spread_counts: weight of the prior covariance, as a number of throws.
    """

    position: float = 0.005
    turn: float = float(np.radians(5.0))
    speed: float = 0.05
    velocity: float = 0.03
    spin: float = 0.4
    bias_counts: float = 4.0
    spread_counts: float = 24.0

    def __post_init__(self) -> None:
        check_positive(self, ("position", "turn", "velocity", "spin", "bias_counts", "spread_counts"), "noise.")
        check_not_negative(self, ("speed",), "noise.")

    def units(self, states: Array) -> Array:
        """(K, 12) what is expected of the errors of commands (K, 13)."""
        speeds = np.linalg.norm(states[:, 7:10], axis=1)
        units = np.empty((len(states), ERRORS))
        units[:, :3], units[:, 3:6], units[:, 9:] = self.position, self.turn, self.spin
        units[:, 6:9] = np.hypot(self.velocity, self.speed * speeds)[:, None]
        return units


DEFAULT_NOISE = NoiseConfig()

FARTHEST = 100.0
"""An executed throw whose error is larger than so many of the default units is none: it is in millimetres or degrees, say."""

PARTS = (("position", "m"), ("orientation", "rad"), ("velocity", "m/s"), ("spin", "rad/s"))
"""What three errors each are about, and in which unit."""


@dataclass(frozen=True, eq=False)
class ExecutionNoise:
    """Distribution of execution errors.

    Attributes:
        config: their units.
        bias: (12,) mean, in units.
        covariance: (12, 12), in units.
        throws: how many were learned from.
    """

    config: NoiseConfig
    bias: Array
    covariance: Array
    throws: int = 0

    @staticmethod
    def expected(config: NoiseConfig = DEFAULT_NOISE) -> "ExecutionNoise":
        """The prior, before any throw was measured."""
        return ExecutionNoise(config, np.zeros(ERRORS), np.eye(ERRORS))

    @staticmethod
    def learned(commanded: Array, executed: Array, config: NoiseConfig = DEFAULT_NOISE) -> "ExecutionNoise":
        """Estimates the noise from releases (K, 13) as commanded and as executed, in SI units.

        Raises:
            InvalidValueError: shapes that differ, or a number that is not finite.
        """
        if commanded.shape != executed.shape or commanded.ndim != 2 or commanded.shape[1] != 13:
            raise InvalidValueError("executed throws", f"shapes {commanded.shape} and {executed.shape}", "twice (K, 13)")
        if not (np.isfinite(commanded).all() and np.isfinite(executed).all()):
            raise InvalidValueError("executed throws", "a value that is not finite", "finite numbers")
        count = len(commanded)
        if not count:
            return ExecutionNoise.expected(config)
        errors = errors_of(commanded, executed) / config.units(commanded)
        mean = errors.mean(axis=0)
        spread = (errors - mean).T @ (errors - mean)
        between = config.bias_counts * count / (config.bias_counts + count) * np.outer(mean, mean)
        covariance = (config.spread_counts * np.eye(ERRORS) + spread + between) / (config.spread_counts + count)
        return ExecutionNoise(config, mean * count / (config.bias_counts + count), covariance, count)

    @cached_property
    def root(self) -> Array:
        """(12, 12) L with L L^T the covariance."""
        return np.asarray(np.linalg.cholesky(self.covariance))

    def executions(self, states: Array, draws: Array) -> Array:
        """What may become of commands: states (K, E, 13).

        Args:
            states: (K, 13) in SI units.
            draws: (E, 12) standard normal numbers, the same for every command.
        """
        errors = (self.bias + draws @ self.root.T)[None] * self.config.units(states)[:, None]  # (K, E, 12)
        count = len(draws)
        repeated = np.repeat(states, count, axis=0)
        return with_errors(repeated, errors.reshape(-1, ERRORS)).reshape(len(states), count, 13)


def balanced_draws(count: int, rng: np.random.Generator) -> Array:
    """(count, 12) standard normal numbers; each is followed by its mirror image, so that the mean of every even number is zero.

    Raises:
        InvalidValueError: an odd number, or none.
    """
    if count < 2 or count % 2:
        raise InvalidValueError("executions", count, "an even number of at least 2")
    half = rng.standard_normal((count // 2, ERRORS))
    return np.stack([half, -half], axis=1).reshape(count, ERRORS)


def errors_of(commanded: Array, executed: Array) -> Array:
    """(K, 12) by which executed releases (K, 13) differ from the commanded ones, in the commands' heading frames."""
    back = _heading_turns(commanded, -1.0)
    turn = quaternions.multiply(executed[:, 3:7], quaternions.conjugate(commanded[:, 3:7]))
    parts: Sequence[Array] = (
        executed[:, :3] - commanded[:, :3],
        quaternions.log(turn),
        executed[:, 7:10] - commanded[:, 7:10],
        _spins(executed) - _spins(commanded),
    )
    return np.column_stack([quaternions.rotate(back, part) for part in parts])


def check_executed(commanded: Array, executed: Array) -> None:
    """Checks that an executed release (13,) may have become of a commanded one (13,); one that cannot would count for ever.

    Raises:
        InvalidValueError: it is too far from the command.
    """
    with np.errstate(over="ignore", invalid="ignore"):  # so large a number is refused
        errors = np.linalg.norm(errors_of(commanded[None], executed[None]).reshape(4, 3), axis=1)
    allowed = FARTHEST * DEFAULT_NOISE.units(commanded[None])[0, ::3]
    worst = int(np.nan_to_num(errors / allowed, nan=np.inf).argmax())
    if not errors[worst] <= allowed[worst]:
        name, unit = PARTS[worst]
        expected = f"at most {allowed[worst]:.3g}; report it in m, m/s and rad/s, in the frames of the command"
        raise InvalidValueError(f"executed {name}", f"{errors[worst]:.3g} {unit} from the commanded one", expected)


def with_errors(commanded: Array, errors: Array) -> Array:
    """Releases (K, 13) that differ from the commanded ones by errors (K, 12); the inverse of `errors_of`."""
    forth = _heading_turns(commanded, 1.0)
    place, turn, velocity, spin = (quaternions.rotate(forth, errors[:, k : k + 3]) for k in (0, 3, 6, 9))
    orientations = quaternions.normalized(quaternions.multiply(quaternions.exp(turn), commanded[:, 3:7]))
    spins = quaternions.rotate(quaternions.conjugate(orientations), _spins(commanded) + spin)
    return np.column_stack([commanded[:, :3] + place, orientations, commanded[:, 7:10] + velocity, spins])


def _spins(states: Array) -> Array:
    """Angular velocities (K, 3) in the board's frame."""
    return quaternions.rotate(states[:, 3:7], states[:, 10:])


def _heading_turns(states: Array, sign: float) -> Array:
    """Rotations (K, 4) from the heading frames to the board's, or back."""
    angles = sign * headings(states[:, 7:10])
    return quaternions.exp(np.column_stack([np.zeros((len(states), 2)), angles]))
