"""The tosses of ContactNets' files, after the gates; files that are none become lines."""

from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from hashlib import sha256
from pathlib import Path

from contact_curation.contact.body import Body
from contact_curation.errors import UnreadableInputError
from contact_curation.motion.calibration import put_right
from contact_curation.motion.gates import inspect
from contact_curation.motion.restored_toss import restored
from contact_curation.motion.toss import Rejected
from contact_curation.storage.bags.file import file_sha256
from contact_curation.storage.datasets.contactnets import contactnets_files, read_contactnets_toss
from contact_curation.storage.inputs.records import Found, InputReading, InputsConfig, InputSummary, Problem
from contact_curation.storage.provenance import TossProvenance


def read_contactnets_tosses(path: Path, body: Body, config: InputsConfig) -> InputReading:
    """The tosses of a folder of files, or of one, in the order of their numbers.

    Raises:
        UnreadableInputError: there are no files, or no file is a toss.
    """
    files = contactnets_files(path)
    gates = config.gates.of_body(body.gravity, body.friction).of_tracker(config.segmenter.tracker_noise)
    config = replace(config, gates=gates)
    digests = [file_sha256(file) for file in files]
    counts: Counter[str] = Counter()
    unreadable: list[UnreadableInputError] = []  # said once there is a toss; else the whole folder is something else
    for file, digest in zip(files, digests):
        try:
            found = _gated(file, digest, body, config)
        except UnreadableInputError as error:
            unreadable.append(error)
        else:
            counts["rejected" if isinstance(found.outcome, Rejected) else "tosses"] += 1
            counts["poses"] += found.toss.frames
            yield found
        if counts:
            yield from _told(path, unreadable)
    if not counts:
        raise unreadable[0] if len(files) == 1 else _none_of(path, files, unreadable[0])
    return InputSummary(str(path), _together(files, digests), "", None, None, dict(counts))


def _gated(file: Path, digest: str, body: Body, config: InputsConfig) -> Found:
    stored = read_contactnets_toss(file, body)
    toss = stored if config.as_stored else put_right(restored(stored).toss, config.rig)
    reasons = inspect(toss, body.polytope, config.gates)
    return Found(Rejected(toss, reasons) if reasons else toss, TossProvenance(str(file), digest))


def _told(path: Path, unreadable: list[UnreadableInputError]) -> Iterator[Problem]:
    yield from (Problem(str(path), str(error).removeprefix(f"{path}/")) for error in unreadable)
    unreadable.clear()


def _none_of(path: Path, files: list[Path], first: UnreadableInputError) -> UnreadableInputError:
    why = str(first).removeprefix(f"{path}/")
    return UnreadableInputError(path, f"found {len(files)} .pt files, none of them a toss of ContactNets', e.g. {why}")


def _together(files: list[Path], digests: list[str]) -> str:
    if len(digests) == 1:
        return digests[0]
    return sha256("".join(f"{digest}  {file.name}\n" for digest, file in zip(digests, files)).encode()).hexdigest()
