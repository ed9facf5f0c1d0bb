"""Where pip and colcon put the package: commands in bin for one, in lib/contact_curation for `ros2 run` for the other."""

import os
import platform
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from test.kernel.builds import setup_module

REPOSITORY = Path(__file__).resolve().parents[2]
kernel_levels = setup_module().kernel_levels
EXECUTABLES = {
    *("pose_ingest", "fisher_scorer", "curator", "trainer", "throw_designer", "sim_arm", "sim_camera", "player"),
    *("session_recorder", "dashboard", "container", "trajectory_thrower"),
}
KERNEL = {f"contact_curation/solver/_kernel_{level.replace('-', '_')}.so" for level in kernel_levels(platform.machine())}
SHARED = {"package.xml", "config/cube.yaml"}


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The project as it is, but with a kernel of one line, so that it builds at once."""
    copy = tmp_path_factory.mktemp("project")
    for name in ("setup.py", "setup.cfg", "pyproject.toml", "package.xml", "README.md", "LICENSE", "MANIFEST.in"):
        shutil.copy(REPOSITORY / name, copy)
    shutil.copytree(REPOSITORY / "resource", copy / "resource")
    built = shutil.ignore_patterns("__pycache__", "*.so", "*.cpp")
    shutil.copytree(REPOSITORY / "contact_curation", copy / "contact_curation", ignore=built)
    (copy / "contact_curation" / "solver" / "kernel" / "source.cpp").write_text('extern "C" int one() { return 1; }\n')
    return copy


def run(project: Path, *arguments: str) -> None:
    command = [sys.executable, "-W", "ignore", *arguments]
    done = subprocess.run(
        command, cwd=project, env=os.environ | {"PYTHONWARNINGS": "ignore"}, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


@pytest.mark.slow
def test_pips_wheel_holds_commands_kernel_and_ros_files(project: Path, tmp_path: Path) -> None:
    run(project, "-m", "pip", "wheel", "--no-deps", "--no-build-isolation", "--wheel-dir", str(tmp_path), ".")
    (built,) = tmp_path.glob("*.whl")
    assert built.name.endswith(f"-py3-none-linux_{platform.machine()}.whl")  # for every Python 3.12 and later
    with zipfile.ZipFile(built) as wheel:
        names = {name.split(".data/data/")[-1] for name in wheel.namelist()}
        entry_points = wheel.read(next(name for name in wheel.namelist() if name.endswith("entry_points.txt"))).decode()
    assert names >= KERNEL
    assert names >= {f"share/contact_curation/{name}" for name in SHARED}
    assert names >= {"share/ament_index/resource_index/packages/contact_curation", "contact_curation/config/cube.yaml"}
    commands = {line.split(" = ")[0] for line in entry_points.splitlines() if " = " in line}
    assert commands == EXECUTABLES | {"contact-curation"}


@pytest.mark.slow
def test_colcons_install_puts_each_node_where_ros2_run_looks(project: Path, tmp_path: Path) -> None:
    record = ["--single-version-externally-managed", "--record", str(tmp_path / "record")]
    run(project, "setup.py", "-q", "build", "--build-base", str(tmp_path / "b"), "install", "--prefix", str(tmp_path), *record)
    assert {path.name for path in (tmp_path / "lib" / "contact_curation").iterdir()} == EXECUTABLES | {"contact-curation"}
    assert not (tmp_path / "bin").exists()
    installed = next(tmp_path.glob("lib/python*/site-packages"))
    assert all((installed / name).is_file() for name in KERNEL)
    assert all((tmp_path / "share" / "contact_curation" / name).is_file() for name in SHARED)
    assert (tmp_path / "share" / "ament_index" / "resource_index" / "packages" / "contact_curation").is_file()
