"""Every call that changes a file fails once: what a program leaves behind then, and that it goes on afterwards.

    python -m test.reliability.every_call score export-mcap    a row of docs/reliability.md for each, or for all
    python -m test.reliability.every_call --every 5 toss-store    the same of each fifth call

A first run counts the calls on paths below one folder. Then each of them fails in its turn, in a process of its own that
starts with the same files: the disk is full from there on, the call fails once (EIO), or the process is killed. Processes are
forked, so that the imports are done once. What is expected of each:

- a file that the program replaces is the old one or the new one, whole, and so is a folder; nothing else is there but names
  that begin with a point
- an error is one line and status 1, and nothing is left of what was begun
- the same program, started again, comes to the files of one that nothing disturbed, and removes what a kill left
"""

import atexit
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import traceback
import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

from contact_curation.errors import ContactCurationError
from test.reliability.shim import LIBRARY, Action, arm, environment

FAILURES = (Action.FULL, Action.BROKEN, Action.KILLED)
REMOVALS = ("unlink", "rmdir")
"""Calls that clean up; where they fail something hidden may stay."""

Content = Mapping[str, object]
"""What files hold by their path in a folder, as it is compared."""


def bytes_of(path: Path) -> object:
    """A file's content as it is compared: its bytes."""
    return path.read_bytes()


@dataclass(frozen=True)
class Program:
    """Something that writes files.

    Attributes:
        run: does it in a folder `out`, given a folder of inputs; gives its exit status.
        inputs: makes what it reads, once.
        before: makes what is in `out` before it.
        plain: what of a file must be the same in every run; None of a file that is a part of another one.
        wholes: folders in `out` that appear as a whole.
        once: refuses to be started again where its result is.
        grows: where files are added to or belong together: gives what is wrong after a failure, or nothing, from `out` and that
            of an undisturbed run.
    """

    run: Callable[[Path, Path], int]
    inputs: Callable[[Path], None] = lambda _: None
    before: Callable[[Path, Path], None] = lambda _, __: None
    plain: Callable[[Path], object] = bytes_of
    wholes: tuple[str, ...] = ()
    once: bool = False
    grows: Callable[[Path, Path], str] | None = None


class Ended(NamedTuple):
    """How a process ended: its status, or minus the number of the signal; what it said on standard error; its calls."""

    status: int
    lines: tuple[str, ...]
    calls: tuple[str, ...]


@dataclass
class Tally:
    """What became of all failures of a program.

    Attributes:
        calls: of a run that nothing disturbs.
        tried: failures.
        went_on: came to the end all the same.
        said: ended with one line.
        killed: by us.
        messages: by their text, the path left out.
        defects: one line each.
    """

    calls: int = 0
    tried: int = 0
    went_on: int = 0
    said: int = 0
    killed: int = 0
    messages: Counter[str] = field(default_factory=Counter)
    defects: list[str] = field(default_factory=list)


class Trial:
    """One program under failures, in a folder of its own.

    Args:
        program: that is tried.
        folder: empty.
    """

    def __init__(self, program: Program, folder: Path) -> None:
        self._program = program
        self._inputs, self._root, self._aside = folder / "inputs", folder / "counted", folder / "aside"
        for one in (self._inputs, self._aside):
            one.mkdir()
        self._prepared(lambda: program.inputs(self._inputs))
        self._fresh()
        self._old = self._content()
        undisturbed = self._ended(0, Action.COUNT)
        for name in (self._aside / "modules").read_text().split():  # so that no other process has to
            with suppress(Exception):
                import_module(name)
        if undisturbed.status:
            raise AssertionError(f"status {undisturbed.status} without failures: {undisturbed.lines}")
        self._new = self._content()
        self._said = Counter(undisturbed.lines)
        self.calls = undisturbed.calls
        self._restarted: dict[object, tuple[str, ...]] = {}
        self._reference = folder / "reference"
        shutil.copytree(self._root / "out", self._reference)

    def failed(self, call: int, action: Action, tally: Tally) -> None:
        """Has one call fail, counted from 1, and notes in the tally what became of it."""
        self._fresh()
        ended = self._ended(call, action)
        tally.tried += 1
        what = f"{action.name} at call {call} ({self.calls[call - 1]})"
        removal = self.calls[call - 1].partition(" ")[0] in REMOVALS
        for why in (*self._wrong(ended, action, removal, tally), *self._after_restart(killed=ended.status < 0)):
            tally.defects.append(f"{what}: {why}")

    def _wrong(self, ended: Ended, action: Action, removal: bool, tally: Tally) -> Iterator[str]:
        said = list((Counter(ended.lines) - self._said).elements())
        content = self._content()
        if ended.status == 0:
            tally.went_on += 1
            if _visible(content) != _visible(self._new):
                yield f"status 0, but {self._differences(content)}"
            if not removal and _hidden(content):
                yield f"status 0, but left {sorted(_hidden(content))}"
        elif ended.status == -signal.SIGKILL and action is Action.KILLED:
            tally.killed += 1
            yield from self._third_states(content)
        elif ended.status == 1:
            tally.said += 1
            yield from self._third_states(content)
            if not removal and (left := _hidden(content)):
                yield f"left {sorted(left)}"
            if len(said) != 1:
                yield f"{len(said)} lines, expected one: {said[-3:]}"
            tally.messages.update(line.replace(str(self._root), "") for line in said[-1:])
        else:
            yield f"status {ended.status}: {said[-3:]}"

    def _third_states(self, content: Content) -> Iterator[str]:
        """What is neither as before nor as in the end."""
        if self._program.grows is not None:
            why = self._program.grows(self._root / "out", self._reference)
            if why:
                yield why
            return
        old, new, now = (_by_whole(_visible(one), self._program.wholes) for one in (self._old, self._new, content))
        for name in sorted({*old, *new, *now}):
            if now.get(name) not in (old.get(name), new.get(name)):
                yield f"{name} is neither the old nor the new one"

    def _after_restart(self, killed: bool) -> tuple[str, ...]:
        """What is wrong after the same program was started again; from equal files once."""
        if self._program.once and _visible(self._content()) == _visible(self._new):
            return ()
        found = tuple(sorted(self._bytes().items()))
        if found not in self._restarted:
            self._restarted[found] = tuple(self._restart(killed))
        return self._restarted[found]

    def _restart(self, killed: bool) -> Iterator[str]:
        again = self._ended(0, Action.COUNT)
        content = self._content()
        if again.status:
            yield f"started again: status {again.status}: {again.lines[-3:]}"
        elif _visible(content) != _visible(self._new):
            yield f"started again: {self._differences(content)}"
        elif killed and (left := {name for name in _hidden(content) if not name.startswith("tmp/")}):
            yield f"started again: left {sorted(left)}"

    def _differences(self, content: Content) -> str:
        now, new = _visible(content), _visible(self._new)
        return f"found other {sorted(name for name in {*now, *new} if now.get(name) != new.get(name))}"

    def _fresh(self) -> None:
        """`counted/out` as it is before the program, and an empty folder for temporary files."""
        shutil.rmtree(self._root, ignore_errors=True)
        (self._root / "out").mkdir(parents=True)
        (self._root / "tmp").mkdir()
        self._prepared(lambda: self._program.before(self._root / "out", self._inputs))

    def _prepared(self, work: Callable[[], None]) -> None:
        if _in_child(work, self._aside):
            raise AssertionError((self._aside / "stderr").read_text())

    def _bytes(self) -> dict[str, bytes]:
        paths = [path for path in self._root.rglob("*") if path.is_file()]
        return {str(path.relative_to(self._root)): path.read_bytes() for path in paths}

    def _content(self) -> Content:
        paths = {str(path.relative_to(self._root)): path for path in self._root.rglob("*") if path.is_file()}
        plain = {name: self._program.plain(path) for name, path in paths.items()}
        return {name: found for name, found in plain.items() if found is not None}

    def _ended(self, call: int, action: Action) -> Ended:
        trace = self._aside / "calls"

        def armed() -> int:
            os.environ["TMPDIR"] = str(self._root / "tmp")
            tempfile.tempdir = None
            descriptor = os.open(trace, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_APPEND)
            arm(self._root, call, action, descriptor)
            return self._program.run(self._root / "out", self._inputs)

        status = _in_child(armed, self._aside)
        calls = tuple(trace.read_text(errors="replace").splitlines())
        return Ended(status, tuple((self._aside / "stderr").read_text(errors="replace").splitlines()), calls)


def _visible(content: Content) -> dict[str, object]:
    """Files in `out` that no part of the path hides."""
    return {name: data for name, data in content.items() if name.startswith("out/") and not _is_hidden(name)}


def _hidden(content: Content) -> set[str]:
    return {name for name in content if name.startswith("tmp/") or _is_hidden(name)}


def _is_hidden(name: str) -> bool:
    return any(part.startswith(".") for part in name.split("/"))


def _by_whole(files: Content, wholes: Sequence[str]) -> dict[str, object]:
    """Files, and folders that appear as a whole, by name."""
    found: dict[str, object] = {}
    for name, data in files.items():
        whole = next((one for one in wholes if name.startswith(f"out/{one}/")), None)
        if whole is None:
            found[name] = data
        else:
            inside = found.setdefault(whole, {})
            assert isinstance(inside, dict)
            inside[name] = data
    return found


def _in_child(work: Callable[[], Any], aside: Path) -> int:
    """The status of a forked process that does it; what it says goes to files `stdout` and `stderr` in `aside`."""
    with warnings.catch_warnings(action="ignore", category=DeprecationWarning):  # threads of libraries that wait
        child = os.fork()
    if child:
        _, status = os.waitpid(child, 0)
        return os.waitstatus_to_exitcode(status)
    status = 70
    try:
        for descriptor, name in ((1, "stdout"), (2, "stderr")):
            os.dup2(os.open(aside / name, os.O_WRONLY | os.O_CREAT | os.O_TRUNC), descriptor)
        status = int(work() or 0)
    except SystemExit as end:
        status = int(end.code or 0)
    except (ContactCurationError, OSError) as error:  # as the entry points of nodes and commands do
        print(f"error: {error}", file=sys.stderr)  # noqa: T201
        status = 1
    except BaseException:  # noqa: BLE001 - of a forked process, which must not go on as the test
        traceback.print_exc()
    finally:
        (aside / "modules").write_text("\n".join(sys.modules))
        atexit._run_exitfuncs()
        for stream in (sys.stdout, sys.stderr):
            stream.flush()
        os._exit(status)


def every_failure(program: Program, folder: Path, every: int = 1, actions: Sequence[Action] = FAILURES) -> Tally:
    """Tries each `every`-th call of a program with each action."""
    trial = Trial(program, folder)
    tally = Tally(len(trial.calls))
    for action in actions:
        for call in range(1, len(trial.calls) + 1, every):
            trial.failed(call, action, tally)
    return tally


def under_shim(names: Sequence[str], every: int = 1, actions: Sequence[Action] = FAILURES) -> Mapping[str, Tally]:
    """The tallies of programs by name, from one process that runs under the library."""
    words = [sys.executable, "-m", "test.reliability.every_call", "--json", str(every), ",".join(one.name for one in actions)]
    done = subprocess.run([*words, *names], env=environment(), stdout=subprocess.PIPE, check=True)
    told = json.loads(done.stdout)
    return {name: Tally(**{**values, "messages": Counter(values["messages"])}) for name, values in told.items()}


def row(name: str, tally: Tally) -> str:
    """A row of the table in docs/reliability.md."""
    lost = len(tally.defects)
    message = tally.messages.most_common(1)[0][0] if tally.messages else ""
    counts = (tally.calls, tally.tried, tally.tried - lost, lost)
    return f"| `{name}` | {' | '.join(str(count) for count in counts)} | {message} |"


def main(words: Sequence[str]) -> None:
    """Prints tallies."""
    from test.reliability.programs import PROGRAMS

    if words[:1] == ["--json"]:
        every, actions = int(words[1]), [Action[name] for name in words[2].split(",")]
        tallies = {}
        for name in words[3:]:
            folder = Path(tempfile.mkdtemp())  # a TemporaryDirectory would go with the first child
            tallies[name] = vars(every_failure(PROGRAMS[name], folder, every, actions))
            shutil.rmtree(folder)
        print(json.dumps(tallies))  # noqa: T201
        return
    every, names = (int(words[1]), words[2:]) if words[:1] == ["--every"] else (1, words)
    for name in names or PROGRAMS:  # each in a process that ends
        tally = under_shim([name], every)[name]
        print(row(name, tally), flush=True)  # noqa: T201
        for line in tally.defects:
            print(f"    {line}", file=sys.stderr, flush=True)  # noqa: T201


if __name__ == "__main__":
    assert LIBRARY
    main(sys.argv[1:])
