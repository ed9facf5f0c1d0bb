"""A session as one HTML page that needs nothing beside it: figures are in it, and nothing is loaded or run."""

from base64 import b64encode
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from pathlib import Path

from contact_curation.dashboard.figures.report_data import ReportData
from contact_curation.files import write_atomically

STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; color: #222; max-width: 1000px; margin: 2em auto; padding: 0 1em; }
h1 { font-size: 1.6em; margin-bottom: 0.2em; } h2 { font-size: 1.2em; margin: 1.8em 0 0.4em; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; }
th, td { text-align: left; padding: 0.15em 1.2em 0.15em 0; vertical-align: top; border-bottom: 1px solid #eee; }
th { font-weight: 600; } td.number, th.number { text-align: right; }
tr.selected td { background: #eef5fa; }
img { max-width: 100%; } p.note { color: #666; }
"""

LARGEST_TABLE = 500
"""Rows; of more the last ones are left out, and counted."""


def save_report(data: ReportData, figures: Mapping[str, Path], path: Path) -> None:
    """Writes the page.

    Args:
        data: data of the session.
        figures: PNG files by their titles.
        path: path of the HTML file.

    Raises:
        InvalidValueError: the file cannot be written there.
    """
    write_atomically(path, report_text(data, figures).encode())


def report_text(data: ReportData, figures: Mapping[str, Path]) -> str:
    """The page."""
    parts = [
        _table(("", ""), [(name, text) for name, text in data.facts]),
        *(f"<h2>{escape(title)}</h2>\n{_image(title, file)}" for title, file in figures.items()),
        f"<h2>Throws</h2>\n{_throws(data)}",
        f"<h2>Ranking</h2>\n{_ranking(data)}",
        f"<h2>Rejected motions</h2>\n{_rejected(data)}",
        f"<h2>Restarts</h2>\n{_restarts(data)}",
    ]
    title = escape(data.title)
    head = f'<meta charset="utf-8"><title>{title}</title><style>{STYLE}</style>'
    body = f"<h1>{title}</h1>\n" + "\n".join(parts)
    return f'<!doctype html>\n<html lang="en"><head>{head}</head>\n<body>\n{body}\n</body></html>\n'


def _throws(data: ReportData) -> str:
    rows = [
        (str(throw.number), throw.kind, _number(throw.planned), _number(throw.realised), throw.outcome) for throw in data.throws
    ]
    return _table(("throw", "kind", "planned gain", "realised gain", "toss"), rows, numbers=(0, 2, 3))


def _ranking(data: ReportData) -> str:
    rows = [
        (
            str(toss.rank),
            toss.toss_id,
            _number(toss.score),
            _number(toss.gain),
            _number(toss.trace),
            "yes" if toss.selected else "no",
        )
        for toss in data.ranking
    ]
    selected = {place for place, toss in enumerate(data.ranking) if toss.selected}
    return _table(("rank", "toss", "score", "marginal gain", "trace", "selected"), rows, numbers=(0, 2, 3, 4), marked=selected)


def _rejected(data: ReportData) -> str:
    if not data.rejected:
        return '<p class="note">The gates rejected nothing.</p>'
    return _table(("toss", "reasons"), [(toss_id, "; ".join(reasons)) for toss_id, reasons in data.rejected])


def _restarts(data: ReportData) -> str:
    deaths = [event for event in data.events if event.event in ("died", "given up")]
    if not deaths:
        return '<p class="note">No node died.</p>'
    rows = [(f"{event.seconds:.1f}", event.node, event.event, event.detail) for event in deaths]
    return _table(("time [s]", "node", "", "how"), rows, numbers=(0,))


def _table(heads: Sequence[str], rows: Sequence[Sequence[str]], numbers: Sequence[int] = (), marked: Iterable[int] = ()) -> str:
    """Rows of texts; columns of `numbers` are set to the right, `marked` rows are of the selected set."""
    if not rows:
        return '<p class="note">None.</p>'
    chosen = set(marked)
    lines = [_row(heads, "th", numbers)] if any(heads) else []
    for place, row in enumerate(rows[:LARGEST_TABLE]):
        lines.append(_row(row, "td", numbers, "selected" if place in chosen else ""))
    more = len(rows) - LARGEST_TABLE
    note = f'<p class="note">{more} more are left out here.</p>' if more > 0 else ""
    return "<table>\n" + "\n".join(lines) + f"\n</table>{note}"


def _row(cells: Sequence[str], tag: str, numbers: Sequence[int], kind: str = "") -> str:
    marks = [' class="number"' if place in numbers else "" for place in range(len(cells))]
    inside = "".join(f"<{tag}{mark}>{escape(cell)}</{tag}>" for cell, mark in zip(cells, marks))
    return f'<tr class="{kind}">{inside}</tr>' if kind else f"<tr>{inside}</tr>"


def _image(title: str, file: Path) -> str:
    data = b64encode(file.read_bytes()).decode("ascii")
    return f'<img alt="{escape(title)}" src="data:image/png;base64,{data}">'


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.4g}"
