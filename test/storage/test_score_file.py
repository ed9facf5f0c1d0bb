"""Score files: what was added comes back, from plain numpy, and nothing half-written is left."""

from pathlib import Path

import numpy as np
import pytest

from contact_curation.contact.evaluation import LOSS_TERMS, Evaluation
from contact_curation.errors import InvalidValueError
from contact_curation.storage.score_file import ScoreFileWriter

NAMES = ("a[0]", "a[1]", "height")


def evaluation(count: int, seed: int) -> Evaluation:
    rng = np.random.default_rng(seed)
    return Evaluation(
        terms=rng.normal(size=(count, 5)),
        impulses=rng.normal(size=(count, 2, 3)),
        scores=rng.normal(size=(count, 4)),
        residuals=rng.normal(size=count),
        status=rng.integers(0, 3, count).astype(np.int32),
        iterations=np.zeros(count, np.int32),
    )


def test_what_was_added_comes_back_as_plain_arrays_without_pickle(tmp_path: Path) -> None:
    first, second = evaluation(3, 1), evaluation(5, 2)
    with ScoreFileWriter(tmp_path / "scores.npz", NAMES) as writer:
        writer.add("7", np.arange(3), first)
        writer.add("a-longer-id", np.arange(5), second)
    with np.load(tmp_path / "scores.npz", allow_pickle=False) as file:
        read = dict(file)
    assert read["toss_id"].tolist() == ["7"] * 3 + ["a-longer-id"] * 5
    assert read["index"].tolist() == [0, 1, 2, 0, 1, 2, 3, 4]
    assert read["parameter_names"].tolist() == list(NAMES)
    assert set(read) == {
        *LOSS_TERMS,
        "toss_id",
        "index",
        "loss",
        "impulse",
        "score",
        "parameter_names",
        "status",
        "kkt_residual",
        "format_version",
    }
    expected = {
        "impulse": [first.impulses, second.impulses],
        "score": [first.scores[:, :3], second.scores[:, :3]],
        "cone": [first.terms[:, 3], second.terms[:, 3]],
        "loss": [first.losses, second.losses],
        "status": [first.status.astype(float), second.status.astype(float)],
        "kkt_residual": [first.residuals, second.residuals],
    }
    for name, values in expected.items():
        np.testing.assert_array_equal(read[name], np.concatenate(values))
    assert [path.name for path in tmp_path.iterdir()] == ["scores.npz"]


def test_an_error_leaves_the_old_file_and_nothing_else(tmp_path: Path) -> None:
    path = tmp_path / "scores.npz"
    path.write_bytes(b"old")
    with pytest.raises(RuntimeError, match="on purpose"), ScoreFileWriter(path, NAMES) as writer:
        writer.add("7", np.arange(3), evaluation(3, 1))
        raise RuntimeError("on purpose")
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("name", ["scores.txt", "scores", "missing/scores.npz"])
def test_a_path_that_cannot_be_written_is_refused_at_once(tmp_path: Path, name: str) -> None:
    with pytest.raises(InvalidValueError, match="output"):
        ScoreFileWriter(tmp_path / name, NAMES)
