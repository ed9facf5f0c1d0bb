"""config/sros2_policy.xml allows each node what it has in the graph, and nothing else."""

from pathlib import Path

import pytest

import contact_curation
from test.graph.parts.declared_parameters import NODES
from test.graph.parts.graph import Graph
from test.graph.parts.sros2_policy import NAMESPACE, all_rules, policy_of, read_policy, rules_in
from test.graph.test_design_loop import Loop

POLICY = Path(contact_curation.__file__).parent / "config" / "sros2_policy.xml"
OF_SROS2 = {
    ("topics", "publish"), ("topics", "subscribe"), ("services", "reply"), ("services", "request"),
    ("actions", "execute"), ("actions", "call"),
}  # fmt: skip
"""What a policy can allow."""

IN_THE_LOOP = ("pose_ingest", "fisher_scorer", "curator", "sim_camera", "sim_arm", "throw_designer")


@pytest.mark.slow
def test_the_policy_allows_what_each_node_has_and_nothing_else() -> None:
    again = "python -m test.graph.parts.sros2_policy contact_curation/config/sros2_policy.xml"
    assert POLICY.read_text() == policy_of(all_rules()), f"run {again}"


def test_every_executable_has_an_enclave_and_only_the_recorder_hears_everything() -> None:
    policy = read_policy(POLICY)
    assert sorted(policy) == sorted(f"{NAMESPACE}/{name}" for name in (*NODES, "container"))
    for profiles in policy.values():
        for node, rules in profiles.items():
            assert set(rules) <= OF_SROS2
            assert any("*" in name for names in rules.values() for name in names) == (node == "session_recorder")
    assert policy[f"{NAMESPACE}/container"]["curator"] == policy[f"{NAMESPACE}/curator"]["curator"]


@pytest.mark.slow
@pytest.mark.live
def test_nodes_that_throw_score_and_curate_have_nothing_that_the_policy_forbids(graph: Graph) -> None:
    policy = read_policy(POLICY)
    Loop(graph, 1).until_made(1)
    for name in IN_THE_LOOP:
        allowed, found = policy[f"{NAMESPACE}/{name}"][name], rules_in(graph.listener.node, name)
        assert found["topics", "publish"]
        for key, names in found.items():
            assert set(names) <= set(allowed.get(key, ())), f"{name} {key}"
