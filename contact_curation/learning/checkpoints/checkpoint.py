"""Stores a training as bytes, so that it continues bit for bit as if it had not been stopped."""

from dataclasses import asdict
from math import inf, isfinite, nan
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import torch

from contact_curation.contact.body import Body
from contact_curation.contact.evaluation import Cone
from contact_curation.contact.loss_config import LossConfig
from contact_curation.contact.parameter_form import Form
from contact_curation.errors import InvalidValueError, UnreadableInputError
from contact_curation.learning.checkpoints.safetensors_bytes import Packed, pack, unpack
from contact_curation.learning.checkpoints.stored_model import (
    BEST,
    LAST,
    MALFORMED,
    description,
    model_of_packed,
    named,
    named_back,
)
from contact_curation.learning.training.objective import InfluenceBound, InfluenceShape
from contact_curation.learning.training.progress import Counters, EarlyStop, Evaluated, TrainingMemory, TrainingState
from contact_curation.learning.training.protocols import AdamWConfig, Patience, Schedule, TrainingConfig
from contact_curation.learning.training.training import Training
from contact_curation.motion.transitions import Transitions

MOMENTS, ORDER, ORIGIN = "moments/", "order", "origin/"
HISTORY = 1000
"""Evaluations that are kept, the last ones."""


class HowTrained(NamedTuple):
    """How a model was trained, as far as its checkpoint says.

    Attributes:
        loss: that its training minimised; None where that is not known.
        shape_known_to: how exactly its training knew the corners beforehand [m]; None where it did not.
        at_optimum: whether its training ended at the optimum of its tosses.
    """

    loss: LossConfig | None = None
    shape_known_to: float | None = None
    at_optimum: bool = False


def checkpoint_bytes(training: Training, notes: dict[str, str] | None = None) -> bytes:
    """The state of a training without its data, as bytes.

    Args:
        training: of any model.
        notes: whatever else the reader should know, such as which buffer the data are.
    """
    memory = training.memory
    best = {} if memory.best_tensors is None else memory.best_tensors
    moments = {name: value.numpy() for name, value in memory.moments.items()}
    arrays = {**named(LAST, training.model.tensors()), **named(BEST, best), **named(MOMENTS, moments), ORDER: memory.order}
    arrays |= named(ORIGIN, memory.origin or {})
    documents = {
        "model": description(training.model),
        "training": {"config": document_of(training.config), **_memory_document(memory)},
        "notes": notes or {},
    }
    return pack(arrays, documents)


def training_of_bytes(
    data: bytes, source: Path | str, transitions: Transitions, held_out: Transitions | None, body: Body | None = None
) -> Training:
    """The training in the bytes of a checkpoint, to go on with.

    Args:
        data: untrusted.
        source: where they come from, for the message.
        transitions: the same as it had, or others, which then replace them.
        held_out: likewise.
        body: which the model must be for; None takes the body as stored.

    Raises:
        UnreadableInputError: no such bytes, a model without a training, or one for another body.
        InvalidValueError: transitions that a training refuses.
    """
    packed = unpack(data, source)
    if "training" not in packed.documents:
        raise UnreadableInputError(source, "holds a model without its training, expected a checkpoint")
    model = model_of_packed(packed, source, body, last=True)
    try:
        config, memory = _memory_of(packed)
    except MALFORMED as error:
        raise UnreadableInputError(source, f"holds no training ({type(error).__name__}: {error})") from error
    return Training.resumed(model, transitions, held_out, config, memory)


def how_trained(data: bytes, source: Path | str) -> HowTrained:
    """How the model in the bytes of a checkpoint was trained; of a model alone nothing is known.

    Raises:
        UnreadableInputError: no such bytes, no weights of a loss, or no length.
    """
    try:
        training = unpack(data, source).documents.get("training")
        if training is None:
            return HowTrained()
        config = training["config"]
        found = config.get("shape_known_to")
        known_to = None if found is None else float(found)
        converged = training["counters"]["state"] == TrainingState.CONVERGED
        told = HowTrained(_loss_of(config["loss"]), known_to, bool(config.get("exact")) and converged)
    except MALFORMED as error:
        raise UnreadableInputError(source, f"holds no training ({type(error).__name__}: {error})") from error
    if known_to is not None and not (isfinite(known_to) and known_to > 0.0):
        raise UnreadableInputError(source, f"found shape_known_to {known_to}, expected a positive number of metres")
    return told


def document_of(config: TrainingConfig) -> dict[str, Any]:
    """A protocol as JSON takes it: enumerations are strings already."""
    return asdict(config)


def config_of(document: dict[str, Any]) -> TrainingConfig:
    """The inverse of `document_of`; every record checks its own values.

    Raises:
        KeyError, TypeError, ValueError, InvalidValueError: a document of another form.
    """
    patience, influence = document["patience"], document["influence"]
    return TrainingConfig(
        **{
            **document,
            "form": Form(document["form"]),
            "polytope": AdamWConfig(**document["polytope"]),
            "network": AdamWConfig(**document["network"]),
            "schedule": Schedule(document["schedule"]),
            "patience": None if patience is None else Patience(**patience),
            "influence": InfluenceBound(**{**influence, "shape": InfluenceShape(influence["shape"])}),
            "loss": _loss_of(document["loss"]),
        }
    )


def _loss_of(document: dict[str, Any]) -> LossConfig:
    """The loss as stored; earlier versions stored no `balanced`, and had the published one."""
    return LossConfig(**{"balanced": False, **document, "cone": Cone(document["cone"])})


def _memory_document(memory: TrainingMemory) -> dict[str, Any]:
    """JSON has no numbers that are not finite: they are null."""
    return {
        "counters": asdict(memory.counters),
        "best": memory.early_stop.best if isfinite(memory.early_stop.best) else None,
        "waited": memory.early_stop.waited,
        "history": [_finite_or_null(entry) for entry in memory.history[-HISTORY:]],
        "batches": memory.batches,
        "data": memory.data,
        "held_out": memory.held_out,
    }


def _memory_of(packed: Packed) -> tuple[TrainingConfig, TrainingMemory]:
    told = packed.documents["training"]
    np.random.PCG64().state = told["batches"]["generator"]  # refuses what is none
    moments = named_back(MOMENTS, packed.arrays)
    memory = TrainingMemory(
        counters=_counters(told["counters"]),
        early_stop=EarlyStop(inf if told["best"] is None else float(told["best"]), int(told["waited"])),
        history=tuple(_evaluated(entry) for entry in told["history"]),
        best_tensors=named_back(BEST, packed.arrays) or None,
        moments={name: torch.tensor(value) for name, value in moments.items()},
        order=packed.arrays[ORDER].copy(),
        batches=dict(told["batches"]),
        data=str(told["data"]),
        held_out=str(told["held_out"]),
        origin=named_back(ORIGIN, packed.arrays) or None,
    )
    return config_of(told["config"]), memory


def _counters(told: dict[str, Any]) -> Counters:
    counters = Counters(**{**told, "state": TrainingState(told["state"])})
    for name, default in asdict(Counters()).items():
        value = getattr(counters, name)
        if type(value) is not type(default) or (type(value) is int and value < 0):
            raise InvalidValueError(name, value, f"a {type(default).__name__} of at least 0")
    return counters


def _finite_or_null(entry: Evaluated) -> dict[str, Any]:
    return {name: value if isfinite(value) else None for name, value in asdict(entry).items()}


def _evaluated(entry: dict[str, Any]) -> Evaluated:
    losses = {name: nan if entry[name] is None else float(entry[name]) for name in ("training_loss", "held_out_loss")}
    return Evaluated(gradient_steps=int(entry["gradient_steps"]), epochs=int(entry["epochs"]), **losses)
