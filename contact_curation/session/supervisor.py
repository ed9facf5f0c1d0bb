"""Programs that are kept running: started, watched, started again with growing patience, stopped together.

None of them outlives this process, even where it is killed: Linux ends them then (prctl). They are in process groups of their
own, so that Ctrl-C reaches this process alone, which then stops them in order.
"""

import ctypes
import os
import re
import signal
import subprocess
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import NamedTuple, Self

from contact_curation.errors import ContactCurationError

PRCTL = ctypes.CDLL(None).prctl
"""Looked up beforehand: between fork and exec as little as possible may happen."""

SET_PARENT_DEATH_SIGNAL = 1
"""Of Linux's prctl."""

TRACEBACK = "Traceback (most recent call last):"
RAISED = re.compile(r"[\w.]*(Error|Exception|Interrupt)\b")

LARGEST_TAIL = 1 << 14
"""Bytes at the end of a log in which its last line is looked for."""


class ProgramFailedError(ContactCurationError):
    """A program died again and again, right after its start.

    Attributes:
        why: without the place of its log.
    """

    def __init__(self, why: str, log: Path | None = None) -> None:
        super().__init__(f"{why} ({log})" if log else why)
        self.why = why


@dataclass(frozen=True)
class Program:
    """What is to run.

    Attributes:
        name: of its log, too.
        command: the program and its arguments.
        needed: whether nothing goes on without it; another one is given up alone.
        stage: programs of a lower stage are stopped first.
    """

    name: str
    command: tuple[str, ...]
    needed: bool = True
    stage: int = 0


@dataclass(frozen=True)
class Patience:
    """How programs are started again and stopped.

    Attributes:
        first_wait: before a program that died is started again [s]; doubles with each failure.
        longest_wait: between two starts [s].
        steady: a death later than this after the start is no failure to start [s].
        most_failures: in a row, after which a program is given up.
        grace: to end after SIGINT [s].
    """

    first_wait: float = 0.5
    longest_wait: float = 10.0
    steady: float = 30.0
    most_failures: int = 4
    grace: float = 15.0


class Incident(NamedTuple):
    """What happened to a program.

    Attributes:
        what: started, died, restarted, given up or stopped.
        program: its name.
        detail: how, in words; empty where there is nothing to say.
        pid: of its process.
    """

    what: str
    program: str
    detail: str
    pid: int


class Supervisor:
    """Keeps programs running; use it as a context manager, in the thread that calls `look`.

    Args:
        programs: started in this order.
        environment: of all of them.
        logs: folder; each program's output goes to its own file, behind what is there.
        tell: called with what happens.
        patience: with them.
        now: a steady clock [s].
    """

    def __init__(
        self,
        programs: Sequence[Program],
        environment: Mapping[str, str],
        logs: Path,
        tell: Callable[[Incident], None],
        patience: Patience | None = None,
        now: Callable[[], float] = time.monotonic,
    ) -> None:
        self._runs = {program.name: _Run(program, environment, logs / f"{program.name}.log") for program in programs}
        self._tell = tell
        self._patience = patience or Patience()
        self._now = now

    @property
    def restarts(self) -> dict[str, int]:
        """How often each program was started again."""
        return {name: max(run.starts - 1, 0) for name, run in self._runs.items()}

    def start(self) -> None:
        """Starts all of them."""
        for run in self._runs.values():
            self._start(run)

    def look(self) -> None:
        """Notes who died and starts again whose time has come; cheap, to be called often.

        Raises:
            ProgramFailedError: a needed program died again and again, right after its start.
        """
        for run in self._runs.values():
            if run.process is not None and run.process.poll() is not None:
                self._died(run, run.process)
            if run.due is not None and self._now() >= run.due:
                self._start(run)

    def kill(self, name: str) -> None:
        """Ends a program at once; it is started again as after any death."""
        self._runs[name].kill()

    def stop(self, names: Sequence[str] | None = None) -> None:
        """Asks programs to end, those of a low stage first, and insists after a while; all of them by default."""
        chosen = [run for name, run in self._runs.items() if names is None or name in names]
        for stage in sorted({run.program.stage for run in chosen}):
            self._stop([run for run in chosen if run.program.stage == stage])

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        try:
            self.stop()
        finally:  # a second Ctrl-C does not wait
            for run in self._runs.values():
                run.kill()

    def _start(self, run: "_Run") -> None:
        pid = run.start(self._now())
        self._tell(Incident("started" if run.starts == 1 else "restarted", run.program.name, "", pid))

    def _died(self, run: "_Run", process: subprocess.Popen[bytes]) -> None:
        how = f"{_ending(process.returncode)}: {run.last_words()}"
        sound = self._now() - run.began > self._patience.steady
        run.failures = 1 if sound else run.failures + 1
        run.process = None
        self._tell(Incident("died", run.program.name, how, process.pid))
        if run.failures >= self._patience.most_failures:
            self._give_up(run, how, process.pid)
        else:
            wait = self._patience.first_wait * 2.0 ** (run.failures - 1)
            run.due = self._now() + min(wait, self._patience.longest_wait)

    def _give_up(self, run: "_Run", how: str, pid: int) -> None:
        name, times = run.program.name, self._patience.most_failures
        self._tell(Incident("given up", name, how, pid))
        if run.program.needed:
            raise ProgramFailedError(f"{name} died {times} times right after its start, the last time with {how}", run.log)

    def _stop(self, runs: Sequence["_Run"]) -> None:
        for run in runs:
            run.due = None
            if run.process is not None and run.process.poll() is None:
                run.process.send_signal(signal.SIGINT)
        end = self._now() + self._patience.grace
        for run in runs:
            if run.process is None:
                continue
            try:
                run.process.wait(max(end - self._now(), 0.0))
            except subprocess.TimeoutExpired:
                run.process.kill()
                run.process.wait()
            how = _ending(run.process.returncode)
            self._tell(Incident("stopped", run.program.name, how, run.process.pid))
            run.process = None


class _Run:
    """A program and its process, while there is one."""

    def __init__(self, program: Program, environment: Mapping[str, str], log: Path) -> None:
        self.program = program
        self.log = log
        self.process: subprocess.Popen[bytes] | None = None
        self.starts = self.failures = 0
        self.began = 0.0
        self.due: float | None = None
        self._environment = dict(environment)

    def start(self, now: float) -> int:
        """Starts the process; returns its id."""
        self.began, self.due = now, None
        self.starts += 1
        parent = os.getpid()
        with self.log.open("ab") as log:
            self.process = subprocess.Popen(
                self.program.command,
                env=self._environment,
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                process_group=0,
                preexec_fn=lambda: _end_with(parent),
            )
        return self.process.pid

    def kill(self) -> None:
        if self.process is not None and self.process.poll() is None:
            self.process.kill()
            self.process.wait()

    def last_words(self) -> str:
        """The last line it said; of a traceback the line with the error."""
        with self.log.open("rb") as log:
            log.seek(max(self.log.stat().st_size - LARGEST_TAIL, 0))
            lines = log.read().decode(errors="replace").strip().splitlines() or ["it said nothing"]
        raised = lines.index(TRACEBACK) if TRACEBACK in lines else len(lines)
        named = [line for line in lines[raised:] if RAISED.match(line)]
        return (named or lines)[-1].strip()


def _ending(status: int) -> str:
    """In words."""
    return f"signal {signal.Signals(-status).name}" if status < 0 else f"status {status}"


def _end_with(parent: int) -> None:
    """Between fork and exec: even where the parent is killed, this process is too; it may be gone already."""
    PRCTL(SET_PARENT_DEATH_SIGNAL, signal.SIGKILL)
    if os.getppid() != parent:
        os._exit(1)
