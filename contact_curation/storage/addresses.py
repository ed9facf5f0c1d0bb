"""Recordings on servers, as paths: `s3://bucket/session.mcap`, `https://host/session.mcap`, `gs://...`, by fsspec.

An address is a path whose file operations send requests to the server, so every function that reads a path reads an address,
too. Bytes are requested in ranges. The end of a file, where MCAP has its summary, is one request. A reader can announce ranges
with `plan`; ranges that lie near each other become one request if this adds at most an eighth to the requested bytes.
Credentials, endpoints and retries are those of fsspec's library for the protocol.
"""

import io
import json
import os
import re
import stat
from collections.abc import Generator, Iterable, Iterator
from contextlib import contextmanager
from glob import glob, has_magic
from hashlib import sha256
from itertools import pairwise
from pathlib import Path, PosixPath
from typing import Any, Self
from urllib.parse import urlsplit

from contact_curation.errors import InvalidValueError, MissingDependencyError, UnreadableInputError

SCHEME = re.compile(r"^[a-zA-Z][a-zA-Z0-9+.-]+://")
MAGIC = re.compile(r"[*\[]")
"""Characters that make an address a pattern; `?` is none of them, because it begins the query of a web address."""

END_BYTES = 1 << 16
"""Size of the first request at a file's end [bytes]; the summary of an MCAP file with a hundred chunks has about 10 kB."""

MOST_BYTES = 64 << 20
"""Largest size of one request [bytes], which is also what a reader holds in memory."""

MOST_UNWANTED = 0.125
"""Largest share of additional bytes in a joined request."""

CONTENT = ("ETag", "etag", "md5Hash", "crc32c", "LastModified", "Last-Modified", "last_modified", "mtime", "updated")
"""Names that file systems give to a value that changes with a file's content, most reliable first."""


def matching(name: str) -> list[Path]:
    """The recordings that a path, an address or a pattern stands for, sorted by name.

    Raises:
        UnreadableInputError: nothing matches a pattern, or its server cannot be reached.
        MissingDependencyError: the library for this kind of address is not installed.
        InvalidValueError: this kind of address is not supported.
    """
    scheme = SCHEME.match(name)
    if scheme and scheme[0].lower() != "file://":
        return _addresses(name)
    if scheme:
        from urllib.request import url2pathname  # with it come HTTP and TLS, which no local path needs

        name = url2pathname(urlsplit(name).path)
    if not has_magic(name) or _exists(Path(name)):
        return [Path(name)]
    return [Path(each) for each in _some(name, sorted(glob(name, recursive=True)))]  # noqa: PTH207 - of absolute patterns, too


def _exists(path: Path) -> bool:
    """Whether there is such a file; True where that cannot be seen, which whoever reads it says."""
    try:
        return path.exists()
    except OSError:  # a folder that may not be entered, a name that is too long
        return True


def _addresses(name: str) -> list[Path]:
    import fsspec

    scheme = name.partition("://")[0]
    try:
        fsspec.get_filesystem_class(scheme)
    except ImportError as error:
        raise MissingDependencyError(f"{scheme}:// ({error})", "pip install 'contact-curation[cloud]'") from error
    except ValueError as error:
        expected = "a path, or an address such as s3://bucket/session.mcap or https://host/session.mcap"
        raise InvalidValueError("INPUT", name, expected) from error
    if not MAGIC.search(name):
        return [Address(name)]
    with _reached(name):
        files, pattern = fsspec.core.url_to_fs(name)
        files.invalidate_cache()  # listings, which fsspec keeps for the life of the process
        found = files.glob(pattern, detail=True)
        return [*_some(name, [Address(files.unstrip_protocol(one)).known(found[one]) for one in sorted(found)])]


def _some[Found](pattern: str, found: list[Found]) -> list[Found]:
    if not found:
        raise UnreadableInputError(pattern, "nothing matches this pattern, expected recordings")
    return found


class Address(PosixPath):
    """A file or folder on a server; `str` of it is its URI. Its properties are requested once and cached."""

    _facts: dict[str, Any] | None = None
    _ranges: "_Ranges | None" = None

    def known(self, facts: dict[str, Any]) -> Self:
        """The same address with properties that a listing has given already."""
        self._facts = facts if facts.get("size") is not None else None
        return self

    @property
    def known_size(self) -> int:
        """Its size [bytes], or 0 before the server was asked for its properties."""
        return int((self._facts or {}).get("size") or 0)

    @property
    def facts(self) -> dict[str, Any]:
        """Its properties, as the server gives them.

        Raises:
            UnreadableInputError: the server cannot be reached, or nothing is at this address.
        """
        if self._facts is None:
            with _reached(self):
                files, path = self._place()
                files.invalidate_cache(path)  # a listing from before
                self._facts = files.info(path)
        return self._facts

    def fingerprint(self) -> str:
        """A digest of the file's size and of its ETag, checksum or date, whichever the server reports."""
        said = next((str(self.facts[name]).strip('"') for name in CONTENT if self.facts.get(name)), "")
        return sha256(json.dumps([self.facts.get("size"), said]).encode()).hexdigest()

    def plan(self, wanted: Iterable[tuple[int, int]]) -> None:
        """Announces ranges [begin, end) [bytes] that will be read from an open file, so that near ones become one request."""
        if self._ranges is not None:
            self._ranges.planned = coalesced(wanted)

    def fetch(self, begin: int, end: int) -> bytes:
        """The bytes from `begin` to `end`, or the whole file if the server does not support ranges.

        Raises:
            UnreadableInputError: the request failed.
        """
        with _reached(self):
            files, path = self._place()
            return bytes(files.cat_file(path, start=begin, end=end))

    def download(self, target: Path) -> None:
        """Writes the whole file to `target`.

        Raises:
            UnreadableInputError: the request failed.
        """
        with _reached(self):
            files, path = self._place()
            files.get_file(path, str(target))

    def _place(self) -> tuple[Any, str]:
        import fsspec

        files, path = fsspec.core.url_to_fs(str(self))
        return files, str(path)

    def __str__(self) -> str:
        return super().__str__().replace(":/", "://", 1)

    def __reduce__(self) -> Any:
        return _with_facts, (str(self), self._facts)

    def absolute(self) -> Self:
        return self

    def stat(self, *, follow_symlinks: bool = True) -> os.stat_result:
        kind = stat.S_IFDIR if self.is_dir() else stat.S_IFREG
        if self.facts.get("size") is None:
            raise UnreadableInputError(self, "its server does not say how long it is, expected a server of files")
        return os.stat_result((kind, 0, 0, 1, 0, 0, self.facts["size"], 0, 0, 0))

    def exists(self, *, follow_symlinks: bool = True) -> bool:
        try:
            return bool(self.facts)
        except UnreadableInputError:
            return False

    def is_dir(self) -> bool:
        return bool(self.facts["type"] == "directory")

    def is_file(self) -> bool:
        return self.exists() and not self.is_dir()

    def iterdir(self) -> Generator[Self, None, None]:
        with _reached(self):
            files, path = self._place()
            for one in files.ls(path, detail=True):
                yield type(self)(files.unstrip_protocol(one["name"])).known(one)

    def glob(self, pattern: str, **kwargs: Any) -> Generator[Self, None, None]:
        return (one for one in self.iterdir() if one.match(pattern))

    def open(self, *args: Any, **kwargs: Any) -> Any:
        """Opens the file for reading bytes, the only mode; without a buffer, which would request more than is needed."""
        if self._ranges is None:
            self._ranges = _Ranges(self)
        return _AddressFile(self._ranges)

    def read_bytes(self) -> bytes:
        return self.fetch(0, self.stat().st_size)

    def read_text(self, *args: Any, **kwargs: Any) -> str:
        return self.read_bytes().decode()


def _with_facts(uri: str, facts: dict[str, Any] | None) -> Address:
    return Address(uri).known(facts or {})


class _Ranges:
    """The cached bytes of a file: its end, and the range that was requested last."""

    def __init__(self, address: Address) -> None:
        self.address = address
        self.size = address.stat().st_size
        self.planned: list[tuple[int, int]] = []
        self.open_files = 0
        self._end = (self.size, b"")
        self._last = (0, b"")

    def between(self, begin: int, end: int) -> bytes:
        """The bytes from `begin` to `end`, both within the file."""
        for start, data in (self._end, self._last):
            if start <= begin and end <= start + len(data):
                return data[begin - start : end - start]
        if end == self.size or begin >= self.size - END_BYTES:
            start = min(begin, max(0, self.size - END_BYTES))
            self._end = (start, self._asked(start, self._end[0]) + self._end[1])
            return self.between(begin, end)
        around = next(((first, last) for first, last in self.planned if first <= begin and end <= last), (begin, end))
        self._last = (around[0], self._asked(*around))
        return self.between(begin, end)

    def close(self) -> None:
        self.open_files -= 1
        if not self.open_files:
            self._end, self._last = (self.size, b""), (0, b"")

    def _asked(self, begin: int, end: int) -> bytes:
        data = self.address.fetch(begin, end)
        if len(data) == self.size:  # a server without support for ranges
            return data[begin:end]
        if len(data) != end - begin:
            found = f"{len(data)} bytes where {end - begin} were asked for at byte {begin}"
            raise UnreadableInputError(self.address, f"found {found}, expected a server that gives ranges")
        return data


class _AddressFile(io.RawIOBase):
    """An open file on a server."""

    def __init__(self, ranges: _Ranges) -> None:
        self._ranges = ranges
        self._at = 0
        ranges.open_files += 1

    def readable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def tell(self) -> int:
        return self._at

    def seek(self, offset: int, whence: int = io.SEEK_SET, /) -> int:
        self._at = offset + {io.SEEK_SET: 0, io.SEEK_CUR: self._at, io.SEEK_END: self._ranges.size}[whence]
        return self._at

    def readall(self) -> bytes:
        return self.read(max(0, self._ranges.size - self._at)) or b""

    def readinto(self, buffer: Any, /) -> int:
        view = memoryview(buffer).cast("B")
        data = self._ranges.between(self._at, max(self._at, min(self._at + len(view), self._ranges.size)))
        view[: len(data)] = data
        self._at += len(data)
        return len(data)

    def close(self) -> None:
        if not self.closed:
            self._ranges.close()
        super().close()


def coalesced(wanted: Iterable[tuple[int, int]]) -> list[tuple[int, int]]:
    """Joins ranges that lie near each other into requests, as long as this adds few bytes.

    Args:
        wanted: ranges [begin, end) [bytes], which may overlap.
    """
    ranges = sorted(wanted)
    spare = MOST_UNWANTED * sum(end - begin for begin, end in ranges)
    gaps = sorted((after[0] - before[1], place) for place, (before, after) in enumerate(pairwise(ranges), start=1))
    joined: set[int] = set()
    for gap, place in gaps:
        spare -= max(gap, 0)
        if spare < 0:
            break
        joined.add(place)
    asked: list[tuple[int, int]] = []
    for place, (begin, end) in enumerate(ranges):
        if place in joined and asked and end - asked[-1][0] <= MOST_BYTES:
            asked[-1] = (asked[-1][0], max(asked[-1][1], end))
        else:
            asked.append((begin, end))
    return asked


@contextmanager
def _reached(address: "Address | str") -> Iterator[None]:
    """Turns errors of a server or its library into one line.

    Raises:
        UnreadableInputError: the block raised an error.
    """
    try:
        yield
    except (UnreadableInputError, ModuleNotFoundError):
        raise
    except FileNotFoundError as error:
        raise UnreadableInputError(str(address), "found nothing there, expected a recording") from error
    except Exception as error:  # every protocol has its own library with its own errors
        raise UnreadableInputError(str(address), f"cannot be read ({type(error).__name__}: {error})") from error
