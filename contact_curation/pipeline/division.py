"""Divides tosses into training tosses and held-out tosses, with a line for each toss that is left out.

The tosses are read before they are divided, since a training toss can be the duplicate of a held-out one that comes in a later
recording.
"""

import re
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path

from contact_curation.configs import changed_fields
from contact_curation.errors import ContactCurationError, InvalidValueError, UnreadableInputError, why_unreadable
from contact_curation.learning.evaluation.held_out import Duplicate, HeldOutRule, NumberedToss, possible_duplicates, split
from contact_curation.motion.toss import Toss
from contact_curation.pipeline.reading import Reading
from contact_curation.pipeline.tosses import EachOnce, Tosses, copies_among
from contact_curation.pipeline.wording import counted_tosses, listed
from contact_curation.storage.export.selected import changed_inputs
from contact_curation.storage.inputs.inputs import InputsConfig
from contact_curation.storage.manifest.file import FORMATS, read_manifest
from contact_curation.storage.manifest.manifest import Manifest

NOTHING = "none"
NUMBERS = re.compile(r"\d{1,9}(-\d{1,9})?(,\d{1,9}(-\d{1,9})?)*", re.ASCII)
SHARE = re.compile(r"0?\.\d+", re.ASCII)
LARGEST_FILE = 1 << 26
"""Bytes; a million ids take half of it."""

OF_TOSSES = ("rig.", "segmenter.", "poses.transforms_ahead=")
"""Settings with which the same recording gives other tosses under the same ids."""

HELD_OUT = "held out"
DUPLICATE = "duplicate of a held-out toss"


type HeldOut = str | PathLike[str] | float | Iterable[int]
"""Which tosses are held out: as a command's option says it, a file of ids, a share, a number, or several numbers."""


def held_out_rule(spec: HeldOut, name: str = "--held-out") -> HeldOutRule:
    """Parses which tosses are held out: numbers as 400-569 or 3,7-9, a share as 0.2, a file of ids, a manifest, or none.

    Args:
        spec: text, or numbers, a share or a path themselves.
        name: of the option or parameter, for messages.

    Raises:
        InvalidValueError: it is nothing of what is accepted.
        UnreadableInputError: it names a file that holds no ids.
    """
    text = _as_text(spec)
    if text == NOTHING:
        return HeldOutRule(name=name)
    spans = spans_of(text)
    if spans is not None:
        return HeldOutRule(spans=spans, name=name)
    if SHARE.fullmatch(text):
        return HeldOutRule(share=float(text), name=name)
    if not (isinstance(spec, str | PathLike) and text and Path(spec).exists()):
        expected = "numbers such as 400-569, a share such as 0.2, none, or the name of a file with ids"
        raise InvalidValueError(name, repr(spec), expected)
    return HeldOutRule(ids=_ids_in(Path(spec)), name=name)


def _as_text(spec: object) -> str:
    """`3,7,8` of numbers, ./400 of a path, so that it is not read as a number; empty for what is no number.

    These are truth values, bytes, whose elements are codes of letters, and arrays without dimensions.
    """
    if isinstance(spec, PathLike):
        return f"./{spec}"
    if isinstance(spec, Iterable) and not isinstance(spec, str):
        other = isinstance(spec, bytes | bytearray) or getattr(spec, "shape", None) == ()
        return "" if other else ",".join(map(_as_text, spec))
    return "" if isinstance(spec, bool) else str(spec)


def spans_of(spec: str) -> tuple[tuple[int, int], ...] | None:
    """First and last numbers, both included, of `400-569` or `3,7-9`; None where it is no numbers."""
    return tuple(_span(part) for part in spec.split(",")) if NUMBERS.fullmatch(spec) else None


class OtherRecordingsError(ContactCurationError):
    """A manifest is of other recordings than those that were given."""

    def __init__(self, manifest: Path | None, given: Sequence[str]) -> None:
        made = [one.path for one in read_manifest(manifest).run.inputs] if manifest else []
        what = f"{manifest} was made from {listed(_names(made)) or 'other tosses'}"
        super().__init__(f"{what}; you gave {listed(_names(given))}, which holds none of its selected tosses")


def _names(paths: Sequence[str]) -> list[str]:
    return [Path(path).name for path in paths if path]


def selected_ids(manifest: Path) -> tuple[str, ...]:
    """Ids of the tosses that a ranking selected, best first.

    Raises:
        UnreadableInputError: the file is no manifest.
        InvalidValueError: it selected nothing.
    """
    ids = tuple(row.toss_id for row in read_manifest(manifest).selected)
    if not ids:
        raise InvalidValueError(f"selected tosses of {manifest}", "none", "at least one: rank again, with tosses that pass")
    return ids


@dataclass(frozen=True)
class HeldOutTosses:
    """Tosses that are held out of a pool.

    Attributes:
        reasons: by toss id, in one line.
        warnings: about what a rule names and nobody has, one line each.
    """

    reasons: Mapping[str, str] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()


def held_out_tosses(
    readings: Sequence[Reading], rule: HeldOutRule, motions: Callable[[Mapping[str, int]], Mapping[str, Toss]]
) -> HeldOutTosses:
    """Finds the held-out tosses of recordings and their duplicates under other ids.

    Args:
        readings: what is known of the recordings.
        rule: what is held out.
        motions: gets ids with the places of their recordings, and returns these tosses; called only if some may be duplicates.

    Raises:
        InvalidValueError: the rule holds out none of the tosses.
    """
    if rule == HeldOutRule():
        return HeldOutTosses()
    once = EachOnce()
    for reading in readings:
        once.add(reading)
    pool = {toss_id: taken for toss_id, taken in sorted(once.taken.items()) if not taken.seen.reasons}
    numbers = {toss_id: taken.seen.number for toss_id, taken in pool.items()}
    ids = frozenset(toss_id for toss_id, number in numbers.items() if rule.names(toss_id, number))
    if pool:
        _check_something_is_held_out(rule, len(ids), numbers.values())
    outlines = {
        held_out: {i: one.seen.outline for i, one in pool.items() if (i in ids) == held_out} for held_out in (False, True)
    }
    alike = sorted(possible_duplicates(outlines[False], outlines[True]))
    tosses = motions({toss_id: pool[toss_id].recording for toss_id in alike}) if alike else {}
    parts = split([NumberedToss(tosses[toss_id], numbers[toss_id]) for toss_id in alike], HeldOutRule(ids=ids))
    reasons = dict.fromkeys(ids, HELD_OUT)
    reasons |= {duplicate.left_out: f"{DUPLICATE}: {duplicate.held_out}" for duplicate in parts.duplicates}
    return HeldOutTosses(reasons, tuple(_unknown_ids(rule, numbers)))


@dataclass(frozen=True, eq=False)
class DivisionConfig:
    """How tosses are divided into training tosses and held-out tosses.

    Attributes:
        rule: what is held out.
        said: whether the user said so; else what a manifest selected is not held out.
        manifest: where `selected` comes from.
        selected: ids of what may be learned from; None for all.
        with_duplicates: learn from motions that are held out under another id.
    """

    rule: HeldOutRule = field(default_factory=HeldOutRule)
    said: bool = False
    manifest: Path | None = None
    selected: tuple[str, ...] | None = None
    with_duplicates: bool = False


@dataclass(frozen=True, eq=False)
class LearningTosses:
    """Training tosses and held-out tosses, both in the order of their ids.

    Attributes:
        training: to learn from.
        held_out: never to learn from.
        duplicates: left out of the training since they are held out under another id.
        rejected: how many tosses failed a gate, by reason.
        warnings: what is wrong with the inputs, one line each.
    """

    training: tuple[Toss, ...]
    held_out: tuple[Toss, ...]
    duplicates: tuple[Duplicate, ...]
    rejected: Counter[str]
    warnings: tuple[str, ...]


def ranked_otherwise(manifest: Manifest, name: object, tosses: Tosses) -> list[str]:
    """A line for each recording with selected tosses that has other bytes than the ranked one, and one for other settings.

    Args:
        manifest: of the ranking.
        name: of the manifest, for the line.
        tosses: read now.
    """
    found = [(row, tosses.taken[row.toss_id].seen.origin) for row in manifest.selected if row.toss_id in tosses.taken]
    return [*changed_inputs(found), *_read_otherwise(manifest, name, tosses.config.inputs)]


def _read_otherwise(manifest: Manifest, name: object, inputs: InputsConfig) -> list[str]:
    """A line where tosses are read with another rig calibration or segmentation than they were ranked with, or none."""
    ranked, now = (
        " ".join(f"--set {setting}" for setting in settings if setting.startswith(OF_TOSSES)) or "no such setting"
        for settings in (manifest.run.settings, changed_fields(inputs, InputsConfig()))
    )
    return [] if ranked == now else [f"{name}: its tosses were ranked with {ranked}, and are read here with {now}"]


def learning_tosses(tosses: Tosses, config: DivisionConfig) -> LearningTosses:
    """Divides tosses into training tosses and held-out tosses.

    Raises:
        NothingFoundError: there is no toss.
        InvalidValueError: there is nothing to learn from, or nothing of what was to be held out.
    """
    pool = tosses.check_some("no toss to learn from").numbered
    selected = None if config.selected is None else frozenset(config.selected)
    exempt = frozenset() if config.said or selected is None else selected
    held_out = [one for one in pool if one.toss.toss_id not in exempt and config.rule.holds_out(one)]
    if config.said:
        _check_something_is_held_out(config.rule, len(held_out), [one.number for one in pool])
    others = [one for one in pool if selected is None or one.toss.toss_id in selected]
    if not others:
        raise OtherRecordingsError(config.manifest, tosses.paths)
    ids = frozenset(one.toss.toss_id for one in held_out)
    parts = split(
        [*held_out, *(one for one in others if one.toss.toss_id not in ids)], HeldOutRule(ids=ids), config.with_duplicates
    )
    otherwise = ranked_otherwise(read_manifest(config.manifest), config.manifest, tosses) if config.manifest else []
    copies = (line for part in (parts.training, parts.held_out) for line in copies_among(part, tosses.body))
    lines = (*tosses.warnings, *_missing(pool, ids, config), *otherwise, *copies)
    if not parts.training:
        why = f"none of {len(pool)}: {len(held_out)} are held out, {len(parts.duplicates)} are duplicates of those"
        raise InvalidValueError("tosses to learn from", why, "at least one: hold out fewer, or give more recordings")
    return LearningTosses(parts.training, parts.held_out, parts.duplicates, tosses.reasons, lines)


def _missing(tosses: Sequence[NumberedToss], held_out: frozenset[str], config: DivisionConfig) -> list[str]:
    """Lines about ids that were named and are not there, or not to be learned from."""
    there = {one.toss.toss_id for one in tosses}
    lines = _unknown_ids(config.rule, there)
    selected = config.selected or ()
    absent = [toss_id for toss_id in selected if toss_id not in there]
    if absent:
        few = f"{len(absent)} of {len(selected)} selected tosses are not in the inputs"
        lines.append(f"{config.manifest}: {few}: {listed(absent)}")
    withheld = [toss_id for toss_id in selected if toss_id in held_out]
    if withheld:
        lines.append(f"{config.manifest}: {len(withheld)} of {len(selected)} selected tosses are held out: {listed(withheld)}")
    return lines


def _check_something_is_held_out(rule: HeldOutRule, held_out: int, numbers: Collection[int]) -> None:
    """InvalidValueError when a rule that a user gave holds nothing out of a pool with these numbers."""
    if held_out or rule == HeldOutRule():
        return
    tosses = counted_tosses(len(numbers))
    if rule.spans:
        spans = ", ".join(str(first) if first == last else f"{first}-{last}" for first, last in rule.spans)
        each = ", counted in each recording" if len(set(numbers)) < len(numbers) else ""
        said = f"some of the {tosses} that passed, from {min(numbers)} to {max(numbers)}{each}"
        raise InvalidValueError(rule.name, f"numbers {spans}", said)
    if rule.ids:
        found = f"{len(rule.ids)} ids, none of them of the {tosses}"
        raise InvalidValueError(rule.name, found, "ids of these recordings: is it the file of others?")
    expected = f"more tosses, a larger share, or numbers such as 0-{max(0, len(numbers) // 5)}"
    raise InvalidValueError(rule.name, f"a share of {rule.share:g} that takes none of {tosses}", expected)


def _unknown_ids(rule: HeldOutRule, there: Collection[str]) -> list[str]:
    """A line about ids that a rule names and that are not there, or none."""
    unknown = [toss_id for toss_id in sorted(rule.ids) if toss_id not in there]
    if not unknown:
        return []
    return [f"{rule.name}: {len(unknown)} of {len(rule.ids)} ids are not among the tosses: {listed(unknown)}"]


def _span(text: str) -> tuple[int, int]:
    first, _, last = text.partition("-")
    return int(first), int(last or first)


def _ids_in(path: Path) -> frozenset[str]:
    if path.suffix in FORMATS:
        return frozenset(row.toss_id for row in read_manifest(path).selected)
    try:
        with path.open("rb") as file:
            data = file.read(LARGEST_FILE + 1)
        lines = data.decode().splitlines()
    except OSError as error:
        raise UnreadableInputError(path, f"cannot be read: {why_unreadable(path, error)}") from error
    except UnicodeDecodeError as error:
        raise UnreadableInputError(path, "holds no text, expected an id a line") from error
    ids = frozenset(line.strip() for line in lines) - {""}
    if len(data) > LARGEST_FILE or not ids:
        raise UnreadableInputError(path, f"holds {len(data)} bytes and {len(ids)} ids, expected an id a line")
    return ids
