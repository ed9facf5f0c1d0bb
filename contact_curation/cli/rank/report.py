"""What `rank` says of its result: a table and some lines for people, one object for programs, a picture."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from contact_curation.cli.report import counted, counted_tosses
from contact_curation.dashboard.figures.ranking import RankingPicture
from contact_curation.information.curation import SUFFICIENT_EPSILON, Curation
from contact_curation.information.diagnostics import BlockShare
from contact_curation.pipeline.pool_scoring import PoolConfig
from contact_curation.storage.manifest.manifest import Diagnostic, Manifest, ManifestRow

LISTED = 10
"""Tosses that the table shows."""


@dataclass(frozen=True, eq=False)
class RankReport:
    """A ranking with all that came with it.

    Attributes:
        manifest: every toss.
        warnings: what is wrong with the inputs, one line each.
        out: where the manifest lies, if anywhere.
        figure: where the figure lies, if anywhere.
    """

    manifest: Manifest
    warnings: tuple[str, ...]
    out: Path | None
    figure: Path | None

    @cached_property
    def outcomes(self) -> dict[str, int]:
        """How many tosses went which way: kept, not kept, and by the first reason against the others."""
        counts = Counter(_outcome(row) for row in self.manifest.rows)
        first = ("kept", "ranked, not kept")
        others = sorted((name for name in counts if name not in first), key=lambda name: (-counts[name], name))
        return {name: counts[name] for name in (*first, *others)}


def _outcome(row: ManifestRow) -> str:
    if row.rank is None:
        return row.reasons[0].partition(":")[0]
    return "kept" if row.kept else "ranked, not kept"


def diagnostics_of(curation: Curation, config: PoolConfig) -> dict[str, Diagnostic]:
    """The evidence as the manifest carries it, and what the tosses were scored for."""
    certificate = curation.ranking.certificate
    scored: dict[str, Diagnostic] = {"form": config.form, "network": asdict(config.network) if config.of_weights else None}
    return {
        **scored,
        "dimension": curation.dimension,
        "epsilon": curation.epsilon,
        "raw_epsilon": curation.raw_epsilon,
        "sufficient_epsilon": SUFFICIENT_EPSILON,
        "sufficient_k": curation.sufficient_k,
        "spectrum": curation.spectrum.tolist(),
        "efficiency": asdict(curation.efficiency),
        "frame_efficiency": asdict(curation.frame_efficiency),
        "answer": asdict(curation.answer),
        "certificate": asdict(certificate) if certificate else None,
        "kept_gram": asdict(curation.kept_gram) if curation.kept_gram else None,
        "block_shares": {share.name: share.share for share in curation.block_shares},
        "warnings": list(curation.warnings),
    }


def json_report(report: RankReport) -> dict[str, Any]:
    """Everything, as one object."""
    manifest = report.manifest
    return {
        **{name: value for name, value in asdict(manifest.run).items() if name != "command"},
        "outcomes": report.outcomes,
        "diagnostics": dict(manifest.diagnostics),
        "warnings": report.warnings,
        "out": str(report.out) if report.out else None,
        "figure": str(report.figure) if report.figure else None,
        "tosses": [asdict(row) for row in manifest.rows],
    }


def print_report(report: RankReport, curation: Curation) -> None:
    """For people."""
    _print_table(report.manifest)
    print()
    _print_totals(report)
    print()
    _print_evidence(report, curation)
    for what, path in (("manifest", report.out), ("figure", report.figure)):
        if path:
            print(f"{what}: {path}")


def _print_table(manifest: Manifest) -> None:
    """The best tosses."""
    rows = [row for row in manifest.rows if row.rank is not None][:LISTED]
    width = max(len("toss"), *(len(row.toss_id) for row in rows))
    print(f"{'rank':>4}  {'toss':<{width}}  {'score':>10}  {'gain':>10}  {'trace':>10}  {'time [s]':>8}  frames  kept")
    for row in rows:
        numbers = "  ".join(f"{value:>10.4g}" for value in (row.score, row.marginal_gain, row.trace))
        kept = "yes" if row.kept else "no"
        print(f"{row.rank:>4}  {row.toss_id:<{width}}  {numbers}  {row.duration:>8.2f}  {row.frames:>6}  {kept}")


def _print_totals(report: RankReport) -> None:
    """Where all tosses went."""
    rows = report.manifest.rows
    ranked = sum(row.rank is not None for row in rows)
    scored = [row for row in rows if row.rank is not None]
    transitions, not_scored = (sum(getattr(row, name) or 0 for row in scored) for name in ("transitions", "not_scored"))
    run = report.manifest.run
    where = counted(len(run.inputs), "input")
    print(f"{counted_tosses(len(rows))} of {where}: {ranked} ranked by {run.criterion}, {report.outcomes['kept']} kept")
    if not report.outcomes["ranked, not kept"]:
        print("every toss that could be ranked is kept, for --top asks for no fewer")
    print(f"scored with {run.estimator} at {run.parameters}: {transitions} transitions, {not_scored} not solved")
    if run.influence_bound != np.inf:
        print(f"losses above {run.influence_bound:.4g} count as that much")
    for name, count in list(report.outcomes.items())[2:]:
        print(f"kept back: {count} ({name})")
    if report.warnings:
        print(f"warnings: {len(report.warnings)}")


def _print_evidence(report: RankReport, curation: Curation) -> None:
    """What to think of the kept set."""
    enough = "no number is" if curation.sufficient_k is None else f"{curation.sufficient_k} are"
    print(f"epsilon {curation.epsilon:.3g} per toss, {curation.raw_epsilon:.3g} in all, on {curation.dimension} directions")
    print(f"tosses of this ranking that come within epsilon {SUFFICIENT_EPSILON:g} of the pool: {enough} enough")
    per_toss, per_transition = curation.efficiency, curation.frame_efficiency
    print(
        f"D-efficiency {per_toss.determinant:.3g} per toss, {per_transition.determinant:.3g} per transition; "
        f"E-efficiency {per_toss.smallest:.3g} per toss (1 is the average toss)"
    )
    answer = curation.answer
    print(
        f"the kept tosses' answer is {answer.off:.3g} from that of all, as many at random about {answer.by_chance:.3g} "
        "(1 is what single tosses scatter by)"
    )
    certificate = curation.ranking.certificate
    if certificate:
        print(
            f"certificate: D-efficiency at least {certificate.subset:.3g} of the best set of that size, "
            f"{certificate.kiefer_wolfowitz:.3g} of the best weighting"
        )
    gram = curation.kept_gram
    if gram:
        print(
            f"Gram matrix of the kept scores: eigenvalues {gram.smallest:.3g} to {gram.largest:.3g}, rank {gram.rank}, "
            f"effectively {gram.effective_rank:.3g}"
        )
    shares = ", ".join(f"{share.name} {100.0 * share.share:.1f} %" for share in curation.block_shares)
    print(f"share of the trace: {shares}")
    for line in curation.warnings:
        print(f"careful: {line}")


def picture_of(report: RankReport, curation: Curation, kept_shares: Sequence[BlockShare]) -> RankingPicture:
    """What the figure shows; `kept_shares` are those of the kept tosses."""
    ranked = [row for row in report.manifest.rows if row.rank is not None]
    run = report.manifest.run
    return RankingPicture(
        title=f"{len(ranked)} tosses ranked by {run.criterion} ({run.estimator}), {report.outcomes['kept']} kept",
        criterion=run.criterion,
        scores=np.array([row.score for row in ranked], dtype=float),
        gains=np.array([row.marginal_gain for row in ranked], dtype=float),
        selected=report.outcomes["kept"],
        spectrum=curation.spectrum,
        epsilon=curation.epsilon,
        shares={share.name: (share.share, kept.share) for share, kept in zip(curation.block_shares, kept_shares)},
        outcomes=tuple(report.outcomes.items()),
    )
