"""Bodies of the experiments: thirds that a seed draws, the square lifted out of its plane, tosses as a tracker sees them."""

from pathlib import Path

import numpy as np
import pytest

from contact_curation.errors import InvalidValueError
from contact_curation.experiments import bodies
from contact_curation.experiments.bodies import BODIES, SQUARE_DATA, bench_of
from contact_curation.motion.transitions import states_of


def test_a_seed_draws_the_third_that_judges(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bodies, "SIMULATED", 6)
    one, again, other = bench_of("slab", 0), bench_of("slab", 0), bench_of("slab", 1)
    names = [{toss.toss_id for toss in bench.held_out} for bench in (one, again, other)]
    assert len(one.held_out) == 2
    assert len(one.training) == 4
    assert not names[0] & {toss.toss_id for toss in one.training}
    assert names[0] == names[1] != names[2]
    assert [toss.digest() for toss in one.training] == [toss.digest() for toss in again.training]


def test_a_simulated_toss_ends_on_the_board_with_the_trackers_noise(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bodies, "SIMULATED", 2)
    for name in ("wedge", "irregular"):
        body, tosses = BODIES[name]()
        states = states_of(tosses[0], 1.0)
        lowest = body.polytope.corner_heights(states[:, :3], states[:, 3:7]).min(axis=-1)
        assert lowest[0] > 0.1
        assert abs(lowest[-1]) < 1e-3
        assert 1e-6 < np.abs(np.diff(states[-5:, 0])).mean() < 1e-3
        np.testing.assert_allclose(np.diff(states[:6, :3], axis=0) * 148.0, states[1:6, 7:10], atol=0.05)


def test_the_square_turns_in_its_plane(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    time = 0.004 * np.arange(30)
    fall = np.stack([1.5 * time, 0.4 - 4.905 * time**2, 2.0 * time], axis=1)
    np.savez(tmp_path / "throws.npz", poses=np.stack([fall, fall]))
    monkeypatch.setenv(SQUARE_DATA, str(tmp_path))
    body, tosses = BODIES["square"]()
    assert len({toss.toss_id for toss in tosses}) == 2
    states = states_of(tosses[0], 1.0)
    np.testing.assert_allclose(states[:, 7], 1.5, atol=1e-9)
    np.testing.assert_allclose(states[:, [1, 8, 10, 12]], 0.0, atol=1e-9)
    np.testing.assert_allclose(states[:, 11], -2.0, atol=1e-9)  # theta grows from x towards z
    assert body.vertices.shape == (8, 3)


def test_what_is_not_there_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(InvalidValueError, match="--bodies: found ball, expected one of cube, square"):
        bench_of("ball", 0)
    monkeypatch.delenv(SQUARE_DATA, raising=False)
    with pytest.raises(InvalidValueError, match="SQUARE_DATA: found nothing"):
        bench_of("square", 0)
