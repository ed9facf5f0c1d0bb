"""Checkpoints on disk: whole or not at all, and refused in a line where they are no checkpoint."""

import pickle
from pathlib import Path

import numpy as np
import pytest

from contact_curation.errors import InvalidValueError, UnreadableInputError
from contact_curation.learning.training.protocols import budgeted
from contact_curation.learning.training.training import Training, new_training
from contact_curation.storage import checkpoint_file
from contact_curation.storage.checkpoint_file import read_model, read_notes, resume_training, save_checkpoint, save_model
from test.contact.cases import CUBE, tracked_transitions


@pytest.fixture(scope="module")
def training() -> Training:
    kind = "polytope"
    training = new_training(kind, CUBE, tracked_transitions(), None, budgeted(kind), 0)
    training.advance(2)
    return training


def test_a_training_comes_back_from_its_file(training: Training, tmp_path: Path) -> None:
    path = tmp_path / "theta.safetensors"
    save_checkpoint(path, training, {"buffer": "4"})
    assert resume_training(path, training.data, None, CUBE).progress == training.progress
    assert read_notes(path) == {"buffer": "4"}
    found, expected = read_model(path, CUBE).tensors(), training.model.tensors()
    assert all(np.array_equal(found[name], expected[name]) for name in expected)


def test_a_checkpoint_is_replaced_and_nothing_else_is_left_behind(training: Training, tmp_path: Path) -> None:
    path = tmp_path / "theta.safetensors"
    save_model(path, training.model)
    save_checkpoint(path, training)
    assert [file.name for file in tmp_path.iterdir()] == ["theta.safetensors"]
    assert resume_training(path, training.data, None).progress == training.progress


def test_a_path_that_cannot_be_written_is_refused(training: Training, tmp_path: Path) -> None:
    with pytest.raises(InvalidValueError, match="output"):
        save_checkpoint(tmp_path / "nowhere" / "theta.safetensors", training)


def test_what_is_no_file_of_ours_is_refused_by_its_path(
    training: Training, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "theta.safetensors"
    with pytest.raises(UnreadableInputError, match=f"{path}: cannot be read"):
        read_model(path)
    with pytest.raises(UnreadableInputError, match=f"{tmp_path}: cannot be read"):
        read_model(tmp_path)
    path.write_bytes(pickle.dumps(print))
    with pytest.raises(UnreadableInputError, match=f"{path}: is no safetensors file"):
        read_model(path)
    save_checkpoint(path, training)
    monkeypatch.setattr(checkpoint_file, "LARGEST_BYTES", 1000)
    with pytest.raises(UnreadableInputError, match=f"{path}: holds more than 1000 bytes"):
        read_model(path)
