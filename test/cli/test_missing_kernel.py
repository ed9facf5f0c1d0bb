"""Without the compiled kernel `rank`, `score` and `train` of networks go on in torch; the others end in one line."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from contact_curation.solver import compiled
from test.cli.commands import Cli


@pytest.fixture
def no_kernel(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setattr(compiled, "KERNEL_FOLDER", tmp_path)
    compiled.load_kernel.cache_clear()
    yield
    compiled.load_kernel.cache_clear()


@pytest.mark.usefixtures("no_kernel")
@pytest.mark.parametrize("verb", ["train", "evaluate", "design"])
def test_a_verb_that_needs_it_ends_in_one_line_and_writes_nothing(
    cli: Cli, golden: Path, true_parameters: Path, tmp_path: Path, verb: str
) -> None:
    words = {
        "train": (golden, "--steps", "1", "--out", tmp_path / "model.safetensors"),
        "evaluate": (true_parameters, golden, "--figure", tmp_path / "motion.png"),
        "design": ("--throws", "1", "--out", tmp_path / "throws.json"),
    }
    done = cli(verb, *words[verb])
    assert (done.status, done.out, len(done.err_lines)) == (1, "", 1)
    assert "the compiled kernel" in done.err
    assert "make test" in done.err
    assert list(tmp_path.iterdir()) == [true_parameters]


def test_scores_are_the_same_without_it(
    cli: Cli, golden: Path, true_parameters: Path, tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    command = ("score", golden, "--params", true_parameters, "--out", tmp_path / "scores.npz", "--json")
    compiled_loss = cli(*command).json["mean_loss"]
    request.getfixturevalue("no_kernel")
    done = cli(*command)
    assert (done.status, done.json["not_solved"]) == (0, 0)
    assert done.json["mean_loss"] == pytest.approx(compiled_loss, rel=1e-6)
