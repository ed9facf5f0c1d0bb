"""A gripper's delay is learned from tracked releases, a sticking gripper does not mislead it, and a change is noticed."""

import numpy as np
import pytest

from contact_curation.design.release_delay import DEFAULT_DELAY, DelayConfig, Seen, learned_delay, with_release
from contact_curation.errors import InvalidValueError

JITTER = 0.01


def drawn(mean: float, count: int, seed: int, jitter: float = JITTER) -> tuple[Seen, ...]:
    return tuple(Seen(float(one), 5e-4) for one in mean + jitter * np.random.default_rng(seed).standard_normal(count))


def learned_in_turn(delays: tuple[Seen, ...], seen: tuple[Seen, ...] = ()) -> tuple[tuple[Seen, ...], list[int]]:
    """What counts in the end, and at which throws a change was reported."""
    changes = []
    for number, one in enumerate(delays):
        seen, changed = with_release(seen, one)
        changes += [number] if changed else []
    return seen, changes


def test_before_the_first_throw_the_guess_counts() -> None:
    delay = learned_delay(())
    assert (delay.mean, delay.jitter, delay.throws) == (DEFAULT_DELAY.guess, DEFAULT_DELAY.jitter, 0)
    assert delay.mean_sd == DEFAULT_DELAY.guess_sd


def test_the_error_of_the_mean_is_as_large_as_is_said() -> None:
    found = [learned_delay(drawn(0.05, 50, seed)) for seed in range(60)]
    errors = np.array([(one.mean - 0.05) / one.mean_sd for one in found])
    assert 0.7 < np.sqrt(np.mean(errors**2)) < 1.4
    assert np.mean([one.jitter for one in found]) == pytest.approx(JITTER, rel=0.15)


def test_a_regular_gripper_is_learned_from_few_throws() -> None:
    delay = learned_delay(drawn(0.05, 5, seed=1, jitter=0.001))
    assert delay.mean == pytest.approx(0.05, abs=0.002)


def test_a_jitter_is_at_least_as_large_as_is_said_from_the_third_throw_on() -> None:
    said = [learned_delay(drawn(0.05, 30, seed)[:count]).least_jitter for seed in range(40) for count in range(3, 31)]
    assert np.mean(np.array(said) > JITTER) < 0.05
    assert max(said) < 1.3 * JITTER
    many = [learned_delay(drawn(0.05, 100, seed)).least_jitter for seed in range(10)]
    assert min(many) > 0.7 * JITTER


def test_a_gripper_that_sticks_once_moves_the_mean_by_less_than_its_error() -> None:
    regular = drawn(0.05, 30, seed=2)
    with_one = learned_delay((*regular[:20], Seen(0.25, 5e-4), *regular[20:]))
    assert abs(with_one.mean - learned_delay(regular).mean) < with_one.mean_sd


def test_one_late_release_is_no_change() -> None:
    regular = drawn(0.05, 20, seed=3, jitter=0.003)
    assert learned_in_turn((*regular[:10], Seen(0.15, 5e-4), *regular[10:]))[1] == []


def test_a_change_by_four_jitters_is_noticed_within_three_throws_and_learned() -> None:
    noticed = []
    for seed in range(10):
        before, _ = learned_in_turn(drawn(0.05, 30, seed))
        after, changes = learned_in_turn(drawn(0.05 + 4.0 * JITTER, 3, 100 + seed), before)
        delay = learned_delay(after)
        noticed.append(bool(changes) and abs(delay.mean - 0.09) < 3.0 * delay.mean_sd)
    assert sum(noticed) >= 9


def test_changes_are_reported_about_as_seldom_as_is_said() -> None:
    reported = sum(len(learned_in_turn(drawn(0.05, 40, seed))[1]) for seed in range(4))
    assert reported <= 1  # 160 throws, one in a thousand expected


@pytest.mark.parametrize(("name", "value"), [("guess", -0.1), ("jitter", 0.0), ("guess_sd", np.nan), ("false_alarms", 1.0)])
def test_an_impossible_assumption_is_refused(name: str, value: float) -> None:
    with pytest.raises(InvalidValueError, match=f"delay.{name}"):
        DelayConfig(**{name: value})
