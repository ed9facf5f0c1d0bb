"""Recordings as MCAP files of their kept tosses alone: the same bytes, and the same tosses when they are read again.

What was written is read back, and each toss must be the one of the whole recording, bit for bit; where it is not, more of what
is around it is taken.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from contact_curation.contact.body import Body
from contact_curation.errors import UnreadableInputError
from contact_curation.storage.bags.reader import BagReader
from contact_curation.storage.export.subset import write_subsets
from contact_curation.storage.export.survey import Motion, Surroundings, Survey, digests_in, survey
from contact_curation.storage.export.windows import Window
from contact_curation.storage.inputs.records import InputsConfig
from contact_curation.storage.provenance import TossProvenance

type Parts = dict[Path, tuple[Window, ...]]


@dataclass(frozen=True, eq=False)
class BagExport:
    """What became of a recording.

    Attributes:
        origin: the recording.
        files: where each toss went, by its id; none where no toss was wanted.
        warnings: what could not be read of it, and motions that were not wanted but are in the files; one line each.
    """

    origin: TossProvenance
    files: Mapping[str, Path]
    warnings: tuple[str, ...]


def export_bag(
    path: Path,
    files: Mapping[str, Path],
    body: Body,
    config: InputsConfig,
    advance: Callable[[int], None],
) -> BagExport:
    """Writes what a bag holds of some tosses.

    Args:
        path: of the bag.
        files: where each toss goes that is wanted, by its id; several may go to one file.
        body: what was tossed.
        config: how the bag is read.
        advance: told how many motions more were read.

    Raises:
        UnreadableInputError: it is no bag, or a toss does not come out of a part of it as it comes out of the whole.
        MissingTopicError: no topic, or several, could tell where the body is.
        InvalidValueError: a file cannot be written.
    """
    with BagReader(path) as reader:
        found = survey(reader, body, config, advance)
        motions = found.kept(files)
        if not motions:
            return BagExport(found.origin, {}, found.left_out)
        for surroundings in Surroundings:
            parts = _parts(found, motions, surroundings, files)
            write_subsets(reader, parts, found.source)
            again = _read_again(parts, body, config)
            changed = [motion.toss_id for motion in motions if again.get(motion.toss_id) != motion.digest]
            if not changed:
                break
        else:
            raise UnreadableInputError(path, f"found toss {changed[0]} to be another in a part of it, expected the same")
    taken = {motion.toss_id: files[motion.toss_id] for motion in motions}
    others = sorted(set(again) - set(taken))
    extra = (f"{path}: the export holds motions that were not kept, too: {', '.join(others)}",) if others else ()
    return BagExport(found.origin, taken, (*found.left_out, *extra))


def _parts(found: Survey, motions: Sequence[Motion], surroundings: Surroundings, files: Mapping[str, Path]) -> Parts:
    parts: Parts = {}
    for motion in motions:
        target = files[motion.toss_id]
        parts[target] = (*parts.get(target, ()), found.window(motion, surroundings))
    return parts


def _read_again(files: Iterable[Path], body: Body, config: InputsConfig) -> dict[str, str]:
    """The digests of all motions in some bags."""
    digests: dict[str, str] = {}
    for file in files:
        with BagReader(file) as reader:
            digests.update(digests_in(reader, body, config))
    return digests
