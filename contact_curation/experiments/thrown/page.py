"""Tables of `designed-throws` in Markdown, as docs/reference/ways_to_throw.md has them."""

from collections.abc import Sequence

from contact_curation.experiments.cell_run import Row
from contact_curation.experiments.summary import summarised
from contact_curation.experiments.tables import markdown_of
from contact_curation.experiments.thrown.cell import ARMS, DESIGNED
from contact_curation.learning.evaluation.bootstrap import BootstrapConfig, Interval

MEASURES = {
    "position": ("position %", 1),
    "rotation": ("rotation °", 1),
    "penetration": ("penetration %", 2),
    "world_position": ("in the world: position %", 1),
    "world_rotation": ("rotation °", 1),
    "vertices": ("vertices, mm", 1),
    "friction_from_described": ("friction off", 3),
    "landed": ("tasks done", 2),
}
"""What the tables call the measures, and their decimals."""


def page_of(rows: Sequence[Row]) -> str:
    """For each world and learner a table of medians and one of the paired differences to designed throws."""
    groups = dict.fromkeys((row["world"], row["restitution"]) for row in rows)
    return "\n".join(_world([row for row in rows if (row["world"], row["restitution"]) == group]) for group in groups)


def _world(rows: Sequence[Row]) -> str:
    learner = "with" if rows[0]["restitution"] else "without"
    others = tuple(rule for rule in ARMS if rule != DESIGNED and any(row["rule"] == rule for row in rows))
    found = summarised(rows, ("world", "rule", "throws"), tuple(MEASURES), others, BootstrapConfig())
    by = {(str(dict(one.group)["rule"]), float(dict(one.group)["throws"]), one.measure): one for one in found}
    numbers = sorted({throws for _, throws, _ in by})
    rules = tuple(rule for rule in ARMS if any(name == rule for name, _, _ in by))
    seeds = max(one.seeds for one in found)
    title = f"World `{rows[0]['world']}`, learners {learner} a restitution, {seeds} seeds"
    medians, differences = list[list[str]](), list[list[str]]()
    for throws, measure in ((throws, measure) for throws in numbers for measure in MEASURES):
        own = [by.get((rule, throws, measure)) for rule in rules]
        if not any(own):
            continue
        first = f"{throws:.0f}" if measure == next(iter(MEASURES)) else ""
        name, places = MEASURES[measure]
        medians.append([first, name, *(_number(one.median, places) if one else "" for one in own)])
        if one := by.get((DESIGNED, throws, measure)):
            differences.append([first, name, *(_difference(one.beside[other], places) for other in others)])
    parts = [f"## {title}\n\n{markdown_of(['throws', 'median of', *rules], medians)}"]
    if differences:
        heads = ["throws", "designed minus", *others]
        parts.append(markdown_of(heads, differences))
    return "\n".join(parts)


def _number(interval: Interval, places: int) -> str:
    return f"{interval.value:.{places}f} ({interval.low:.{places}f} to {interval.high:.{places}f})"


def _difference(interval: Interval, places: int) -> str:
    """Bold where the interval excludes 0."""
    value = f"{interval.value:+.{places}f}"
    shown = f"**{value}**" if interval.low > 0.0 or interval.high < 0.0 else value
    return f"{shown} ({interval.low:+.{places}f} to {interval.high:+.{places}f})"
