"""`rank INPUT...`: how much each toss teaches, which to keep, and why."""

import argparse
import os
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from contact_curation import __version__
from contact_curation.cli.options.output_paths import check_outputs
from contact_curation.cli.progress import Progress
from contact_curation.cli.rank.dashboard import RankDashboard, add_dashboard_options, dashboard_of
from contact_curation.cli.rank.options import RankConfig, add_rank_options, rank_config
from contact_curation.cli.rank.report import RankReport, diagnostics_of, json_report, picture_of, print_report
from contact_curation.cli.report import nothing_found, print_json, warn
from contact_curation.dashboard.figures.ranking import save_ranking_figure
from contact_curation.information.curation import Curation, curate_particles
from contact_curation.information.diagnostics import BlockShare, block_shares
from contact_curation.information.network.score_folder import ScoreFolder, coordinates_of
from contact_curation.information.pool import Pool, pool_of
from contact_curation.pipeline.held_out_tosses import held_out_tosses
from contact_curation.pipeline.pool_scoring import ScoredPool, score_pool
from contact_curation.pipeline.rank_rows import PoolToss, TossPool, manifest_rows, pool_of_inputs
from contact_curation.solver.compiled import load_kernel
from contact_curation.storage.manifest.file import write_manifest
from contact_curation.storage.manifest.manifest import Manifest
from contact_curation.storage.provenance import InputProvenance, RunProvenance
from contact_curation.storage.stores.factor_spool import FactorSpool


def add_options(parser: argparse.ArgumentParser) -> None:
    """Adds the verb's options to its parser."""
    parser.description = (
        "Scores every toss that passes the gates and is not held out, ranks them, and says what to think of the result. An "
        "input that cannot be read is a line on standard error, and the others are ranked; the exit status is 1 only if none "
        "could be."
    )
    add_rank_options(parser)
    add_dashboard_options(parser)
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Reads, scores, ranks, writes, and says what came out.

    Raises:
        InvalidValueError: nothing could be ranked, or an output cannot be written.
    """
    load_kernel()  # better said before tosses are read
    check_outputs(out=arguments.out, figure=_figure(arguments), recording=arguments.recording)
    config = rank_config(arguments)
    dashboard = dashboard_of(arguments, config)
    try:
        _rank(arguments, config, dashboard)
        if dashboard:
            dashboard.end()
    finally:
        if dashboard:
            dashboard.drop()
    return 0


def _rank(arguments: argparse.Namespace, config: RankConfig, dashboard: RankDashboard | None) -> None:
    jobs = min(arguments.jobs or os.cpu_count() or 1, len(arguments.inputs))
    with Progress("reading", "tosses") as progress:
        held_out = held_out_tosses(arguments.inputs, config.pool.reading, config.held_out, jobs, progress.advance)
    config = config.without(held_out)
    with FactorSpool() as spool, TemporaryDirectory(prefix="contact-curation-") as folder:
        config = config.with_exact_scores_in(Path(folder))
        with Progress("scoring", "tosses") as progress:
            scored = score_pool(arguments.inputs, config.pool, jobs, progress.advance, spool)
        pool = pool_of_inputs(scored.inputs)
        curation = curated(pool, config) if pool.rankable else None
        if dashboard and curation:
            dashboard.show(pool, curation)
    _report(arguments, config, scored, pool, curation, held_out.warnings)


def _report(
    arguments: argparse.Namespace,
    config: RankConfig,
    scored: ScoredPool,
    pool: TossPool,
    curation: Curation | None,
    missing: Sequence[str],
) -> None:
    """Writes what is wanted, and says what came out; InvalidValueError where nothing did."""
    warnings = (*(line for one in scored.inputs for line in one.reading.warnings), *pool.left_out, *missing)
    report = RankReport(manifest_of(arguments, config, scored, pool, curation), warnings, arguments.out, _figure(arguments))
    if report.out and report.manifest.rows:
        write_manifest(report.manifest, report.out)
    if curation is None:
        reasons = "; ".join(f"{count} {name}" for name, count in report.outcomes.items() if count)
        counted = f" ({reasons})" if reasons else ""
        raise nothing_found(arguments.inputs, warnings, f"no toss that could be ranked{counted}", "at least one")
    warn(warnings)
    if report.figure:
        save_ranking_figure(picture_of(report, curation, kept_shares(pool, curation)), report.figure)
    if arguments.json:
        print_json(json_report(report))
    else:
        print_report(report, curation)


def curated(pool: TossPool, config: RankConfig) -> Curation:
    """The ranking of the tosses that were scored at every theta."""
    tosses = sorted(pool.rankable, key=lambda toss: toss.seen.toss_id)
    particles = range(len(tosses[0].informations)) if tosses else ()
    return curate_particles([_particle(tosses, k, config.pool.score_folder) for k in particles], config.ranking)


def _particle(tosses: Sequence[PoolToss], theta: int, folder: ScoreFolder | None) -> Pool:
    """The pool at one theta; with a folder, the networks' exact scores stand in it for the sketched ones."""
    infos = [toss.informations[theta] for toss in tosses]
    if folder is None:
        return pool_of(infos)
    gram = folder.gram([toss.seen.digest for toss in tosses], infos[0].parameters_version)
    return pool_of(infos, network_scores=coordinates_of(gram))


def kept_shares(pool: TossPool, curation: Curation) -> tuple[BlockShare, ...]:
    """The parameter blocks' shares of the trace of the kept tosses, at the first theta."""
    kept = set(curation.ranking.selected_ids)
    return block_shares([toss.informations[0] for toss in pool.rankable if toss.seen.toss_id in kept])


def manifest_of(
    arguments: argparse.Namespace, config: RankConfig, scored: ScoredPool, pool: TossPool, curation: Curation | None
) -> Manifest:
    """Every toss, and how the ranking was made."""
    scorers = config.pool.scorers(scored.bounds, jobs=1)
    readings = [one.reading for one in scored.inputs]
    run = RunProvenance(
        criterion=config.ranking.criterion,
        estimator=config.pool.scoring.estimator.value,
        influence_bound=scored.bounds[0],
        model=arguments.model,
        parameters=config.parameters,
        parameters_version="+".join(scorer.version for scorer in scorers),
        seed=config.ranking.seed,
        package_version=__version__,
        command=arguments.command,
        inputs=tuple(InputProvenance(reading.path, reading.sha256, reading.warnings) for reading in readings),
    )
    rows = manifest_rows(pool, curation.ranking if curation else None)
    return Manifest(run, rows, diagnostics_of(curation, config.pool) if curation else {})


def _figure(arguments: argparse.Namespace) -> Path | None:
    """Where the figure goes: where it is wanted, or beside the manifest."""
    if arguments.no_figure or arguments.figure or arguments.out is None:
        return None if arguments.no_figure else arguments.figure
    return Path(arguments.out).with_suffix(".png")
