"""A body of another size than described is named, and no setting hides it; errors of a rig are not taken for it."""

import re

import numpy as np
import pytest

from contact_curation.contact.body import CONTACTNETS_CUBE, Body
from contact_curation.geometry.polytopes import Polytope, box
from contact_curation.pipeline.diagnosis.diagnosis import concluded
from contact_curation.pipeline.diagnosis.evidence import Evidence
from contact_curation.pipeline.diagnosis.finding import Severity
from contact_curation.pipeline.diagnosis.findings.body import other_shape, other_size
from contact_curation.pipeline.diagnosis.recording import Recording
from contact_curation.pipeline.reading import ReadingConfig
from test.motion.survey.rigs import Rig, Throws, recorded

SLAB = box([0.06, 0.04, 0.025])


LOPSIDED = Polytope(np.add(SLAB.vertices, [0.02, 0.01, 0.0]))
"""A slab whose centre of mass is not in its middle."""


def seen(rig: Rig, described: float, thrown: Polytope = SLAB) -> Evidence:
    """Evidence of a slab's throws; it is described so many times as large."""
    body = Body("slab", described * thrown.vertices, 0.3, CONTACTNETS_CUBE.inertia, 0.3, 0.05)
    return Evidence(ReadingConfig(body), (Recording("a", series=tuple(recorded(thrown, rig, Throws(20)))),))


@pytest.mark.parametrize(
    ("described", "severity", "words"),
    [
        (0.92, Severity.FAULT, "9 % larger than slab"),
        (1.10, Severity.FAULT, "9 % smaller than slab"),
        (0.96, Severity.WARNING, "4 % larger than slab"),
    ],
)
def test_a_body_of_another_size_lies_on_each_face_as_high_as_its_depth_says(
    described: float, severity: Severity, words: str
) -> None:
    evidence = seen(Rig(), described)
    found = other_size(evidence)
    assert found is not None
    assert found.severity == severity
    assert words in found.what
    assert "at rest and on " in found.what
    assert other_shape(evidence) is None


def test_where_nothing_is_seen_of_the_centre_of_mass_a_marker_beside_the_body_looks_alike(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    alike = "record more throws: the same is seen of a marker beside the body"
    found = other_size(seen(Rig(), 0.92))
    monkeypatch.setattr(Evidence, "mass_centre", None)
    unsure = other_size(seen(Rig(), 0.92))
    assert found is not None
    assert unsure is not None
    assert (alike in found.remedy, alike in unsure.remedy) == (False, True)


def test_settings_do_not_hide_the_size_of_a_body() -> None:
    alone, short = (concluded(seen(Rig(scale=scale), 0.92)) for scale in (1.0, 1.03))
    for found in (alone, short):
        assert "9 % larger" in " ".join((found.verdict, *found.reasons))
        assert not re.search("tracked frame|bodies at rest lie", " ".join(found.reasons))
        assert not re.search(r"rig\.height|rig\.marker", found.settings)
    assert alone.settings == ""
    assert "rig.scale" in short.settings


def test_the_size_of_a_body_does_not_move_its_centre_of_mass() -> None:
    evidence = seen(Rig(), 0.92, LOPSIDED)
    assert other_size(evidence) is not None
    assert "turn about a point" not in " ".join(concluded(evidence).reasons)


@pytest.mark.parametrize("rig", [Rig(height=0.004), Rig(height=0.004, marker_offset=(0.004, -0.006, 0.008)), Rig(scale=1.03)])
def test_a_wrong_board_marker_or_scale_is_no_wrong_size(rig: Rig) -> None:
    evidence = seen(rig, 1.0)
    assert evidence.rig is not None
    assert other_size(evidence) is None
