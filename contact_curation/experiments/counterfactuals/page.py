"""Tables of datamodeling scores in Markdown, as docs/results.md has them."""

from collections.abc import Sequence

from contact_curation.experiments.cell_run import Row
from contact_curation.experiments.counterfactuals.correlations import ALL_BODIES
from contact_curation.experiments.tables import markdown_of

SHOWN = ("loss", "rotation")
"""Outcomes of the tables of single bodies."""

MEANS = ("loss", "position", "rotation", "vertices")
"""Outcomes of the table of means."""


def page_of(table: Sequence[Row]) -> str:
    """A table by size for each body and outcome, and one of the means over bodies by outcome."""
    pages = list[str]()
    for body in dict.fromkeys(str(row["body"]) for row in table):
        own = [row for row in table if row["body"] == body]
        pages += [_means(own)] if body == ALL_BODIES else [_by_size(own, body, outcome) for outcome in SHOWN]
    return "\n".join(pages)


def _by_size(rows: Sequence[Row], body: str, outcome: str) -> str:
    found = {(float(row["size"]), row["score"]): row for row in rows if row["outcome"] == outcome}
    sizes = list(dict.fromkeys(size for size, _ in found))
    subsets = " and ".join(dict.fromkeys(f"{float(row['subsets']):.0f}" for row in found.values()))
    lines = [[score, *(_cell(found[size, score]) for size in sizes)] for score in _scores(rows)]
    return f"`{body}`, {outcome}, {subsets} subsets:\n\n{markdown_of(['score', *(f'{size:.0f}' for size in sizes)], lines)}"


def _means(rows: Sequence[Row]) -> str:
    found = {(row["outcome"], row["score"]): row for row in rows}
    lines = [[score, *(_cell(found[outcome, score]) for outcome in MEANS)] for score in _scores(rows)]
    return f"All bodies, {float(rows[0]['subsets']):.0f} subsets:\n\n{markdown_of(['score', *MEANS], lines)}"


def _scores(rows: Sequence[Row]) -> list[str]:
    return list(dict.fromkeys(str(row["score"]) for row in rows))


def _cell(row: Row) -> str:
    low, high = (float(row[name]) for name in ("low", "high"))
    return f"{float(row['spearman']):.2f} ({low:.2f} to {high:.2f})"
