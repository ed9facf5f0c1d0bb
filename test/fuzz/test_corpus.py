"""Readers refuse what fuzzing found with an error of this package, within seconds, and read the seeds that it began from."""

import itertools
import subprocess
import sys
import time
import warnings
from pathlib import Path

import pytest

from test.fuzz.targets import TARGETS, TouchedError, read

HERE = Path(__file__).parent
SEEDS = sorted((HERE / "corpus").glob("*/*"))
FOUND = sorted(path for path in (HERE / "found").glob("*/*") if path.parent.name in TARGETS)
SLOWEST = 20.0
"""[s] The fuzzer allows 5; tests share their cores."""


def named(path: Path) -> str:
    return f"{path.parent.name}-{path.name}"


def test_every_target_has_a_seed() -> None:
    assert {path.parent.name for path in SEEDS} == set(TARGETS)


@pytest.mark.parametrize("path", SEEDS, ids=named)
def test_a_seed_is_read(path: Path) -> None:
    assert read(path.parent.name, path.read_bytes()) is None


@pytest.mark.slow
def test_libraries_that_start_a_process_are_imported_before_a_reader_is_watched() -> None:
    """As in a fuzzer, which has imported nothing yet."""
    seeds = {path.parent.name: str(path) for path in SEEDS if TARGETS[path.parent.name].library}
    code = (
        "import sys; from pathlib import Path; from test.fuzz.targets import read\n"
        "for name, seed in zip(sys.argv[1::2], sys.argv[2::2]): read(name, Path(seed).read_bytes())"
    )
    words = [word for one in seeds.items() for word in one]
    done = subprocess.run([sys.executable, "-c", code, *words], capture_output=True, text=True, check=False)
    assert (done.returncode, sorted(seeds)) == (0, ["checkpoint", "pt"]), done.stderr


@pytest.mark.parametrize("path", FOUND, ids=named)
def test_what_was_found_is_refused_in_one_line_and_soon(path: Path) -> None:
    began = time.monotonic()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # those of libraries about such input
        read(path.parent.name, path.read_bytes())
    assert time.monotonic() - began < SLOWEST


@pytest.mark.parametrize("target", [name for name in TARGETS if name != "messages"])
def test_a_seed_that_is_cut_or_has_a_byte_changed_is_refused_in_one_line(target: str) -> None:
    data = next(path for path in SEEDS if path.parent.name == target).read_bytes()
    places = range(1, len(data), max(1, len(data) // 12))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for place in itertools.islice(places, 12):
            read(target, data[:place])
            read(target, data[:place] + bytes([data[place] ^ 0xFF]) + data[place + 1 :])


def test_the_watch_sees_a_reader_that_writes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def writes(path: Path) -> None:
        (tmp_path / "touched").write_bytes(path.read_bytes())

    monkeypatch.setitem(TARGETS, "theta", TARGETS["theta"]._replace(read=writes))
    with pytest.raises(TouchedError):
        read("theta", b"anything")


NESTED = "".join(f"- &a{k} [{', '.join([f'*a{k - 1}'] * 9)}]\n" for k in range(1, 9))
BOMBS = {
    "aliases that stand for 43 million numbers": ("body", b"name: b\nvertices:\n- &a0 [1, 1, 1]\n" + NESTED.encode()),
    "a list that holds itself": ("body", b"name: b\nmass: 1\nvertices: &a [*a, *a]\n"),
    "a box of 1e308 m": (
        "body",
        b"{name: b, half_extents: [1.0e+308, 1.0e+308, 1.0e+308], mass: 1, inertia: [1, 1, 1], friction: 0.1, length_scale: 1}",
    ),
    "a number that is longer than a message": ("body", b"name: 0x" + b"f" * 6000),
    "a section that holds itself": ("node_parameters", b"/**:\n  ros__parameters: &a {b: *a}\n"),
    "a board of nine billion tags": (
        "tag_map",
        b"bodies: [{t: {type: board, board: {tag_rows: 1000000000, tag_columns: 9, tag_size: 1, tag_spacing: 1}}}]",
    ),
    "a document type that is not in ASCII": (
        "urdf",
        '<?xml version="1.0" encoding="utf-16"?><!DOCTYPE robot [<!ENTITY a "b">]><robot name="&a;"/>'.encode("utf-16"),
    ),
}


@pytest.mark.parametrize("bomb", BOMBS)
def test_what_stands_for_far_more_than_it_is_is_refused_before_it_is_unfolded(bomb: str) -> None:
    target, data = BOMBS[bomb]
    began = time.monotonic()
    error = read(target, data)
    assert time.monotonic() - began < SLOWEST
    said = ("aliases", "587 tags", "document type", "24000 bits", "metres, at most")
    assert any(word in str(error) for word in said), str(error)
