"""The policy of SROS2: an enclave for each executable that allows what its node has in the graph, and nothing else.

python -m test.graph.parts.sros2_policy contact_curation/config/sros2_policy.xml

Each node is made beside a tracker and an arm's description, so that it has all that it ever makes.
"""

import sys
import time
from collections.abc import Sequence
from pathlib import Path
from xml.etree import ElementTree

from rclpy.action import get_action_client_names_and_types_by_node, get_action_server_names_and_types_by_node
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from contact_curation.nodes.container import DEFAULT
from test.graph.parts.declared_parameters import NODES
from test.graph.parts.made_node import POSES, lone_domain, made_node

HEAD = """\
<?xml version="1.0" encoding="UTF-8"?>
<!-- What each node may do in the graph, for SROS2: the topics, services and actions that it has, and nothing else.
docs/explanation/security.md says how to use it. Change tagslam/odom/body_cube to your tracker's topic, the names of controller
and gripper to yours, and ns to your namespace. Made by `python -m test.graph.parts.sros2_policy FILE`; a test compares. -->
"""
NAMESPACE = "/contact_curation"
ALL_TOPICS = ("session_recorder",)
"""Nodes that subscribe to whatever there is."""

WITH_POSES = ("pose_ingest", "trajectory_thrower", "player")
"""Nodes that find the topic of the poses after their start."""

LONGEST = 60.0
"""That this may take on a busy machine [s]."""

COMMON = {"clock", "diagnostics", "parameter_events", "rosout"}
"""Names that are the same in all namespaces."""

Rules = dict[tuple[str, str], tuple[str, ...]]
"""Names by kind and permission, such as topics and publish."""


def rules_of(name: str, domain: int) -> Rules:
    """What a node has in the graph."""
    with made_node(name, domain) as (node, tracker):
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        found, end = rules_in(tracker, name), time.monotonic() + LONGEST
        while name in WITH_POSES and not any(POSES in names for names in found.values()):
            assert time.monotonic() < end, f"{name} has not found {POSES}"
            executor.spin_once(0.1)
            found = rules_in(tracker, name)
        executor.shutdown()
    return found


def rules_in(listener: Node, name: str) -> Rules:
    """What a node of the root namespace has, as a listener sees it."""
    asked = {
        ("topics", "publish"): listener.get_publisher_names_and_types_by_node(name, "/"),
        ("topics", "subscribe"): listener.get_subscriber_names_and_types_by_node(name, "/"),
        ("services", "reply"): listener.get_service_names_and_types_by_node(name, "/"),
        ("services", "request"): listener.get_client_names_and_types_by_node(name, "/"),
        ("actions", "execute"): get_action_server_names_and_types_by_node(listener, name, "/"),
        ("actions", "call"): get_action_client_names_and_types_by_node(listener, name, "/"),
    }
    rules = {key: sorted({relative(topic, name) for topic, _ in had if "/_action/" not in topic}) for key, had in asked.items()}
    if name in ALL_TOPICS:
        rules["topics", "subscribe"] = ["*"]
    return {key: tuple(names) for key, names in rules.items() if names}


def relative(topic: str, node: str) -> str:
    """A name as a policy has it: private, relative to the namespace, or absolute."""
    first, _, rest = topic.removeprefix("/").partition("/")
    if first == node and rest:
        return f"~/{rest}"
    return topic if first in COMMON and not rest else topic.removeprefix("/")


def all_rules() -> dict[str, Rules]:
    """What every node has."""
    with lone_domain() as domain:
        return {name: rules_of(name, domain) for name in NODES}


def policy_of(rules: dict[str, Rules]) -> str:
    """The file."""
    policy = ElementTree.Element("policy", version="0.2.0")
    enclaves = ElementTree.SubElement(policy, "enclaves")
    for executable, nodes in [*((name, (name,)) for name in rules), ("container", DEFAULT)]:
        _add_enclave(enclaves, executable, nodes, rules)
    ElementTree.indent(policy)
    return HEAD + ElementTree.tostring(policy, encoding="unicode") + "\n"


def _add_enclave(enclaves: ElementTree.Element, executable: str, nodes: Sequence[str], rules: dict[str, Rules]) -> None:
    enclave = ElementTree.SubElement(enclaves, "enclave", path=f"{NAMESPACE}/{executable}")
    profiles = ElementTree.SubElement(enclave, "profiles")
    for node in nodes:
        profile = ElementTree.SubElement(profiles, "profile", ns="/", node=node)
        for (kind, permission), names in rules[node].items():
            group = ElementTree.SubElement(profile, kind, {permission: "ALLOW"})
            for name in names:
                ElementTree.SubElement(group, kind.removesuffix("s")).text = name


def read_policy(path: Path) -> dict[str, dict[str, Rules]]:
    """What a file allows, by enclave and node."""
    return {
        enclave.attrib["path"]: {
            profile.attrib["node"]: {
                (group.tag, permission): tuple(str(one.text) for one in group)
                for group in profile
                for permission, value in group.attrib.items()
                if value == "ALLOW"
            }
            for profile in enclave.iter("profile")
        }
        for enclave in ElementTree.parse(path).getroot().iter("enclave")
    }


def main() -> None:
    """Writes the file; the middleware has the standard output for itself."""
    Path(sys.argv[1]).write_text(policy_of(all_rules()))


if __name__ == "__main__":
    main()
