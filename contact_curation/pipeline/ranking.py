"""Ranks recordings: scores all tosses, sets the held-out ones aside, ranks the others, and makes the manifest."""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

from contact_curation.configs import changed_fields
from contact_curation.contact.loss_config import DEFAULT_LOSS
from contact_curation.errors import InvalidValueError
from contact_curation.files import temporary_folder
from contact_curation.information.curation import Curation
from contact_curation.information.network.score_folder import ScoreFolder
from contact_curation.information.ranker import RankingConfig, criterion_named
from contact_curation.learning.evaluation.held_out import HeldOutRule
from contact_curation.pipeline.pool import TossPool, pool_of_inputs
from contact_curation.pipeline.ranked import RankedTosses
from contact_curation.pipeline.recordings.index import RecordingIndex
from contact_curation.pipeline.scoring import PoolConfig, ScoredPool, copies_scored, score_pool
from contact_curation.pipeline.tosses import Tosses
from contact_curation.pipeline.workers import Engine, LocalEngine, Progress, processes_for, silent
from contact_curation.solver.compiled import load_kernel
from contact_curation.storage.inputs.records import InputsConfig
from contact_curation.storage.manifest.manifest import Diagnostic, Manifest
from contact_curation.storage.manifest.ranked import ranked_manifest
from contact_curation.storage.provenance import InputProvenance, RunProvenance
from contact_curation.storage.stores.factor_spool import FactorSpool
from contact_curation.version import __version__


@dataclass(frozen=True, eq=False)
class RankConfig:
    """How recordings are ranked.

    Attributes:
        pool: how they become scored tosses.
        ranking: how these are ranked.
        model: what theta parameterises.
        parameters: where theta comes from, for the manifest.
        held_out: what is not ranked, and changes nothing of the ranking.
        jobs: how many processes at most; None for one per processor as far as starting them pays.
        engine: schedules the recordings; None for processes of this machine.
        index: what was read and scored before.
        command: the command line; empty when the library is called.
        warnings: of theta, one line each.
    """

    pool: PoolConfig
    ranking: RankingConfig = field(default_factory=RankingConfig)
    model: str = "polytope"
    parameters: str = ""
    held_out: HeldOutRule = field(default_factory=HeldOutRule)
    jobs: int | None = None
    command: tuple[str, ...] = ()
    engine: Engine | None = None
    index: RecordingIndex | None = None
    warnings: tuple[str, ...] = ()

    def with_exact_scores_in(self, folder: Path) -> "RankConfig":
        """The same configuration with a folder for exact network scores, where the criterion needs them."""
        wanted = criterion_named(self.ranking.criterion).reads_exact_scores(self.ranking)
        if not (wanted and self.pool.of_weights):
            return self
        return replace(self, pool=replace(self.pool, score_folder=ScoreFolder(folder)))


type Watcher = Callable[[TossPool, Curation], None]
"""Sees a ranking while the factors of its pool can still be read."""


def rank_tosses(
    source: Sequence[Path] | Tosses, config: RankConfig, progress: Progress = silent, watcher: Watcher | None = None
) -> RankedTosses:
    """Ranks the tosses of recordings.

    Args:
        source: recordings, of which no more than 64 tosses are in memory at a time; or tosses that were read.
        config: how.
        progress: hears how far it is.
        watcher: sees the ranking, where there is one.

    Raises:
        InvalidValueError: the rule holds out none of the tosses, or what is asked for does not go together.
        MissingDependencyError: the kernel was not built.
    """
    load_kernel()  # better said before tosses are read
    if config.engine and config.with_exact_scores_in(Path()).pool.score_folder:
        expected = (
            "one that needs no exact scores of a network's weights with --engine ray, which lie in a folder of one machine"
        )
        raise InvalidValueError("criterion", config.ranking.criterion, expected)
    if config.engine and not config.pool.device.is_cpu:
        raise InvalidValueError(
            "device", config.pool.device.name, "cpu with --engine ray, whose tasks are given processors only"
        )
    sources, jobs = (source.recordings(), 1) if isinstance(source, Tosses) else (source, processes_for(source, config.jobs))
    with FactorSpool() as spool, temporary_folder("rank") as folder:
        pool_config = config.with_exact_scores_in(folder).pool
        with progress("scoring", "tosses") as bar:
            engine, index = config.engine or LocalEngine(jobs), config.index and config.index.made()
            scored = score_pool(sources, pool_config, engine, bar.advance, spool, index, config.held_out)
        pool = pool_of_inputs(scored.inputs)
        curation = pool.curated(config.ranking, pool_config.score_folder) if pool.rankable else None
        reasons = pool.reasons(curation, config.ranking) if curation else {}
        if watcher and curation:
            watcher(pool, curation)
    read = (line for one in scored.inputs for line in one.reading.warnings)
    warnings = (*read, *config.warnings, *pool.left_out, *scored.warnings, *copies_scored(scored.inputs))
    manifest = _manifest(config, scored, pool, curation)
    kept = source if isinstance(source, Tosses) else tuple(source)
    return RankedTosses(manifest, curation, pool, warnings, kept, config.pool.reading, reasons)


def _settings(config: RankConfig) -> tuple[str, ...]:
    """What is not as it is by default, as `--set` takes it; the number of threads changes nothing."""
    loss = replace(config.pool.scoring.loss, threads=DEFAULT_LOSS.threads)
    return (
        *changed_fields(config.pool.reading.inputs, InputsConfig()),
        *changed_fields(loss, DEFAULT_LOSS, "loss."),
        *changed_fields(config.ranking, RankingConfig(), "ranking."),
    )


def _manifest(config: RankConfig, scored: ScoredPool, pool: TossPool, curation: Curation | None) -> Manifest:
    """Every toss, and how the ranking was made."""
    scorers = config.pool.scorers(scored.bounds, jobs=1)
    readings = [one.reading for one in scored.inputs]
    run = RunProvenance(
        criterion=config.ranking.criterion,
        estimator=config.pool.scoring.estimator.value,
        influence_bound=scored.bounds[0],
        model=config.model,
        parameters=config.parameters,
        parameters_version="+".join(scorer.version for scorer in scorers),
        seed=config.ranking.seed,
        package_version=__version__,
        command=config.command,
        body=config.pool.reading.body.to_mapping(),
        inputs=tuple(InputProvenance(reading.path, reading.sha256, reading.warnings) for reading in readings),
        settings=_settings(config),
    )
    network = asdict(config.pool.network) if config.pool.of_weights else None
    others: dict[str, Diagnostic] = {"form": config.pool.form, "network": network}
    return ranked_manifest(run, pool.tosses, curation, others)
