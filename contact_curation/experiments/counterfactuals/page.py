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
    """A table for each body, by size, and one of the means over bodies."""
    bodies = list(dict.fromkeys(str(row["body"]) for row in table))
    return "\n".join(_page([row for row in table if row["body"] == body], body) for body in bodies)


def _page(rows: Sequence[Row], body: str) -> str:
    found = {(row["outcome"], row["size"], row["score"]): row for row in rows}
    sizes = sorted({float(row["size"]) for row in rows})
    columns = [(outcome, size) for outcome in (MEANS if body == ALL_BODIES else SHOWN) for size in sizes]
    subsets = [f"{max(float(row['subsets']) for row in rows if row['size'] == size):.0f}" for size in sizes]
    heads = ["score", *(outcome if body == ALL_BODIES else f"{outcome}, {size:.0f}" for outcome, size in columns)]
    title = f"All bodies, {subsets[0]} subsets:" if body == ALL_BODIES else f"`{body}`, {' and '.join(subsets)} subsets:"
    scores = dict.fromkeys(str(row["score"]) for row in rows)
    lines = [[score, *(_cell(found.get((outcome, size, score))) for outcome, size in columns)] for score in scores]
    return f"{title}\n\n{markdown_of(heads, lines)}"


def _cell(row: Row | None) -> str:
    if row is None:
        return ""
    low, high = (float(row[name]) for name in ("low", "high"))
    return f"{float(row['spearman']):.2f} ({low:.2f} to {high:.2f})"
