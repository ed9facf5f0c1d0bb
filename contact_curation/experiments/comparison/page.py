"""Tables of the comparison in Markdown, as docs/results.md has them: means over seeds, and differences.

With a difference stands its interval, or of fewer than ten seeds the number of seeds in which it is below zero. Learned numbers
are medians over seeds.
"""

from collections.abc import Sequence

import numpy as np

from contact_curation.experiments.cell_run import Row
from contact_curation.experiments.engines import JUDGES
from contact_curation.experiments.tables import markdown_of

COLUMNS = {"position": "position %", "rotation": "rotation °"}
LEARNED = {"vertices": ("vertices, mm", 1), "friction": ("friction", 3)}
CERTAIN = 0.05
"""Differences with a smaller p, corrected for all comparisons, are bold."""


def pages_of(rows: Sequence[Row], table: Sequence[Row], minus: str) -> str:
    """A table for each body and judge.

    Args:
        rows: of cells.
        table: of `intervals.differences`.
        minus: rule that the others are compared with.
    """
    bodies = list(dict.fromkeys(str(row["body"]) for row in rows))
    return "\n".join(_page(body, judge, rows, table, minus) for body in bodies for judge in JUDGES)


def _page(body: str, judge: str, rows: Sequence[Row], table: Sequence[Row], minus: str) -> str:
    own = [row for row in rows if row["body"] == body]
    seeds = len({row["seed"] for row in own})
    heads = ["selected", "rule", *(head for name in COLUMNS.values() for head in (name, f"difference to {minus}"))]
    heads += [head for head, _ in LEARNED.values()] if judge == JUDGES[0] else []
    differences = {(float(row["size"]), row["rule"], row["measure"]): row
                   for row in table if (row["body"], row["minus"]) == (body, minus)}  # fmt: skip
    lines = list[list[str]]()
    for size in sorted({float(row["size"]) for row in own}):
        for rule in dict.fromkeys(str(row["rule"]) for row in own if float(row["size"]) == size):
            cells = [row for row in own if (float(row["size"]), row["rule"]) == (size, rule)]
            against = [differences.get((size, rule, f"{judge}_{name}")) for name in COLUMNS]
            lines.append([f"{size:.0f}", rule, *_numbers(cells, judge, against)])
    return f"`{body}`, {seeds} seeds, judged by {judge}:\n\n{markdown_of(heads, lines)}"


def _numbers(cells: Sequence[Row], judge: str, against: Sequence[Row | None]) -> list[str]:
    texts = list[str]()
    for name, difference in zip(COLUMNS, against, strict=True):
        measure = f"{judge}_{name}"
        mean = float(np.mean([np.nanmean(np.array(str(row[measure]).split(), dtype=float)) for row in cells]))
        texts += [f"{mean:.1f}", _difference(difference)]
    if judge == JUDGES[0]:
        texts += [f"{np.median([float(row[name]) for row in cells]):.{digits}f}" for name, (_, digits) in LEARNED.items()]
    return texts


def _difference(row: Row | None) -> str:
    if row is None:
        return ""
    value = f"{float(row['difference']):+.1f}"
    value = f"**{value}**" if float(row["p_bonferroni"]) < CERTAIN else value
    if np.isfinite(float(row["low"])):
        return f"{value} ({float(row['low']):+.1f} to {float(row['high']):+.1f})"
    return f"{value} ({float(row['seeds_better']):.0f} of {float(row['seeds']):.0f})"
