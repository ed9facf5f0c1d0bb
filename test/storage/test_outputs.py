"""What can be made again is replaced, and nothing else."""

from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from contact_curation.dashboard.style import save_figure
from contact_curation.design.throw import Throw
from contact_curation.errors import InvalidValueError
from contact_curation.storage.manifest.file import read_manifest, write_manifest
from contact_curation.storage.outputs import check_replaceable, path_below
from contact_curation.storage.throws_file import write_throws

PREVIOUS = Path(__file__).parent / "previous_release"
REMEDY = "a new name, or --overwrite to replace it"


@pytest.mark.parametrize("name", ["bag.mcap", "model.safetensors", "notes.csv", "data.json", "photo.png", "data.parquet"])
def test_what_is_not_ours_to_make_again_is_refused(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    path.write_bytes(b"years of work")
    with pytest.raises(InvalidValueError, match=f"^--out: found a file at {path}, expected {REMEDY}$"):
        check_replaceable("--out", path, REMEDY)
    assert path.read_bytes() == b"years of work"


def test_a_new_name_and_an_empty_file_are_free(tmp_path: Path) -> None:
    check_replaceable("--out", tmp_path / "new.mcap", REMEDY)
    (tmp_path / "empty.mcap").touch()
    check_replaceable("--out", tmp_path / "empty.mcap", REMEDY)


def test_an_earlier_figure_and_earlier_throws_are_replaced(tmp_path: Path) -> None:
    save_figure(Figure(), tmp_path / "a.png")
    throw = Throw("t", "cube", np.zeros(3), np.eye(4)[0], np.zeros(3), np.zeros(3))
    write_throws(tmp_path / "a.json", [throw])
    for name in ("a.png", "a.json"):
        check_replaceable("--out", tmp_path / name, REMEDY)


def test_a_figure_and_a_log_of_another_program_are_refused(tmp_path: Path) -> None:
    Figure().savefig(tmp_path / "a.png")
    (tmp_path / "a.jsonl").write_text('{"event": "start", "app": "my robot"}\n')
    for name in ("a.png", "a.jsonl"):
        with pytest.raises(InvalidValueError, match="expected a new name"):
            check_replaceable("--out", tmp_path / name, REMEDY)


def test_a_csv_manifest_is_replaced_unless_it_was_edited(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_bytes((PREVIOUS / "manifest.csv").read_bytes())
    check_replaceable("--out", path, REMEDY)
    write_manifest(read_manifest(path), path)
    check_replaceable("--out", path, REMEDY)
    path.write_bytes(path.read_bytes().replace(b"\n", b",my notes\n", 1))
    with pytest.raises(InvalidValueError, match="expected a new name"):
        check_replaceable("--out", path, REMEDY)


@pytest.mark.parametrize(
    "path", ["../a.csv", "/etc/a.csv", "sub/../../a.csv", "", ".", "out/a.csv", "loop", "a\0b", "~/../../a"]
)
def test_a_path_of_a_message_stays_in_its_folder(tmp_path: Path, path: str) -> None:
    folder = tmp_path / "allowed"
    folder.mkdir()
    (folder / "out").symlink_to(tmp_path)
    (folder / "loop").symlink_to(folder / "loop")
    with pytest.raises(InvalidValueError, match=r"^path: found .*, expected a "):
        path_below("path", folder, path)


def test_a_path_in_the_folder_is_taken_by_either_name(tmp_path: Path) -> None:
    assert path_below("path", tmp_path, "sub/a.csv") == tmp_path.resolve() / "sub" / "a.csv"
    assert path_below("path", tmp_path, str(tmp_path / "a.csv")) == tmp_path.resolve() / "a.csv"
