"""What is fuzzed: every reader of bytes that others made. Each target takes bytes and may raise this package's errors only.

A target lies in a folder of memory (`/dev/shm`, where there is one), into which it writes its input, since readers take paths.
While it runs, a file outside of that folder may be read and not written, nothing is started and nothing is connected to: an
audit hook of the interpreter refuses it.
"""

import atexit
import json
import os
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

import safetensors
import safetensors.numpy

from contact_curation.contact.body import CONTACTNETS_CUBE, Body
from contact_curation.errors import ContactCurationError
from contact_curation.learning.checkpoints import safetensors_bytes
from contact_curation.learning.checkpoints.theta_bytes import geometry_of_bytes
from contact_curation.session.parameter_files import read_node_parameters
from contact_curation.storage.bags.reader import BagReader
from contact_curation.storage.datasets.contactnets import read_contactnets
from contact_curation.storage.datasets.orientations import UNTOLD, AngleConvention
from contact_curation.storage.datasets.pose_table import PoseTable
from contact_curation.storage.inputs.bag_tosses import read_bag_tosses
from contact_curation.storage.inputs.records import InputsConfig
from contact_curation.storage.manifest.file import read_manifest
from contact_curation.storage.parameters_file import read_parameters
from contact_curation.storage.tag_map_file import read_tag_maps
from contact_curation.storage.throws_file import read_throws, read_throws_body

MEMORY = Path("/dev/shm")
WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND
REFUSED = {
    *("os.remove", "os.rename", "os.mkdir", "os.rmdir", "os.link", "os.symlink", "os.chmod", "os.truncate", "shutil.rmtree"),
    *("subprocess.Popen", "os.system", "os.exec", "os.posix_spawn", "os.fork", "socket.connect", "socket.bind"),
    "pickle.find_class",
}


class TouchedError(Exception):
    """A reader did something else than reading."""


class Target(NamedTuple):
    """A reader.

    Attributes:
        read: of a file.
        endings: of the file's name; with several, the first byte of an input chooses one and is no part of the file.
        longest: input that is worth trying [B].
        library: imported before the reader is watched, since its import starts a process.
    """

    read: Callable[[Path], object]
    endings: tuple[str, ...]
    longest: int = 1 << 14
    library: str = ""


def _bag(path: Path) -> None:
    with BagReader(path) as reader:
        for topic in reader.topics:
            reader.qos(topic.name)
        assert isinstance(reader.notes, dict)
        for _ in reader.raw_messages():
            pass
    found = read_bag_tosses(path, CONTACTNETS_CUBE, InputsConfig())
    for _ in found:
        pass


def _body(path: Path) -> None:
    Body.from_file(path)


def _shape(path: Path) -> None:
    Body.from_file(path, mass=0.3, friction=0.2, length_scale=0.05)


def _mesh(path: Path) -> None:
    Body.from_file(path, mass=0.3, friction=0.2, length_scale=0.05, scale=1.0, name="mesh")


def _theta(path: Path) -> None:
    geometry_of_bytes(path.read_bytes())


def _model(path: Path) -> None:
    data = path.read_bytes()
    for one in dict.fromkeys((data, _with_right_digest(data))):
        _models(path, one)


def _with_right_digest(data: bytes) -> bytes:
    """The same content as if it had been written so: a digest keeps out damage and not intent."""
    try:
        arrays = safetensors.numpy.load(data)
        said = json.loads(data[8 : 8 + int.from_bytes(data[:8], "little")])["__metadata__"][safetensors_bytes.FORMAT]
        return safetensors_bytes.pack(arrays, json.loads(json.loads(said)["documents"]))
    except (safetensors.SafetensorError, ValueError, LookupError, TypeError, AttributeError, RecursionError):
        return data


def _models(path: Path, data: bytes) -> None:
    # PyTorch, which takes longer to load than most targets run
    from contact_curation.learning.checkpoints.checkpoint import training_of_bytes
    from contact_curation.learning.checkpoints.stored_model import body_of_bytes, model_of_bytes, notes_of_bytes

    for read in (model_of_bytes, body_of_bytes, notes_of_bytes):
        with _ours():
            read(data, path)
    with _ours():
        training_of_bytes(data, path, _data(), None)


def _throws(path: Path) -> None:
    with _ours():
        read_throws(path)
    read_throws_body(path)


def _pt(path: Path) -> None:
    for _ in read_contactnets(path):
        pass


def _poses(path: Path) -> None:
    angles = b"pitch" in path.read_bytes()
    for _ in PoseTable(path, angles=AngleConvention("xyz", "deg") if angles else UNTOLD):
        pass


def _message(path: Path) -> None:
    from test.fuzz.messages import read_message  # ROS, which the other targets need not load

    read_message(path.read_bytes())


def _parameters(path: Path) -> None:
    read_parameters(path, CONTACTNETS_CUBE)


@cache
def _data() -> Any:
    from contact_curation.motion.transitions import transitions_of
    from test.simulated import simulated_tosses

    return transitions_of(simulated_tosses(1, seed=1), CONTACTNETS_CUBE.length_scale)


@contextmanager
def _ours() -> Iterator[None]:
    """One of several readers of the same bytes may refuse them, and the others still get them."""
    try:
        yield
    except ContactCurationError as error:
        str(error)


TARGETS: dict[str, Target] = {
    "mcap": Target(_bag, (".mcap",), 1 << 13),
    "sqlite": Target(_bag, (".db3",), 1 << 15),
    "ros1": Target(_bag, (".bag",), 1 << 14),
    "body": Target(_body, (".yaml",), 1 << 12),
    "urdf": Target(_shape, (".urdf",)),
    "mjcf": Target(_shape, (".xml",), 1 << 12),
    "mesh": Target(_mesh, (".stl", ".obj", ".ply", ".off"), 1 << 12),
    "tag_map": Target(read_tag_maps, (".yaml",), 1 << 12),
    "theta": Target(_theta, (".safetensors",)),
    "checkpoint": Target(_model, (".safetensors",), 1 << 16, "torch"),
    "manifest": Target(read_manifest, (".csv", ".json", ".parquet")),
    "throws": Target(_throws, (".json",)),
    "pt": Target(_pt, (".pt",), library="torch"),
    "poses": Target(_poses, (".csv",), 1 << 12),
    "parameters": Target(_parameters, (".json",)),
    "node_parameters": Target(read_node_parameters, (".yaml",)),
    "messages": Target(_message, (".cdr",)),
}


_folder: Path | None = None
_watching = False


def folder() -> Path:
    """Where inputs are written, one for each process."""
    global _folder
    if _folder is None:
        _folder = Path(tempfile.mkdtemp(prefix="fuzz-", dir=MEMORY if MEMORY.is_dir() else None))
        atexit.register(shutil.rmtree, _folder, ignore_errors=True)
        sys.addaudithook(_watch)
    return _folder


def _watch(event: str, arguments: tuple[Any, ...]) -> None:
    if not _watching:
        return
    if event == "open":
        path, _, flags = arguments
        writes = isinstance(flags, int) and flags & WRITING
        if not writes or isinstance(path, int):
            return
        name = os.fsdecode(path)
        if not name.startswith((str(_folder), "/dev/null")):
            raise TouchedError(f"{path} was opened for writing")
    elif event in REFUSED and not (arguments and str(arguments[0]).startswith(str(_folder))):
        raise TouchedError(f"{event} {arguments[:2]}")


def read(name: str, data: bytes) -> ContactCurationError | None:
    """Gives bytes to a target; returns the error with which it refused them.

    Raises:
        Exception: any that is not of this package, which is a finding.
    """
    global _watching
    target = TARGETS[name]
    if target.library:
        import_module(target.library)
    ending = target.endings[0]
    if len(target.endings) > 1:
        if not data:
            return None
        ending, data = target.endings[data[0] % len(target.endings)], data[1:]
    path, before = folder() / f"input{ending}", (tempfile.tempdir, sys.dont_write_bytecode)
    path.write_bytes(data)
    # A reader may import a module for the first time: Python would write its bytecode.
    _watching, tempfile.tempdir, sys.dont_write_bytecode = True, str(folder()), True
    try:
        target.read(path)
    except ContactCurationError as error:
        if "\n" in str(error):
            raise ValueError(f"an error of several lines: {error}") from error
        return error
    finally:
        _watching, (tempfile.tempdir, sys.dont_write_bytecode) = False, before
    return None
