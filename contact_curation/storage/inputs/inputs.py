"""Reads any input as a stream of tosses: bags of every kind, folders of ContactNets' files, or single files.

Tosses come one at a time, in the order of the inputs. An input that cannot be read gives a line, and the others are read. A
toss that occurred before gives a line, too, also if its content is another one. If a toss was rejected before, for example
because its recording was cut short, the whole toss takes its place, after a line that says so.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path

from contact_curation.contact.body import Body
from contact_curation.errors import ContactCurationError
from contact_curation.motion.toss import Rejected, Toss
from contact_curation.storage.bags.folder import STORAGE_ENDINGS
from contact_curation.storage.datasets.contactnets import SUBFOLDER, read_contactnets_tosses
from contact_curation.storage.inputs.bag_tosses import read_bag_tosses
from contact_curation.storage.inputs.known_tosses import KnownTosses
from contact_curation.storage.inputs.records import Found
from contact_curation.storage.inputs.records import InputsConfig as InputsConfig
from contact_curation.storage.inputs.records import InputSummary as InputSummary
from contact_curation.storage.inputs.records import Problem as Problem
from contact_curation.storage.provenance import TossProvenance


def open_inputs(paths: Sequence[Path], body: Body, config: InputsConfig | None = None) -> "Inputs":
    """The tosses of `paths`, to be iterated over once; memory stays flat.

    Args:
        paths: MCAP files, rosbag2 folders or their storage files, ROS 1 bags, folders of ContactNets' `.pt` files or single
            ones.
        body: tossed body.
        config: how the inputs are read.
    """
    return Inputs(paths, body, config or InputsConfig())


class Inputs:
    """Iterates over the tosses of several inputs.

    Attributes:
        summaries: the inputs that have been read to their end, in order.
        origin: recording of the last toss.
    """

    def __init__(self, paths: Sequence[Path], body: Body, config: InputsConfig) -> None:
        self.summaries: list[InputSummary] = []
        self.origin = TossProvenance()
        self._paths = tuple(paths)
        self._body = body
        self._config = config
        self._known = KnownTosses()

    def __iter__(self) -> Iterator[Toss | Rejected | Problem]:
        for path in self._paths:
            try:
                yield from self._read(path)
            except (ContactCurationError, OSError) as error:
                yield Problem(str(path), str(error).removeprefix(f"{path}: "))

    def _read(self, path: Path) -> Iterator[Toss | Rejected | Problem]:
        read = read_contactnets_tosses if is_contactnets(path) else read_bag_tosses
        reading = read(path, self._body, self._config)
        while True:
            try:
                item = next(reading)
            except StopIteration as end:
                self.summaries.append(end.value)
                return
            if isinstance(item, Found):
                yield from self._new(item)
            else:
                yield item

    def _new(self, found: Found) -> Iterator[Toss | Rejected | Problem]:
        """Yields a problem if this toss, or an earlier rejected one with its id, is left out; then the toss if it is taken."""
        whole = isinstance(found.outcome, Toss)
        check = self._known.see(found.toss.toss_id, found.toss.digest(), found.origin.input, whole=whole)
        if check.left_out:
            yield Problem(*check.left_out)
        if check.taken:
            self.origin = found.origin
            yield found.outcome


def is_contactnets(path: Path) -> bool:
    """Whether a path is read as ContactNets' files, by its name, or for a folder by the names of its files."""
    if not path.is_dir():
        return path.suffix == ".pt"
    names = [entry.name for entry in path.iterdir()]
    return not any(name.endswith(STORAGE_ENDINGS) for name in names) and any(
        name.endswith(".pt") or name == SUBFOLDER for name in names
    )
