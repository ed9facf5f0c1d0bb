"""The selected tosses of a manifest, and checks that the given recordings are those that were ranked."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from contact_curation.errors import InvalidValueError
from contact_curation.motion.toss import Toss
from contact_curation.storage.manifest.manifest import Manifest, ManifestRow
from contact_curation.storage.provenance import TossProvenance

MOST_LISTED = 3
"""Largest number of ids in one message."""


@dataclass(frozen=True, eq=False)
class SelectedToss:
    """A selected toss and its row of the manifest.

    Attributes:
        toss: toss as it was cut from its recording.
        row: its row of the manifest.
        origin: its recording.
    """

    toss: Toss
    row: ManifestRow
    origin: TossProvenance


@dataclass(frozen=True, eq=False)
class SelectedTosses:
    """All selected tosses of a manifest.

    Attributes:
        tosses: tosses, best first.
        warnings: problems of the inputs, one line each.
    """

    tosses: tuple[SelectedToss, ...]
    warnings: tuple[str, ...]


def selected_rows(manifest: Manifest, path: Path) -> dict[str, ManifestRow]:
    """The rows of the selected tosses by their ids, best first.

    Raises:
        InvalidValueError: the manifest selected nothing.
    """
    if not manifest.selected:
        raise InvalidValueError(
            f"selected tosses of {path}", f"none of {len(manifest.rows)}", "at least one: rank again, with tosses that pass"
        )
    return {row.toss_id: row for row in manifest.selected}


def check_all_found(rows: Mapping[str, ManifestRow], found: Collection[str], manifest: Path, problems: Sequence[str]) -> None:
    """Checks that all selected tosses were found.

    Raises:
        InvalidValueError: a selected toss was not found; the message contains the problems of the inputs.
    """
    missing = [row for toss_id, row in rows.items() if toss_id not in found]
    if not missing:
        return
    listed = ", ".join(row.toss_id for row in missing[:MOST_LISTED]) + (", ..." if len(missing) > MOST_LISTED else "")
    ranked = sorted({row.input for row in missing if row.input})
    wanted = f"the recordings that were ranked ({', '.join(ranked[:MOST_LISTED])})" if ranked else "the recordings ranked"
    why = f"; {'; '.join(problems[:MOST_LISTED])}" if problems else ""
    raise InvalidValueError(
        "inputs", f"{len(missing)} of {len(rows)} selected tosses of {manifest} not in them: {listed}{why}", wanted
    )


def ranked_recordings(rows: Iterable[ManifestRow]) -> dict[str, str]:
    """By id the digest of the recording that a toss was ranked from; without those whose recording is not known."""
    return {row.toss_id: row.input_sha256 for row in rows if row.input_sha256}


def changed_inputs(selected: Iterable[tuple[ManifestRow, TossProvenance]]) -> tuple[str, ...]:
    """A line for each recording that contains a selected toss, but has other bytes than the ranked one."""
    paths = dict.fromkeys(
        origin.input for row, origin in selected if row.input_sha256 and row.input_sha256 != origin.input_sha256
    )
    return tuple(f"{path}: holds selected tosses, but its bytes are not those that were ranked" for path in paths)
