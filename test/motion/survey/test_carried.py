"""What bodies that lie still tell of the transforms that move a camera."""

from collections.abc import Callable

import numpy as np
import pytest

from contact_curation.geometry import quaternions
from contact_curation.geometry.quaternions import Array
from contact_curation.motion.survey.carried import Carried, scatter, wander
from contact_curation.motion.survey.series import PoseSeries

RATE, REST, RESTS, NOISE = 150.0, 0.8, 8, 2.2e-5
HAND = np.array([2e-3, -1e-3, 1e-3]), np.radians([0.9, -0.6, 0.3])


def swaying(times: Array) -> tuple[Array, Array]:
    """Places (T, 3) and orientations (T, 4) of a camera on an arm."""
    waves = np.sin(np.outer(times, [2.1, 2.7, 1.5]) + np.array([0.0, 1.0, 2.0]))
    turns = quaternions.exp(0.1 * waves[:, ::-1] + np.array([-2.2, 0.0, 0.0]))
    return 0.1 * waves + np.array([0.0, -0.6, 0.6]), turns


def still(times: Array) -> tuple[Array, Array]:
    """One that stands."""
    place, turn = swaying(times[:1])
    return np.repeat(place, len(times), axis=0), np.repeat(turn, len(times), axis=0)


def measured(
    moves: Callable[[Array], tuple[Array, Array]],
    *,
    lead: float = 0.0,
    hand: tuple[Array, Array] = (np.zeros(3), np.zeros(3)),
    scattering: float = 0.0,
    held: bool = False,
) -> list[Carried]:
    """Bodies that lie still one after the other, or are held by what carries the camera; transforms are at 100 Hz."""
    rng, found = np.random.default_rng(0), []
    for number in range(RESTS):
        times = 3.0 * number + np.arange(0.0, REST, 1.0 / RATE)
        place, true = np.array([0.1 * rng.random(), 0.1 * rng.random(), 0.02]), moves(times)
        seen = quaternions.rotate(quaternions.conjugate(true[1]), place - true[0])
        seen = seen[:1] + 0.0 * seen if held else seen
        seen = seen + NOISE * rng.standard_normal(seen.shape)
        at, turns = moves(times + lead)
        at = at + quaternions.rotate(turns, hand[0])
        noise = np.repeat(rng.standard_normal((len(times), 3)), 2, axis=0)[: len(times)]
        at, turns = at + scattering * noise, quaternions.multiply(turns, quaternions.exp(hand[1]))
        carrier = PoseSeries(np.rint(1e9 * times).astype(np.int64), at, turns)
        flat = np.repeat([[1.0, 0.0, 0.0, 0.0]], len(times), axis=0)
        body = PoseSeries(carrier.stamps_ns, at + quaternions.rotate(turns, seen), flat)
        found.append(Carried("camera", body, carrier))
    return found


@pytest.mark.parametrize("lead", [0.004, -0.012, 0.05])
def test_the_time_by_which_transforms_are_ahead_is_found(lead: float) -> None:
    found = wander(measured(swaying, lead=lead, scattering=5e-5))
    assert found is not None
    assert found.lead == pytest.approx(lead, rel=0.05, abs=2e-4)
    assert found.by_place == 0.0


def test_a_camera_that_is_mounted_otherwise_is_not_taken_for_late_transforms() -> None:
    found = wander(measured(swaying, hand=HAND))
    assert found is not None
    assert found.lead == 0.0
    assert 1e-4 < found.by_place < 1e-3


def test_both_are_told_at_once() -> None:
    found = wander(measured(swaying, lead=-0.01, hand=HAND))
    assert found is not None
    assert found.lead == pytest.approx(-0.01, abs=2e-4)
    assert 1e-4 < found.by_place < 1e-3


@pytest.mark.parametrize("scattering", [0.0, 3e-4])
def test_of_sound_and_noisy_transforms_neither_is_said(scattering: float) -> None:
    found = wander(measured(swaying, scattering=scattering))
    assert found is not None
    assert (found.lead, found.by_lead, found.by_place) == (0.0, 0.0, 0.0)


def test_a_camera_that_stands_still_and_a_body_that_is_carried_along_tell_nothing() -> None:
    assert wander(measured(still, lead=0.01, scattering=1e-4)) is None
    assert wander(measured(swaying, held=True)) is None


@pytest.mark.parametrize("moves", [still, swaying])
def test_noise_of_transforms_is_told_from_that_of_poses(moves: Callable[[Array], tuple[Array, Array]]) -> None:
    quiet, noisy = scatter(measured(moves, lead=0.01)), scatter(measured(moves, scattering=2e-4))
    assert quiet is not None
    assert noisy is not None
    assert quiet.on_board == pytest.approx(np.sqrt(3.0) * NOISE, rel=0.2)
    assert noisy.in_carrier == pytest.approx(np.sqrt(3.0) * NOISE, rel=0.5)
    assert noisy.on_board == pytest.approx(np.sqrt(3.0) * 2e-4, rel=0.3)


def test_rests_of_so_few_poses_that_noise_cannot_be_seen_tell_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(f"{__name__}.RATE", 4.0)
    monkeypatch.setattr(f"{__name__}.REST", 1.2)
    assert scatter(measured(swaying)) is None
