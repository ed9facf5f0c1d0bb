"""Vendored messages fill a gap; they never stand in front of the packages they stand in for."""

import importlib.util
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

INSTALL = Path(__file__).resolve().parents[2] / "msg_defs" / "install.py"


@pytest.fixture(scope="module")
def is_ours_to_build() -> Callable[[str], bool]:
    spec = importlib.util.spec_from_file_location("install_messages", INSTALL)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    judge: Callable[[str], bool] = module.is_ours_to_build
    return judge


def test_a_package_that_is_nowhere_is_built(is_ours_to_build: Callable[[str], bool]) -> None:
    assert is_ours_to_build("msgs_that_nobody_has_installed")


def test_a_package_that_we_installed_is_built_again(is_ours_to_build: Callable[[str], bool]) -> None:
    assert is_ours_to_build("tf2_msgs")
    assert is_ours_to_build("apriltag_msgs")


def test_a_package_that_someone_else_installed_is_left_alone(
    is_ours_to_build: Callable[[str], bool], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "their_msgs").mkdir()
    (tmp_path / "their_msgs" / "__init__.py").touch()
    monkeypatch.syspath_prepend(tmp_path)
    assert not is_ours_to_build("their_msgs")


def test_a_definition_with_an_unknown_type_is_refused(tmp_path: Path) -> None:
    (tmp_path / "msg").mkdir()
    (tmp_path / "msg" / "Wrong.msg").write_text("float63 x\n")
    (tmp_path / "package.xml").write_text(
        "<package><name>wrong_msgs</name><version>0.0.1</version><description>d</description><license>BSD-3-Clause</license></package>"
    )
    code = (
        "import sys; from pathlib import Path; sys.path.insert(0, sys.argv[1])\n"
        "from pip_build.generation import describe\n"
        "from pip_build.interface_package import read_interface_package\n"
        "describe(read_interface_package(Path(sys.argv[2])), Path(sys.argv[2]) / 'build')"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, str(INSTALL.parent), str(tmp_path)], capture_output=True, text=True, check=False
    )
    assert done.returncode != 0
    assert "float63" in done.stderr
