"""config/nodes.yaml has every parameter of every node, and the launch files set none that there is not."""

import re
import runpy
import shutil
import subprocess
import sys
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple
from xml.etree import ElementTree

import pytest
import yaml

import contact_curation
from contact_curation.session.node_parameters import STAGES
from contact_curation.session.parameter_files import read_node_parameters, write_node_parameters
from test.graph.parts.declared_parameters import OF_RCLPY, all_declared, nodes_yaml

PACKAGE = Path(contact_curation.__file__).parent
CONFIG = PACKAGE / "config" / "nodes.yaml"
LAUNCH_FILES = sorted((PACKAGE / "launch").glob("*.launch.py"))


@pytest.fixture(scope="module")
def declared(tmp_path_factory: pytest.TempPathFactory) -> dict[str, dict[str, Any]]:
    """What the nodes declare now."""
    path = tmp_path_factory.mktemp("declared") / "nodes.yaml"
    path.write_text(nodes_yaml())
    return read_node_parameters(path)


def test_the_file_has_every_parameter_with_its_default(declared: dict[str, dict[str, Any]]) -> None:
    again = "python -m test.graph.parts.declared_parameters contact_curation/config/nodes.yaml"
    assert CONFIG.read_text() == nodes_yaml(), f"run {again}"
    found = read_node_parameters(CONFIG)
    assert set(found) == set(declared)
    for node, values in declared.items():
        assert found[node] == values, f"run {again}"
        assert {name: type(value) for name, value in found[node].items()} == {name: type(one) for name, one in values.items()}


def test_every_parameter_says_what_it_is() -> None:
    assert [f"{node}: {one.name}" for node, found in all_declared().items() for one in found if not one.description] == []


def test_what_is_written_is_read_again(tmp_path: Path) -> None:
    shared = [0.5, 1.0]
    values: dict[str, dict[str, Any]] = {
        "curator": {"top": 4, "prior": 1e-6, "store": "a: b", "far": float("inf"), "a": shared},
        "trainer": {"b": shared},
    }
    write_node_parameters(tmp_path / "own.yaml", values)
    assert read_node_parameters(tmp_path / "own.yaml") == values
    assert "&" not in (tmp_path / "own.yaml").read_text()  # ROS refuses aliases


class Recorded:
    """Stands for anything of `launch`: remembers what it was made of."""

    def __init__(self, *parts: Any, **named: Any) -> None:
        self.parts, self.named = parts, named


def described(path: Path, monkeypatch: pytest.MonkeyPatch, **given: str) -> list[Recorded]:
    """The actions of a launch file, and those that its functions give for arguments.

    `launch` itself is not on the package index, so that stand-ins take its place.
    """
    tree = {
        "launch": ["LaunchContext", "LaunchDescription"],
        "launch.actions": ["DeclareLaunchArgument", "OpaqueFunction"],
        "launch.conditions": ["IfCondition"],
        "launch.substitutions": ["LaunchConfiguration", "NotEqualsSubstitution", "PathJoinSubstitution"],
        "launch_ros": [],
        "launch_ros.actions": ["Node"],
        "launch_ros.parameter_descriptions": ["ParameterValue"],
        "launch_ros.substitutions": ["FindPackageShare"],
    }
    for name, classes in tree.items():
        module = ModuleType(name)
        for one in classes:
            setattr(module, one, type(one, (Recorded,), {}))
        monkeypatch.setitem(sys.modules, name, module)
    monkeypatch.setattr(Recorded, "perform", lambda value, context: context[value.parts[0]], raising=False)
    actions = list(runpy.run_path(str(path))["generate_launch_description"]().parts[0])
    context = {one.parts[0]: one.named["default_value"] for one in actions if type(one).__name__ == "DeclareLaunchArgument"}
    for one in [one for one in actions if type(one).__name__ == "OpaqueFunction"]:
        actions += one.named["function"]({**context, **given}) or []
    return actions


def parameters_of(node: Recorded) -> dict[str, Any]:
    """The parameters of a node that its launch file sets itself."""
    return {name: value for part in node.named["parameters"] if isinstance(part, dict) for name, value in part.items()}


@pytest.mark.parametrize("path", LAUNCH_FILES, ids=lambda path: path.name)
def test_a_launch_file_starts_nodes_that_there_are_with_parameters_that_they_have(
    path: Path, declared: dict[str, dict[str, Any]], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    arguments = {one.parts[0] for one in described(path, monkeypatch) if type(one).__name__ == "DeclareLaunchArgument"}
    actions = described(path, monkeypatch, **{name: str(tmp_path) for name in arguments})
    for one in actions:
        if type(one).__name__ == "Node":
            node = one.named
            assert node["package"] == "contact_curation"
            assert node["name"] == node["executable"]
            assert used_arguments(node["parameters"][0]) == {"params_file"}, node["executable"]  # before what arguments set
            assert set(parameters_of(one)) <= {*declared[node["executable"]], *OF_RCLPY}, node["executable"]
    assert used_arguments(actions) == arguments


@pytest.mark.parametrize("path", LAUNCH_FILES, ids=lambda path: path.name)
def test_an_argument_that_is_not_given_leaves_the_parameter_to_the_file(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    nodes = [one for one in described(path, monkeypatch) if type(one).__name__ == "Node"]
    values = [parameter for node in nodes for parameter in parameters_of(node).items()]
    assert {name for name, value in values if used_arguments(value) - {"folder"}} <= {"auto", "thrower"}
    given = described(path, monkeypatch, rate="2.0", use_sim_time="true", bag="123")
    rated = {node.named["name"]: parameters_of(node) for node in given if type(node).__name__ == "Node"}
    assert {name for name, one in rated.items() if "rate" in one} == {"sim_arm" if "online" in path.name else "player"}
    assert {name for name, one in rated.items() if "use_sim_time" not in one} <= {"player"}


@pytest.mark.parametrize("path", LAUNCH_FILES, ids=lambda path: path.name)
def test_a_launch_file_makes_its_folder_before_it_starts_nodes(
    path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    actions = described(path, monkeypatch)
    kinds = [type(one).__name__ for one in actions]
    for _ in range(2):
        actions[kinds.index("OpaqueFunction")].named["function"]({"folder": str(tmp_path / "a" / "b")})
    assert (tmp_path / "a" / "b").is_dir()
    assert kinds.index("OpaqueFunction") < kinds.index("Node")


def used_arguments(value: Any) -> set[str]:
    """Names of all LaunchConfigurations in a description."""
    if type(value).__name__ == "LaunchConfiguration":
        return {value.parts[0]}
    if isinstance(value, Recorded):
        return used_arguments([*value.parts, *value.named.values()])
    if isinstance(value, dict):
        return used_arguments(list(value.values()))
    if isinstance(value, list | tuple):
        return set().union(*(used_arguments(one) for one in value))
    return set()


def test_the_loop_is_launched_with_all_eight_nodes(monkeypatch: pytest.MonkeyPatch) -> None:
    nodes = [
        one.named["executable"]
        for one in described(PACKAGE / "launch" / "online.launch.py", monkeypatch)
        if type(one).__name__ == "Node"
    ]
    assert nodes == [*STAGES, "dashboard", "session_recorder"]


def test_the_loop_finds_the_poses_of_any_body(monkeypatch: pytest.MonkeyPatch) -> None:
    actions = described(PACKAGE / "launch" / "online.launch.py", monkeypatch)
    (ingest,) = [one for one in actions if type(one).__name__ == "Node" and one.named["name"] == "pose_ingest"]
    assert "topic" not in parameters_of(ingest)
    assert read_node_parameters(CONFIG)["pose_ingest"]["topic"] == ""


def test_every_argument_has_a_description(monkeypatch: pytest.MonkeyPatch) -> None:
    for path in LAUNCH_FILES:
        for one in described(path, monkeypatch):
            if type(one).__name__ == "DeclareLaunchArgument":
                assert one.named["description"]


def test_the_config_files_are_yaml() -> None:
    assert all(yaml.safe_load(path.read_text()) for path in CONFIG.parent.glob("*.yaml"))


class Frontend(NamedTuple):
    """A launch file in XML or YAML.

    Attributes:
        arguments: default value and description by name.
        file: the launch file that it includes.
        passed: what it passes on, by name.
    """

    arguments: dict[str, tuple[str, str]]
    file: str
    passed: dict[str, str]


def read_xml(path: Path) -> Frontend:
    root = ElementTree.parse(path).getroot()
    arguments = {one.attrib["name"]: (one.attrib["default"], one.attrib["description"]) for one in root.findall("arg")}
    (included,) = root.findall("include")
    passed = {one.attrib["name"]: one.attrib["value"] for one in included.findall("arg")}
    return Frontend(arguments, included.attrib["file"], passed)


def read_yaml(path: Path) -> Frontend:
    actions = yaml.safe_load(path.read_text())["launch"]
    found = [action["arg"] for action in actions if "arg" in action]
    (included,) = [action["include"] for action in actions if "include" in action]
    arguments = {one["name"]: (one["default"], one["description"]) for one in found}
    return Frontend(arguments, included["file"], {one["name"]: one["value"] for one in included["arg"]})


@pytest.mark.parametrize("path", LAUNCH_FILES, ids=lambda path: path.name)
def test_a_launch_file_in_xml_and_in_yaml_has_all_arguments_of_the_one_in_python_and_passes_them_on(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    share = "$(find-pkg-share contact_curation)"
    expected: dict[str, tuple[str, str]] = {}
    for one in described(path, monkeypatch):
        if type(one).__name__ == "DeclareLaunchArgument":
            default = one.named["default_value"]
            text = default if isinstance(default, str) else f"{share}/{'/'.join(default.parts[0][1:])}"
            expected[one.parts[0]] = (text, one.named["description"])
    passed = {name: f"$(var {name})" for name in expected}
    for found in (read_xml(path.with_suffix(".xml")), read_yaml(path.with_suffix(".yaml"))):
        assert found == Frontend(expected, f"{share}/launch/{path.name}", passed)


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("ros2") is None, reason="no command ros2: the real launch is in no package index")
@pytest.mark.parametrize("path", sorted((PACKAGE / "launch").glob("*.launch.*")), ids=lambda path: path.name)
def test_ros2_launch_shows_the_arguments_of_every_launch_file(path: Path) -> None:
    command = ["ros2", "launch", "contact_curation", path.name, "--show-args"]
    shown = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    assert set(read_xml(path.with_suffix(".xml")).arguments) <= set(re.findall(r"'(\w+)':", shown))
