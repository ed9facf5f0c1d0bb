"""Without the compiled kernel every verb that needs it, of a network too, ends in one line that says how to build it."""

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
@pytest.mark.parametrize("verb", ["rank", "score", "train", "train deep", "evaluate", "design"])
def test_a_verb_that_needs_it_ends_in_one_line_and_writes_nothing(
    cli: Cli, golden: Path, true_parameters: Path, tmp_path: Path, verb: str
) -> None:
    words = {
        "rank": (golden, "--out", tmp_path / "ranked.json"),
        "score": (golden, "--params", true_parameters, "--out", tmp_path / "scores.npz"),
        "train deep": (golden, "--model", "deep", "--steps", "1", "--out", tmp_path / "model.safetensors"),
        "train": (golden, "--steps", "1", "--out", tmp_path / "model.safetensors"),
        "evaluate": (true_parameters, golden, "--figure", tmp_path / "motion.png"),
        "design": ("--throws", "1", "--out", tmp_path / "throws.json"),
    }
    done = cli(verb.split()[0], *words[verb])
    assert (done.status, done.out, len(done.err_lines)) == (1, "", 1)
    assert "the compiled kernel" in done.err
    assert "make test" in done.err
    assert list(tmp_path.iterdir()) == [true_parameters]
