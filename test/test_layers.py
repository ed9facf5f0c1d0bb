"""The parts of the package know only the parts to their left, and each outside library stays in its part.

errors | version < configs | exit_timer | extras | files < geometry | solver < contact | motion < information < learning
< design < simulation | storage | dashboard < pipeline | stages < session < nodes | cli < experiments

The face, `import contact_curation as cc`, imports nothing until a name of it is used; types are an exception. The parts of the
package do not use it, but for the command line, whose verbs are the same functions.
"""

import ast
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

import contact_curation

PACKAGE = "contact_curation"
FOLDER = Path(__file__).resolve().parents[1] / PACKAGE

LAYERS = (
    ("errors", "version"),
    ("configs", "exit_timer", "extras", "files"),
    ("geometry", "solver"),
    ("contact", "motion"),
    ("information",),
    ("learning",),
    ("design",),
    ("simulation", "storage", "dashboard"),
    ("pipeline", "stages"),
    ("session",),
    ("nodes", "cli"),
    ("experiments",),
)
RANK = {part: rank for rank, layer in enumerate(LAYERS) for part in layer}
MOST_FILES = 20
"""In one folder."""

FACE = f"{PACKAGE}.__init__"
FACE_NAMES = set(contact_curation.__all__) - set(RANK)
MAY_USE_THE_FACE = ("cli", "experiments")

NOT_CODE = {"launch", "config", "kernel", "__pycache__"}
HOME = {
    "rclpy": "nodes",
    "mujoco": "simulation",
    "rosbags": "storage",
    "mcap": "storage",
    "fsspec": "storage",
    "ray": "pipeline",
    "rerun": "dashboard",
    "trimesh": "geometry",
    "argparse": "cli",
}
"""Where each outside library belongs; ROS messages belong to the nodes, see `home_of`."""


def home_of(library: str) -> str | None:
    """The only part that may import `library`; None for those that all may."""
    if library.endswith(("_msgs", "_interfaces", "_srvs")):
        return "nodes"
    return HOME.get(library)


def imported_names(tree: ast.AST, module: str) -> list[str]:
    """Full names of all that a module imports: at its top, inside functions, relatively, by importlib with a literal name."""
    names: list[str] = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            above = module.split(".")[: -node.level] if node.level else []
            base = ".".join([*above, *([node.module] if node.module else [])])
            names += [f"{base}.{alias.name}" for alias in node.names]
        elif isinstance(node, ast.Call) and ast.unparse(node.func) in (
            "importlib.import_module",
            "import_module",
            "__import__",
        ):
            names += [str(argument.value) for argument in node.args[:1] if isinstance(argument, ast.Constant)]
    return names


def violations(module: str, source: str) -> list[str]:
    """One line per import of `source` that breaks the rules for this module, such as contact_curation.motion.toss."""
    part = module.split(".")[1]
    found = []
    tree = ast.parse(source)
    if module == FACE:
        tree.body = [node for node in tree.body if not (isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING")]
    for name in imported_names(tree, module):
        library, _, rest = name.partition(".")
        target = rest.split(".")[0]
        home = home_of(library)
        if home not in (None, part):
            found.append(f"{module} imports {name}, which belongs to {home}")
        if (
            library == PACKAGE
            and target in RANK
            and target not in (part, "version")
            and (part not in RANK or RANK[target] >= RANK[part])
        ):
            found.append(f"{module} imports {name}, which is not to its left")
        if library == PACKAGE and target in FACE_NAMES and part not in MAY_USE_THE_FACE:
            found.append(f"{module} imports {name}, which is the face's")
    return found


def module_name(path: Path) -> str:
    """The dotted name of a file of the package."""
    parts = path.relative_to(FOLDER.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = sorted(FOLDER.rglob("*.py"))


def test_every_module_imports_only_what_lies_to_its_left() -> None:
    found = []
    for path in MODULES:
        # A package's own name lacks the last part that relative imports count from.
        module = module_name(path) + (".__init__" if path.name == "__init__.py" else "")
        found += violations(module, path.read_text(encoding="utf-8"))
    assert len(MODULES) > 100
    assert found == []


@pytest.mark.parametrize("top", ["contact_curation", "test", "docs", "benchmarks", "conformance", "msg_defs"])
def test_no_folder_holds_more_than_twenty_files(top: str) -> None:
    made = {"__pycache__", "build", "dist"}
    folders = [
        folder
        for folder in [FOLDER.parent / top, *(FOLDER.parent / top).rglob("*/")]
        if not any(part in made or part.endswith(".egg-info") for part in folder.relative_to(FOLDER.parent).parts)
    ]
    built = {".so", ".flags", ".pyc"}
    counts = {str(folder): sum(path.is_file() and path.suffix not in built for path in folder.iterdir()) for folder in folders}
    assert {folder: count for folder, count in counts.items() if count > MOST_FILES} == {}


def test_no_modules_import_each_other_in_a_circle_not_even_inside_functions() -> None:
    names = {module_name(path) for path in MODULES}
    graph: dict[str, set[str]] = {}
    for path in MODULES:
        module = module_name(path)
        said = imported_names(ast.parse(path.read_text(encoding="utf-8")), module)
        found = {name if name in names else name.rpartition(".")[0] for name in said}
        graph[module] = (found & names) - {module, PACKAGE}
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as circle:
        pytest.fail(" -> ".join(circle.args[1]))


def test_every_part_has_its_place_in_the_layers() -> None:
    parts = {path.stem if path.is_file() else path.name for path in FOLDER.iterdir() if path.is_dir() or path.suffix == ".py"}
    assert parts - set(RANK) - NOT_CODE == {"__init__"}


@pytest.mark.parametrize(
    ("module", "source"),
    [
        ("contact_curation.geometry.poses", "from contact_curation.motion.toss import Toss"),
        ("contact_curation.geometry.poses", "import contact_curation.solver.compiled"),
        ("contact_curation.motion.toss", "from contact_curation import contact"),
        ("contact_curation.motion.toss", "from ..contact import body"),
        ("contact_curation.storage.bags", "def late():\n    from contact_curation.nodes.curator import main"),
        ("contact_curation.storage.bags", "import importlib\nimportlib.import_module('contact_curation.simulation.world')"),
        ("contact_curation.errors", "from contact_curation.geometry import poses"),
        ("contact_curation.__init__", "from contact_curation.errors import ContactCurationError"),
        ("contact_curation.__init__", "if True:\n    from contact_curation.pipeline import api"),
        ("contact_curation.stages.curation", "from contact_curation import rank"),
        ("contact_curation.cli.main", "from contact_curation.nodes.curator import main"),
        ("contact_curation.cli.main", "import rclpy"),
        ("contact_curation.storage.bags", "from nav_msgs.msg import Odometry"),
        ("contact_curation.storage.bags", "from rcl_interfaces.msg import ParameterDescriptor"),
        ("contact_curation.nodes.player", "from rosbags.highlevel import AnyReader"),
        ("contact_curation.nodes.player", "import mcap.reader"),
        ("contact_curation.design.plan", "def step():\n    import mujoco"),
        ("contact_curation.cli.online.command", "import rerun as rr"),
        ("contact_curation.nodes.player", "import argparse"),
        ("contact_curation.contact.body", "import trimesh"),
    ],
)
def test_the_judge_condemns_an_import_to_the_right_or_across(module: str, source: str) -> None:
    assert len(violations(module, source)) == 1


@pytest.mark.parametrize(
    ("module", "source"),
    [
        ("contact_curation.motion.toss", "import numpy as np\nfrom contact_curation.motion import transitions"),
        ("contact_curation.motion.toss", "from . import transitions\nfrom ..geometry import poses"),
        ("contact_curation.motion.__init__", "from .toss import Toss\nfrom ..errors import ContactCurationError"),
        ("contact_curation.__init__", "if TYPE_CHECKING:\n    from contact_curation.pipeline.api import rank"),
        ("contact_curation.cli.rig", "from contact_curation import read"),
        ("contact_curation.cli.main", "import argparse\nfrom contact_curation.storage import bags"),
        (
            "contact_curation.nodes.curator",
            "import rclpy\nfrom std_srvs.srv import Trigger\nfrom contact_curation.version import __version__",
        ),
        ("contact_curation.storage.bags", "import mcap\nimport rosbags.typesys"),
    ],
)
def test_the_judge_acquits_an_import_to_the_left(module: str, source: str) -> None:
    assert violations(module, source) == []
