"""The index: what was read and scored before, so that a second ranking reads and scores only what changed.

Two shards a recording: its tosses under rules of reading, and their scores at a theta. Their names are digests of all that they
follow from, this package's code included. Of a recording that is what the file system says of each of its files: size and
times of change, of a file on a server its ETag. `mtime` can be set, as copies do, `ctime` cannot. So no recording is read to
see that nothing changed.

    DIR/tosses/DIGEST.parquet    DIR/scores/DIGEST.parquet
"""

from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Any

from contact_curation.errors import UnreadableInputError
from contact_curation.files import writing
from contact_curation.information.record import TossInformation
from contact_curation.information.scoring import NotScored
from contact_curation.motion.toss import Toss
from contact_curation.pipeline.reading import InputReader, Reading, ReadingConfig
from contact_curation.storage.addresses import Address
from contact_curation.storage.bags.formats.sqlite import stored_parts
from contact_curation.storage.datasets.contactnets import SUBFOLDER
from contact_curation.storage.provenance import SeenToss, TossProvenance
from contact_curation.storage.shards import Shard, ShardRow, shard_at, writing_shard
from contact_curation.storage.stores.information import packed_information, unpacked_information
from contact_curation.storage.stores.tosses import packed_toss, unpacked_toss
from contact_curation.version import __version__

Scores = tuple[TossInformation | NotScored, ...]
"""The information of one toss, once per theta."""

TOSSES, SCORES = "tosses", "scores"

COMPILED = 4
"""To be raised when the kernel gives other numbers: `_code` does not see its compiled code."""


@dataclass(frozen=True)
class RecordingIndex:
    """Shards in a folder that processes may share.

    Args:
        folder: where.
    """

    folder: Path

    def made(self) -> "RecordingIndex":
        """The same; its folder is there.

        Raises:
            UnwritableOutputError: it cannot be made.
        """
        with writing(self.folder):
            for kind in (TOSSES, SCORES):
                (self.folder / kind).mkdir(parents=True, exist_ok=True)
        return self

    def reader(self, path: Path, config: ReadingConfig) -> "IndexedTosses | RecordingReader":
        """The tosses of a recording: those of the index where it has them; else they are read, and written to it.

        A worker on a machine that does not have the folder only reads.
        """
        digest = digest_of_tosses(path, config) if self.folder.is_dir() else ""
        place = self._place(TOSSES, digest) if digest else None
        shard = shard_at(place) if place else None
        return IndexedTosses(shard) if shard and shard.note["complete"] else RecordingReader(path, config, place)

    def scores(self, digest: str) -> tuple[Reading, dict[str, Scores]] | None:
        """What a digest of `digest_of_scores` was written for; None where it was not."""
        shard = shard_at(self._place(SCORES, digest))
        if shard is None:
            return None
        scores: dict[str, list[TossInformation | NotScored]] = {}
        for row in shard.rows():
            version, _, head = row.head.partition(" ")
            scores.setdefault(row.id, []).append(
                unpacked_information(row.id, version, head, row.arrays) if row.arrays else NotScored(row.id, head)
            )
        return _reading(shard.note), {toss_id: tuple(by_theta) for toss_id, by_theta in scores.items()}

    def keep_scores(self, digest: str, reading: Reading, scores: Mapping[str, Scores]) -> None:
        """Writes the scores of a recording that was read to its end.

        Raises:
            UnwritableOutputError: they cannot be written.
        """
        with writing_shard(self._place(SCORES, digest)) as shard:
            for toss_id, by_theta in scores.items():
                for one in by_theta:
                    if isinstance(one, TossInformation):
                        head, arrays = packed_information(one)
                        shard.add(ShardRow(toss_id, f"{one.parameters_version} {head}", arrays))
                    else:
                        shard.add(ShardRow(toss_id, f" {one.reason}", b""))
            shard.note = _note(reading)

    def _place(self, kind: str, digest: str) -> Path:
        return self.folder / kind / f"{digest}.parquet"


class RecordingReader:
    """Reads a recording, and writes its tosses to an index.

    Args:
        path: recording.
        config: how it is read.
        place: of the shard; None to write none.
    """

    def __init__(self, path: Path, config: ReadingConfig, place: Path | None) -> None:
        self._reader = InputReader(path, config)
        self._place = place

    def tosses(self) -> Iterator[Toss]:
        """The same as in `InputReader`."""
        if self._place is None:
            yield from self._reader.tosses()
            return
        with writing_shard(self._place) as shard:
            for toss in self._reader.tosses():
                shard.add(ShardRow(toss.toss_id, *packed_toss(toss, {})))
                yield toss
            shard.note = _note(self._reader.reading())

    def reading(self) -> Reading:
        """The same as in `InputReader`."""
        return self._reader.reading()


@dataclass(frozen=True, eq=False)
class IndexedTosses:
    """A recording whose tosses are in the index.

    Args:
        shard: of its tosses.
    """

    shard: Shard

    def tosses(self) -> Iterator[Toss]:
        """The same as in `InputReader`."""
        return (unpacked_toss(*row) for row in self.shard.rows())

    def reading(self) -> Reading:
        """The same as in `InputReader`."""
        return _reading(self.shard.note)


def digest_of_tosses(path: Path, config: ReadingConfig) -> str:
    """What the tosses of a recording follow from, besides this package's code; empty where that cannot be looked at."""
    try:
        state = [_state(one) for one in _files(path)]
        tag_map = Path(config.inputs.poses.tag_map).read_text(encoding="utf-8") if config.inputs.poses.tag_map else ""
    except (OSError, UnicodeDecodeError, UnreadableInputError):
        return ""
    return _digest(TOSSES, str(path), state, config.body.to_mapping(), config.inputs, tag_map)


def digest_of_scores(path: Path, config: ReadingConfig, rules: object) -> str:
    """What the scores of a recording follow from, besides this package's code; empty as that of its tosses.

    Args:
        path: recording.
        config: how it is read.
        rules: all that they are scored by, theta included; `repr` says all of it.
    """
    tosses = digest_of_tosses(path, config)
    return _digest(SCORES, tosses, rules) if tosses else ""


def _digest(*parts: object) -> str:
    return sha256(repr((__version__, _code(), COMPILED, *parts)).encode()).hexdigest()


@cache
def _code() -> str:
    """Digest of this package's Python files, where they are there: rules change between its releases, too."""
    package, state = Path(__file__).parents[2], sha256()
    for file in sorted(package.rglob("*.py")):
        for part in (file.relative_to(package).as_posix().encode(), file.read_bytes()):
            state.update(len(part).to_bytes(8) + part)
    return state.hexdigest()


def _files(path: Path) -> list[Path]:
    """The files of a recording; of the folders in its folder only that of ContactNets' tosses belongs to it."""
    if not path.is_dir():
        return stored_parts(path)
    entries = sorted(path.iterdir())
    tosses = [one for folder in entries if folder.name == SUBFOLDER and folder.is_dir() for one in sorted(folder.iterdir())]
    return [one for one in (*entries, *tosses) if one.is_file()]


def _state(file: Path) -> tuple[str, object, object]:
    """Name of a file, and what changes with its content."""
    if isinstance(file, Address):
        return str(file), file.facts.get("size"), file.fingerprint()
    status = file.stat()
    return str(file.absolute()), status.st_size, (status.st_mtime_ns, status.st_ctime_ns)


def _note(reading: Reading) -> dict[str, Any]:
    return asdict(reading)


def _reading(note: Mapping[str, Any]) -> Reading:
    seen = [
        SeenToss(**{**one, "reasons": tuple(one["reasons"]), "origin": TossProvenance(**one["origin"])}) for one in note["seen"]
    ]
    lines = {name: tuple(note[name]) for name in ("problems", "losses")}
    return Reading(**{**note, "seen": tuple(seen), **lines})
