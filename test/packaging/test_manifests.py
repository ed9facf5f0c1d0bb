"""package.xml, setup.py, the installed package and the files on disk tell one story."""

import ast
import importlib
import json
import re
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import contact_curation_msgs
import pytest
import yaml

import contact_curation
from test.kernel.builds import setup_module

REPOSITORY = Path(__file__).resolve().parents[2]
NODES = REPOSITORY / "contact_curation" / "nodes"
READ_SETUP = """
import json
from distutils.core import run_setup
found = run_setup("setup.py", stop_after="init")
print(json.dumps({"name": found.get_name(), "version": found.get_version(), "packages": found.packages,
                  "data_files": found.data_files, "scripts": found.entry_points["console_scripts"]}))
"""


def manifest(folder: Path) -> ElementTree.Element:
    return ElementTree.parse(folder / "package.xml").getroot()


@pytest.fixture(scope="module")
def distribution() -> dict[str, Any]:
    """What setup.py declares, read as colcon reads it."""
    command = [sys.executable, "-W", "ignore", "-c", READ_SETUP]
    declared: dict[str, Any] = json.loads(subprocess.run(command, cwd=REPOSITORY, check=True, capture_output=True).stdout)
    return declared


@pytest.fixture(scope="module")
def executables(distribution: dict[str, Any]) -> dict[str, str]:
    """Executable name -> the module whose main it calls."""
    pairs = [script.split(" = ") for script in distribution["scripts"]]
    assert all(target.endswith(":main") for _, target in pairs)
    return {name: target.removesuffix(":main") for name, target in pairs}


def has_main(path: Path) -> bool:
    return any(isinstance(node, ast.FunctionDef) and node.name == "main" for node in ast.parse(path.read_text()).body)


def test_one_version_is_given_everywhere(distribution: dict[str, Any]) -> None:
    given = {
        "package.xml": manifest(REPOSITORY).findtext("version"),
        "setup.py": distribution["version"],
        "__version__": contact_curation.__version__,
        "installed": version("contact_curation"),
        "CITATION.cff": str(yaml.safe_load((REPOSITORY / "CITATION.cff").read_text())["version"]),
        "messages' package.xml": manifest(REPOSITORY / "msg_defs").findtext("version"),
        "installed messages": version("contact_curation_msgs"),
    }
    assert set(given.values()) == {contact_curation.__version__}, given


def test_the_names_are_those_that_ros_and_python_use(distribution: dict[str, Any]) -> None:
    assert manifest(REPOSITORY).findtext("name") == distribution["name"] == contact_curation.__name__
    assert manifest(REPOSITORY / "msg_defs").findtext("name") == contact_curation_msgs.__name__


def test_colcon_sees_an_ament_python_package_and_an_ament_cmake_package() -> None:
    assert manifest(REPOSITORY).findtext("export/build_type") == "ament_python"
    assert manifest(REPOSITORY / "msg_defs").findtext("export/build_type") == "ament_cmake"


def test_the_package_is_marked_in_the_resource_index(distribution: dict[str, Any]) -> None:
    installed = dict(distribution["data_files"])
    assert installed["share/ament_index/resource_index/packages"] == ["resource/contact_curation"]
    assert (REPOSITORY / "resource" / "contact_curation").is_file()
    assert installed["share/contact_curation"] == ["package.xml"]


@pytest.mark.parametrize(("folder", "pattern"), [("launch", "*.*"), ("config", "*.*")])
def test_all_launch_and_config_files_are_installed(distribution: dict[str, Any], folder: str, pattern: str) -> None:
    on_disk = {f"contact_curation/{folder}/{path.name}" for path in (REPOSITORY / "contact_curation" / folder).glob(pattern)}
    assert set(dict(distribution["data_files"])[f"share/contact_curation/{folder}"]) == on_disk


def test_every_part_with_modules_is_installed(distribution: dict[str, Any]) -> None:
    folders = {path.parent for path in (REPOSITORY / "contact_curation").rglob("*.py") if path.parent.name != "launch"}
    assert set(distribution["packages"]) == {".".join(folder.relative_to(REPOSITORY).parts) for folder in folders}


def test_every_executable_has_a_module_with_a_main(executables: dict[str, str]) -> None:
    for name, module in executables.items():
        assert callable(getattr(importlib.import_module(module), "main", None)), f"{name}: {module} has no main"


def test_every_node_is_an_executable_of_its_own_name(executables: dict[str, str]) -> None:
    nodes = {path.stem for path in NODES.glob("*.py") if has_main(path)}
    assert {name: module for name, module in executables.items() if ".nodes." in module} == {
        node: f"contact_curation.nodes.{node}" for node in nodes
    }


def test_the_ros_packages_that_nodes_import_are_declared() -> None:
    declared = {element.text for element in manifest(REPOSITORY).iter("exec_depend")}
    trees = [ast.parse(path.read_text()) for path in NODES.glob("*.py")]
    modules = [node.module or "" for tree in trees for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)]
    used = {name.split(".")[0] for name in modules}
    ros = {name for name in used if name.endswith(("_msgs", "_interfaces", "_srvs")) or name == "rclpy"}
    assert ros <= declared


def test_every_package_of_the_ubuntu_list_is_bounded_and_what_the_nodes_need_is_in_it_or_in_ubuntu() -> None:
    lines = (REPOSITORY / "docs" / "ros" / "ubuntu_24.04.txt").read_text().splitlines()
    listed = dict(re.findall(r"^([\w-]+)(.*)$", "\n".join(line for line in lines if not line.startswith("#")), re.MULTILINE))
    assert all(">=" in bounds and "<" in bounds for bounds in listed.values()), listed
    setup = setup_module()
    needed = {re.split("[<>=[]", name)[0] for name in [*setup.REQUIRES, *setup.TRAIN, *setup.SIM]}
    assert needed - set(listed) == {"matplotlib", "PyYAML", "tqdm"}  # exec_depend of package.xml
