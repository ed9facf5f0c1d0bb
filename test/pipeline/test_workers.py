"""Work in several processes: results in order, a death noticed, no process left behind."""

import errno
import multiprocessing
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from contact_curation.errors import InvalidValueError
from contact_curation.pipeline import workers
from contact_curation.pipeline.workers import (
    BYTES_PER_PROCESS,
    Advance,
    Finished,
    WorkerDiedError,
    each,
    processes_for,
    unheard,
)
from contact_curation.storage.addresses import Address


def squared(number: int, advance: Advance) -> int:
    time.sleep(0.05 * (3 - number))  # so that the last is done first
    advance(number)
    return number * number


def ending(number: int, advance: Advance) -> int:
    os.kill(os.getpid(), signal.SIGKILL)
    return number


@pytest.mark.parametrize("jobs", [1, 2])
def test_results_come_in_the_order_of_the_inputs(jobs: int) -> None:
    told: list[int] = []
    shares: list[float] = []

    def advance(count: int, /, *, note: str = "", share: float | None = None) -> None:
        told.append(count)
        shares.extend([] if share is None else [share])

    assert list(each(squared, [0, 1, 2, 3], jobs, advance)) == [0, 1, 4, 9]
    assert (sum(told), shares) == (6, [0.25, 0.5, 0.75, 1.0])


def length(path: Path, advance: Advance) -> int:
    return len(path.read_bytes()) if path.exists() else 0


@pytest.mark.parametrize("jobs", [1, 2])
def test_progress_counts_recordings_and_their_bytes_if_all_are_known(jobs: int, tmp_path: Path) -> None:
    paths = [tmp_path / name for name in "abc"]
    for path, size in zip(paths, (3_000_000, 500_000, 500_000), strict=True):
        path.write_bytes(bytes(size))
    told: list[tuple[str, float | None]] = []

    def advance(count: int, /, *, note: str = "", share: float | None = None) -> None:
        told.append((note, share))

    list(each(length, paths, jobs, advance))
    assert told[-1] == ("3 of 3 recordings, 4.0 of 4.0 MB", 1.0)
    if jobs == 1:
        assert told[:2] == [("1 of 3 recordings, 3.0 of 4.0 MB", 0.75), ("2 of 3 recordings, 3.5 of 4.0 MB", 0.875)]
    told.clear()
    list(each(length, [paths[0], tmp_path / "missing"], 1, advance))
    list(each(length, paths[:1], 1, advance))
    assert told == [("1 of 2 recordings", 0.5), ("2 of 2 recordings", 1.0), ("", 1.0)]


def test_sizes_on_servers_count_if_they_are_known() -> None:
    told: list[tuple[int, str, float | None]] = []

    def advance(count: int, /, *, note: str = "", share: float | None = None) -> None:
        told.append((count, note, share))

    listed = [Address(f"s3://lab/{n}.mcap").known({"size": n * 10**9}) for n in (4, 1)]
    Finished(listed, advance).add(0, 7)
    Finished([listed[0], Address("s3://lab/other.mcap")], advance).add(0, 7)
    assert told == [(7, "1 of 2 recordings, 4.0 of 5.0 GB", 0.8), (7, "1 of 2 recordings", 0.5)]


def test_processes_are_started_for_recordings_large_enough_and_as_asked_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("os.cpu_count", lambda: 4)
    small, large, folder = tmp_path / "small.mcap", tmp_path / "large.mcap", tmp_path / "folder"
    small.write_bytes(b"bag")
    with large.open("wb") as file:
        file.truncate(BYTES_PER_PROCESS)  # takes no room on the disk
    folder.mkdir()
    (folder / "large.mcap").hardlink_to(large)
    server = Address("https://host/session.mcap")
    assert [processes_for([small] * count, None) for count in (1, 2, 100)] == [1, 1, 1]
    assert [processes_for([each] * 3, None) for each in (large, folder, server, tmp_path / "missing")] == [3, 3, 3, 1]
    assert processes_for([large] * 9, None) == 4
    assert [processes_for([small] * 3, jobs) for jobs in (1, 2, 5)] == [1, 2, 3]
    assert processes_for([], None) == 1


def test_a_daemonic_process_reads_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(multiprocessing.current_process()._config, "daemon", True)  # type: ignore[attr-defined]
    server = Address("https://host/session.mcap")
    assert [processes_for([server] * 3, jobs) for jobs in (None, 2)] == [1, 1]


def test_an_interrupt_ends_the_workers_and_no_other_child_of_the_process(monkeypatch: pytest.MonkeyPatch) -> None:
    own = multiprocessing.get_context("spawn").Process(target=time.sleep, args=(60,))
    own.start()

    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(workers, "wait", interrupted)
    with pytest.raises(KeyboardInterrupt):
        list(each(squared, [0, 1], 2, unheard))
    wait_until(lambda: multiprocessing.active_children() == [own])
    time.sleep(0.1)  # a signal would have arrived
    assert own.is_alive()
    own.terminate()
    own.join()


def test_a_worker_that_is_killed_is_an_error_of_ours() -> None:
    with pytest.raises(WorkerDiedError, match="--jobs"):
        list(each(ending, [1, 2], 2, unheard))


def alive(pid: int) -> bool:
    """Whether a process runs and is no zombie."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


SLEEPER = """
import multiprocessing, sys, time
sys.path.insert(0, {folder!r})
from contact_curation.pipeline.workers import each, unheard
from sleeping import nap
if __name__ == "__main__":
    list(each(nap, [0, 1], 2, unheard))
"""


def test_workers_end_when_their_parent_is_killed(tmp_path: Path) -> None:
    (tmp_path / "sleeping.py").write_text(
        "import os, pathlib, time\n"
        "def nap(number, advance):\n"
        f"    (pathlib.Path({str(tmp_path)!r}) / f'{{number}}.part').write_text(str(os.getpid()))\n"
        f"    (pathlib.Path({str(tmp_path)!r}) / f'{{number}}.part').rename({str(tmp_path)!r} + f'/{{number}}.pid')\n"
        "    time.sleep(60)\n"
    )
    script = tmp_path / "parent.py"
    script.write_text(SLEEPER.format(folder=str(tmp_path)))
    parent = subprocess.Popen([sys.executable, str(script)])
    pids = [tmp_path / "0.pid", tmp_path / "1.pid"]
    wait_until(lambda: all(path.exists() for path in pids))
    workers = [int(path.read_text()) for path in pids]
    assert all(alive(pid) for pid in workers)
    parent.kill()
    parent.wait()
    wait_until(lambda: not any(alive(pid) for pid in workers))


UNGUARDED = """
import sys
from pathlib import Path
from contact_curation.pipeline.workers import each, unheard
from test.pipeline.test_workers import length
print("begins")
print(list(each(length, [Path(sys.argv[1]), Path(sys.argv[1])], 2, unheard)))
"""


@pytest.mark.slow
@pytest.mark.parametrize("from_standard_input", [False, True])
def test_a_script_needs_no_guard(from_standard_input: bool, tmp_path: Path) -> None:
    script = tmp_path / "script.py"
    script.write_text(UNGUARDED)
    command = [sys.executable, "-" if from_standard_input else str(script), str(script)]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run(command, input=UNGUARDED, env=environment, capture_output=True, text=True, check=False)
    assert done.stdout == f"begins\n[{len(UNGUARDED)}, {len(UNGUARDED)}]\n", done.stderr


@pytest.mark.slow
def test_threads_that_start_workers_at_once_leave_the_script_as_it_is() -> None:
    script = sys.modules["__main__"]
    with ThreadPoolExecutor(4) as threads:
        assert list(threads.map(lambda _: list(each(squared, [3, 3], 2, unheard)), range(4))) == [[9, 9]] * 4
    assert sys.modules["__main__"] is script


def wait_until(holds: Callable[[], bool], seconds: float = 30.0) -> None:
    end = time.monotonic() + seconds
    while not holds():
        assert time.monotonic() < end, "waited too long"
        time.sleep(0.02)


def test_a_system_where_processes_share_nothing_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(*_: object, **__: object) -> None:
        raise OSError(errno.EROFS, os.strerror(errno.EROFS))

    monkeypatch.setattr(workers, "ProcessPoolExecutor", refused)
    with pytest.raises(
        InvalidValueError, match=r"^jobs: found 2, expected 1, .* \(Read-only file system\): may /dev/shm be written"
    ):
        list(each(squared, [1, 2], 2, unheard))
