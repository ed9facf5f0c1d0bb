"""Motions that are rejected: their sizes are read out of the reasons, and a setting is offered where one helps."""

from dataclasses import replace
from functools import cache

import pytest

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.motion.segmenter_config import SegmenterConfig
from contact_curation.motion.toss import Rejected, Toss
from contact_curation.pipeline.diagnosis.diagnosis import concluded
from contact_curation.pipeline.diagnosis.evidence import Evidence
from contact_curation.pipeline.diagnosis.finding import Finding
from contact_curation.pipeline.diagnosis.findings.tosses import rejected
from contact_curation.pipeline.diagnosis.recording import Recording
from contact_curation.pipeline.reading import ReadingConfig
from contact_curation.storage.inputs.inputs import InputsConfig
from test.simulated import simulated_tosses


@cache
def toss() -> Toss:
    return simulated_tosses(1, 1)[0]


def seen(lines: list[str], largest_gap: float = 1.5) -> Evidence:
    """Evidence of motions that were rejected for these reasons."""
    outcomes = tuple(Rejected(replace(toss(), toss_id=f"t{number}"), (line,)) for number, line in enumerate(lines))
    inputs = InputsConfig(segmenter=SegmenterConfig(largest_gap=largest_gap))
    return Evidence(ReadingConfig(CONTACTNETS_CUBE, inputs), (Recording("a", outcomes=outcomes),))


def found(lines: list[str], largest_gap: float = 1.5) -> Finding:
    finding = rejected(seen(lines, largest_gap))
    assert finding is not None
    return finding


def gaps(periods: float, allowed: float = 1.5) -> list[str]:
    return [f"gap: found {periods / 148.0:.4g} s before frame 30, expected at most {allowed / 148.0:.4g} s"] * 3


@pytest.mark.parametrize(
    ("line", "sizes"),
    [
        ("height at rest: found {} m, expected at most 0.003 m over or under the board", ["0.004", "-0.0042", "0.0041"]),
        ("lowest corner of the toss: found {} mm, expected within 7 mm of the board", ["-8", "-10", "-9"]),
    ],
)
def test_a_size_is_the_median_of_magnitudes_with_a_sign_where_all_have_it(line: str, sizes: list[str]) -> None:
    what = found([line.format(size) for size in sizes]).what
    assert "(0.0041 m in the median, allowed 0.003)" in what or "(-9 mm in the median, allowed 7)" in what


@pytest.mark.parametrize(
    ("line", "size"),
    [
        ("time between frames: found 2 frame periods at frame 30, expected at most 1.5 frame periods", "2 frame periods"),
        ("quaternion norm beside 1: found 0.0002 at frame 0, expected at most 0.0001", "0.0002"),
        (gaps(2.0)[0], "0.0135 s"),
    ],
)
def test_a_size_has_its_whole_unit(line: str, size: str) -> None:
    assert f"({size} in the median, allowed" in found([line]).what


def test_a_size_just_beside_its_bound_is_another_number() -> None:
    assert "(0.264 s in the median, allowed 0.2641)" in found(["duration: found 0.2640 s, expected at least 0.2641 s"]).what


def test_the_setting_that_accepts_single_lost_frames_is_offered() -> None:
    diagnosis = concluded(seen(gaps(2.0)))
    assert "or say --set segmenter.largest_gap=2.5: one transition spans a gap" in diagnosis.verdict
    assert diagnosis.settings == "--set segmenter.largest_gap=2.5"
    assert diagnosis.next.startswith("contact-curation rank a --set segmenter.largest_gap=2.5")
    assert found(gaps(3.0, 2.5), largest_gap=2.5).settings == ("segmenter.largest_gap=3.5",)


def test_no_setting_is_offered_for_long_gaps() -> None:
    assert found(gaps(7.0)).settings == ()
    assert found(gaps(4.0, 3.5), largest_gap=3.5).settings == ()


@pytest.mark.parametrize(("seconds", "says"), [(0.03, "record at a steady rate"), (2.0, "rests flat on a described face")])
def test_a_pause_after_a_body_that_never_lies_on_a_described_face_is_no_loss_of_frames(seconds: float, says: str) -> None:
    assert says in found(gaps(148.0 * seconds)).line
