"""Parameters that a node reads once are read-only for `ros2 param set`; those that may change while it runs are listed here."""

import pytest
from rclpy.parameter import Parameter

from test.graph.parts.declared_parameters import NODES, OF_RCLPY
from test.graph.parts.made_node import lone_domain, made_node

pytestmark = pytest.mark.slow

CHANGEABLE = {
    "curator": {
        "criterion",
        "top",
        "seed",
        "prior",
        "normalisation",
        "variant",
        "whiten",
        "centre",
        "cut",
        "certificate_steps",
    },
    "throw_designer": {"auto"},
    "sim_arm": {"rate"},
    "player": {"rate", "seek"},
}


@pytest.mark.parametrize("name", NODES)
def test_parameters_that_are_read_once_are_read_only(name: str) -> None:
    with lone_domain() as domain, made_node(name, domain) as (node, _):
        own = [parameter for parameter in node.get_parameters_by_prefix("").values() if not parameter.name.startswith(OF_RCLPY)]
        assert len(own) > 1
        changed = {each.name for each in own if node.set_parameters([Parameter(each.name, value=each.value)])[0].successful}
        assert changed == CHANGEABLE.get(name, set())
