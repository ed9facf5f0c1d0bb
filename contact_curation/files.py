"""Files and folders that a user names: read whole and never further than a bound, written whole or not at all."""

import errno
import fcntl
import json
import math
import os
import reprlib
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from secrets import token_hex
from tempfile import gettempdir
from typing import IO, Any, BinaryIO

import yaml

from contact_curation.errors import (
    InvalidValueError,
    NewerVersionError,
    UnreadableInputError,
    UnwritableOutputError,
    why_unreadable,
)

BLUEPRINT = ".rbl"
"""Ending of the layout's file beside a dashboard's recording, for `rerun OTHER.rrd SESSION.rbl`."""

MOST_VALUES = 1_000_000
"""In a YAML file, whose few aliases can stand for any number."""
LONG_TEXT = 100
"""Characters of a text in a YAML file that count as one more value."""
LARGEST_BITS = 14_000
"""Of a whole number in a YAML file: Python writes no longer one in decimal digits."""


def as_word(path: object) -> str:
    """A path as a word of a command line: one that begins with a dash would be taken for an option."""
    return f"./{path}" if str(path).startswith("-") else str(path)


def path_of(name: str, given: object, expected: str) -> Path:
    """The path that a user gives.

    Raises:
        InvalidValueError: it is no path, empty, or has a null character; `name` and what is `expected` are in the message.
    """
    text = os.fspath(given) if isinstance(given, str | os.PathLike) else None
    if not isinstance(text, str) or not text or "\0" in text:
        raise InvalidValueError(name, reprlib.repr(given), expected)
    return Path(given)  # type: ignore[arg-type]


def read_bounded(path: Path, largest: int, expected: str, *, devices: bool = True) -> bytes:
    """The bytes of a file.

    Args:
        path: of the file.
        largest: how many bytes it may have.
        expected: what it should hold, for the message.
        devices: whether it may be a pipe or a device in /dev, as a shell gives them. Not where another file names it.

    Raises:
        UnreadableInputError: there is no such file, it is a pipe or a device that nobody may ever write to, or it is larger.
    """
    if path.exists() and not (path.is_file() or path.is_dir() or (devices and path.is_relative_to("/dev"))):
        raise UnreadableInputError(path, f"is no regular file, expected one with {expected}")
    try:
        with path.open("rb") as file:
            data = file.read(largest + 1)
    except OSError as error:
        raise UnreadableInputError(path, f"cannot be read: {why_unreadable(path, error)}") from error
    if len(data) > largest:
        raise UnreadableInputError(path, f"holds more than {largest} bytes, expected at most that for {expected}")
    return data


def read_yaml(path: Path, largest: int, expected: str) -> Any:
    """What a YAML file holds; arguments and errors as `read_bounded`, and UnreadableInputError for what is no YAML."""
    try:
        return parse_yaml(read_bounded(path, largest, expected).decode("utf-8"), _OnceLoader)
    except ValueError as error:
        raise UnreadableInputError(path, f"found no YAML ({_why(error)}), expected {expected}") from error


def parse_yaml(text: str, loader: type[yaml.SafeLoader] = yaml.SafeLoader) -> Any:
    """What YAML text holds.

    Args:
        text: of a file.
        loader: PyYAML's, which takes the last of several equal keys, or a stricter one.

    Raises:
        ValueError: it is no YAML, or holds too much. PyYAML itself raises a KeyError for `!!bool x`, an AttributeError for
            `!!timestamp x` and an OverflowError for a number with two hundred colons.
    """
    try:
        content = yaml.load(text, loader)
        values = _expanded(content, {})
    except (yaml.YAMLError, RecursionError) as error:
        raise ValueError(str(error)) from error
    except (LookupError, AttributeError, ArithmeticError) as error:
        raise ValueError("a value is too large or not of the kind that its tag names") from error
    if values > MOST_VALUES:
        raise ValueError(f"its aliases stand for over {MOST_VALUES} values")
    return content


class _OnceLoader(yaml.SafeLoader):  # type: ignore[misc]
    """Refuses a key that stands in a mapping twice, as YAML itself does: a hand wrote it, and meant one of the two values."""

    def compose_mapping_node(self, anchor: Any) -> Any:
        node = super().compose_mapping_node(anchor)
        lines: dict[str, int] = {}
        for key in (key for key, _ in node.value if isinstance(key, yaml.ScalarNode)):
            line = key.start_mark.line + 1
            if key.value in lines:
                raise ValueError(f"{key.value[:40]!r} stands there twice, in lines {lines[key.value]} and {line}")
            lines[key.value] = line
        return node


def _expanded(value: Any, known: dict[int, float]) -> float:
    """How many values nested ones hold, each alias counted as often as it stands there; inf for one that holds itself.

    A long text counts as many values.

    Raises:
        ValueError: one of them is a whole number that is too large even for a message, as one in hexadecimal can be.
    """
    if isinstance(value, int) and value.bit_length() > LARGEST_BITS:
        raise ValueError(f"a whole number of {value.bit_length()} bits")
    if not isinstance(value, list | dict | tuple | set):
        return 1 + len(value) // LONG_TEXT if isinstance(value, str | bytes) else 1
    if id(value) not in known:
        known[id(value)] = math.inf
        parts = [*value, *(value.values() if isinstance(value, dict) else ())]
        known[id(value)] = 1 + sum(_expanded(part, known) for part in parts)
    return known[id(value)]


def read_json(path: Path, largest: int, expected: str) -> Any:
    """What a JSON file holds; arguments and errors as `read_bounded`, and UnreadableInputError for what is no JSON."""
    try:
        return json.loads(read_bounded(path, largest, expected))
    except (ValueError, RecursionError) as error:
        raise UnreadableInputError(path, f"is not JSON ({_why(error)}), expected {expected}") from error


def check_version(path: Path, what: str, found: object, newest: int) -> None:
    """Refuses a file in a version of its format that this release does not know.

    Args:
        path: of the file, for the message.
        what: its format, for the message.
        found: the version that the file names; the first is 1.
        newest: that is known.

    Raises:
        NewerVersionError: a later release wrote the file.
        UnreadableInputError: what the file names is no version.
    """
    if type(found) is not int or found < 1:
        raise UnreadableInputError(path, f"found version {str(found)[:40]} of {what}, expected 1 to {newest}")
    if found > newest:
        raise NewerVersionError(path, what, found, newest)


def _why(error: Exception) -> str:
    return "it is no text" if isinstance(error, UnicodeDecodeError) else str(error)


def write_atomically(path: Path, data: bytes) -> None:
    """Writes `data` to `path`, in place of what was there; whoever reads meanwhile sees the old file or the new one.

    Raises:
        InvalidValueError: the file cannot be written there.
    """
    with replacing(path) as file:
        file.write(data)


@contextmanager
def replacing(path: Path) -> Iterator[BinaryIO]:
    """A hidden file beside `path` that takes its name, whole, when the block ends well, and is removed when it does not.

    A link stays, and what it leads to is replaced.

    Raises:
        InvalidValueError: the file cannot be written there.
    """
    with writing(path):
        path = Path(os.path.realpath(path)) if path.is_symlink() else path
        descriptor, partial = _partial(path, _new_file)
        try:
            with os.fdopen(descriptor, "wb") as file:
                yield file
                file.flush()
                sync_file(descriptor)
                partial.replace(path)  # while it is locked: nobody takes it for one that was left behind
        except BaseException:  # an interrupt leaves nothing behind either
            with suppress(OSError):
                partial.unlink(missing_ok=True)
            raise
        sync_folder(path.absolute().parent)


@contextmanager
def staged_folder(path: Path) -> Iterator[Path]:
    """A hidden folder beside `path` that takes its name when the block ends well, and is removed when it does not.

    Raises:
        InvalidValueError: `path` holds something, or cannot be written.
    """
    if path.exists() and not (path.is_dir() and not any(path.iterdir())):
        what = "a folder that is not empty" if path.is_dir() else "a file"
        raise InvalidValueError("output", f"{path}, {what}", "a folder that is empty or not there yet")
    with writing(path):
        path.absolute().parent.mkdir(parents=True, exist_ok=True)
        lock, staged = _partial(path.absolute(), _new_folder)
        try:
            yield staged
            staged.replace(path)
        except BaseException:
            shutil.rmtree(staged, ignore_errors=True)
            raise
        finally:
            os.close(lock)


@contextmanager
def scratch_folder(path: Path, mode: int = 0o777) -> Iterator[Path]:
    """A hidden folder beside `path`, for files that then take their names; it is removed when the block ends.

    Args:
        path: of what is written.
        mode: who may use the folder, before the umask.

    Raises:
        UnwritableOutputError: it cannot be made there.
    """
    with writing(path):
        lock, folder = _partial(path.absolute(), lambda folder: _new_folder(folder, mode))
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)
        os.close(lock)


@contextmanager
def temporary_folder(kind: str) -> Iterator[Path]:
    """A folder of this user alone, for what is needed while the block runs.

    It is removed when the block ends. What a process left that was killed is removed by the next one that needs a folder of the
    same kind.

    Args:
        kind: what the folder is for, in its name.

    Raises:
        UnwritableOutputError: it cannot be made.
    """
    path = Path(gettempdir()) / f"contact-curation-{kind}"
    with scratch_folder(path, mode=0o700) as folder:
        yield folder


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Says what the system refuses (a disk that is full or breaks, a folder that is not there) as an error of this output.

    Raises:
        UnwritableOutputError: the block raised an OSError, or could not write a part of this output.
    """
    try:
        yield
    except UnwritableOutputError as error:
        raise UnwritableOutputError(path, error.reason) from error
    except OSError as error:
        raise UnwritableOutputError(path, str(error.strerror or error)) from error


def partial_name(path: Path) -> Path:
    """A hidden name beside `path` for what is not complete yet; nobody can guess it, and put a link in its place before."""
    return path.with_name(f"{_prefix(path)}{token_hex(4)}")


def lock(file: int | IO[bytes], kind: int = fcntl.LOCK_EX) -> bool:
    """Takes an advisory lock until `file` is closed; False where another process holds it.

    On file systems without locks nothing is taken, and it is True.
    """
    try:
        fcntl.flock(file, kind | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        return True
    return True


def claimed(path: Path) -> Callable[[], None]:
    """Makes this process the only one that replaces a file, until what is returned is called.

    By a lock on a hidden file beside it, which stays: a file that is replaced keeps no lock. A folder that is not there, or a
    file system without locks, claims nothing.

    Raises:
        UnreadableInputError: another process has claimed it.
    """
    try:
        descriptor = os.open(path.with_name(f".{path.name}.lock"), os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o666)
    except OSError:
        return lambda: None
    if not lock(descriptor):
        os.close(descriptor)
        why = "is written by another process, expected one that nobody writes: give each node a file of its own"
        raise UnreadableInputError(path, why)
    return lambda: os.close(descriptor)


def _prefix(path: Path) -> str:
    return f".{path.name}.partial-"


def _partial(path: Path, make: Callable[[Path], int]) -> tuple[int, Path]:
    """A hidden file or folder beside `path` that is locked while its descriptor is open, and removes those that nobody locks.

    They are what processes left that were killed. A name that nobody can foretell is no link to somewhere else.
    """
    for left in [one for one in path.parent.iterdir() if one.name.startswith(_prefix(path))]:
        _remove_unlocked(left)
    while True:
        partial = partial_name(path)
        descriptor = make(partial)
        if lock(descriptor) and partial.exists():  # else somebody takes it for one that was left behind
            return descriptor, partial
        os.close(descriptor)


def _new_file(path: Path) -> int:
    return os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666)


def _new_folder(path: Path, mode: int = 0o777) -> int:
    path.mkdir(mode)
    return os.open(path, os.O_RDONLY)


def _remove_unlocked(left: Path) -> None:
    """Removes a file or folder, unless somebody has it locked or it may not be removed."""
    with suppress(OSError):
        descriptor = os.open(left, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK)  # a pipe has nobody at its other end
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if left.is_dir():
                shutil.rmtree(left)
            else:
                left.unlink()
        finally:
            os.close(descriptor)


def sync_file(descriptor: int) -> None:
    """Waits until the disk has what was written to a file, where its file system can say so: some shared folders cannot."""
    try:
        os.fsync(descriptor)
    except OSError as error:
        if error.errno not in (errno.EINVAL, errno.ENOSYS, errno.ENOTSUP):
            raise


def sync_folder(folder: Path) -> None:
    """A name outlives the machine's death, too, where the file system can promise that."""
    with suppress(OSError):
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
