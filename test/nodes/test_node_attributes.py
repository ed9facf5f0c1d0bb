"""A node's own attributes and methods never replace those of the classes under it: it would lose its clock, or its end."""

import inspect
import re
from pathlib import Path

import pytest
from rclpy.node import Node

from contact_curation import nodes
from contact_curation.nodes.ros.node_main import StageNode

FILES = sorted(path for path in Path(nodes.__file__).parent.glob("*.py") if "(StageNode)" in path.read_text())


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_a_node_replaces_no_private_name_of_the_classes_under_it(path: Path) -> None:
    taken = set(re.findall(r"\bself\.(_\w+)", inspect.getsource(Node) + inspect.getsource(StageNode))) | set(dir(StageNode))
    source = path.read_text()
    set_here = {
        name for line in source.splitlines() if " = " in line for name in re.findall(r"self\.(_\w+)", line.partition(" = ")[0])
    }
    defined_here = set(re.findall(r"^    def (_[a-z]\w*)", source, re.MULTILINE))
    assert set_here
    assert (set_here | defined_here) & taken == set()
