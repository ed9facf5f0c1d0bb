"""Reads and writes checkpoints and models as .safetensors files; files are replaced atomically, reading executes no code."""

from pathlib import Path

from contact_curation.contact.body import Body
from contact_curation.contact.models.model import Model
from contact_curation.files import read_bounded, write_atomically
from contact_curation.learning.checkpoints.checkpoint import checkpoint_bytes, training_of_bytes
from contact_curation.learning.checkpoints.safetensors_bytes import LARGEST_BYTES
from contact_curation.learning.checkpoints.stored_model import body_of_bytes, model_bytes, model_of_bytes, notes_of_bytes
from contact_curation.learning.training.training import Training
from contact_curation.motion.transitions import Transitions


def save_checkpoint(path: Path, training: Training, notes: dict[str, str] | None = None) -> None:
    """Writes the state of a training without its data.

    Raises:
        InvalidValueError: the file cannot be written there.
    """
    write_atomically(path, checkpoint_bytes(training, notes))


def save_model(path: Path, model: Model) -> None:
    """Writes a model without the state of a training.

    Raises:
        InvalidValueError: the file cannot be written there.
    """
    write_atomically(path, model_bytes(model))


def resume_training(path: Path, data: Transitions, held_out: Transitions | None, body: Body | None = None) -> Training:
    """Reads the training of a checkpoint; see `learning.checkpoints.checkpoint.training_of_bytes`."""
    return training_of_bytes(_content(path), path, data, held_out, body)


def read_model(path: Path, body: Body | None = None) -> Model:
    """Reads the model of a checkpoint or of a model's file; see `learning.checkpoints.stored_model.model_of_bytes`."""
    return model_of_bytes(_content(path), path, body)


def read_body(path: Path) -> Body:
    """Reads the body of a checkpoint or of a model's file."""
    return body_of_bytes(_content(path), path)


def read_notes(path: Path) -> dict[str, str]:
    """Reads the notes of a checkpoint or of a model's file."""
    return notes_of_bytes(_content(path), path)


def _content(path: Path) -> bytes:
    return read_bounded(path, LARGEST_BYTES, "a checkpoint or a model")
