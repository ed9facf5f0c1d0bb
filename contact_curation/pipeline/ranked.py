"""The result of a ranking: the manifest, tables, a figure, and diagnostics of the selected set."""

import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from datetime import UTC, datetime
from functools import cached_property
from html import escape
from importlib.util import find_spec
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from contact_curation.dashboard.figures.ranking import RankingPicture, ranking_figure, save_ranking_figure
from contact_curation.errors import MissingDependencyError
from contact_curation.information.curation import SUFFICIENT_EPSILON, Curation
from contact_curation.information.diagnostics import block_shares
from contact_curation.motion.toss import NANOSECONDS
from contact_curation.pipeline.division import DUPLICATE, HELD_OUT
from contact_curation.pipeline.pool import TossPool
from contact_curation.pipeline.reading import ReadingConfig
from contact_curation.pipeline.tosses import CHECK_SAYS, Tosses, read_tosses
from contact_curation.pipeline.wording import counted, counted_tosses, in_brackets, nothing_found, plain_json
from contact_curation.storage.export.selected import changed_inputs, ranked_recordings
from contact_curation.storage.manifest.file import FORMATS, provenance_of, write_manifest
from contact_curation.storage.manifest.manifest import Manifest, ManifestRow
from contact_curation.storage.outputs import CSV
from contact_curation.storage.saved_path import saved_path

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SELECTED, NOT_SELECTED = "selected", "not selected"
LISTED = 10
"""Tosses of a kind that a table shows."""

COLUMNS = ("rank", "toss", "file", "time (UTC)", "lasts [s]", "info [%]", "gain", "why")
"""info: the toss's share of the information of all ranked tosses, by the trace of its Fisher matrix."""
TEXTS = ("toss", "file", "why")

NUMBER = re.compile(r"-?\d+(\.\d+)?(e[-+]?\d+)?")

HALF = 0.5
"""Share of rejected tosses from which on a recording is named, or the command that says what is wrong."""

EARLIEST = 1e8
"""[s] Clocks that count from the start of a machine are below, those that count from 1970 above."""


@dataclass(frozen=True, eq=False)
class RankedTosses:
    """A ranking of tosses: which are selected, and why. `print` shows a table and the evidence, a notebook a table.

    Attributes:
        manifest: every toss with its place; what was rejected, and why.
        curation: the ranking and its evidence; None where no toss could be ranked.
        pool: every toss once, as it was scored.
        warnings: what is wrong with the inputs, one line each.
        source: the recordings, or their tosses where they are in memory.
        reading: how recordings become tosses.
        reasons: why each ranked toss is selected or not, by id.
    """

    manifest: Manifest
    curation: Curation | None
    pool: TossPool
    warnings: tuple[str, ...]
    source: tuple[Path, ...] | Tosses
    reading: ReadingConfig
    reasons: Mapping[str, str] = field(default_factory=dict)

    @property
    def selected_ids(self) -> tuple[str, ...]:
        """Ids of the selected tosses, best first."""
        return tuple(row.toss_id for row in self.manifest.selected)

    @property
    def ids(self) -> tuple[str, ...]:
        """Ids of all ranked tosses, best first."""
        return tuple(row.toss_id for row in self.ranked_rows)

    @cached_property
    def selected(self) -> Tosses:
        """The selected tosses, best first; those of recordings that were not in memory are read once more."""
        if isinstance(self.source, Tosses):
            return self.source.only(self.selected_ids)
        meant = ranked_recordings(self.manifest.rows)
        tosses = read_tosses(self.source, self.reading, only=self.selected_ids, meant=meant).only(self.selected_ids)
        changed = changed_inputs((row, tosses.taken[row.toss_id].seen.origin) for row in self.manifest.selected)
        return replace(tosses, warnings=(*tosses.warnings, *changed))

    @property
    def ranked_rows(self) -> tuple[ManifestRow, ...]:
        """The manifest rows of the ranked tosses, best first."""
        return tuple(row for row in self.manifest.rows if row.rank is not None)

    @property
    def information(self) -> float:
        """The trace of the summed Fisher matrices of all ranked tosses."""
        return sum(row.trace or 0.0 for row in self.ranked_rows)

    @property
    def outcomes(self) -> dict[str, int]:
        """Counts of tosses: selected, not selected, and rejected by their first reason."""
        counts = Counter(_outcome(row) for row in self.manifest.rows)
        first = (SELECTED, NOT_SELECTED)
        others = sorted((name for name in counts if name not in first), key=lambda name: (-counts[name], name))
        return {name: counts[name] for name in (*first, *others)}

    @property
    def rejected_by_input(self) -> dict[str, dict[str, int]]:
        """Counts of rejected tosses by recording and first reason; a bad day of a rig is seen in it."""
        counts: dict[str, Counter[str]] = {one.path: Counter() for one in self.manifest.run.inputs}
        for row in self.manifest.rows:
            if row.rank is None:
                counts.setdefault(self.manifest.given_input(row), Counter())[_outcome(row)] += 1
        return {path: dict(sorted(found.items(), key=lambda one: (-one[1], one[0]))) for path, found in counts.items()}

    def evidence(self) -> Curation:
        """The curation.

        Raises:
            NothingFoundError: no toss could be ranked.
        """
        if self.curation is None:
            paths = [one.path for one in self.manifest.run.inputs]
            found = f"no toss that could be ranked{self._typical_reason()}{in_brackets(self.outcomes)}"
            from contact_curation.pipeline.diagnosis.explained import explained  # a diagnosis needs many modules

            raise explained(nothing_found(paths, self.warnings, found, CHECK_SAYS), paths, self.reading)
        return self.curation

    def save(self, path: str | Path, *, overwrite: bool = False) -> None:
        """Writes the manifest, whole or not at all: Parquet, CSV or JSON, by the ending of `path`.

        Args:
            path: of the file.
            overwrite: whether to replace any file that is there; without it, only an earlier manifest, score or throws file is
                replaced.

        Raises:
            InvalidValueError: another ending, a file that must not be replaced, or the file cannot be written.
        """
        path = saved_path(path, FORMATS, overwrite=overwrite)
        if path.suffix == CSV:
            saved_path(provenance_of(path), FORMATS, overwrite=overwrite)
        write_manifest(self.manifest, path)

    def to_arrow(self) -> Any:
        """The manifest as a pyarrow table: a row per toss, the columns of `ManifestRow`."""
        from pyarrow import parquet

        return parquet.read_table(BytesIO(FORMATS[".parquet"].write(self.manifest)))

    def to_pandas(self) -> Any:
        """The manifest as a pandas data frame, with the same columns.

        Raises:
            MissingDependencyError: pandas is not installed.
        """
        if find_spec("pandas") is None:
            raise MissingDependencyError("pandas", "pip install pandas, or take to_arrow()")
        return self.to_arrow().to_pandas()

    def plot(self) -> "Figure":
        """Draws the scores and how well the selected tosses represent the pool, as a matplotlib figure."""
        return ranking_figure(self._picture())

    def save_figure(self, path: str | Path, *, overwrite: bool = False) -> None:
        """Writes the same figure to a PNG file.

        Args:
            path: of the file.
            overwrite: whether to replace any file that is there; without it, only an earlier figure is replaced.

        Raises:
            InvalidValueError: another ending, a file that must not be replaced, or the file cannot be written.
        """
        save_ranking_figure(self._picture(), saved_path(path, (".png",), overwrite=overwrite))

    def document(self) -> dict[str, Any]:
        """Everything, as one object for JSON; numbers that are not finite are None."""
        document = {
            **{name: value for name, value in asdict(self.manifest.run).items() if name != "command"},
            "outcomes": self.outcomes,
            "rejected": [{"input": path, "reasons": reasons} for path, reasons in self.rejected_by_input.items()],
            "diagnostics": dict(self.manifest.diagnostics),
            "warnings": self.warnings,
            "tosses": [asdict(row) for row in self.manifest.rows],
        }
        return {name: plain_json(value) for name, value in document.items()}

    def __str__(self) -> str:
        return "\n".join(_lines(self))

    def __repr__(self) -> str:
        return f"<{len(self.selected_ids)} of {len(self.manifest.rows)} tosses selected by {self.manifest.run.criterion}>"

    def _repr_html_(self) -> str:
        return _html(self)

    def _typical_reason(self) -> str:
        """The most frequent reason to be rejected, as the median toss has it: ``, mostly for depth: found 0.01 m, ...``."""
        first = [row.reasons[0] for row in self.manifest.rows if row.reasons]
        if not first:
            return ""
        name = Counter(reason.partition(":")[0] for reason in first).most_common(1)[0][0]
        alike = sorted((reason for reason in first if reason.startswith(name)), key=_first_number)
        return f", mostly for {alike[len(alike) // 2]}"

    def _picture(self) -> RankingPicture:
        curation, run = self.evidence(), self.manifest.run
        selected = set(self.selected_ids)
        own = block_shares([toss.informations[0] for toss in self.pool.rankable if toss.seen.toss_id in selected])
        return RankingPicture(
            title=f"{len(self.ids)} tosses ranked by {run.criterion} ({run.estimator}), {len(selected)} selected",
            criterion=run.criterion,
            scores=np.array([row.score for row in self.ranked_rows], dtype=float),
            gains=np.array([row.marginal_gain for row in self.ranked_rows], dtype=float),
            selected=len(selected),
            spectrum=curation.spectrum,
            epsilon=curation.epsilon,
            shares={share.name: (share.share, part.share) for share, part in zip(curation.block_shares, own)},
            outcomes=tuple(self.outcomes.items()),
        )


def _first_number(reason: str) -> float:
    found = NUMBER.search(reason)
    return float(found[0]) if found else 0.0


def _outcome(row: ManifestRow) -> str:
    if row.rank is None:
        return row.reasons[0].partition(":")[0]
    return SELECTED if row.selected else NOT_SELECTED


def _lines(ranked: RankedTosses) -> Iterator[str]:
    """For people: the best tosses, where all tosses went, and what to think of the selected set."""
    yield from _table(ranked)
    yield ""
    yield from _totals(ranked)
    yield ""
    yield from _evidence(ranked)


def _html(ranked: RankedTosses) -> str:
    """The best tosses, as a table."""
    head = "".join(f"<th>{escape(name)}</th>" for name in COLUMNS)
    cells = _cells(ranked, ranked.ranked_rows[:LISTED])
    body = "".join("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in cells)
    totals = "; ".join(f"{count} {escape(name)}" for name, count in ranked.outcomes.items())
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table><p>{totals}</p>"


def _table(ranked: RankedTosses) -> Iterator[str]:
    """The best tosses, and those that were rejected."""
    rejected = [row for row in ranked.manifest.rows if row.rank is None]
    rows = [COLUMNS, *_cells(ranked, (*ranked.ranked_rows[:LISTED], *rejected[:LISTED]))]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        cells = zip(row, widths, COLUMNS, strict=True)
        yield "  ".join(cell.ljust(width) if name in TEXTS else cell.rjust(width) for cell, width, name in cells).rstrip()
    for left, name in ((len(ranked.ranked_rows) - LISTED, "ranked"), (len(rejected) - LISTED, "rejected")):
        if left > 0:
            yield f"and {left} more {name}: --out FILE or --json lists all"


def _files(rows: Sequence[ManifestRow]) -> dict[str, str]:
    """Inputs by their names, and as they are where several have one name."""
    inputs = {row.input for row in rows}
    names = Counter(Path(one).name for one in inputs)
    return {one: Path(one).name if names[Path(one).name] == 1 else one for one in inputs}


def _cells(ranked: RankedTosses, rows: Sequence[ManifestRow]) -> list[tuple[str, ...]]:
    """The columns of some of its tosses."""
    files = _files(ranked.manifest.rows)
    return [_cells_of(ranked, row, files[row.input]) for row in rows]


def _cells_of(ranked: RankedTosses, row: ManifestRow, file: str) -> tuple[str, ...]:
    why = ranked.reasons.get(row.toss_id, "") if row.rank is not None else f"rejected: {'; '.join(row.reasons)}"
    return (
        "" if row.rank is None else str(row.rank),
        row.toss_id,
        file,
        time_of_day(row.first_stamp_ns),
        f"{row.duration:.2f}",
        "" if row.rank is None else f"{100.0 * (row.trace or 0.0) / (ranked.information or 1.0):.1f}",
        "" if row.marginal_gain is None else f"{row.marginal_gain:.4g}",
        why,
    )


def time_of_day(stamp_ns: int) -> str:
    """When a toss began, in UTC; seconds for stamps that do not count from 1970."""
    seconds = stamp_ns / NANOSECONDS
    return f"{seconds:.2f} s" if seconds < EARLIEST else datetime.fromtimestamp(seconds, UTC).strftime("%H:%M:%S")


def _totals(ranked: RankedTosses) -> Iterator[str]:
    rows, run = ranked.manifest.rows, ranked.manifest.run
    scored = ranked.ranked_rows
    transitions, not_scored = (sum(getattr(row, name) or 0 for row in scored) for name in ("transitions", "not_scored"))
    where, selected = counted(len(run.inputs), "input"), ranked.outcomes[SELECTED]
    share = 100.0 * sum(row.trace or 0.0 for row in ranked.manifest.selected) / (ranked.information or 1.0)
    chosen = f"{selected} selected, which hold {share:.0f} % of the information"
    yield f"{counted_tosses(len(rows))} of {where}: {len(scored)} ranked by {run.criterion}, {chosen}"
    if not ranked.outcomes[NOT_SELECTED]:
        yield "every toss that could be ranked is selected: there are no more than were asked for"
    yield f"scored with {run.estimator} at {run.parameters}: {transitions} transitions, {not_scored} not solved"
    if run.influence_bound != np.inf:
        yield f"losses above {run.influence_bound:.4g} count as that much"
    rejected = dict(list(ranked.outcomes.items())[2:])
    yield from (f"rejected: {count} ({name})" for name, count in rejected.items())
    bad = sum(count for name, count in rejected.items() if name not in (HELD_OUT, DUPLICATE))
    if bad > HALF * (bad + len(scored)):
        yield f"{bad} of {counted_tosses(bad + len(scored))} cannot be used: `contact-curation check` says why"
    yield from _worst_inputs(ranked)
    if ranked.warnings:
        yield f"warnings: {len(ranked.warnings)}"


def _worst_inputs(ranked: RankedTosses) -> Iterator[str]:
    """The recordings with the largest shares of rejected tosses, where there are several and some lost half of theirs."""
    tosses = Counter(map(ranked.manifest.given_input, ranked.manifest.rows))
    rejected = {path: reasons for path, reasons in ranked.rejected_by_input.items() if reasons and len(tosses) > 1}
    shares = {path: sum(reasons.values()) / tosses[path] for path, reasons in rejected.items()}
    worst = sorted((path for path, share in shares.items() if share >= HALF), key=lambda path: -shares[path])
    for path in worst[:LISTED]:
        yield f"rejected of {path}: {sum(rejected[path].values())} of {tosses[path]}{in_brackets(rejected[path])}"
    if len(worst) > LISTED:
        yield f"and {len(worst) - LISTED} more recordings lost half of their tosses: --json counts all"


def _evidence(ranked: RankedTosses) -> Iterator[str]:
    curation = ranked.evidence()
    enough = "no number is" if curation.sufficient_k is None else f"{curation.sufficient_k} are"
    yield f"epsilon {curation.epsilon:.3g} per toss, {curation.raw_epsilon:.3g} in all, on {curation.dimension} directions"
    yield f"tosses of this ranking that come within epsilon {SUFFICIENT_EPSILON:g} of the pool: {enough} enough"
    per_toss, per_transition = curation.efficiency, curation.frame_efficiency
    yield (
        f"D-efficiency {per_toss.determinant:.3g} per toss, {per_transition.determinant:.3g} per transition; "
        f"E-efficiency {per_toss.smallest:.3g} per toss (1 is the average toss)"
    )
    shift = curation.optimum_shift
    yield (
        f"the estimate from the selected tosses is {shift.distance:.3g} from the full-data estimate, "
        f"half of all random subsets of the same size are within {shift.at_random:.3g} (1 is the scatter of single tosses)"
    )
    certificate = curation.ranking.certificate
    if certificate:
        yield (
            f"certificate: D-efficiency at least {certificate.subset:.3g} of the best set of that size, "
            f"{certificate.kiefer_wolfowitz:.3g} of the best weighting"
        )
    gram = curation.selected_gram
    if gram:
        yield (
            f"Gram matrix of the selected scores: eigenvalues {gram.smallest:.3g} to {gram.largest:.3g}, rank {gram.rank}, "
            f"effectively {gram.effective_rank:.3g}"
        )
    shares = ", ".join(f"{share.name} {100.0 * share.share:.1f} %" for share in curation.block_shares)
    yield f"share of the trace: {shares}"
    yield from (f"careful: {line}" for line in curation.warnings)
