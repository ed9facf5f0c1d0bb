"""Bodies of the experiments: thirds that a seed draws, the square lifted out of its plane, tosses as a tracker sees them."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from contact_curation.contact.body import Body
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.rollout import rollout
from contact_curation.errors import InvalidValueError
from contact_curation.experiments import bodies
from contact_curation.experiments.bodies import BODIES, SQUARE_DATA, SQUARE_SIDE, bench_of
from contact_curation.geometry.polytopes import box
from contact_curation.motion.calibration import NO_CORRECTION
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


def test_the_square_turns_in_its_plane_from_x_towards_z(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    half = 0.5 * SQUARE_SIDE
    body = Body("square", box([half] * 3).vertices, 0.1, 0.1 * SQUARE_SIDE**2 / 6.0 * np.eye(3), 0.3, half)
    release = np.array([0.0, 0.0, 0.15 / half, 1.0, 0.0, 0.0, 0.0, 0.9 / half, 0.0, 0.0, 0.0, -4.0, 0.0])
    states = rollout(ContactGeometry.of_body(body), body, release[None], 200, 0.004).states
    angles = -2.0 * np.arctan2(states[:, 5], states[:, 3])
    thrown = np.stack([half * states[:, 0], half * states[:, 2], angles], axis=1)
    np.savez(tmp_path / "throws.npz", poses=np.stack([thrown, thrown]))
    monkeypatch.setenv(SQUARE_DATA, str(tmp_path))
    monkeypatch.setattr(bodies, "SQUARE_INGEST", replace(bodies.SQUARE_INGEST, rig=NO_CORRECTION))
    found, tosses = BODIES["square"]()
    assert (found.vertices.shape, len({toss.toss_id for toss in tosses})) == ((8, 3), 2)
    seen = states_of(tosses[0], half)
    assert 40 < len(seen) < 199  # it ends when the square rests
    np.testing.assert_allclose(seen[:, [1, 8, 10, 12]], 0.0, atol=1e-9)
    np.testing.assert_allclose(seen[:20, 11], -4.0, atol=1e-9)
    np.testing.assert_allclose(seen[:20, 7], 0.9 / half, atol=1e-6)


def test_what_is_not_there_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(InvalidValueError, match="--bodies: found ball, expected one of cube, square"):
        bench_of("ball", 0)
    monkeypatch.delenv(SQUARE_DATA, raising=False)
    with pytest.raises(InvalidValueError, match="SQUARE_DATA: found nothing"):
        bench_of("square", 0)
