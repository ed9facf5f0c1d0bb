"""The noise of executions: errors and their inverse, and what is learned from throws."""

import numpy as np
import pytest

from contact_curation.design.execution_noise import (
    ERRORS,
    ExecutionNoise,
    NoiseConfig,
    balanced_draws,
    errors_of,
    with_errors,
)
from contact_curation.errors import InvalidValueError
from contact_curation.geometry import quaternions
from test.design.cases import releases
from test.design.test_releases import turned

CONFIG = NoiseConfig()


def test_errors_are_found_again_in_what_they_made() -> None:
    rng = np.random.default_rng(0)
    commands = turned(releases(9), 0.7, (0.1, 0.0))
    errors = 0.1 * rng.standard_normal((9, ERRORS))
    np.testing.assert_allclose(errors_of(commands, with_errors(commands, errors)), errors, atol=1e-12)


def test_errors_do_not_depend_on_where_a_throw_goes() -> None:
    errors = 0.1 * np.random.default_rng(1).standard_normal((9, ERRORS))
    commands = releases(9)
    one = turned(with_errors(commands, errors), 1.9, (0.3, 0.2))
    other = with_errors(turned(commands, 1.9, (0.3, 0.2)), errors)
    np.testing.assert_allclose(one[:, [0, 1, 2, 7, 8, 9, 10, 11, 12]], other[:, [0, 1, 2, 7, 8, 9, 10, 11, 12]], atol=1e-12)
    np.testing.assert_allclose(quaternions.angle_between(one[:, 3:7], other[:, 3:7]), 0.0, atol=1e-7)


def test_bias_and_covariance_are_learned_from_throws() -> None:
    rng = np.random.default_rng(2)
    bias = np.linspace(-1.0, 1.0, ERRORS)
    root = np.eye(ERRORS) * 0.5
    root[4, 0] = 0.8
    commands = releases(3000)
    errors = (bias + rng.standard_normal((3000, ERRORS)) @ root.T) * CONFIG.units(commands)
    noise = ExecutionNoise.learned(commands, with_errors(commands, errors))
    np.testing.assert_allclose(noise.bias, bias, atol=0.05)
    np.testing.assert_allclose(noise.covariance, root @ root.T, atol=0.06)
    assert noise.throws == 3000


def test_with_few_throws_the_expected_noise_holds_and_with_none_nothing_else() -> None:
    commands = releases(2)
    noise = ExecutionNoise.learned(commands, commands)
    np.testing.assert_allclose(noise.covariance, np.eye(ERRORS) * CONFIG.spread_counts / (CONFIG.spread_counts + 2.0))
    np.testing.assert_allclose(noise.bias, 0.0, atol=1e-12)
    missed = ExecutionNoise.learned(commands, with_errors(commands, CONFIG.units(commands)))
    np.testing.assert_allclose(missed.bias, 2.0 / (2.0 + CONFIG.bias_counts))
    none = ExecutionNoise.learned(commands[:0], commands[:0])
    np.testing.assert_array_equal(none.covariance, np.eye(ERRORS))


def test_executions_spread_as_the_default_says() -> None:
    command = releases(1)
    executed = ExecutionNoise.expected().executions(command, np.random.default_rng(3).standard_normal((4000, ERRORS)))[0]
    errors = errors_of(np.repeat(command, 4000, axis=0), executed)
    speed = np.linalg.norm(command[0, 7:10])
    expected = np.repeat([0.005, np.radians(5.0), np.hypot(0.03, 0.05 * speed), 0.4], 3)
    np.testing.assert_allclose(errors.std(axis=0), expected, rtol=0.05)


def test_balanced_draws_have_no_mean_and_repeat_by_seed() -> None:
    one, other = (balanced_draws(8, np.random.default_rng(5)) for _ in range(2))
    np.testing.assert_allclose(one.sum(axis=0), 0.0, atol=1e-12)
    assert one.tobytes() == other.tobytes()
    with pytest.raises(InvalidValueError, match="executions: found 7"):
        balanced_draws(7, np.random.default_rng(5))


def test_throws_that_were_not_measured_are_refused() -> None:
    commands = releases(3)
    broken = commands.copy()
    broken[1, 2] = np.nan
    with pytest.raises(InvalidValueError, match="not finite"):
        ExecutionNoise.learned(commands, broken)
    with pytest.raises(InvalidValueError, match="shapes"):
        ExecutionNoise.learned(commands, commands[:2])
