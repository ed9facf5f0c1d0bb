"""The report of a session is one page with everything in it, whatever the session had."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from contact_curation.dashboard.figures.report_data import ReportData, ReportedEvent, ReportedThrow, ReportedToss, save_figures
from contact_curation.dashboard.figures.session_report import LARGEST_TABLE, report_text, save_report
from contact_curation.errors import InvalidValueError

STORY = ReportData(
    title="Session of 2 throws",
    facts=[("throws", "2 made"), ("restarts", "curator 1")],
    throws=[
        ReportedThrow(1, "exploration", None, None, "rejected: gap"),
        ReportedThrow(2, "designed", 3.25, 2.125, "selected, rank 1 of 1"),
    ],
    ranking=[ReportedToss(1, "cube-1", 12.5, 12.5, 80.0, True), ReportedToss(2, "cube-2", 7.0, 1.0, 60.0, False)],
    rejected=[("cube-0", ["gap: found 3 < 4", "lowest corner"])],
    events=[
        ReportedEvent(0.0, "started", "curator"),
        ReportedEvent(5.0, "died", "curator", "signal SIGKILL: last words"),
        ReportedEvent(6.0, "restarted", "curator"),
        ReportedEvent(10.0, "stopped", "curator", "status 0"),
    ],
    seconds=10.0,
    errors={"position error [% of width]": np.array([80.0, 20.0]), "held-out loss": np.array([0.8, 0.02])},
    throws_then=np.array([1, 2]),
    spectrum=np.array([0.4, 1.1, 1.6]),
    epsilon=0.6,
)
EMPTY = ReportData("Session of 0 throws", [], [], [], [], [], 0.0)


def test_the_page_tells_everything_and_loads_nothing(tmp_path: Path) -> None:
    figures = save_figures(STORY, tmp_path)
    titles = ["Errors on held-out tosses", "Planned and realised gains", "Information of the selected set", "Nodes"]
    assert list(figures) == titles
    save_report(STORY, figures, tmp_path / "report.html")
    page = (tmp_path / "report.html").read_text()
    for text in (
        "2 made",
        "3.25",
        "2.125",
        "selected, rank 1 of 1",
        "cube-2",
        "gap: found 3 &lt; 4; lowest corner",
        "signal SIGKILL",
    ):
        assert text in page
    assert len(re.findall(r'src="data:image/png;base64,', page)) == len(figures)
    assert not re.search(r'(src|href)="(?!data:)|<script|url\(|@import', page)


def test_every_tag_is_closed() -> None:
    page = report_text(STORY, {})
    for tag in ("html", "body", "table", "tr", "td", "th", "h1", "h2", "p"):
        assert len(re.findall(f"<{tag}[ >]", page)) == page.count(f"</{tag}>"), tag


def test_names_are_no_markup() -> None:
    page = report_text(replace(STORY, title="<b>"), {})
    assert "<b>" not in page
    assert "&lt;b&gt;" in page


def test_a_session_without_anything_has_a_page_without_figures(tmp_path: Path) -> None:
    assert save_figures(EMPTY, tmp_path) == {}
    page = report_text(EMPTY, {})
    assert "The gates rejected nothing." in page
    assert "No node died." in page


def test_long_tables_say_what_they_leave_out() -> None:
    many = [ReportedToss(place, f"cube-{place}", 1.0, 1.0, 1.0, False) for place in range(LARGEST_TABLE + 7)]
    page = report_text(replace(STORY, ranking=many), {})
    assert "7 more are left out here." in page


def test_a_place_that_cannot_be_written_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(InvalidValueError, match="expected a path that can be written"):
        save_report(STORY, {}, tmp_path / "none" / "report.html")
    with pytest.raises(InvalidValueError, match="expected a path that can be written"):
        save_figures(STORY, tmp_path / "none")
