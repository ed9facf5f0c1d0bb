"""Words about contacts that the usual model does not describe: where they are true, and nowhere else."""

import re
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from benchmarks.learning.starts import body_of
from contact_curation.contact.body import CONTACTNETS_CUBE as CUBE
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.design.releases import published_releases
from contact_curation.design.throw import throw_of_state
from contact_curation.learning.evaluation.misfit import (
    bounce_in_words,
    friction_use,
    sliding_in_words,
    sliding_of,
    sticking_in_words,
)
from contact_curation.motion.survey.series import series_of
from contact_curation.motion.survey.sliding import Sliding, sliding
from contact_curation.motion.toss import Toss
from contact_curation.motion.transitions import transitions_of
from contact_curation.pipeline.diagnosis.evidence import Evidence
from contact_curation.pipeline.diagnosis.finding import Severity
from contact_curation.pipeline.diagnosis.findings.contact import bounces, friction, friction_varies, gives_way, slides_apart
from contact_curation.pipeline.diagnosis.findings.facts import identifiable
from contact_curation.pipeline.diagnosis.findings.smoothing import smoothed
from contact_curation.pipeline.diagnosis.recording import Recording
from contact_curation.pipeline.reading import ReadingConfig
from contact_curation.simulation.thrown_toss import ThrownTossConfig, thrown_toss
from contact_curation.simulation.world import WorldConfig
from contact_curation.storage.datasets.contactnets import read_contactnets_toss
from test.simulated import RIG_NOISE, TrackerNoise, simulated_tosses

RADIUS = float(np.linalg.norm(CUBE.vertices, axis=1).max())


def seen(tosses: tuple[Toss, ...]) -> Evidence:
    """Evidence that has these tosses, and no recordings."""
    evidence = Evidence(ReadingConfig(CUBE), ())
    evidence.__dict__["tosses"] = tosses
    return evidence


@cache
def thrown(restitution: float = 0.0, variation: float = 0.0) -> tuple[Toss, ...]:
    """30 tosses, with frictions that vary from one to the next."""
    rng = np.random.default_rng(3)
    geometry = replace(ContactGeometry.of_body(CUBE).rigid(), restitution=restitution)
    if not variation:
        return simulated_tosses(30, 1, RIG_NOISE, geometry=geometry)
    frictions = CUBE.friction * np.exp(variation * rng.standard_normal(30))
    return tuple(
        toss
        for seed, value in enumerate(frictions.tolist())
        for toss in simulated_tosses(1, seed, RIG_NOISE, geometry=replace(geometry, tangents=value * np.eye(2, 3)))
    )


def test_a_body_that_bounces_is_said_to_and_one_that_does_not_is_not() -> None:
    found = bounces(seen(thrown(restitution=0.3)))
    assert found is not None
    assert found.severity == Severity.FACT
    assert found.line.startswith("the body bounces: corners leave first impacts with 0.3")
    assert found.line.endswith("learn it, too: train --set training.restitution=true")
    assert bounces(seen(thrown())) is None
    assert bounces(seen(thrown(restitution=0.3)[:5])) is None


def test_a_body_whose_corner_rises_when_the_next_one_lands_does_not_bounce() -> None:
    body = body_of(17)
    rigid = ContactGeometry.of_body(body).rigid()
    without, bouncing = (
        simulated_tosses(30, 1, RIG_NOISE, body=body, geometry=replace(rigid, restitution=value)) for value in (0.0, 0.4)
    )
    assert bounce_in_words(without, body) == ""
    assert re.match(r"the body bounces: corners leave first impacts with 0\.[34]", bounce_in_words(bouncing, body))


@pytest.mark.parametrize(("milliseconds", "said"), [(6.0, False), (20.0, True)])
def test_soft_contacts_are_said_to_be_soft_and_not_smoothed_and_firm_ones_are_neither(milliseconds: float, said: bool) -> None:
    config = ThrownTossConfig(world=WorldConfig(contact_time=0.001 * milliseconds))
    releases = published_releases(10, np.random.default_rng(5))
    throws = [throw_of_state(f"{number}", CUBE.name, release) for number, release in enumerate(releases)]
    tosses = tuple(thrown_toss(CUBE, throw, config) for throw in throws)
    found = gives_way(seen(tosses))
    line = r"soft contacts: corners go [67]\.\d mm below where they rest \(median of 10" if said else "^$"
    assert re.match(line, found.what if found else "")
    recording = Recording("a", series=tuple(map(series_of, tosses)), outcomes=tosses)
    assert smoothed(Evidence(ReadingConfig(CUBE), (recording,))) is None


def test_a_noisy_tracker_makes_no_contact_soft() -> None:
    noise = TrackerNoise(90.0 * RIG_NOISE.position, 90.0 * RIG_NOISE.orientation)
    assert gives_way(seen(simulated_tosses(12, 1, noise))) is None


def test_friction_that_varies_between_tosses_is_said_to_and_one_that_does_not_is_not() -> None:
    found = friction_varies(seen(thrown(variation=0.25)))
    assert found is not None
    assert found.severity == Severity.WARNING
    assert found.what.startswith("friction varies between tosses: 0.1")
    assert friction_varies(seen(thrown())) is None
    assert friction_varies(seen(thrown(restitution=0.3))) is None


def test_a_toss_that_slides_otherwise_than_the_others_is_named() -> None:
    """Such as one that a cable holds back, among 30: the median and its scatter do not show it."""
    rough = replace(ContactGeometry.of_body(CUBE).rigid(), tangents=2.0 * CUBE.friction * np.eye(2, 3))
    held = tuple(replace(simulated_tosses(1, seed, geometry=rough)[0], toss_id=f"held-{seed}") for seed in range(3))
    found = slides_apart(seen((*thrown(), *held)))
    assert found is not None
    assert found.severity == Severity.WARNING
    assert {word for word in found.what.split() if "-" in word} <= {f"held-{seed}" for seed in range(3)}
    assert "held-" in found.what
    assert friction_varies(seen((*thrown(), *held))) is None
    assert slides_apart(seen(thrown())) is None
    assert slides_apart(seen(thrown(restitution=0.3))) is None


def test_the_sliding_friction_is_that_of_the_world_and_stands_beside_the_described_one() -> None:
    found = sliding(thrown(), RADIUS, CUBE.gravity)
    assert np.median(found.friction) == pytest.approx(CUBE.friction, abs=0.003)
    assert found.variation < 0.02
    fact = friction(seen(thrown()))
    assert fact is not None
    assert fact.line.startswith("sliding friction: 0.18")
    assert fact.line.endswith("described 0.18")
    assert len(sliding(thrown()[:0], RADIUS, CUBE.gravity).friction) == 0


def test_a_described_friction_that_is_far_from_the_sliding_one_is_a_warning() -> None:
    evidence = Evidence(ReadingConfig(replace(CUBE, friction=0.3)), ())
    evidence.__dict__["tosses"] = thrown()
    found = friction(evidence)
    assert found is not None
    assert (found.severity, found.remedy) == (Severity.WARNING, "describe it so: --friction 0.18")


def test_a_body_that_turns_on_the_board_slides_nevertheless() -> None:
    """Slowed down by mu g along its way, and turning at 0.3 of its speed at its corners."""
    (toss,) = simulated_tosses(1, 1)
    seconds = 0.01 * np.arange(30)
    speeds = 2.0 - 0.18 * CUBE.gravity * seconds
    flat = np.zeros((30, 3))
    still = replace(
        toss, stamps_ns=(1e9 * seconds).astype(int), positions=flat, orientations_wxyz=np.eye(4)[np.zeros(30, int)],
        linear_velocities=speeds[:, None] * np.eye(3)[0], angular_velocities=flat,
    )  # fmt: skip
    for axis, share, slides in ((2, 0.3, True), (2, 0.6, False), (0, 0.3, False)):
        spins = share * speeds[:, None] / RADIUS * np.eye(3)[axis]
        found = sliding([replace(still, angular_velocities=spins)], RADIUS, CUBE.gravity)
        assert found.friction == pytest.approx([0.18] if slides else [])


def test_a_learned_friction_that_no_slide_bears_out_is_said_to_be_one() -> None:
    found = sliding_of(thrown(), CUBE)
    assert sliding_in_words(found, 0.182, 0.01) == ""
    assert sliding_in_words(None, 0.5, 0.01) == ""
    assert sliding_in_words(found, 0.25, 0.01).startswith("bodies that slide slow down by a friction of 0.18")


def test_a_friction_that_is_hardly_used_up_is_said_to_be_higher() -> None:
    described = ContactGeometry.of_body(CUBE).rigid()
    rough, learned = (replace(described, tangents=friction * np.eye(2, 3)) for friction in (0.9, 0.55))
    tosses = simulated_tosses(8, 5, geometry=rough)
    data = transitions_of(tosses, CUBE.length_scale)
    use = friction_use(data, learned, CUBE)
    assert use is not None
    assert use.sliding < 0.5 < use.at_rest
    assert sticking_in_words(data, learned, CUBE, None) == (
        f"friction hardly used up: contacts slide in {100.0 * use.sliding:.0f} % of the frames that move on the board "
        "(expected 60 % at least), so the friction is higher than the 0.55 that is learned; much friction is learned better "
        "where it is described: give --friction 0.6, or friction: 0.6 in the object's file, and rank and train again"
    )
    assert sticking_in_words(data, learned, replace(CUBE, friction=0.5), None).endswith("than the 0.55 that is learned")
    assert sticking_in_words(transitions_of(tosses[:7], CUBE.length_scale), learned, CUBE, None) == ""
    assert sticking_in_words(data, None, CUBE, None) == ""
    assert sticking_in_words(data, learned, CUBE, Sliding(np.full(8, 0.9), np.full(8, 0.02))) != ""
    assert sticking_in_words(data, learned, CUBE, Sliding(np.full(8, 0.5), np.full(8, 0.02))) == ""  # slides contradict it
    assert sticking_in_words(transitions_of(thrown(), CUBE.length_scale), described, CUBE, None) == ""


@pytest.mark.parametrize("friction", [0.6, 0.9])
def test_bodies_that_roll_and_tumble_without_sliding_do_not_say_that_a_right_friction_is_higher(friction: float) -> None:
    right = replace(ContactGeometry.of_body(CUBE).rigid(), tangents=friction * np.eye(2, 3))
    tosses = simulated_tosses(8, 5, geometry=right)
    words = sticking_in_words(transitions_of(tosses, CUBE.length_scale), right, replace(CUBE, friction=friction), None)
    assert words.endswith(f"they stick or roll, where the friction may be higher than the {friction:.2f} that is learned")


def test_bounds_on_accuracy_are_not_left_alone_beside_a_model_that_is_not_right() -> None:
    wrong, right = (identifiable(seen(thrown(restitution=value))) for value in (0.3, 0.0))
    assert wrong is not None
    assert right is not None
    assert wrong.line.endswith("the model that these bounds hold for is not right here (see above): expect more")
    assert "see above" not in right.line


def test_the_real_cube_bounces_and_its_friction_hardly_varies(contactnets_folder: Path) -> None:
    numbers = np.random.default_rng(0).choice(400, 40, replace=False).tolist()
    evidence = seen(tuple(read_contactnets_toss(contactnets_folder / f"{number}.pt", CUBE) for number in numbers))
    assert bounces(evidence) is not None
    assert friction_varies(evidence) is None
