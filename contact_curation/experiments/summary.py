"""What rows say together: medians over seeds with bootstrap intervals, and how rules differ seed by seed.

Rows of equal fields but the seed are a group. Two rules are compared by the differences that each seed makes, since a hard pool
or a bad initialisation is hard for both (method.md 1.12).
"""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from contact_curation.errors import InvalidValueError
from contact_curation.experiments.cell_run import Row
from contact_curation.learning.evaluation.bootstrap import BootstrapConfig, Interval, paired_spread, spread

type Group = tuple[tuple[str, float | str], ...]
"""Names and values of the fields that rows of a group share."""


@dataclass(frozen=True)
class Summary:
    """One measure of one group.

    Attributes:
        group: its fields.
        measure: a column of the rows.
        seeds: how many there are.
        median: over the seeds.
        beside: median of the differences to the same seeds of other groups, by their rules.
    """

    group: Group
    measure: str
    seeds: int
    median: Interval
    beside: Mapping[str, Interval]

    def as_row(self) -> Row:
        """For a table."""
        row: Row = {**dict(self.group), "measure": self.measure, "seeds": float(self.seeds), **_columns("median", self.median)}
        for name, interval in self.beside.items():
            row |= _columns(f"minus {name}", interval)
        return row


def summarised(
    rows: Sequence[Row], fields: Sequence[str], measures: Sequence[str], baselines: Sequence[str], config: BootstrapConfig
) -> tuple[Summary, ...]:
    """Every measure of every group, in the order in which groups first come.

    Args:
        rows: each with `fields`, `seed`, and as many of the measures as it has.
        fields: what makes a group.
        measures: columns of numbers.
        baselines: rules, values of the field `rule`, that every group is compared with.
        config: of the intervals.

    Raises:
        InvalidValueError: a group has a seed twice.
    """
    groups = _groups(rows, fields)
    found = []
    for group, seeds in groups.items():
        for measure in measures:
            own = {seed: value for seed, row in seeds.items() if (value := _number(row, measure)) is not None}
            if own:
                others = {name: groups.get(_beside(group, name), {}) for name in baselines if dict(group).get("rule") != name}
                beside = {name: _paired(own, other, measure, config) for name, other in others.items() if other}
                median = spread(list(own.values()), config).median
                found.append(Summary(group, measure, len(own), median, beside))
    return tuple(found)


def _groups(rows: Sequence[Row], fields: Sequence[str]) -> dict[Group, dict[float | str, Row]]:
    groups: defaultdict[Group, dict[float | str, Row]] = defaultdict(dict)
    for row in rows:
        group = tuple((name, row[name]) for name in fields)
        if row["seed"] in groups[group]:
            raise InvalidValueError(f"rows of {dict(group)}", f"seed {row['seed']} twice", "each seed once")
        groups[group][row["seed"]] = row
    return dict(groups)


def _beside(group: Group, rule: str) -> Group:
    return tuple((name, rule if name == "rule" else value) for name, value in group)


def _paired(
    own: Mapping[float | str, float], other: Mapping[float | str, Row], measure: str, config: BootstrapConfig
) -> Interval:
    both = [(value, theirs) for seed, value in own.items() if (theirs := _number(other.get(seed, {}), measure)) is not None]
    if not both:
        return Interval(np.nan, np.nan, np.nan)
    ours, others = zip(*both)
    return paired_spread(ours, others, config).median


def _number(row: Mapping[str, float | str], measure: str) -> float | None:
    value = row.get(measure)
    return float(value) if isinstance(value, float | int) and np.isfinite(value) else None


def _columns(name: str, interval: Interval) -> Row:
    return {name: interval.value, f"{name} low": interval.low, f"{name} high": interval.high}
