"""The tosses that a manifest kept, found again in the recordings that it was made of."""

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from contact_curation.contact.body import Body
from contact_curation.errors import InvalidValueError
from contact_curation.motion.toss import Rejected, Toss
from contact_curation.storage.inputs.inputs import open_inputs
from contact_curation.storage.inputs.records import InputsConfig, Problem
from contact_curation.storage.manifest.manifest import Manifest, ManifestRow
from contact_curation.storage.provenance import TossProvenance

Advance = Callable[[int], None]
"""Told how many tosses more were read."""

MOST_LISTED = 3
"""Ids in one message."""


@dataclass(frozen=True, eq=False)
class KeptToss:
    """A toss, and what the manifest says of it.

    Attributes:
        toss: as it was cut from its recording.
        row: of the manifest.
        origin: the recording.
    """

    toss: Toss
    row: ManifestRow
    origin: TossProvenance


@dataclass(frozen=True, eq=False)
class KeptTosses:
    """All that were kept.

    Attributes:
        tosses: best first.
        warnings: what is wrong with the inputs, one line each.
    """

    tosses: tuple[KeptToss, ...]
    warnings: tuple[str, ...]


def kept_rows(manifest: Manifest, path: Path) -> dict[str, ManifestRow]:
    """The rows of what was kept by their ids, best first.

    Raises:
        InvalidValueError: nothing was.
    """
    if not manifest.kept:
        raise InvalidValueError(f"kept tosses of {path}", f"none of {len(manifest.rows)}", "at least one")
    return {row.toss_id: row for row in manifest.kept}


def find_kept(
    inputs: Sequence[Path], rows: Mapping[str, ManifestRow], manifest: Path, body: Body, config: InputsConfig, advance: Advance
) -> KeptTosses:
    """Reads recordings for the tosses that were kept; those that the gates would keep back now, too.

    Args:
        inputs: at least one.
        rows: of what was kept.
        manifest: where they come from, for messages.
        body: what was tossed.
        config: how recordings are read.
        advance: told of progress.

    Raises:
        InvalidValueError: one that was kept is in no input.
    """
    found: dict[str, KeptToss] = {}
    problems: list[str] = []
    reading = open_inputs(inputs, body, config)
    for item in reading:
        if isinstance(item, Problem):
            problems.append(str(item))
            continue
        toss = item.toss if isinstance(item, Rejected) else item
        advance(1)
        if toss.toss_id in rows:
            found[toss.toss_id] = KeptToss(toss, rows[toss.toss_id], reading.origin)
    check_all_found(rows, found, manifest, problems)
    lost = [f"{one.path}: {line}" for one in reading.summaries for line in one.losses]
    tosses = tuple(found[toss_id] for toss_id in rows)
    changed = changed_inputs((one.row, one.origin) for one in tosses)
    return KeptTosses(tosses, (*problems, *lost, *changed))


def check_all_found(rows: Mapping[str, ManifestRow], found: Collection[str], manifest: Path, problems: Sequence[str]) -> None:
    """InvalidValueError, if a kept toss was not found; with what is wrong with the inputs, if anything is."""
    missing = [row for toss_id, row in rows.items() if toss_id not in found]
    if not missing:
        return
    listed = ", ".join(row.toss_id for row in missing[:MOST_LISTED]) + (", ..." if len(missing) > MOST_LISTED else "")
    ranked = sorted({row.input for row in missing if row.input})
    wanted = f"the recordings that were ranked ({', '.join(ranked[:MOST_LISTED])})" if ranked else "the recordings ranked"
    why = f"; {'; '.join(problems[:MOST_LISTED])}" if problems else ""
    raise InvalidValueError(
        "inputs", f"{len(missing)} of {len(rows)} kept tosses of {manifest} not in them: {listed}{why}", wanted
    )


def changed_inputs(kept: Iterable[tuple[ManifestRow, TossProvenance]]) -> tuple[str, ...]:
    """A line for each recording that holds a kept toss, but not the bytes that were ranked."""
    paths = dict.fromkeys(origin.input for row, origin in kept if row.input_sha256 and row.input_sha256 != origin.input_sha256)
    return tuple(f"{path}: holds kept tosses, but its bytes are not those that were ranked" for path in paths)
