"""The dashboard's page: Rerun's viewer, served at one address of this machine.

`rerun.serve_web_viewer` of Rerun 0.41 listens on every address. The program `rerun`, which the same package brings, takes one
(`--bind`), so it serves the page in a process of its own. That process ends with this one, however this one ends.
"""

import ctypes
import os
import signal
import subprocess
import sys
import time
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path
from typing import NoReturn

from contact_curation.errors import ContactCurationError, MissingDependencyError

SET_PARENT_DEATH_SIGNAL = 1
"""Of Linux's prctl."""

LISTENS = "0A"
"""State of a TCP socket (Linux's include/net/tcp_states.h)."""

LONGEST_START = 30.0
"""[s]"""

POLL = 0.05
"""[s]"""

QUIET = {"CI": "true", "RUST_LOG": "off"}
"""Environment in which the program writes no log, and neither collects usage data nor keeps a file about that."""


class WebViewer:
    """Serves the viewer until it is closed.

    Args:
        address: IPv4 address of this machine.
        port: of the page.
        data: address of the data, which the program is told so that it serves none itself.

    Raises:
        MissingDependencyError: Rerun is installed without its program.
        ContactCurationError: the program ended at once, or serves nothing.
    """

    def __init__(self, address: str, port: int, data: str) -> None:
        command = [str(_program()), "--serve-web", "--bind", address, "--web-viewer-port", str(port), data]
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-m", __name__, str(os.getpid()), *command],
            env={**os.environ, **QUIET},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,  # Ctrl-C is for this process, which then closes it
        )
        try:
            self._wait(address, port)
        except BaseException:
            self.close()
            raise

    @property
    def serves(self) -> bool:
        """Whether the program is running."""
        return self._process.poll() is None

    def close(self) -> None:
        """Ends the program."""
        self._process.kill()  # it only reads
        self._process.wait()

    def _wait(self, address: str, port: int) -> None:
        end = time.monotonic() + LONGEST_START
        while not listens(self._process.pid, port):
            status = self._process.poll()
            if status is not None or time.monotonic() > end:
                how = f"nothing for {LONGEST_START:g} s" if status is None else f"status {status}"
                raise ContactCurationError(f"rerun --serve-web: found {how}, expected a page at {address}:{port}")
            time.sleep(POLL)


def _program() -> Path:
    found = find_spec("rerun_cli")
    folders = [] if found is None else list(found.submodule_search_locations or ())
    programs = [Path(folder, "rerun") for folder in folders]
    if not (programs and programs[0].is_file()):
        raise MissingDependencyError("the program of rerun", "pip install 'contact-curation[dashboard]'")
    return programs[0]


def listens(process: int, port: int) -> bool:
    """Whether a process listens at a TCP port, as Linux says it: another one may answer there."""
    rows = [line.split() for line in Path("/proc/net/tcp").read_text(encoding="ascii").splitlines()[1:]]
    sockets = {f"socket:[{row[9]}]" for row in rows if row[3] == LISTENS and int(row[1].rpartition(":")[2], 16) == port}
    with suppress(OSError):  # it has ended
        return any(_target(one) in sockets for one in Path(f"/proc/{process}/fd").iterdir())
    return False


def _target(descriptor: Path) -> str:
    """What a descriptor of a process is; empty for one that is closed, such as that by which this process lists its own."""
    try:
        return str(descriptor.readlink())
    except OSError:
        return ""


def become(parent: int, command: list[str]) -> NoReturn:
    """Becomes a program that Linux ends with its parent.

    Args:
        parent: the process that asked for it; it may be gone already.
        command: the program and its arguments.
    """
    ctypes.CDLL(None).prctl(SET_PARENT_DEATH_SIGNAL, signal.SIGKILL)
    if os.getppid() != parent:
        sys.exit(1)
    os.execv(command[0], command)


if __name__ == "__main__":
    become(int(sys.argv[1]), sys.argv[2:])
