"""Files are written with the rights that the user's umask gives, under names that nobody can prepare."""

import ast
import errno
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import nullcontext
from pathlib import Path

import pytest

from contact_curation import files
from contact_curation.errors import UnreadableInputError, UnwritableOutputError
from contact_curation.files import partial_name, read_yaml, scratch_folder, staged_folder, temporary_folder, write_atomically
from test.conftest import REPOSITORY

NO_FILES = ("self._gripper", "self._worlds")
"""What has a method `open` and is no file."""


@pytest.fixture(params=[0o077, 0o027, 0o022], ids=oct)
def umask(request: pytest.FixtureRequest) -> Iterator[int]:
    before = os.umask(request.param)
    yield int(request.param)
    os.umask(before)


def test_files_and_folders_have_the_rights_that_the_umask_gives(tmp_path: Path, umask: int) -> None:
    write_atomically(tmp_path / "a.json", b"{}")
    with staged_folder(tmp_path / "folder") as folder:
        (folder / "b").touch()
    assert (tmp_path / "a.json").stat().st_mode & 0o777 == 0o666 & ~umask
    assert (tmp_path / "folder").stat().st_mode & 0o777 == 0o777 & ~umask


def test_the_name_of_what_is_not_complete_is_another_one_each_time(tmp_path: Path) -> None:
    names = {partial_name(tmp_path / "a.json") for _ in range(100)}
    assert len(names) == 100
    assert {name.parent for name in names} == {tmp_path}


def test_a_scratch_folder_is_of_one_writer_and_what_a_killed_one_left_is_removed(tmp_path: Path) -> None:
    left = tmp_path / ".a.rrd.partial-killed"
    left.mkdir()
    (left / "a.rrd").touch()
    with scratch_folder(tmp_path / "a.rrd") as one, scratch_folder(tmp_path / "a.rrd") as other:
        assert set(tmp_path.iterdir()) == {one, other}
        (one / "a.rrd").touch()
    assert not list(tmp_path.iterdir())


def test_a_temporary_folder_is_of_its_user_alone_and_the_next_one_removes_what_a_killed_process_left(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    code = "import os, signal; from contact_curation.files import temporary_folder as folder\n"
    code += "with folder('bag') as one, folder('rank') as other:\n (one / 'copy').touch(); os.kill(os.getpid(), signal.SIGKILL)"
    subprocess.run([sys.executable, "-c", code], env={**os.environ, "TMPDIR": str(tmp_path)}, check=False)
    _, rank = sorted(tmp_path.iterdir())
    with temporary_folder("bag") as one, temporary_folder("bag") as other:
        assert one.stat().st_mode & 0o777 == 0o700
        assert set(tmp_path.iterdir()) == {rank, one, other}
    assert set(tmp_path.iterdir()) == {rank}


def test_a_folder_that_another_process_takes_for_one_left_behind_is_not_used(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made: list[Path] = []

    def make(path: Path, mode: int) -> int:
        path.mkdir(mode)
        made.append(path)
        if len(made) == 1:  # the other one has looked at it before it was locked, and removes it soon
            assert files.lock(os.open(path, os.O_RDONLY))
        return os.open(path, os.O_RDONLY)

    monkeypatch.setattr(files, "_new_folder", make)
    with scratch_folder(tmp_path / "a.rrd") as folder:
        assert [folder] == made[1:]


def test_a_pipe_under_a_hidden_name_is_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / ".a.json.partial-pipe")
    write_atomically(tmp_path / "a.json", b"{}")
    assert [path.name for path in tmp_path.iterdir()] == ["a.json"]


def in_a_folder(path: Path) -> None:
    with staged_folder(path):
        pass


@pytest.mark.parametrize("write", [lambda path: write_atomically(path, b"new"), in_a_folder], ids=["file", "folder"])
def test_what_is_there_under_the_hidden_name_is_never_followed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, write: Callable[[Path], None]
) -> None:
    monkeypatch.setattr(files, "token_hex", lambda count: "guessed")
    victim = tmp_path / "victim"
    victim.write_bytes(b"years of work")
    (tmp_path / ".a.partial-guessed").symlink_to(victim)
    with pytest.raises(Exception, match="File exists"):
        write(tmp_path / "a")
    assert victim.read_bytes() == b"years of work"


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("a: !!bool x", "its tag names"),
        ("a: !!int ''", "its tag names"),
        ("a: !!timestamp x", "its tag names"),
        (f"a: {':'.join(['1'] * 200)}.0", "too large"),
        ("a: 2020-13-45", "month must be in 1..12"),
        (f"a: 0x{'f' * 6000}", "a whole number of 24000 bits"),
        ("a: [", "while parsing"),
        ("mass: 1\nb: {c: 1, c: 2}", "'c' stands there twice, in lines 2 and 2"),
        ("mass: 1\nname: b\nmass: 2", "'mass' stands there twice, in lines 1 and 3"),
    ],
)
def test_what_is_no_yaml_is_refused_in_one_line(tmp_path: Path, text: str, why: str) -> None:
    path = tmp_path / "a.yaml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(UnreadableInputError, match=why) as raised:
        read_yaml(path, 1 << 17, "a body")
    assert "\n" not in str(raised.value)


def test_no_file_of_text_depends_on_the_locale() -> None:
    without = []
    for path in (REPOSITORY / "contact_curation").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_bytes())):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
                named = any(word.arg == "encoding" for word in node.keywords)
                text = node.func.attr in ("read_text", "write_text") or ast.unparse(node).endswith((".open()", ".open('w')"))
                without += [f"{path}:{node.lineno}"] * (text and not named and ast.unparse(node.func.value) not in NO_FILES)
    assert without == []


@pytest.mark.parametrize(("number", "raises"), [(errno.EINVAL, False), (errno.EIO, True)])
def test_a_file_system_that_cannot_wait_for_the_disk_is_no_error(
    number: int, raises: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(descriptor: int) -> None:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(os, "fsync", refused)
    with pytest.raises(UnwritableOutputError) if raises else nullcontext():
        write_atomically(tmp_path / "a.json", b"{}")
    assert [one.name for one in tmp_path.iterdir()] == ([] if raises else ["a.json"])


def test_a_file_that_is_replaced_is_claimed_once_until_it_is_released(tmp_path: Path) -> None:
    path = tmp_path / "state.json"
    release = files.claimed(path)
    files.write_atomically(path, b"1")
    with pytest.raises(UnreadableInputError, match=r"state\.json: is written by another process"):
        files.claimed(path)
    release()
    files.claimed(path)()
    files.claimed(tmp_path / "nowhere" / "state.json")()
