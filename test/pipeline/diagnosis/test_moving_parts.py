"""Bodies that do not move as rigid ones in the air are told, and no others; nothing is then inferred from how they fall."""

from functools import cache

import mujoco
import numpy as np
import pytest

from benchmarks.data.moving_parts import NOISES, evidence_of, thrown, tracked, xml
from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.geometry import quaternions
from contact_curation.motion.calibration import NO_CORRECTION
from contact_curation.pipeline.diagnosis.evidence import Evidence
from contact_curation.pipeline.diagnosis.findings import smoothing
from contact_curation.pipeline.diagnosis.findings.body import moving_parts
from contact_curation.pipeline.diagnosis.findings.rig import inertia, mass_centre
from contact_curation.pipeline.diagnosis.findings.smoothing import smoothed
from test.motion.survey.rigs import FLYING, Rig, Throws, recorded


@cache
def seen(kind: str) -> Evidence:
    rng = np.random.default_rng(3)
    world, body = xml(kind, rng)
    model = mujoco.MjModel.from_xml_string(world)
    return evidence_of(tracked([thrown(model, rng) for _ in range(16)], NOISES[0], rng), body)


@pytest.mark.parametrize("kind", ["hinge", "ball"])
def test_links_that_move_are_told_in_one_line_and_no_wrong_centre_of_mass(kind: str) -> None:
    found = moving_parts(seen(kind))
    assert found is not None
    assert found.line.startswith("bodies do not move as rigid ones in the air: no point of theirs falls on a parabola")
    assert seen(kind).moved_centre(NO_CORRECTION) is None
    assert mass_centre(seen(kind)) is None
    assert inertia(seen(kind)) is None


@pytest.mark.parametrize("kind", ["lump", "foam"])
def test_of_a_rigid_body_it_is_not_said_wherever_its_mass_is_and_however_light_it_is(kind: str) -> None:
    assert seen(kind).mass_centre is not None
    assert moving_parts(seen(kind)) is None


def test_a_body_that_vibrates_in_the_air_is_no_filter_since_noise_is_white_at_rest() -> None:
    def looked_at(filtered: bool) -> Evidence:
        series = recorded(CONTACTNETS_CUBE.polytope, Rig(), Throws(count=16))
        for one in series:
            if filtered:
                one.positions[1:] = 0.5 * (one.positions[1:] + one.positions[:-1])
            else:
                shaken = 3e-4 * np.sin(2.0 * np.pi * 25.0 * one.times[:FLYING])[:, np.newaxis] * np.array([1.0, 0.0, 0.0])
                one.positions[:FLYING] += quaternions.rotate(one.orientations_wxyz[:FLYING], shaken)
        return evidence_of(tuple(series), CONTACTNETS_CUBE)

    assert smoothed(looked_at(filtered=False)) is None
    assert smoothed(looked_at(filtered=True)) is not None


def test_a_few_throws_whose_impacts_are_spread_may_have_landed_on_one_corner_after_the_other(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    evidence = evidence_of(tuple(recorded(CONTACTNETS_CUBE.polytope, Rig(), Throws(count=16))), CONTACTNETS_CUBE)
    monkeypatch.setattr(smoothing, "_sharpness", lambda _: np.array([0.5, 0.6, 0.7]))
    assert smoothed(evidence) is None
    monkeypatch.setattr(smoothing, "_sharpness", lambda _: np.array([0.4, 0.5, 0.6, 0.6, 0.6, 0.7]))
    assert smoothed(evidence) is not None
