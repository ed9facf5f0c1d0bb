"""Why nothing was found: the verdict of a diagnosis in place of a bare count."""

from collections.abc import Sequence
from pathlib import Path

from contact_curation.errors import NothingFoundError
from contact_curation.pipeline.diagnosis.diagnosis import MOST_MESSAGES, concluded
from contact_curation.pipeline.diagnosis.evidence import Evidence
from contact_curation.pipeline.diagnosis.recording import read_recording
from contact_curation.pipeline.reading import ReadingConfig

MOST_RECORDINGS = 3
"""That are looked at again."""


def explained(error: NothingFoundError, paths: Sequence[Path | str], config: ReadingConfig) -> NothingFoundError:
    """The error with what `check` says of the recordings, and its own line among the warnings.

    It stays as it is where poses were measured in none of them, for it says why, and where the diagnosis finds no fault.
    """
    named = [Path(path) for path in paths if str(path)][:MOST_RECORDINGS]
    recordings = tuple(read_recording(path, config, MOST_MESSAGES // len(named)) for path in named)
    if not any(one.poses or len(one.measured) for one in recordings):
        return error
    found = concluded(Evidence(config, recordings))
    if found.ok:
        return error
    more = "the reasons and the settings" if found.settings else "the reasons"
    line = f"{found.verdict} (`contact-curation check` gives {more})"
    if len(named) == len(paths) == 1:
        return NothingFoundError(f"{named[0]}: {line}", error.warnings)
    return NothingFoundError(line, (*error.warnings, str(error)))
