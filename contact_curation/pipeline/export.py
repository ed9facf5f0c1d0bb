"""Exports selected tosses for other tools: as parts of recordings, ContactNets' files, or a LeRobot dataset."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from contact_curation.errors import ChangedTossError, ContactCurationError, InvalidValueError, UnwritableOutputError
from contact_curation.motion.calibration import NO_CORRECTION
from contact_curation.pipeline.division import ranked_otherwise
from contact_curation.pipeline.reading import ReadingConfig
from contact_curation.pipeline.tosses import read_tosses
from contact_curation.pipeline.workers import Advance, unheard
from contact_curation.storage.bags.reader import BagReader
from contact_curation.storage.datasets.contactnets import SUBFOLDER
from contact_curation.storage.export.contactnets import write_contactnets
from contact_curation.storage.export.data_card import CARD, data_card
from contact_curation.storage.export.lerobot import uneven_lines, write_lerobot
from contact_curation.storage.export.mcap import BagExport, export_bag
from contact_curation.storage.export.selected import (
    SelectedToss,
    SelectedTosses,
    changed_inputs,
    check_all_found,
    ranked_recordings,
    selected_rows,
)
from contact_curation.storage.inputs.inputs import InputsConfig, is_contactnets
from contact_curation.storage.manifest.file import read_manifest, write_manifest
from contact_curation.storage.manifest.manifest import Manifest, ManifestRow


@dataclass(frozen=True, eq=False)
class ExportJob:
    """The selected tosses and where to write them.

    Attributes:
        inputs: recordings, at least one.
        reading: how they become tosses; as they did when they were ranked.
        manifest_path: of the ranking.
        manifest: what it says.
        rows: of the selected tosses by their ids, best first.
        per_toss: a bag for each toss.
    """

    inputs: tuple[Path, ...]
    reading: ReadingConfig
    manifest_path: Path
    manifest: Manifest
    rows: Mapping[str, ManifestRow]
    per_toss: bool = False

    @property
    def selected_manifest(self) -> Manifest:
        """The manifest of what is exported alone; how it was made stays."""
        return Manifest(self.manifest.run, tuple(self.rows.values()), self.manifest.diagnostics)


@dataclass(frozen=True)
class Exported:
    """The files that were written.

    Attributes:
        places: by toss id, best first: the file in the folder.
        warnings: one line each.
    """

    places: Mapping[str, str]
    warnings: tuple[str, ...]


def export_job(inputs: Sequence[Path], reading: ReadingConfig, manifest: Path, *, per_toss: bool) -> ExportJob:
    """The job, once its manifest was read.

    Raises:
        UnreadableInputError: the manifest is none.
        InvalidValueError: it selected nothing.
    """
    content = read_manifest(manifest)
    return ExportJob(tuple(inputs), reading, manifest, content, selected_rows(content, manifest), per_toss)


def to_contactnets(job: ExportJob, folder: Path, advance: Advance) -> Exported:
    """tosses_processed/N.pt and manifest.json, the N-th row of which is N.pt."""
    level = job.reading.inputs.rig == NO_CORRECTION  # corrected tosses are not the content of any file
    inputs = replace(job.reading.inputs, as_stored=level)
    found = found_tosses(job, inputs, advance)
    write_contactnets(found.tosses, job.reading.body, folder, copied=level)
    write_manifest(job.selected_manifest, folder / "manifest.json")
    return Exported({toss_id: f"{SUBFOLDER}/{number}.pt" for number, toss_id in enumerate(job.rows)}, found.warnings)


def to_lerobot(job: ExportJob, folder: Path, advance: Advance) -> Exported:
    """A LeRobot dataset, and the manifest in its meta/."""
    found = found_tosses(job, job.reading.inputs, advance)
    write_lerobot(found.tosses, job.reading.body.name, folder)
    write_manifest(job.selected_manifest, folder / "meta" / "curation.json")
    warnings = (*found.warnings, *uneven_lines([one.toss for one in found.tosses]))
    return Exported({toss_id: f"episode {number}" for number, toss_id in enumerate(job.rows)}, warnings)


def to_mcap(job: ExportJob, folder: Path, advance: Advance) -> Exported:
    """A bag per recording, or per toss, and manifest.json."""
    files_of = [path for path in job.inputs if path.exists() and is_contactnets(path)]
    if files_of:
        wanted = "a recording; `contact-curation import contactnets DIR --tosses NUMBERS` makes a bag of ContactNets' files"
        raise InvalidValueError("input", files_of[0], wanted)
    exports, problems = _exported_bags(job, folder, advance)
    found = {toss_id: one.origin for one in exports for toss_id in one.files}
    check_all_found(job.rows, found, job.manifest_path, problems)
    write_manifest(job.selected_manifest, folder / "manifest.json")
    files = {toss_id: file.name for one in exports for toss_id, file in one.files.items()}
    changed = changed_inputs((row, found[toss_id]) for toss_id, row in job.rows.items())
    warnings = (*problems, *(line for one in exports for line in one.warnings), *changed)
    return Exported({toss_id: files[toss_id] for toss_id in job.rows}, warnings)


FORMATS: Mapping[str, Callable[[ExportJob, Path, Advance], Exported]] = {
    "mcap": to_mcap,
    "contactnets": to_contactnets,
    "lerobot": to_lerobot,
}


def export_tosses(form: str, job: ExportJob, folder: Path, advance: Advance) -> Exported:
    """The selected tosses in one of `FORMATS`, and a data card that says what they are.

    Raises:
        ContactCurationError: a selected toss is in no input, or the format cannot hold the tosses.
    """
    exported = FORMATS[form](job, folder, advance)
    (folder / CARD).write_text(data_card(form, job.reading.body, job.manifest), encoding="utf-8")
    return exported


def found_tosses(job: ExportJob, inputs: InputsConfig, advance: Advance = unheard) -> SelectedTosses:
    """The selected tosses, best first; those that the gates would reject now, too.

    Raises:
        InvalidValueError: one of them is in no input.
    """
    reading = replace(job.reading, inputs=inputs)
    read = read_tosses(job.inputs, reading, advance=advance, only=job.rows, meant=ranked_recordings(job.rows.values()))
    outcomes = {**read.by_id, **{one.toss.toss_id: one.toss for one in read.rejected}}
    check_all_found(job.rows, outcomes, job.manifest_path, read.warnings)
    tosses = tuple(SelectedToss(outcomes[toss_id], row, read.taken[toss_id].seen.origin) for toss_id, row in job.rows.items())
    return SelectedTosses(tosses, (*read.warnings, *ranked_otherwise(job.manifest, job.manifest_path, read)))


def _exported_bags(job: ExportJob, folder: Path, advance: Advance) -> tuple[list[BagExport], list[str]]:
    """What became of each input that could be read, and why others could not be."""
    exports: list[BagExport] = []
    problems: list[str] = []
    missing = dict(job.rows)
    digests = {path: digest for path in job.inputs if (digest := _digest(path))}
    for path, name in zip(job.inputs, file_names(job.inputs)):
        wanted = {
            toss_id: row
            for toss_id, row in missing.items()
            if row.input_sha256 == digests.get(path) or row.input_sha256 not in digests.values()
        }
        files = {toss_id: folder / (f"{toss_id}.mcap" if job.per_toss else name) for toss_id in wanted}
        try:
            exports.append(export_bag(path, files, job.reading.body, job.reading.inputs, advance))
        except (ChangedTossError, UnwritableOutputError):
            raise
        except ContactCurationError as error:
            problems.append(str(error))
        else:
            missing = {toss_id: row for toss_id, row in missing.items() if toss_id not in exports[-1].files}
    return exports, problems


def file_names(paths: Sequence[Path]) -> list[str]:
    """A name for the part of each recording, its own where that is not taken."""
    names: list[str] = []
    for path in paths:
        stem = path.name if path.is_dir() else path.stem
        number, name = 1, f"{stem}.mcap"
        while name in names:
            number, name = number + 1, f"{stem}-{number + 1}.mcap"
        names.append(name)
    return names


def _digest(path: Path) -> str:
    """Of a recording's bytes; empty where it cannot be read, which is said when it is exported."""
    try:
        with BagReader(path) as reader:
            return reader.sha256
    except (ContactCurationError, OSError):
        return ""
