"""An output that cannot be written is one line before any work, and nothing half written is left."""

import resource
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from contact_curation.cli import evaluate
from contact_curation.cli.rank import command as rank
from contact_curation.cli.train import command as train
from contact_curation.errors import InvalidValueError
from contact_curation.files import write_atomically
from contact_curation.storage.bags.writer import BagWriter
from contact_curation.storage.manifest.file import read_manifest
from test.cli.commands import Cli


def below_a_file(folder: Path, ending: str) -> Path:
    (folder / "file").write_text("in the way")
    return folder / "file" / f"out{ending}"


def in_no_folder(folder: Path, ending: str) -> Path:
    return folder / "missing" / f"out{ending}"


def a_folder(folder: Path, ending: str) -> Path:
    (folder / f"out{ending}").mkdir()
    return folder / f"out{ending}"


Place = Callable[[Path, str], Path]
places = pytest.mark.parametrize("place", [below_a_file, in_no_folder, a_folder])


@pytest.fixture
def no_work(monkeypatch: pytest.MonkeyPatch) -> None:
    """Reading a recording would be a failure."""

    def read(*_: object, **__: object) -> None:
        raise AssertionError("work began")

    monkeypatch.setattr(rank, "rank_tosses", read)
    monkeypatch.setattr(evaluate, "read_tosses", read)
    monkeypatch.setattr(train, "read_tosses", read)


@places
@pytest.mark.parametrize(
    ("verb", "option", "ending"),
    [
        ("rank", "--out", ".csv"),
        ("rank", "--figure", ".png"),
        ("evaluate", "--figure", ".png"),
        ("train", "--out", ".safetensors"),
        ("train", "--metrics", ".jsonl"),
        ("design", "--out", ".json"),
    ],
)
@pytest.mark.usefixtures("no_work")
def test_a_file_that_cannot_be_written_is_one_line_before_any_work(
    cli: Cli, golden: Path, true_parameters: Path, tmp_path: Path, place: Place, verb: str, option: str, ending: str
) -> None:
    needed = {
        "rank": (golden,),
        "evaluate": (true_parameters, golden),
        "train": (golden, "--overwrite", *(() if option == "--out" else ("--out", tmp_path / "c.safetensors"))),
        "design": ("--throws", "1000"),
    }
    path = place(tmp_path, ending)
    done = cli(verb, *needed[verb], option, path)
    assert (done.status, done.out, len(done.err_lines)) == (1, "", 1)
    assert done.err.startswith(f"contact-curation: error: {option}: found {path}, expected a path that can be written (")


@pytest.mark.parametrize(
    ("verb", "option", "name"),
    [
        ("rank", "--out", "notes.csv"),
        ("rank", "--figure", "photo.png"),
        ("evaluate", "--figure", "photo.png"),
        ("score", "--out", "data.npz"),
        ("simulate", "--out", "session.mcap"),
        ("import", "--out", "session.mcap"),
        ("design", "--out", "settings.json"),
        ("train", "--metrics", "data.jsonl"),
    ],
)
@pytest.mark.usefixtures("no_work")
def test_a_file_that_cannot_be_made_again_is_never_replaced_in_silence(
    cli: Cli, golden: Path, true_parameters: Path, tmp_path: Path, verb: str, option: str, name: str
) -> None:
    needed = {
        "rank": (golden,),
        "evaluate": (true_parameters, golden),
        "score": (golden, "--params", true_parameters),
        "simulate": (tmp_path / "throws.json",),
        "import": ("contactnets", tmp_path),
        "train": (golden, "--out", tmp_path / "c.safetensors"),
        "design": ("--throws", "1000"),
    }
    path = tmp_path / name
    path.write_text("years of work")
    done = cli(verb, *needed[verb], option, path)
    expected = f"contact-curation: error: {option}: found a file at {path}, expected a new name, or --overwrite to replace it\n"
    assert (done.status, done.out, done.err) == (1, "", expected)
    assert path.read_text() == "years of work"


@pytest.mark.parametrize("ending", [".parquet", ".csv", ".json"])
def test_a_manifest_is_made_again_under_its_name_and_a_bag_only_where_it_is_said(
    cli: Cli, golden: Path, tmp_path: Path, ending: str
) -> None:
    manifest = tmp_path / f"manifest{ending}"
    for top in ("4", "5"):
        assert cli("rank", golden, "--top", top, "--out", manifest, "--criterion", "longest", "--no-figure").status == 0
    assert len(read_manifest(manifest).selected) == 5
    bag = tmp_path / "session.mcap"
    bag.write_bytes(b"years of work")
    assert cli("import", "contactnets", tmp_path / "none", "--out", bag, "--overwrite").err.count("expected a new name") == 0


@places
def test_a_file_is_written_whole_or_refused_in_one_line(tmp_path: Path, place: Place) -> None:
    with pytest.raises(InvalidValueError, match="expected a path that can be written"):
        write_atomically(place(tmp_path, ".json"), b"content")
    assert not list(tmp_path.glob("**/.*"))


@pytest.mark.parametrize("ending", [".mcap", ""])
@places
def test_a_bag_that_cannot_be_written_is_refused_in_one_line(tmp_path: Path, place: Place, ending: str) -> None:
    with pytest.raises(InvalidValueError, match=r"output: found .*, expected "):
        BagWriter(place(tmp_path, ending))
    assert not list(tmp_path.glob("**/.*"))


@contextmanager
def full_disk() -> Iterator[None]:
    """No file grows beyond 4 kB: the system refuses the rest, as a full disk does."""
    before, bytecode = resource.getrlimit(resource.RLIMIT_FSIZE), sys.dont_write_bytecode
    resource.setrlimit(resource.RLIMIT_FSIZE, (4096, before[1]))
    sys.dont_write_bytecode = True  # of modules that are imported meanwhile, Python would keep the first 4 kB
    try:
        yield
    finally:
        sys.dont_write_bytecode = bytecode
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.mark.parametrize("name", ["out.mcap", "out"])
def test_a_full_disk_leaves_no_part_of_a_bag(tmp_path: Path, name: str) -> None:
    noise = np.random.default_rng(0).bytes(100_000)
    with full_disk(), pytest.raises(InvalidValueError, match="File too large"), BagWriter(tmp_path / name) as bag:
        bag.write_raw("/noise", "std_msgs/msg/String", "string data", noise, 0)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("form", ["mcap", "contactnets", "lerobot"])
def test_a_full_disk_is_one_line_and_leaves_no_part_of_an_export(cli: Cli, golden: Path, tmp_path: Path, form: str) -> None:
    manifest = tmp_path / "manifest.csv"
    assert cli("rank", golden, "--top", "4", "--out", manifest, "--no-figure").status == 0
    with full_disk():
        done = cli("export", golden, "--manifest", manifest, "--format", form, "--out", tmp_path / "kept")
    errors = [line for line in done.err_lines if "error:" in line]  # on a busy machine there are lines of progress, too
    assert (done.status, done.out, len(errors)) == (1, "", 1)
    assert f"error: output: found {tmp_path / 'kept'}, expected a path that can be written (" in done.err
    assert set(tmp_path.iterdir()) == {manifest, manifest.with_suffix(".provenance.json")}


def test_an_interrupt_while_a_file_is_written_leaves_the_old_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "manifest.csv"
    path.write_bytes(b"old")

    def interrupted(number: int) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("os.fsync", interrupted)
    with pytest.raises(KeyboardInterrupt):
        write_atomically(path, b"new")
    assert [entry.read_bytes() for entry in tmp_path.iterdir()] == [b"old"]
