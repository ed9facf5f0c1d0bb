"""A node's own attributes never replace those of rclpy's Node: it would lose its clock or its parameters."""

import inspect
import re
from pathlib import Path

import pytest
from rclpy.node import Node

from contact_curation import nodes
from contact_curation.nodes.ros.node_main import StageNode

FILES = sorted(path for path in Path(nodes.__file__).parent.glob("*.py") if "(StageNode)" in path.read_text())


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_a_node_replaces_no_attribute_of_rclpys_node(path: Path) -> None:
    taken = set(re.findall(r"\bself\.(_\w+)", inspect.getsource(Node))) | set(dir(StageNode))
    source = path.read_text()
    own = {
        name for line in source.splitlines() if " = " in line for name in re.findall(r"self\.(_\w+)", line.partition(" = ")[0])
    }
    assert own
    assert own & taken == set()
