"""The plan of a training, which determines its result bit for bit, however often it is stopped and resumed.

A checkpoint says which plan it belongs to, and goes on with no other.
"""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from functools import cached_property
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np

from contact_curation.configs import word_of
from contact_curation.contact.body import Body
from contact_curation.contact.models.model import Model, Rows
from contact_curation.contact.models.polytope import PolytopeModel
from contact_curation.contact.models.registry import model_class
from contact_curation.errors import InvalidValueError, UnreadableInputError
from contact_curation.information.scoring import ScoringConfig
from contact_curation.learning.checkpoints.checkpoint import checkpoint_bytes, config_of, document_of, training_of_bytes
from contact_curation.learning.checkpoints.selection_document import document_of_selections, selections_of
from contact_curation.learning.checkpoints.stored_model import MALFORMED, notes_of_bytes
from contact_curation.learning.fits.exact_fit import theta_0
from contact_curation.learning.training.curated import CuratedTraining, selected_transitions, toss_scorer
from contact_curation.learning.training.data import rows_of
from contact_curation.learning.training.protocols import TrainingConfig
from contact_curation.learning.training.reranking import Reranking, RerankingConfig, Selected
from contact_curation.learning.training.training import Training
from contact_curation.motion.toss import Toss
from contact_curation.motion.transitions import Transitions, transitions_of

SELECTIONS = "selections"
"""The note that says what was selected."""

PROTOCOL, STAGE = "protocol", "training"
"""The note with the protocol's settings, and what stands before their names in `--set`."""


@dataclass(frozen=True, eq=False)
class TrainingPlan:
    """A training before it begins.

    Attributes:
        kind: name of the model.
        body: what is known of the object.
        protocol: how it is trained.
        tosses: what it may learn from, at least one.
        held_out: what it never learns from.
        seed: of the initialisation and the shuffles.
        start: the model to begin with, left as it is; None for the published random initialisation.
        selection: which of the tosses it learns from; None for all.
        scoring: how tosses are scored for that.
    """

    kind: str
    body: Body
    protocol: TrainingConfig
    tosses: tuple[Toss, ...]
    held_out: tuple[Toss, ...]
    seed: int = 0
    start: Model | None = None
    selection: RerankingConfig | None = None
    scoring: ScoringConfig = field(default_factory=ScoringConfig)

    @cached_property
    def length_scale(self) -> float:
        """The unit of length of the model."""
        return (self.start.body if self.start else self.body).length_scale

    @cached_property
    def held_out_transitions(self) -> Transitions | None:
        """None if nothing is held out."""
        return transitions_of(self.held_out, self.length_scale) if self.held_out else None

    @cached_property
    def identity(self) -> dict[str, str]:
        """What must be the same to go on, by name, in words for people; the values of a digest stand for the numbers."""
        selection = None if self.selection is None else {**asdict(self.selection), "scoring": asdict(self.scoring)}
        return {
            "model": self.kind,
            PROTOCOL: json.dumps(document_of(self.protocol), sort_keys=True),
            "seed": str(self.seed),
            "tosses": _described(self.tosses),
            "held-out tosses": _described(self.held_out),
            "selection": json.dumps(selection, sort_keys=True),
            "start": _start_described(self.start),
        }


def begin(plan: TrainingPlan) -> CuratedTraining:
    """The training of a plan before its first step; its first selection is made at the theta that it begins at.

    Raises:
        InvalidValueError: nothing to learn from, or nothing held out where the protocol needs it.
    """
    noise, shuffles = np.random.SeedSequence(plan.seed).generate_state(2)
    everything = transitions_of(plan.tosses, plan.length_scale)
    model = plan.start.with_tensors(plan.start.tensors()) if plan.start else first_model(
        plan.kind, plan.body, plan.protocol, rows_of(everything), int(noise)
    )  # fmt: skip
    reranking = _reranking(plan)
    first = reranking.select(theta_0(model) if plan.protocol.exact else model) if reranking else None
    data = selected_transitions(plan.tosses, first.toss_ids, plan.length_scale) if first else everything
    training = Training(model, data, plan.held_out_transitions, plan.protocol, int(shuffles))
    return CuratedTraining(training, plan.tosses, reranking, (first,) if first else ())


def first_model(kind: str, body: Body, protocol: TrainingConfig, data: Rows, seed: int) -> Model:
    """The model that a training begins at where none is given: the published initialisation, or a shape that is known.

    Args:
        kind: name of the model.
        body: the object.
        protocol: how it is trained.
        data: what it learns from first.
        seed: of the published initialisation.
    """
    if protocol.shape_known_to is not None:
        return PolytopeModel.as_described(body, protocol.form, data)
    return model_class(kind).initial(body, protocol.form, data, np.random.default_rng(seed))


def stored(plan: TrainingPlan, curated: CuratedTraining, notes: Mapping[str, str] | None = None) -> bytes:
    """A training of the plan as the bytes of a checkpoint, with `notes` of one's own."""
    selections = document_of_selections(curated.selections)
    return checkpoint_bytes(curated.training, {**(notes or {}), **plan.identity, SELECTIONS: selections})


def resume(plan: TrainingPlan, data: bytes, source: Path | str) -> CuratedTraining:
    """Goes on where the training in the bytes of a checkpoint was.

    Args:
        plan: the one it was begun with.
        data: untrusted.
        source: where they come from, for the message.

    Raises:
        UnreadableInputError: no such bytes.
        InvalidValueError: they belong to another plan; the line says in what it differs.
    """
    notes = notes_of_bytes(data, source)
    _check_identity(plan.identity, notes, source)
    try:
        selections = selections_of(notes[SELECTIONS])
    except MALFORMED as error:
        raise UnreadableInputError(source, f"says not what was selected ({type(error).__name__}: {error})") from error
    last = selections[-1] if selections else None
    reranking = _reranking(plan, last)
    ids = last.toss_ids if last else [toss.toss_id for toss in plan.tosses]
    transitions = selected_transitions(plan.tosses, ids, plan.length_scale)
    body = plan.start.body if plan.start else plan.body
    training = training_of_bytes(data, source, transitions, plan.held_out_transitions, body)
    return CuratedTraining(training, plan.tosses, reranking, selections)


def _reranking(plan: TrainingPlan, last: Selected | None = None) -> Reranking | None:
    if plan.selection is None:
        return None
    scorer = toss_scorer(plan.scoring, plan.selection.ranking.criterion)
    return Reranking(plan.tosses, scorer, plan.selection, last)


def _check_identity(expected: Mapping[str, str], notes: Mapping[str, str], source: Path | str) -> None:
    for name, value in expected.items():
        if name not in notes:
            raise UnreadableInputError(source, f"says not which {name} it belongs to, expected a checkpoint of `train`")
        path, stored = (STAGE, _protocol_of(notes[name], source)) if name == PROTOCOL else ("", notes[name])
        differences = list(_differences(_document(value), _document(stored), path))
        if differences:
            found, wanted = (" ".join(texts) for texts in zip(*differences, strict=True))
            how = ": add " + " ".join(f"--set {text}" for _, text in differences) if path else ""
            raise InvalidValueError(f"{name} of the training to go on with", found, f"{wanted} as in {source}{how}")


def _document(text: str) -> Any:
    """What a note has as JSON; other notes are texts."""
    try:
        return json.loads(text)
    except ValueError:
        return text


def _protocol_of(text: str, source: Path | str) -> str:
    """A protocol as stored, with settings that the version did not have that stored it as they were without them."""
    try:
        return json.dumps(document_of(config_of(json.loads(text))))
    except MALFORMED as error:
        raise UnreadableInputError(source, f"holds no protocol ({type(error).__name__}: {error})") from error


def _differences(own: Any, stored: Any, path: str) -> Iterator[tuple[str, str]]:
    """Two values that differ; of JSON objects each setting that both have, as `--set` takes it."""
    if isinstance(own, dict) and isinstance(stored, dict):
        for name in sorted(own.keys() & stored.keys()):
            yield from _differences(own[name], stored[name], f"{path}.{name}" if path else name)
    elif own != stored:
        start = f"{path}=" if path else ""
        yield start + word_of(own), start + word_of(stored)


def _described(tosses: Sequence[Toss]) -> str:
    return f"{len(tosses)} tosses, digest {_digest([toss.digest() for toss in tosses])}"


def _start_described(start: Model | None) -> str:
    if start is None:
        return "the published initialisation"
    body = {name: np.asarray(getattr(start.body, name)).tolist() for name in ("mass", "inertia", "length_scale")}
    tensors = {name: value.tolist() for name, value in start.tensors().items()}
    return f"a {start.kind}, digest {_digest([start.settings(), body, tensors])}"


def _digest(content: Any) -> str:
    return sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:16]
