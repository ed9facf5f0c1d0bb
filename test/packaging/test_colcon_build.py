"""colcon builds both packages, one with ament_cmake: the types are those of pip, the nodes run where `ros2 run` looks."""

import json
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from importlib.metadata import version
from pathlib import Path
from typing import Any

import pytest
from ament_index_python.packages import get_package_prefix, get_package_share_directory, get_packages_with_prefixes
from ament_index_python.resources import get_resource

from contact_curation.session.free_domain import free_domain
from test.graph.parts.graph import Graph
from test.graph.parts.offline import assert_same_buffer, curated, tosses_of
from test.graph.parts.processes import parameter_text
from test.packaging import type_hash
from test.packaging.jazzy import REPOSITORY, Workspace, build, lacking, make_jazzy
from test.packaging.test_installation import EXECUTABLES

pytestmark = pytest.mark.slow

MESSAGES = "contact_curation_msgs"
SERVICE = ("", "_Request", "_Response", "_Event")
OF_ACTIONS = tuple(f"_{service}{part}" for service in ("SendGoal", "GetResult") for part in SERVICE)
ACTION = ("", "_Goal", "_Result", "_Feedback", "_FeedbackMessage", *OF_ACTIONS)
PARTS = {"msg": ("",), "srv": SERVICE, "action": ACTION}
"""What the generators make of one definition of each kind."""

GOLDEN = REPOSITORY / "bags" / "golden.mcap"
TOPICS = {"/toss": "Toss", "/toss_information": "TossInformation", "/curated_buffer": "CuratedBuffer"}
TOP = 6
STAGES: dict[str, dict[str, Any]] = {"pose_ingest": {}, "fisher_scorer": {}, "curator": {"top": TOP}}
LONG = 90.0
"""[s]"""


@pytest.fixture(scope="module")
def workspace(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Workspace]:
    """Both packages, built by colcon in an environment of their own; minutes."""
    if reason := lacking():
        pytest.skip(reason)
    folder = tmp_path_factory.mktemp("colcon")
    yield build(folder / "workspace", make_jazzy(folder / "jazzy"))
    shutil.rmtree(folder)


@pytest.fixture
def in_workspace(workspace: Workspace, monkeypatch: pytest.MonkeyPatch) -> Workspace:
    """The workspace, whose index is the one that ament_index_python asks."""
    monkeypatch.setenv("AMENT_PREFIX_PATH", workspace.environment["AMENT_PREFIX_PATH"])
    return workspace


def described_hashes(share: Path) -> dict[str, str]:
    """Type name -> hash, of every type that the descriptions below a package's share folder mention."""
    hashes: dict[str, str] = {}
    for path in share.glob("*/*.json"):
        for entry in json.loads(path.read_text())["type_hashes"]:
            name, found = entry["type_name"], entry["hash_string"]
            assert hashes.setdefault(name, found) == found, f"{path}: two hashes of {name}"
    return hashes


def pip_hashes() -> dict[str, str]:
    return described_hashes(Path(sys.prefix, "share", MESSAGES))


def defined_types() -> set[str]:
    """Every type that the definitions in msg_defs make."""
    definitions = [path for kind in PARTS for path in (REPOSITORY / "msg_defs").glob(f"{kind}/*.{kind}")]
    return {f"{MESSAGES}/{path.parent.name}/{path.stem}{part}" for path in definitions for part in PARTS[path.parent.name]}


def test_colcon_finds_and_builds_exactly_the_two_packages(in_workspace: Workspace) -> None:
    assert {path.name for path in in_workspace.install.iterdir() if path.is_dir()} == {"contact_curation", MESSAGES}
    prefixes = get_packages_with_prefixes()
    for package in ("contact_curation", MESSAGES):
        assert Path(prefixes[package]) == in_workspace.install / package


def test_cmake_and_pip_describe_the_same_types_with_the_same_hashes(workspace: Workspace) -> None:
    cmake = described_hashes(workspace.install / MESSAGES / "share" / MESSAGES)
    assert {name for name in cmake if name.startswith(MESSAGES)} == defined_types()
    assert cmake == pip_hashes()


def test_the_libraries_of_both_builds_announce_these_hashes(workspace: Workspace) -> None:
    types = sorted(defined_types())
    announced = json.loads(workspace.python(type_hash.__file__, *types))
    described = pip_hashes()
    assert announced == {name: described[name] for name in types} == {name: type_hash.compiled_hash(name) for name in types}


def test_the_index_lists_the_same_interfaces_for_both_builds(in_workspace: Workspace) -> None:
    content, prefix = get_resource("rosidl_interfaces", MESSAGES)
    assert Path(prefix) == in_workspace.install / MESSAGES
    of_pip = Path(sys.prefix, "share", "ament_index", "resource_index", "rosidl_interfaces", MESSAGES)
    assert sorted(content.split()) == sorted(of_pip.read_text().split())


def test_a_message_of_the_cmake_build_is_imported_and_serialized(workspace: Workspace) -> None:
    script = f"""
import {MESSAGES}
from {MESSAGES}.action import ExecuteThrow
from {MESSAGES}.msg import Throw, Toss
from {MESSAGES}.srv import GetTosses
from rclpy.serialization import deserialize_message, serialize_message
for sent in (Toss(toss_id="cube-1"), GetTosses.Request(toss_ids=["a"]), ExecuteThrow.Goal(throw_command=Throw(throw_id="t"))):
    assert deserialize_message(serialize_message(sent), type(sent)) == sent
print({MESSAGES}.__file__)
"""
    assert Path(workspace.python("-c", script)).is_relative_to(workspace.install / MESSAGES)


def executables() -> dict[str, Path]:
    """Name -> path, as `ros2 run` looks for them: the files below PREFIX/lib/PACKAGE that may be executed."""
    below = Path(get_package_prefix("contact_curation"), "lib", "contact_curation").rglob("*")
    return {path.name: path for path in below if path.is_file() and os.access(path, os.X_OK)}


def test_ros2_run_finds_every_node_and_its_module_is_the_one_that_colcon_installed(in_workspace: Workspace) -> None:
    assert set(executables()) == EXECUTABLES | {"contact-curation"}
    script = """
import sys
from importlib.metadata import distribution
for entry in distribution("contact_curation").entry_points:
    print(entry.name, sys.modules[entry.load().__module__].__file__)
"""
    loaded = dict(line.split(" ", 1) for line in in_workspace.python("-c", script).splitlines())
    assert set(loaded) == set(executables())
    for path in loaded.values():
        assert Path(path).is_relative_to(in_workspace.install / "contact_curation")


def test_the_command_line_answers_where_ros2_run_finds_it(in_workspace: Workspace) -> None:
    command = [str(executables()["contact-curation"]), "--version"]
    said = subprocess.run(command, env=in_workspace.environment, capture_output=True, text=True, check=True).stdout
    assert version("contact_curation") in said


def test_ros2_launch_finds_every_launch_file_and_its_parameters(in_workspace: Workspace) -> None:
    share = Path(get_package_share_directory("contact_curation"))
    for folder in ("launch", "config"):
        sources = [path for path in (REPOSITORY / "contact_curation" / folder).iterdir() if path.is_file()]
        assert sources
        for source in sources:
            assert (share / folder / source.name).read_bytes() == source.read_bytes()


@contextmanager
def running(workspace: Workspace, name: str, graph: Graph, **parameters: Any) -> Iterator[None]:
    """One executable of the workspace in the graph's domain, ended by SIGINT."""
    options = [part for key, value in parameters.items() for part in ("-p", f"{key}:={parameter_text(value)}")]
    settings = {"ROS_DOMAIN_ID": str(graph.domain), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    with (graph.folder / f"{name}.log").open("ab") as log:
        command = [str(executables()[name]), "--ros-args", *options]
        process = subprocess.Popen(command, env={**workspace.environment, **settings}, stdout=log, stderr=log)
    try:
        yield
    finally:
        process.send_signal(signal.SIGINT)
        try:
            status = process.wait(30.0)
        except subprocess.TimeoutExpired:
            process.kill()
            status = process.wait()
    assert status == 0, f"{name} ended with {status}\n{graph.logs()}"


def test_the_nodes_that_colcon_built_rank_a_recording_as_the_library_and_talk_to_those_of_pip(
    in_workspace: Workspace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    with free_domain() as domain, Graph(tmp_path, domain) as graph, ExitStack() as nodes:
        buffers = graph.buffers()
        for name, chosen in STAGES.items():
            nodes.enter_context(running(in_workspace, name, graph, store=tmp_path / f"{name}.sqlite", **chosen))
        nodes.enter_context(running(in_workspace, "player", graph, bag=GOLDEN, rate=20.0, wait_for=30.0, stay=True))

        tosses = len(tosses_of(GOLDEN))
        graph.until(lambda: buffers and buffers[-1].tosses_seen == tosses, LONG, "every toss to be curated")
        assert_same_buffer(buffers[-1], curated(GOLDEN, TOP))
        hashes = pip_hashes()
        for topic, name in TOPICS.items():
            announced = graph.listener.node.get_publishers_info_by_topic(topic)
            assert {str(publisher.topic_type_hash) for publisher in announced} == {hashes[f"{MESSAGES}/msg/{name}"]}
