"""`make` finds a Python 3.12 that works, or says in one line what to install."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

SCRIPT = Path(__file__).resolve().parents[2] / ".ci" / "find-python"
BROKEN = "#!/bin/sh\necho 'pyenv: python3.12: command not found' >&2\nexit 127\n"
INCOMPLETE = "#!/bin/sh\necho ensurepip Python.h\n"
# Stands in for an interpreter that passes the probe: it lacks nothing, and prints its own path at the end.
COMPLETE = '#!/bin/sh\ncase "$2" in *find_spec*) echo ;; *) echo "$0" ;; esac\n'
UV_WITH_PYTHON = '#!/bin/sh\n[ "$1 $2" = "python find" ] && echo "$HOME/uv-python"\n'
UV_WITHOUT_PYTHON = """#!/bin/sh
case "$1 $2" in
    "python install") ln -s "$HOME/spare" "$HOME/uv-python" ;;
    *) [ -e "$HOME/uv-python" ] && echo "$HOME/uv-python" ;;
esac
"""


@pytest.fixture
def machine(tmp_path: Path) -> Path:
    """A machine with a shell and a compiler, and nothing else on its PATH."""
    (tmp_path / "bin").mkdir()
    for tool in ("sh", "cat"):
        (tmp_path / "bin" / tool).symlink_to(str(shutil.which(tool)))
    for compiler in ("cc", "c++"):
        install(tmp_path / "bin" / compiler, "#!/bin/sh\n")
    return tmp_path


def install(path: Path, script: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(script)
    path.chmod(0o755)


def find(machine: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    variables = {"PATH": str(machine / "bin"), "HOME": str(machine), **environment}
    return subprocess.run(["/bin/sh", str(SCRIPT)], env=variables, capture_output=True, text=True, check=False)


def one_line(done: subprocess.CompletedProcess[str]) -> str:
    assert done.returncode != 0
    assert done.stdout == ""
    assert done.stderr.count("\n") == 1
    return done.stderr


def test_a_real_interpreter_is_found_where_it_is_the_one_on_the_path(machine: Path) -> None:
    (machine / "bin" / "python3.12").symlink_to(Path(sys.executable).resolve())
    done = find(machine)
    assert Path(done.stdout.strip()).resolve() == Path(sys.executable).resolve()


def test_a_shim_that_fails_is_passed_over_for_pyenvs_own_versions(machine: Path) -> None:
    install(machine / "bin" / "python3.12", BROKEN)
    hidden = machine / ".pyenv" / "versions" / "3.12.4" / "bin" / "python3.12"
    install(hidden, COMPLETE)
    assert find(machine).stdout.strip() == str(hidden)


def test_pyenv_is_found_in_its_root_too(machine: Path) -> None:
    hidden = machine / "elsewhere" / "versions" / "3.12.1" / "bin" / "python3.12"
    install(hidden, COMPLETE)
    assert find(machine, PYENV_ROOT=str(machine / "elsewhere")).stdout.strip() == str(hidden)


@pytest.mark.parametrize("place", ["bin/uv", ".local/bin/uv"])
def test_uvs_python_is_taken_when_there_is_no_other(machine: Path, place: str) -> None:
    install(machine / place, UV_WITH_PYTHON)
    install(machine / "uv-python", COMPLETE)
    assert find(machine).stdout.strip() == str(machine / "uv-python")


def test_uv_installs_a_python_when_it_has_none(machine: Path) -> None:
    install(machine / "spare", COMPLETE)
    install(machine / "bin" / "uv", UV_WITHOUT_PYTHON)
    (machine / "bin" / "ln").symlink_to(str(shutil.which("ln")))
    assert find(machine).stdout.strip() == str(machine / "uv-python")


def test_without_python_one_line_says_what_to_install(machine: Path) -> None:
    install(machine / "bin" / "python3.12", BROKEN)
    line = one_line(find(machine))
    assert "No Python 3.12" in line
    assert "Ubuntu 24.04: sudo apt install g++ make python3.12-venv python3.12-dev" in line
    assert "Debian 12" in line


def test_a_python_without_headers_or_pip_is_named_with_what_it_lacks(machine: Path) -> None:
    install(machine / "bin" / "python3.12", INCOMPLETE)
    assert "incomplete: python3.12 (without ensurepip Python.h)" in one_line(find(machine))


def test_without_a_compiler_one_line_says_what_to_install(machine: Path) -> None:
    (machine / "bin" / "c++").unlink()
    line = one_line(find(machine))
    assert "No C++ compiler" in line
    assert "sudo apt install g++" in line
