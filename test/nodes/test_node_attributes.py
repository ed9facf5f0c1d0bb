"""A node's own attributes and methods never replace those of the classes under it: it would lose its clock, or its end."""

import ast
import inspect
import re
from collections.abc import Iterable
from importlib import import_module
from pathlib import Path
from textwrap import dedent

import pytest
from rclpy.lifecycle import LifecycleNodeMixin
from rclpy.node import Node

from contact_curation import nodes
from contact_curation.nodes.ros.managed_node import ManagedNode
from contact_curation.nodes.ros.node_main import StageNode

FILES = sorted(path for path in Path(nodes.__file__).parent.glob("*.py") if "Node):" in path.read_text())


def classes() -> list[type[Node]]:
    """The nodes, and what they are made of."""
    modules = [import_module(f"contact_curation.nodes.{path.stem}") for path in FILES]
    made = [one for module in modules for one in vars(module).values() if getattr(one, "__module__", "") == module.__name__]
    return [StageNode, ManagedNode, *(one for one in made if isinstance(one, type) and issubclass(one, Node))]


def used_by(one: type) -> set[str]:
    """Private names that a class uses on itself or defines."""
    return set(re.findall(r"\bself\.(_\w+)", inspect.getsource(one))) | private(vars(one))


def set_by(one: type) -> set[str]:
    """Private names that a class assigns on itself or defines; what it sets on a part (`self._part.name`) does not count."""
    tree = ast.parse(dedent(inspect.getsource(one)))
    assigned = [node for node in ast.walk(tree) if isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store)]
    return private([*(node.attr for node in assigned if ast.unparse(node.value) == "self"), *vars(one)])


def private(names: Iterable[str]) -> set[str]:
    return {name for name in names if re.match(r"_[a-z]", name)}


@pytest.mark.parametrize("one", classes(), ids=lambda one: one.__name__)
def test_a_node_replaces_no_private_name_of_the_classes_under_it(one: type) -> None:
    under = [base for base in one.__mro__[1:] if base is not object]
    assert {Node, StageNode, ManagedNode} & {*under}
    assert set_by(one)
    assert set_by(one) & set().union(*(used_by(base) for base in under)) == set()


def test_names_of_the_lifecycle_are_seen_and_those_of_parts_are_not() -> None:
    class Careless(ManagedNode):
        def careless(self, part: object) -> None:
            self._state_machine = part
            self._part.callback = part
            self._noted: object = part

    assert set_by(Careless) == {"_state_machine", "_noted"}
    assert "_state_machine" in used_by(LifecycleNodeMixin)
