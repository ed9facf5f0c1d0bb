"""A board or camera that was moved between two throws is named with its place in time, and no settings are given for both."""

import numpy as np
import pytest
from numpy.typing import NDArray

from contact_curation.contact.body import CONTACTNETS_CUBE, Body
from contact_curation.geometry.polytopes import box
from contact_curation.motion.survey.falls import survey
from contact_curation.motion.survey.moved_board import board_move
from contact_curation.motion.survey.rests import Rests, rests_of
from contact_curation.pipeline.diagnosis.diagnosis import concluded
from contact_curation.pipeline.diagnosis.evidence import Evidence
from contact_curation.pipeline.diagnosis.recording import Recording
from contact_curation.pipeline.reading import ReadingConfig
from test.motion.survey.rigs import Rig, Throws, recorded

SLAB = box([0.06, 0.04, 0.025])
COUNT, AT = 16, 7


def seen(before: Rig, after: Rig, described: Body | None = None) -> Evidence:
    """Evidence of a slab's throws in two recordings, the second one by another rig."""
    body = described or Body("slab", SLAB.vertices, 0.3, CONTACTNETS_CUBE.inertia, 0.3, 0.05)
    first, second = (recorded(SLAB, rig, Throws(COUNT)) for rig in (before, after))
    parts = (Recording("a.mcap", series=tuple(first[:AT])), Recording("b.mcap", series=tuple(second[AT:])))
    return Evidence(ReadingConfig(body), parts)


@pytest.mark.parametrize(
    ("after", "step"),
    [
        (Rig(height=0.003), "3.0 mm higher than before, and 0.0 degrees tilted"),
        (Rig(height=-0.02), "20.0 mm lower than before, and 0.0 degrees tilted"),
        (Rig(tilt=(0.0, 0.02)), "and 1.1 degrees tilted"),
    ],
)
def test_a_board_that_was_moved_is_named_with_the_throw_and_the_recording(after: Rig, step: str) -> None:
    found = concluded(seen(Rig(), after))
    assert found.verdict.startswith(f"from throw {AT + 1} of {COUNT} on (70.0 s, b.mcap) bodies lie ")
    assert step in found.verdict
    assert "rig." not in found.settings
    assert not any("face to face" in line or "board is tilted" in line for line in found.reasons)


@pytest.mark.parametrize("rig", [Rig(), Rig(height=0.004), Rig(tilt=(0.02, 0.01)), Rig(marker_turn=(0.02, 0.03, 0.0))])
def test_a_board_that_stays_wherever_it_is_was_not_moved(rig: Rig) -> None:
    assert seen(rig, rig).board_move is None


def test_a_body_that_is_described_wrong_does_not_move_the_board() -> None:
    wrong = Body("slab", box([0.063, 0.036, 0.028]).vertices, 0.3, CONTACTNETS_CUBE.inertia, 0.3, 0.05)
    assert seen(Rig(), Rig(), wrong).board_move is None


def in_order(rests: Rests, order: NDArray[np.int64]) -> Rests:
    """Some of them."""
    return Rests(rests.turns[order], rests.places[order], rests.normals[order], rests.depths[order], rests.throws[order])


@pytest.mark.parametrize(
    ("rig", "faces"),
    [
        (Rig(marker_turn=(0.03, 0.02, 0.0)), 2),
        (Rig(marker_turn=(0.02, 0.02, 0.0), marker_offset=(0.01, 0.004, 0.006)), 99),
        (Rig(scale=1.03, tilt=(0.01, 0.0), marker_turn=(0.015, 0.0, 0.0)), 99),
        (Rig(), 99),
    ],
)
def test_few_rests_in_any_order_hardly_ever_move_the_board(rig: Rig, faces: int) -> None:
    """Also where the place at which bodies land wanders over the board, by a wrong marker, and by a body described wrong."""
    throws = survey(recorded(SLAB, rig, Throws(60, faces=faces))).throws
    rng, moved = np.random.default_rng(0), 0
    for described in (SLAB, box([0.063, 0.037, 0.026])):
        rests = rests_of(throws, described)
        for draw in range(100):
            chosen = rng.choice(len(rests), 8 + 4 * (draw % 3), replace=False)
            order = chosen if draw % 2 else chosen[np.argsort(rests.places[chosen, 0])]
            moved += board_move(in_order(rests, order)) is not None
    assert moved <= 2


def test_a_body_described_wrong_that_lies_on_one_face_after_another_does_not_move_the_board() -> None:
    rests = rests_of(survey(recorded(SLAB, Rig(), Throws(60))).throws, box([0.06, 0.04, 0.035]))
    order = np.argsort(np.abs(rests.normals[:, 2]), kind="stable")
    assert board_move(in_order(rests, order)) is None


def test_a_move_that_is_not_worth_a_line_is_none() -> None:
    assert seen(Rig(), Rig(height=0.0008, tilt=(0.003, 0.0))).board_move is None
