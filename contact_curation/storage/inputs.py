"""Any input becomes a stream of tosses: bags of every kind, folders of ContactNets' files, or one of those (DESIGN 6).

One toss at a time, in the order of the inputs. A bad input is a line, and the others go on. A toss that was seen before is a
line too: it is neither ranked twice nor, where its content is another, silently taken for the first.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path

from contact_curation.contact.body import Body
from contact_curation.errors import ContactCurationError
from contact_curation.motion.toss import Rejected, Toss
from contact_curation.storage.bag_folder import STORAGE_ENDINGS
from contact_curation.storage.bag_tosses import read_bag_tosses
from contact_curation.storage.contactnets import SUBFOLDER
from contact_curation.storage.contactnets_tosses import read_contactnets_tosses
from contact_curation.storage.input_records import Found
from contact_curation.storage.input_records import InputsConfig as InputsConfig
from contact_curation.storage.input_records import InputSummary as InputSummary
from contact_curation.storage.input_records import Problem as Problem
from contact_curation.storage.provenance import TossProvenance


def open_inputs(paths: Sequence[Path], body: Body, config: InputsConfig | None = None) -> "Inputs":
    """The tosses of `paths`, to be iterated over once; memory stays flat.

    Args:
        paths: MCAP files, rosbag2 folders or their storage files, ROS 1 bags, folders of ContactNets' `.pt` files or single
            ones.
        body: what was tossed.
        config: how they are read.
    """
    return Inputs(paths, body, config or InputsConfig())


class Inputs:
    """Iterates over the tosses of several inputs.

    Attributes:
        summaries: the inputs that were read to their end, so far and in order.
        origin: the recording that the last toss came from.
    """

    def __init__(self, paths: Sequence[Path], body: Body, config: InputsConfig) -> None:
        self.summaries: list[InputSummary] = []
        self.origin = TossProvenance()
        self._paths = tuple(Path(path) for path in paths)
        self._body = body
        self._config = config
        self._seen: dict[str, tuple[str, str]] = {}

    def __iter__(self) -> Iterator[Toss | Rejected | Problem]:
        for path in self._paths:
            try:
                yield from self._read(path)
            except (ContactCurationError, OSError) as error:
                yield Problem(str(path), str(error).removeprefix(f"{path}: "))

    def _read(self, path: Path) -> Iterator[Toss | Rejected | Problem]:
        read = read_contactnets_tosses if _is_contactnets(path) else read_bag_tosses
        reading = read(path, self._body, self._config)
        while True:
            try:
                item = next(reading)
            except StopIteration as end:
                self.summaries.append(end.value)
                return
            yield self._new(item) if isinstance(item, Found) else item

    def _new(self, found: Found) -> Toss | Rejected | Problem:
        """A toss that was not seen before, or why it is left out."""
        toss, content = found.toss, found.toss.digest()
        if toss.toss_id not in self._seen:
            self._seen[toss.toss_id] = (content, found.origin.input)
            self.origin = found.origin
            return found.outcome
        known, where = self._seen[toss.toss_id]
        if known == content:
            why = f"found the same one in {where}, expected each once"
        else:
            why = f"found another one of that id in {where}, expected ids that tell tosses apart"
        return Problem(found.origin.input, f"toss {toss.toss_id} is left out: {why}")


def _is_contactnets(path: Path) -> bool:
    """Whether a path is to be read as ContactNets' files: by its name, for a folder by those in it."""
    if not path.is_dir():
        return path.suffix == ".pt"
    names = [entry.name for entry in path.iterdir()]
    return not any(name.endswith(STORAGE_ENDINGS) for name in names) and any(
        name.endswith(".pt") or name == SUBFOLDER for name in names
    )
