"""The tables of docs/results.md are the medians of the rows in docs/results/."""

import csv
import re
from collections import defaultdict
from collections.abc import Collection, Iterator, Sequence
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from scipy.stats import ttest_1samp

from contact_curation.experiments.cell_run import Row
from contact_curation.experiments.comparison.intervals import LEAST_SEEDS
from contact_curation.experiments.comparison.page import pages_of
from contact_curation.experiments.counterfactuals.correlations import ALL_BODIES, correlations, table_of
from contact_curation.experiments.counterfactuals.page import page_of
from contact_curation.experiments.counterfactuals.table import read_refits
from contact_curation.experiments.engines import MEASURES
from contact_curation.experiments.thrown.page import page_of as page_of_throws
from contact_curation.geometry.quaternions import Array
from contact_curation.learning.evaluation.bootstrap import BootstrapConfig

DOCS = Path(__file__).resolve().parents[2] / "docs"
AT_FIT, FROM_THETA_0 = ("criteria_at_fit", "criteria_at_fit_differences"), ("from_theta_0/means", "from_theta_0/differences")
BY_COUNTERFACTUALS, LITERATURE = ((f"{name}/means", f"{name}/differences") for name in ("by_counterfactuals", "literature"))
PAGE, ROWS = DOCS / "results.md", DOCS / "results"
COLUMNS = {
    "rotation °": "rotation",
    "position %": "position",
    "penetration %": "penetration",
    "vertices from the described, mm": "vertices",
    "vertices from all's, mm": "vertices_from_all",
    "from all's, mm": "vertices_from_all",
    "friction": "friction",
    "off all's": "friction_from_all",
    "friction off all's": "friction_from_all",
    "slid farther": "slid farther than expected",
    "spin": "spin at release",
    "friction, off all's": "friction_from_all",
}
RIGID = "friction at contact vertices"
"""Of the column before."""

type Rows = list[dict[str, str]]


class Said(NamedTuple):
    """A number of a table, as text, where it stands and what it is of."""

    size: int
    rule: str
    measure: str
    number: str


@cache
def rows(name: str) -> Rows:
    with (ROWS / f"{name}.csv").open(newline="") as file:
        return list(csv.DictReader(file))


def section(heading: str) -> str:
    found = re.search(rf"^## {re.escape(heading)}\n(.*?)(?=^## |\Z)", PAGE.read_text(), re.DOTALL | re.MULTILINE)
    assert found, heading
    return found[1]


def tables(text: str, first: tuple[str, str]) -> Iterator[Said]:
    """The numbers of all tables whose first two columns are those."""
    measures: list[str | None] = []
    size = 0
    for line in text.splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")] if line.startswith("|") else []
        if tuple(cells[:2]) == first:
            measures = [_measure(cells, place) for place in range(2, len(cells))]
        elif not cells:
            measures = []
        elif measures and not cells[0].startswith("-"):
            size = int(cells[0]) if cells[0] else size
            for measure, cell in zip(measures, cells[2:], strict=True):
                if measure:
                    yield Said(size, cells[1].strip("*"), measure, cell.split(" ")[0])


def _measure(heads: list[str], place: int) -> str | None:
    head = heads[place]
    return f"rigid_{COLUMNS[heads[place - 1]]}" if head == RIGID else COLUMNS.get(head)


def check(said: Said, values: Collection[float], seeds: int) -> None:
    """The number is the median, to its own digits."""
    assert len(values) == seeds, said
    digits = len(said.number.partition(".")[2])
    assert float(np.median(list(values))) == pytest.approx(float(said.number), abs=0.51 * 10.0**-digits), said


def of_seeds(found: Rows, said: Said, rule: str, seeds: int) -> dict[int, float]:
    """What the seeds gave."""
    size = 0 if rule == "all" else said.size
    return {
        int(row["seed"]): float(row[said.measure])
        for row in found
        if row["rule"] == rule and int(row["size"]) == size and int(row["seed"]) < seeds and row[said.measure]
    }


@pytest.mark.parametrize(
    ("heading", "name"),
    [
        ("Dataset quality", "dataset_quality"),
        ("The same along gradient steps", "budgeted"),
        ("The published protocol", "published"),
        ("Friction where the body touches", "dataset_quality"),
        ("Other ways that were tried", "candidate_rules"),
    ],
)
def test_medians_are_those_of_ten_seeds(heading: str, name: str) -> None:
    found, counted = rows(name), 0
    for said in tables(section(heading), ("selected", "rule")):
        check(said, of_seeds(found, said, said.rule, 10).values(), 10)
        counted += 1
    assert counted > 50


FUNCTIONALS = {
    "trace, empirical": "trace",
    "info-orthogonal, literal": "orthogonal-literal",
    "info-orthogonal, pivoted": "orthogonal",
}
"""Rules as the tables of functionals name them; the others have their own names."""


def test_functionals_are_medians_of_ten_seeds() -> None:
    found, counted = [*rows("functionals"), *rows("dataset_quality")], 0
    lines = [[cell.strip() for cell in line.strip("|").split("|")] for line in section("The functionals").splitlines()]
    for measures in (("rotation", "vertices_from_all"), ("position", "friction")):
        place = next(place for place, cells in enumerate(lines) if len(cells) == 5 and cells[1].startswith(measures[0]))
        for rule, *cells in lines[place + 2 : place + 10]:
            for cell, measure, size in zip(cells, np.repeat(measures, 2), (8, 16) * 2, strict=True):
                said = Said(size, rule, str(measure), cell.split(" ")[0])
                check(said, of_seeds(found, said, FUNCTIONALS.get(rule, rule), 10).values(), 10)
                counted += 1
    assert counted == 64


def test_differences_are_those_of_twenty_seeds() -> None:
    found, counted = rows("dataset_quality"), 0
    for said in tables(section("Dataset quality"), ("selected", "less")):
        ours, theirs = (of_seeds(found, said, rule, 20) for rule in ("representative", said.rule))
        check(said, [ours[seed] - theirs[seed] for seed in ours], 20)
        counted += 1
    assert counted == 36


def test_networks_are_those_of_five_seeds() -> None:
    found, counted = rows("networks"), 0
    text = section("Networks").partition("**In the published protocol**")[0]
    for model in ("deep", "deepvertex", "end_to_end"):
        own = [row for row in found if row["model"] == model]
        part = re.search(rf"^`{model}`:\n(.*?)(?=^`|^Differences)", text, re.DOTALL | re.MULTILINE)
        assert part, model
        for said in tables(part[1], ("selected", "rule")):
            check(said, of_seeds(own, said, said.rule, 5).values(), 5)
            counted += 1
    assert counted == 3 * 6 * 3 * 3


@pytest.mark.parametrize(("model", "rules"), [("deep", 5), ("deepvertex", 6), ("end_to_end", 5)])
def test_networks_of_the_published_protocol_are_those_of_five_seeds(model: str, rules: int) -> None:
    found, counted = [row for row in rows("networks_published") if row["model"] == model], 0
    text = section("Networks").partition("**In the published protocol**")[2]
    part = re.search(rf"^`{model}`:\n(.*?)(?=^`|^Differences)", text, re.DOTALL | re.MULTILINE)
    assert part, model
    for said in tables(part[1], ("selected", "rule")):
        check(said, of_seeds(found, said, said.rule, 5).values(), 5)
        counted += 1
    assert counted == 3 * rules * 3


def of_pool(rule: str, fault: str, share: float, gated: bool, measure: str) -> dict[int, float]:
    """What the seeds gave with such a pool."""
    key = (rule, fault, share, str(gated))
    found = (row for row in rows("robustness") if (row["rule"], row["fault"], float(row["share"]), row["gated"]) == key)
    values = {int(row["seed"]): float(row[measure]) for row in found}
    assert len(values) == 10, key
    return values


def beside_clean(rule: str, fault: str, share: float, gated: bool, measure: str) -> float:
    """Median ratio to the same seed's clean pool."""
    clean = of_pool(rule, "", 0.0, True, measure)
    return float(np.median([bad / clean[seed] for seed, bad in of_pool(rule, fault, share, gated, measure).items()]))


def tables_of_bad_tosses(first: str) -> list[list[list[str]]]:
    """Cells of the tables whose heads begin so, head and all."""
    found = re.findall(rf"^\| {first} \|.*?\n\n", section("Bad tosses in the pool") + "\n", re.DOTALL | re.MULTILINE)
    lines = ([re.sub(r"[*%]", "", line).strip("|").split("|") for line in table.strip().splitlines()] for table in found)
    return [[[cell.strip() for cell in line] for line in table if not line[0].startswith("-")] for table in lines]


WORST = ("rotation", "vertices", "position", "penetration")


def test_bad_tosses_cost_what_the_page_says() -> None:
    (table,) = tables_of_bad_tosses("bad")
    faults = {row["fault"] for row in rows("robustness") if row["fault"]}
    assert len(faults) == 6
    assert len(table) == 7
    for share, gates, *numbers in table[1:]:
        for measure, number in zip(WORST, numbers, strict=True):
            pool = (float(share) / 100.0, gates == "with", measure)
            worst = max(beside_clean("representative", fault, *pool) for fault in faults)
            assert worst == pytest.approx(float(number), abs=0.0051), (share, gates, measure)


def test_each_fault_costs_what_the_page_says() -> None:
    first, second = tables_of_bad_tosses("fault")
    assert len(first) == len(second) == 8

    def said(measure: str, digits: int, fault: str) -> str:
        pool = (0.05, True) if fault else (0.0, True)
        median = f"{np.median([*of_pool('representative', fault, *pool, measure).values()]):.{digits}f}"
        return f"{median} ({beside_clean('representative', fault, *pool, measure):.2f}" if fault else median

    for line, other in zip(first[1:], second[1:], strict=True):
        assert line[0] == other[0]
        fault = line[0].partition(":")[0].replace("none", "")
        numbers = [said(measure, 1, fault) for measure in ("rotation", "vertices", "position")]
        assert [cell.partition(")")[0] for cell in line[3:]] == numbers, line
        assert re.split(r"[;)]", other[1])[0] == said("penetration", 2, fault), other
        if fault:
            shares = [
                np.mean([*of_pool("representative", fault, 0.05, gated, measure).values()])
                for gated, measure in ((True, "gate_hits"), (True, "selected_bad"), (False, "selected_bad"))
            ]
            assert [float(cell) for cell in (*line[1:3], other[2])] == pytest.approx(100.0 * np.array(shares), abs=0.51)
            ratios = [beside_clean("representative", fault, 0.05, False, measure) for measure in WORST]
            assert [float(cell) for cell in other[3:]] == pytest.approx(ratios, abs=0.0051), other


def test_bad_tosses_cost_every_rule_what_the_page_says() -> None:
    of_rules, counted = tables_of_bad_tosses("rule"), 0
    for share, table in zip((0.05, 0.05, 0.1, 0.1), of_rules, strict=True):
        rule = ""
        for name, gates, *cells in table[1:]:
            rule = name or rule
            for fault, cell in zip(table[0][2:], cells, strict=True):
                pool = (rule, fault, share, gates == "with")
                bad, *ratios = (float(number) for number in cell.split(","))
                assert bad == pytest.approx(100.0 * np.mean([*of_pool(*pool, "selected_bad").values()]), abs=0.51), pool
                assert ratios == pytest.approx([beside_clean(*pool, name) for name in ("position", "vertices")], abs=0.0051)
                counted += 1
    assert counted == 2 * 5 * 2 * 6


def test_the_tables_of_false_alarms_are_those_of_their_rows() -> None:
    found = rows("gate_false_alarms")
    text = (DOCS / "explanation/data.md").read_text().partition("## What the quality checks reject")[2]
    rejected, tosses = (sum(int(row[name]) for row in found) for name in ("rejected", "tosses"))
    assert f"In one run {rejected} of {tosses:,} tosses ({100.0 * rejected / tosses:.2f} %)" in text
    tables = re.findall(r"^\| (?:body|rate, noise) \|.*?\n\n", text, re.DOTALL | re.MULTILINE)
    bodies, faults = (
        [[cell.strip() for cell in line.strip("|").split("|")] for line in table.strip().splitlines()] for table in tables
    )
    for body, *cells in bodies[2:]:
        own = [row for row in found if row["body"] == body.replace(" ", "_")]
        assert cells == [", ".join(row["rejected"] for row in own if f"{row['rate']} Hz" == rate) for rate in bodies[0][1:]]
    for cell, *shares in faults[2:]:
        own = [row for row in found if f"{row['rate']} Hz, {float(row['noise']):g} times" == cell]
        assert len(own) == len(bodies) - 2 == 9
        means = [100.0 * float(np.mean([float(row[fault]) for row in own])) for fault in faults[0][1:]]
        assert [float(share.removesuffix(" %")) for share in shares] == pytest.approx(means, abs=0.51), cell


@pytest.mark.slow
def test_the_tables_of_ways_to_throw_are_those_of_the_stored_rows() -> None:
    page = (DOCS / "reference" / "ways_to_throw.md").read_text()
    texts = ("world", "rule")
    for name in ("designed_throws", "thrown_bodies/brick", "thrown_bodies/wedge"):
        stored: list[Row] = [
            {field: cell if field in texts else float(cell) for field, cell in row.items() if cell} for row in rows(name)
        ]
        heading, tables = page_of_throws(stored).strip().split("\n", 1)
        assert tables in page, name
        assert (heading in page) == (name == "designed_throws")  # the others have headings with the body
    blocks = 0
    for table in re.findall(r"^\| throws \| (?:median|designed).*?\n\n", section("Designed throws"), re.DOTALL | re.MULTILINE):
        for block in re.findall(r"^\| \d+ \|.*?(?=^\| \d+ \||\Z)", table.strip() + "\n", re.DOTALL | re.MULTILINE):
            assert block in page
            blocks += 1
    assert blocks == 2 + 4 + 2


def test_the_sentence_on_designed_throws_has_the_numbers_of_its_table() -> None:
    said = re.search(r"after 8 by ([\d.]+)° \((.*?)\) in.*?, ([\d.]+) points \((.*?)\) in.*? and ([\d.]+) mm \((.*?)\)",
                     PAGE.read_text(), re.DOTALL)  # fmt: skip
    table = re.search(r"designed minus.*?\n\| 8 \|(.*?)\n\| 12 \|", section("Designed throws"), re.DOTALL)
    assert said
    assert table
    for name, value, ends in zip(
        ("rotation °", "position %", "vertices, mm"), said.groups()[::2], said.groups()[1::2], strict=True
    ):
        near, far = ends.split(" to ")
        line = next(line for line in table[1].splitlines() if f" {name} |" in line)
        assert f"**-{value}** (-{far} to -{near})" in line, name


FITS = {
    "the cube as described": ("described", ""),
    "two sets": ("two", ""),
    "two sets, friction moved": ("two", "shared_"),
    "one set, noise learned": ("noise", ""),
}
"""Of the table of one set of vertices: the arm, and what its columns begin with."""


def test_the_tables_of_one_set_of_vertices_are_medians_of_their_rows() -> None:
    found, counted = rows("impact_noise"), 0
    text = section("One set of vertices and the noise of impacts")
    for table, judges in zip(
        re.findall(r"^\| selected \| rule \| fit \|.*?\n\n", text + "\n", re.DOTALL | re.MULTILINE), ("third", "first")
    ):
        for line in table.strip().splitlines()[2:]:
            size, rule, fit, *numbers = (cell.strip() for cell in line.strip("|").split("|"))
            arm, prefix = FITS[fit]
            rule = rule or ("" if arm == "described" else "all")
            key = (judges, arm, rule, "0" if size in ("", "all") else size)
            own = [row for row in found if (row["judges"], row["arm"], row["rule"], row["size"]) == key]
            assert own, line
            names = (prefix + "position", prefix + "rotation", "vertices", "friction", "mujoco_position", "mujoco_rotation")
            for name, number in zip(names, numbers, strict=False):
                if number:
                    digits = len(number.partition(".")[2])
                    assert float(np.median([float(row[name]) for row in own])) == pytest.approx(
                        float(number), abs=0.51 * 10.0**-digits
                    ), (line, name)
                    counted += 1
    assert counted > 100


def test_the_tables_of_bodies_that_bounce_are_medians_of_their_rows() -> None:
    found, counted = rows("bounce"), 0
    fits = {"two sets": "two sets", "one set, noise learned": "plain", "and restitution, merged": "bounce-merged"}
    fits |= {"the same, with rebounds": "rebounds", "with rebounds, plain differences": "differences"}
    fits |= {"with rebounds, corrected by motions": "motions"}
    columns = {
        "cube": ("position", "rotation", "penetration", "vertices", "friction", "restitution"),
        "square": ("position", "rotation", "friction", "restitution"),
    }
    tables = re.findall(r"^\| selected \| fit \|.*?\n\n", section("Bodies that bounce"), re.DOTALL | re.MULTILINE)
    for (body, names), table in zip(columns.items(), tables, strict=True):
        for line in table.strip().splitlines()[2:]:
            size, fit, *numbers = (cell.strip() for cell in line.strip("|").split("|"))
            key = (body, fits[fit], "0" if size == "all" else size)
            own = [row for row in found if (row["body"], row["arm"], row["size"]) == key]
            assert len(own) == (1 if size == "all" else 10), line
            for name, number in zip(names, numbers, strict=True):
                if number:
                    digits = len(number.partition(".")[2])
                    median = float(np.median([float(row[name]) for row in own]))
                    assert median == pytest.approx(float(number), abs=0.51 * 10.0**-digits), (line, name)
                    counted += 1
    assert counted > 80


AGAINST = (
    "ours_position",
    "ours_rotation",
    "mujoco_position",
    "mujoco_rotation",
    "vertices",
    "friction",
    "fit_seconds",
    "memory",
)
HELD = ("shape_held", "shape_half_width", "friction_held", "friction_half_width")


def test_the_tables_against_system_identification_are_those_of_their_rows() -> None:
    found, text, counted = rows("against_sysid"), section("Against system identification with MuJoCo") + "\n", 0
    seeds = {row["seed"] for row in found}
    assert f"{len(seeds)} seed" in text
    for body, table in re.findall(r"^`(\w+)`[^|`]*:\n\n(\| tosses \| fitter \|.*?)\n\n", text, re.DOTALL | re.MULTILINE):
        heads, _, *lines = table.splitlines()
        measures, middle = (HELD, np.mean) if "held" in heads else (AGAINST, np.median)
        for line in lines:
            size, rule, *numbers = (cell.strip() for cell in line.strip("|").split("|"))
            own = [row for row in found if (row["body"], row["size"], row["rule"]) == (body, size, rule) and not row["failed"]]
            for name, number in zip(measures, numbers, strict=True):
                digits = len(number.partition(".")[2])
                value = float(middle([float(row[name]) for row in own]))
                assert value == pytest.approx(float(number), abs=0.51 * 10.0**-digits), (line, name)
                counted += 1
    assert counted >= 80


def test_the_differences_to_system_identification_are_those_of_the_stored_table() -> None:
    names = ("body", "rule", "minus", "measure")
    found = {(float(row["size"]), *(row[name] for name in names)): row for row in rows("against_sysid_differences")}
    text, counted = section("Against system identification with MuJoCo") + "\n", 0
    for table in re.findall(r"^\| body \| tosses \| begun \|.*?\n\n", text, re.DOTALL | re.MULTILINE):
        for line in table.strip().splitlines()[2:]:
            body, size, begun, *cells = (cell.strip() for cell in line.strip("|").split("|"))
            rule, minus = {"given": ("sysid", "ours"), "random": ("sysid-cold", "ours-cold")}[begun]
            for measure, cell in zip(AGAINST, cells, strict=False):
                row = found[float(size), body, rule, minus, measure]
                said = [float(number) for number in re.findall(r"[+-]?[0-9.]+", cell)]
                numbers = [float(row[name]) for name in ("difference", "low", "high")]
                assert said == pytest.approx(numbers[: len(said)], abs=0.051), (line, measure)
                counted += 1
    assert counted >= 16


def test_the_means_over_bodies_are_those_of_the_stored_correlations() -> None:
    table = re.search(
        r"^\| score \| loss \| rotation .*?\n\n", section("What foresees the error of a subset"), re.DOTALL | re.MULTILINE
    )
    assert table
    heads, _, *lines = ([cell.strip() for cell in line.strip("|").split("|")] for line in table[0].strip().splitlines())
    found = {(row["score"], row["outcome"]): row for row in rows("counterfactual_scores") if row["body"] == ALL_BODIES}
    assert len(lines) == len({score for score, _ in found}) == 15
    for score, *cells in lines:
        for outcome, cell in zip(heads[1:], cells, strict=True):
            numbers = [float(found[score, outcome][name]) for name in ("spearman", "low", "high")]
            said = [float(number) for number in re.findall(r"-?[0-9.]+", cell)]
            assert said == pytest.approx(numbers, abs=0.0051), (score, outcome)


def test_the_tables_of_stored_refits_are_those_of_their_correlations() -> None:
    text = (DOCS / "reference" / "subsets.md").read_text()
    for name in ("counterfactual_scores", "counterfactual_scores_near"):
        assert page_of(as_rows(name)).strip() in text


def test_the_stored_correlations_are_those_of_the_stored_refits() -> None:
    refits, stored = read_refits(ROWS / "counterfactuals.parquet"), rows("counterfactual_scores")
    assert (ROWS / "counterfactuals.parquet").stat().st_size < 4e6
    few = BootstrapConfig(resamples=10)
    found = [one for body in {row["body"] for row in refits}
             for one in correlations([row for row in refits if row["body"] == body], few)]  # fmt: skip
    made = {(row["body"], row["size"], row["outcome"], row["score"]): row for row in table_of(found, few)}
    assert len(made) == len(stored)
    for row in stored:
        one = made[row["body"], float(row["size"]), row["outcome"], row["score"]]
        assert (float(one["spearman"]), one["subsets"]) == pytest.approx(
            (float(row["spearman"]), float(row["subsets"])), abs=1e-5, nan_ok=True
        )
        assert not float(row["low"]) > float(row["spearman"]) > float(row["high"])


def as_rows(name: str) -> list[Row]:
    return [dict(row) for row in rows(name)]


@pytest.mark.parametrize(
    ("stored", "page"),
    [
        (AT_FIT, "rules_at_the_fit"),
        (BY_COUNTERFACTUALS, "rules_at_the_fit"),
        (FROM_THETA_0, "rules_from_theta_0"),
        (LITERATURE, "rules_of_the_literature"),
    ],
)
def test_the_tables_of_compared_rules_are_those_of_the_stored_rows(stored: tuple[str, str], page: str) -> None:
    made = pages_of(as_rows(stored[0]), as_rows(stored[1]), "random")
    assert made.strip() in (DOCS / "reference" / f"{page}.md").read_text()


def test_so_many_differences_of_rules_of_the_literature_are_certain() -> None:
    text, found = section("Which sets are best with the right noise and one geometry"), rows("literature/differences")
    table = re.search(r"^\| rule \| better than random.*?\n\n", text + "\n", re.DOTALL | re.MULTILINE)
    assert table
    _, _, *lines = table[0].strip().splitlines()
    for line in lines:
        rule, *cells = (cell.strip() for cell in line.strip("|").split("|"))
        for (minus, sign), numbers in zip(
            (("random", -1.0), ("random", 1.0), ("representative", 1.0)), (cells[0:2], cells[2:4], cells[4:6]), strict=True
        ):
            for size, number in zip((4.0, 8.0), numbers, strict=True):
                own = [row for row in found if (row["rule"], row["minus"], float(row["size"])) == (rule, minus, size)]
                certain = sum(min(sign * float(row["low"]), sign * float(row["high"])) > 0.0 for row in own)
                assert (str(certain) if own else "") == number, (line, minus, size)
    assert len(lines) == 6


def test_the_errors_of_rules_at_the_fit_are_means_of_the_stored_rows() -> None:
    text, found = section("Which sets are best with the right noise and one geometry"), rows("criteria_at_fit")
    table = re.search(r"^\| body \| rule \|.*?\n\n", text, re.DOTALL | re.MULTILINE)
    assert table
    columns = [(measure, size) for measure in ("mujoco_position", "mujoco_rotation") for size in ("4", "8", "16", "32")]
    _, _, *lines = table[0].strip().splitlines()
    assert len(lines) == 35
    for line in lines:
        body, rule, *cells = (cell.strip(" *") for cell in line.strip("|").split("|"))
        for (measure, size), cell in zip(columns, cells, strict=True):
            own = [float(row[measure]) for row in found if (row["body"], row["rule"], row["size"]) == (body, rule, size)]
            assert float(np.mean(own)) == pytest.approx(float(cell), abs=0.051), line


def worth_of(name: str, drawn: Sequence[Array] | None = None) -> dict[int, list[float]]:
    """By the size of a selected set, how many random tosses it predicts like: of bodies, judges, position and rotation.

    Args:
        name: of the stored rows.
        drawn: for each body which of its seeds the means are over; None for all of them once.
    """
    found, sizes = rows(name), np.array([4, 8, 16, 32])
    worth: dict[int, list[float]] = {4: [], 8: []}
    for place, body in enumerate(sorted({row["body"] for row in found})):
        own = [row for row in found if row["body"] == body]
        for measure in ("ours_position", "ours_rotation", "mujoco_position", "mujoco_rotation"):
            mean = {}
            for rule, wanted in (("random", sizes), ("representative", worth)):
                for size in wanted:
                    values = {int(row["seed"]): float(row[measure]) for row in own
                              if (row["rule"], row["size"]) == (rule, str(size))}  # fmt: skip
                    mean[rule, size] = float(np.mean([values[seed] for seed in (drawn[place] if drawn else values)]))
            errors = np.minimum.accumulate([mean["random", size] for size in sizes])
            for size, found_like in worth.items():
                like = np.interp(-mean["representative", size], -errors, np.log2(sizes), right=6.0)
                found_like.append(float(2.0**like))
    return worth


def worth_over_seeds(name: str) -> dict[int, tuple[float, float]]:
    """95 % intervals of the median worth over resampled seeds of each body."""
    rng = np.random.default_rng(0)
    drawn = [worth_of(name, list(rng.integers(10, size=(5, 10)))) for _ in range(200)]
    ends = {size: np.quantile([np.median(one[size]) for one in drawn], [0.025, 0.975]) for size in (4, 8)}
    return {size: (float(low), float(high)) for size, (low, high) in ends.items()}


@pytest.mark.slow
def test_selected_tosses_are_worth_as_many_random_ones_as_the_pages_say() -> None:
    worth = worth_of("criteria_at_fit")
    assert np.median(worth[4]) == pytest.approx(15.0, abs=0.5)
    assert np.median(worth[8]) == pytest.approx(26.0, abs=0.5)
    assert min(worth[4]) == pytest.approx(5.0, abs=0.5)
    assert sum(np.array(worth[4]) > 31.0) == 3
    assert sorted(worth[4])[-4] == pytest.approx(24.0, abs=0.5)
    assert min(worth[8]) > 9.5
    assert sum(np.array(worth[8]) > 31.0) == 6
    assert worth_over_seeds("criteria_at_fit") == {
        4: pytest.approx((11.0, 15.7), abs=0.5),
        8: pytest.approx((18.4, 64.0), abs=1.5),
    }


@pytest.mark.slow
def test_from_theta_0_too() -> None:
    worth = worth_of(FROM_THETA_0[0])
    assert np.median(worth[4]) == pytest.approx(13.0, abs=0.5)
    assert min(worth[4]) == pytest.approx(9.0, abs=0.5)
    assert sum(np.array(worth[4]) > 31.0) == 3
    assert sorted(worth[4])[-4] == pytest.approx(22.0, abs=0.5)
    assert sum(np.array(worth[8]) > 31.0) == 13
    assert min(worth[8]) == pytest.approx(12.0, abs=0.5)
    assert worth_over_seeds(FROM_THETA_0[0]) == {
        4: pytest.approx((11.0, 15.5), abs=0.5),
        8: pytest.approx((24.3, 64.0), abs=1.5),
    }
    told = re.search(
        r"^\| rule \| better than random \|.*?\n\n", section("And from theta_0, as in use"), re.DOTALL | re.MULTILINE
    )
    assert told
    _, _, *lines = told[0].strip().splitlines()
    assert len(lines) == 6
    for line in lines:
        rule, *cells = (cell.strip(" *") for cell in line.strip("|").split("|"))
        counts = []
        for minus, sign in (("random", -1.0), ("random", 1.0), ("representative", -1.0), ("representative", 1.0)):
            own = [row for row in rows(FROM_THETA_0[1]) if (row["rule"], row["minus"]) == (rule, minus)]
            own = [row for row in own if row["measure"].endswith(("position", "rotation"))]
            counts.append(
                str(sum(min(sign * float(row["low"]), sign * float(row["high"])) > 0.0 for row in own)) if own else ""
            )
        assert cells == counts, line


def certain_by_students(name: str, rule: str) -> int:
    """In how many means the rule is better than random by Student's t over the means of the seeds."""
    found = {(row["body"], row["size"], row["rule"], row["seed"]): row for row in rows(name)}
    cells, certain = {(body, size) for body, size, of, _ in found if of == "log-det"}, 0
    for body, size in cells:
        for measure in MEASURES:
            differences = np.array([float(found[body, size, rule, seed][measure]) - float(row[measure])
                                    for (*cell, seed), row in found.items() if cell == [body, size, "random"]])  # fmt: skip
            certain += float(ttest_1samp(differences, 0.0, alternative="less").pvalue) < 0.025
    return certain


def test_by_students_t_so_many_means_are_certain_as_the_page_says() -> None:
    told = re.search(r"in (\d+) of\s+80 means at the fit\s+and in (\d+) of 40 from theta_0,\s+`log-det` in (\d+) and (\d+)\.",
                     PAGE.read_text())  # fmt: skip
    assert told
    counts = [
        certain_by_students(name, rule) for rule in ("representative", "log-det") for name in (AT_FIT[0], FROM_THETA_0[0])
    ]
    assert list(map(int, told.groups())) == counts


def test_differences_of_networks_are_medians_and_ranges_of_five_seeds() -> None:
    text, counted = section("Networks"), 0
    for name, table in zip(
        ("networks", "networks_published", "networks_published"),
        re.findall(r"^\| rotation °? ?of \| less \|.*?\n\n", text, re.DOTALL | re.MULTILINE),
        strict=True,
    ):
        heads, _, *lines = ([cell.strip(" `") for cell in line.strip("|").split("|")] for line in table.strip().splitlines())
        own = {(row["model"], row["size"], row["rule"], row["seed"]): float(row["rotation"]) for row in rows(name)}
        models = [head for head in heads if head in ("deep", "deepvertex", "end_to_end")]
        for place, line in enumerate(lines):
            rule, minus = lines[place - place % 3][:2]
            for model, cell in zip(models, line[-len(models) :], strict=True):
                if cell != "—":
                    size = ("8", "16", "32")[place % 3]
                    each = [own[model, size, rule, str(seed)] - own[model, size, minus, str(seed)] for seed in range(5)]
                    said = [float(number) for number in re.findall(r"[+-][0-9.]+", cell)]
                    assert said == pytest.approx([np.median(each), min(each), max(each)], abs=0.051), (line, model)
                    counted += 1
    assert counted == 114


def test_the_fourth_sentence_says_where_log_det_is_ahead_of_the_default() -> None:
    told = re.search(r"at the fit it is better in (\d+) of 80, and worse in one, by ([\d.]+) points.*? ahead of `log-det` for "
                     r"certain in (\d+) of 40 means and behind in none.*? behind `log-det` in (\d+), all of position",
                     " ".join(PAGE.read_text().split()))  # fmt: skip
    assert told
    better, worse = (
        [row for row in rows(AT_FIT[1]) if sign * float(row[end]) > 0.0] for sign, end in ((-1, "high"), (1, "low"))
    )
    gains = [row for row in better if (row["rule"], row["minus"]) == ("representative", "random")]
    (lost,) = (row for row in worse if (row["rule"], row["minus"]) == ("representative", "random"))
    behind, ahead = ([row["measure"] for row in side if (row["rule"], row["minus"]) == ("log-det", "representative")]
                     for side in (worse, better))  # fmt: skip
    assert {measure.partition("_")[0] for measure in behind} == {"mujoco"}
    assert set(ahead) == {"ours_position"}
    assert [int(told[place]) for place in (1, 3, 4)] == [len(gains), len(behind), len(ahead)]
    assert float(lost["difference"]) == pytest.approx(float(told[2]), abs=0.051)


def test_errors_of_8_selected_tosses_are_larger_than_those_of_all_as_the_page_says() -> None:
    text = section("Which sets are best with the right noise and one geometry")
    told = re.search(r"In MuJoCo their errors are larger than its by(.*?)\. In our rollouts.*?larger by (.*?) on the square, "
                     r"and by\s+(\d+) % at most", text, re.DOTALL)  # fmt: skip
    assert told

    def excess(body: str, engine: str) -> list[float]:
        return [100.0 * (mean_of(body, "representative", f"{engine}_{kind}") / mean_of(body, "all", f"{engine}_{kind}") - 1.0)
                for kind in ("position", "rotation")]  # fmt: skip

    def mean_of(body: str, rule: str, measure: str) -> float:
        own = (row for row in rows(AT_FIT[0]) if (row["body"], row["rule"], row["size"]) == (body, rule, "8"))
        return float(np.mean([float(row[measure]) for row in own]))

    simulated = [excess(body, "mujoco") for body in ("slab", "wedge", "irregular", "square")]
    said = [float(number) for number in re.findall(r"\d+", told[1])]
    assert said == pytest.approx(np.concatenate(simulated).tolist(), abs=0.51)
    assert [float(number) for number in re.findall(r"\d+", told[2])] == pytest.approx(excess("square", "ours"), abs=0.51)
    others = max(max(excess(body, "ours")) for body in ("cube", "slab", "wedge", "irregular"))
    assert others == pytest.approx(float(told[3]), abs=0.51)


@pytest.mark.parametrize("stored", [AT_FIT, BY_COUNTERFACTUALS, FROM_THETA_0])
def test_the_stored_differences_are_those_of_the_stored_means(stored: tuple[str, str]) -> None:
    found = rows(stored[0])
    means = {(row["body"], float(row["size"]), row["rule"], row["seed"]): row for row in found}
    seeds = {row["seed"] for row in found}
    for row in rows(stored[1]):
        own, others = ([float(means[row["body"], float(row["size"]), rule, seed][row["measure"]]) for seed in sorted(seeds)]
                       for rule in (row["rule"], row["minus"]))  # fmt: skip
        differences = np.array(own) - np.array(others)
        assert float(row["difference"]) == pytest.approx(float(differences.mean()), abs=0.02), row
        assert float(row["seeds_better"]) == (differences < 0.0).sum()
        assert float(row["seeds"]) == len(seeds)
        assert (len(seeds) < LEAST_SEEDS) == np.isnan(float(row["low"]))


def test_the_frictions_of_the_rules_page_are_medians_of_the_stored_rows() -> None:
    table = re.search(r"^\| selected at the fit \|.*?\n\n", (DOCS / "rule.md").read_text(), re.DOTALL | re.MULTILINE)
    assert table
    heads, _, *lines = ([cell.strip(" *") for cell in line.strip("|").split("|")] for line in table[0].strip().splitlines())
    assert len(lines) == 7
    found = [row for row in rows("criteria_at_fit") if row["body"] == "cube"]
    for name, *cells in lines:
        for size, cell in zip((head.split()[-1] for head in heads[1:]), cells, strict=True):
            own = [row for row in found if (row["rule"], row["size"]) == (name.split(",")[0], size)]
            assert float(np.median([float(row["friction"]) for row in own])) == pytest.approx(float(cell), abs=0.00051), name


KNOWN_SHAPES = {
    "published initialisation": "published",
    "1 mm off, said 1": "off 1 mm, said 1",
    "3 mm off, said 3": "off 3 mm, said 3",
    "3 mm off, said 1": "off 3 mm, said 1",
    "1 mm off, said 1, representative": "1 mm, representative",
    "1 mm off, said 1, longest": "1 mm, longest",
    "as described, 1 mm off": "described, off 1 mm",
    "as described, 3 mm off": "described, off 3 mm",
    "1 mm off, friction 1.5 times too high": "1 mm, friction x 1.5",
}
OF_KNOWN_SHAPES = ("position", "rotation", "mujoco_position", "mujoco_rotation", "vertices_mm")


def test_the_table_of_known_shapes_is_the_mean_of_the_stored_rows() -> None:
    found: dict[tuple[str, str, str], list[list[float]]] = defaultdict(list)
    for row in rows("models/known_shape"):
        found[row["body"], row["size"], row["arm"]].append([float(row[measure]) for measure in OF_KNOWN_SHAPES])
    page = (DOCS / "explanation/models.md").read_text().partition("## A shape that is known")[2].partition("## Bounce")[0]
    lines = [line.strip("|") for line in page.splitlines() if line.startswith("| ")][2:]
    said = [[cell.strip() for cell in re.sub(r"[*`]", "", line).split("|")] for line in lines]
    for body, size, description, *means in said:
        own = found[body, size.replace("—", "0"), KNOWN_SHAPES[description]]
        assert len(own) == 10
        assert [float(mean) for mean in means] == pytest.approx(np.mean(own, axis=0), abs=0.051), (body, size, description)
    assert len(said) == 39
