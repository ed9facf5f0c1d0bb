"""Tosses in recordings, all of them or those that a manifest kept."""

from collections.abc import Sequence
from pathlib import Path

from contact_curation.cli.report import nothing_found
from contact_curation.errors import InvalidValueError
from contact_curation.motion.toss import Toss
from contact_curation.pipeline.reading import InputReader, ReadingConfig
from contact_curation.pipeline.workers import Advance, counted_on
from contact_curation.storage.inputs.known_tosses import KnownTosses
from contact_curation.storage.manifest.file import read_manifest


def tosses_in(
    paths: Sequence[Path], manifest: Path | None, reading: ReadingConfig, advance: Advance = lambda count: None
) -> tuple[tuple[Toss, ...], tuple[str, ...]]:
    """The tosses that pass the gates, in the order of their ids, each once; and what is wrong with the recordings.

    Args:
        paths: recordings, perhaps none.
        manifest: whose kept tosses are wanted; all tosses where there is none.
        reading: how recordings become tosses.
        advance: told how many tosses more were read.

    Raises:
        ContactCurationError: recordings without a toss, or a manifest whose kept tosses are not in them.
    """
    if not paths and manifest is not None:
        raise InvalidValueError("--manifest", f"{manifest} and no --known", "--known INPUT..., the recordings that it is of")
    if not paths:
        return (), ()
    known, warnings = KnownTosses(), list[str]()
    found: dict[str, Toss] = {}
    for path in paths:
        reader = InputReader(path, reading)
        passed = {toss.toss_id: toss for toss in counted_on(reader.tosses(), advance)}
        result = reader.reading()
        warnings += result.warnings
        for seen in result.seen:
            standing = known.see(seen.toss_id, seen.digest, result.path, whole=not seen.reasons)
            if standing.left_out:
                warnings.append(f"{standing.left_out.where}: {standing.left_out.why}")
            elif standing.taken and not seen.reasons:
                found[seen.toss_id] = passed[seen.toss_id]
    if not found:
        raise nothing_found(paths, warnings, "no toss", "at least one")
    return tuple(found[toss_id] for toss_id in _wanted(found, manifest)), tuple(warnings)


def _wanted(found: dict[str, Toss], manifest: Path | None) -> list[str]:
    if manifest is None:
        return sorted(found)
    kept = sorted(row.toss_id for row in read_manifest(manifest).selected)
    absent = [toss_id for toss_id in kept if toss_id not in found]
    if absent:
        raise InvalidValueError(f"kept tosses of {manifest}", f"no {absent[0]} in the recordings", "all of them")
    return kept
