"""Programs are started again, given up, stopped in order, and none outlives its supervisor; with tiny stand-ins for nodes."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from contact_curation.session.supervisor import Incident, Patience, Program, ProgramFailedError, Supervisor

QUICK = Patience(first_wait=0.02, longest_wait=0.08, steady=5.0, most_failures=3, grace=5.0)
SLEEPS = ("import time; time.sleep(60)",)
STUBBORN = ("import signal, time; signal.signal(signal.SIGINT, signal.SIG_IGN); print('deaf', flush=True); time.sleep(60)",)
FAILS = ("import sys; sys.exit('found no bag')",)


def program(name: str, code: tuple[str, ...], needed: bool = True, stage: int = 0) -> Program:
    return Program(name, (sys.executable, "-S", "-c", *code), needed, stage)


def made(folder: Path, *programs: Program, patience: Patience = QUICK) -> tuple[Supervisor, list[Incident]]:
    heard: list[Incident] = []
    return Supervisor(programs, dict(os.environ), folder, heard.append, patience), heard


def look_until(supervisor: Supervisor, holds: Callable[[], bool]) -> None:
    end = time.monotonic() + 20.0
    while not holds():
        assert time.monotonic() < end, "waited too long"
        supervisor.look()
        time.sleep(0.01)


def of(heard: list[Incident], what: str) -> list[Incident]:
    return [one for one in heard if one.what == what]


def alive(pid: int) -> bool:
    """Whether a process runs; one that ended and was not waited for does not."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


def test_a_program_that_is_killed_is_started_again_and_its_log_goes_on(tmp_path: Path) -> None:
    speaks = ("print('here', flush=True); import time; time.sleep(60)",)
    supervisor, heard = made(tmp_path, program("node", speaks))
    with supervisor:
        supervisor.start()
        look_until(supervisor, lambda: "here" in (tmp_path / "node.log").read_text())
        os.kill(heard[0].pid, signal.SIGKILL)
        look_until(supervisor, lambda: (tmp_path / "node.log").read_text().count("here") == 2)
    assert [one.what for one in heard] == ["started", "died", "restarted", "stopped"]
    assert heard[1].detail == "signal SIGKILL: here"
    assert supervisor.restarts == {"node": 1}
    assert not any(alive(one.pid) for one in heard)


def test_a_program_that_dies_at_once_is_given_up_with_its_last_words(tmp_path: Path) -> None:
    supervisor, heard = made(tmp_path, program("node", FAILS))
    message = "node died 3 times right after its start, the last time with status 1: found no bag"
    with supervisor, pytest.raises(ProgramFailedError, match=message):
        supervisor.start()
        look_until(supervisor, lambda: False)
    assert [one.what for one in heard] == ["started", "died", "restarted", "died", "restarted", "died", "given up"]


def test_of_a_traceback_the_error_is_quoted(tmp_path: Path) -> None:
    raises = ("raise ValueError('found 3,\\nexpected 4')",)
    supervisor, heard = made(tmp_path, program("node", raises))
    with supervisor:
        supervisor.start()
        look_until(supervisor, lambda: bool(of(heard, "died")))
    assert of(heard, "died")[0].detail == "status 1: ValueError: found 3,"


def test_waits_double_up_to_the_longest_and_a_sound_run_is_forgiven(tmp_path: Path) -> None:
    """With a clock of the test's own, which no stand-in can see."""
    clock = [0.0]
    heard: list[Incident] = []
    patience = Patience(first_wait=1.0, longest_wait=3.0, steady=10.0, most_failures=9)
    supervisor = Supervisor([program("node", SLEEPS)], dict(os.environ), tmp_path, heard.append, patience, lambda: clock[0])

    def waited(before_death: float) -> float:
        """Kills the program and counts quarters of a second until it is back."""
        clock[0] += before_death
        os.kill(heard[-1].pid, signal.SIGKILL)
        while heard[-1].what != "died":
            supervisor.look()
        began = clock[0]
        while heard[-1].what == "died":
            clock[0] += 0.25
            supervisor.look()
        return clock[0] - began

    with supervisor:
        supervisor.start()
        assert [waited(1.0) for _ in range(3)] == [1.0, 2.0, 3.0]
        assert waited(1.0) == 3.0
        assert waited(11.0) == 1.0


def test_a_program_that_is_not_needed_is_given_up_alone(tmp_path: Path) -> None:
    supervisor, heard = made(tmp_path, program("extra", FAILS, needed=False), program("node", SLEEPS))
    with supervisor:
        supervisor.start()
        look_until(supervisor, lambda: bool(of(heard, "given up")))
        started = len(heard)
        for _ in range(20):
            supervisor.look()
            time.sleep(0.01)
        assert len(heard) == started
        assert alive(next(one.pid for one in heard if one.program == "node"))


def test_programs_stop_in_stages_and_a_deaf_one_is_killed(tmp_path: Path) -> None:
    impatient = Patience(first_wait=0.02, grace=0.3)
    programs = program("listener", SLEEPS, stage=1), program("deaf", STUBBORN)
    supervisor, heard = made(tmp_path, *programs, patience=impatient)
    with supervisor:
        supervisor.start()
        look_until(supervisor, lambda: "deaf" in (tmp_path / "deaf.log").read_text())
    stopped = of(heard, "stopped")
    assert [one.program for one in stopped] == ["deaf", "listener"]
    assert stopped[0].detail == "signal SIGKILL"
    assert not any(alive(one.pid) for one in heard)


SUPERVISES = """
import os, sys, time
from pathlib import Path
from contact_curation.session.supervisor import Program, Supervisor
programs = [Program(name, (sys.executable, "-S", "-c", sys.argv[2])) for name in ("one", "two")]
with Supervisor(programs, dict(os.environ), Path(sys.argv[1]), lambda one: print(one.pid, flush=True)) as supervisor:
    supervisor.start()
    time.sleep(60)
"""


def test_no_program_outlives_a_supervisor_that_is_killed(tmp_path: Path) -> None:
    command = [sys.executable, "-c", SUPERVISES, str(tmp_path), *STUBBORN]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as killed:
        assert killed.stdout is not None
        pids = [int(killed.stdout.readline()) for _ in range(2)]
        assert all(alive(pid) for pid in pids)
        killed.kill()
    end = time.monotonic() + 10.0
    while any(alive(pid) for pid in pids):
        assert time.monotonic() < end, "a program outlived its supervisor"
        time.sleep(0.05)


def test_a_program_that_is_killed_on_purpose_comes_back(tmp_path: Path) -> None:
    supervisor, heard = made(tmp_path, program("node", SLEEPS))
    with supervisor:
        supervisor.start()
        supervisor.kill("node")
        look_until(supervisor, lambda: supervisor.restarts == {"node": 1})
    assert [one.what for one in heard] == ["started", "died", "restarted", "stopped"]
