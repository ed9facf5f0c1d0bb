"""Outputs beside their place: what a killed writer left goes with the next one, what is being written stays."""

import fcntl
import os
from pathlib import Path

import pytest

from contact_curation.files import replacing, staged_folder, write_atomically


def test_what_a_killed_writer_left_is_removed_and_what_is_being_written_is_not(tmp_path: Path) -> None:
    left, others, locked = (tmp_path / name for name in (".a.json.partial-1", ".b.json.partial-1", ".a.json.partial-2"))
    for path in (left, others, locked):
        path.write_bytes(b"half")
    with locked.open("rb") as writer:
        fcntl.flock(writer, fcntl.LOCK_EX)
        write_atomically(tmp_path / "a.json", b"whole")
    assert {path.name for path in tmp_path.iterdir()} == {"a.json", others.name, locked.name}


def test_two_writers_at_once_leave_the_file_of_the_last(tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    with replacing(path) as first, replacing(path) as second:
        first.write(b"first")
        second.write(b"second")
    assert path.read_bytes() == b"first"
    assert list(tmp_path.iterdir()) == [path]


def test_a_link_in_the_place_of_a_hidden_name_leads_nowhere(tmp_path: Path) -> None:
    elsewhere = tmp_path / "elsewhere"
    elsewhere.write_bytes(b"of somebody else")
    (tmp_path / f".a.json.partial-{os.getpid()}").symlink_to(elsewhere)
    write_atomically(tmp_path / "a.json", b"whole")
    assert elsewhere.read_bytes() == b"of somebody else"


@pytest.mark.parametrize("leads_to", ["file", "nothing"])
def test_a_link_stays_and_what_it_leads_to_is_replaced(tmp_path: Path, leads_to: str) -> None:
    on_another_disk, path = tmp_path / "disk" / "a.json", tmp_path / "a.json"
    on_another_disk.parent.mkdir()
    if leads_to == "file":
        on_another_disk.write_bytes(b"old")
    path.symlink_to("disk/a.json")
    write_atomically(path, b"new")
    assert path.is_symlink()
    assert on_another_disk.read_bytes() == b"new"
    assert [one.name for one in on_another_disk.parent.iterdir()] == ["a.json"]


def test_a_folder_that_a_killed_export_left_is_removed_by_the_next(tmp_path: Path) -> None:
    left = tmp_path / ".out.partial-1"
    left.mkdir()
    (left / "half").touch()
    with staged_folder(tmp_path / "out") as staged:
        (staged / "whole").touch()
    assert [path.name for path in sorted(tmp_path.rglob("*"))] == ["out", "whole"]


def test_files_have_the_rights_that_the_user_gives_to_files(tmp_path: Path) -> None:
    before = os.umask(0o027)
    try:
        write_atomically(tmp_path / "a", b"")
    finally:
        os.umask(before)
    assert (tmp_path / "a").stat().st_mode & 0o777 == 0o640


def test_what_a_reader_of_the_block_interrupts_leaves_the_old_file(tmp_path: Path) -> None:
    path = tmp_path / "a"
    path.write_bytes(b"old")
    with pytest.raises(KeyboardInterrupt), replacing(path) as file:
        file.write(b"new")
        raise KeyboardInterrupt
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]
