"""The worked example of CONTRIBUTING.md, taken word for word in a scratch copy: a file, a line and a test add a criterion."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from contact_curation.storage.manifest.file import read_manifest
from test.conftest import REPOSITORY

STEP = re.compile(r"^`(?P<path>[^`]+)`[^\n]*\n\n```python\n(?P<text>.*?)```", re.MULTILINE | re.DOTALL)


def steps() -> list[tuple[str, str]]:
    """Files that the example writes, with what it writes into them."""
    text = (REPOSITORY / "CONTRIBUTING.md").read_text(encoding="utf-8")
    example = text.partition("### Add a criterion\n")[2].partition("\n## ")[0].partition("\n### ")[0]
    return [(step["path"], step["text"]) for step in STEP.finditer(example)]


@pytest.fixture(scope="module")
def scratch(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The package and the tests it takes, with the example's steps taken."""
    folder = tmp_path_factory.mktemp("scratch")
    for part in ("contact_curation", "test/information"):
        shutil.copytree(REPOSITORY / part, folder / part, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("pyproject.toml", "test/__init__.py", "test/conftest.py"):
        shutil.copy(REPOSITORY / name, folder / name)
    for path, text in steps():
        with (folder / path).open("a", encoding="utf-8") as file:
            file.write(text)
    return folder


def run(scratch: Path, *words: str) -> str:
    """What a Python of the scratch copy prints; the test fails where it does."""
    done = subprocess.run([sys.executable, *words], cwd=scratch, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_the_example_is_a_new_file_a_line_and_a_test() -> None:
    (own, text), (registry, line), (test, _) = steps()
    assert not (REPOSITORY / own).exists()
    assert not (REPOSITORY / test).exists()
    assert (REPOSITORY / registry).exists()
    assert len(line.splitlines()) == 1
    assert len(text.splitlines()) < 25


@pytest.mark.slow
def test_rank_knows_it_and_the_manifest_names_it(scratch: Path, golden: Path, tmp_path: Path) -> None:
    out = tmp_path / "manifest.json"
    assert "smallest-loss" in run(scratch, "-m", "contact_curation.cli.main", "rank", "--help")
    words = ("rank", str(golden), "--criterion", "smallest-loss", "--top", "5", "--out", str(out))
    assert "21 ranked by smallest-loss, 5 selected" in run(scratch, "-m", "contact_curation.cli.main", *words)
    manifest = read_manifest(out)
    assert manifest.run.criterion == "smallest-loss"
    losses = [row.mean_loss or 0.0 for row in manifest.rows if row.rank is not None]
    assert losses == sorted(losses)
    assert out.with_suffix(".png").exists()


@pytest.mark.slow
def test_its_own_test_and_those_of_every_criterion_pass(scratch: Path) -> None:
    tests = [steps()[2][0], "test/information/criteria/test_registry.py"]
    said = run(scratch, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-k", "smallest", *tests)
    assert re.match(r"\.{8,}", said), said
