"""The parameter that says which body a node works on."""

from pathlib import Path

from rclpy.node import Node

from contact_curation.contact.body import CONTACTNETS_CUBE, Body
from contact_curation.contact.body_description import read_description
from contact_curation.nodes.ros.parameters import declare
from contact_curation.pipeline.carried_body import ASSUMED


def described_body(node: Node) -> Body | None:
    """The body that parameter `body_file` describes; what is odd about it is a warning. None where it is empty.

    Raises:
        UnreadableInputError: the file describes no body.
    """
    about = "YAML, URDF, MJCF or mesh file that describes the body; empty: ContactNets' cube"
    path = declare(node, "body_file", "", about)
    if not path:
        return None
    found = read_description(Path(path))
    for line in found.warnings:
        node.get_logger().warning(f"{path}: {line}")
    return Body.described(found)


def declared_body(node: Node) -> Body:
    """The same; ContactNets' cube where it is empty, and a line that says so.

    Raises:
        UnreadableInputError: the file describes no body.
    """
    found = described_body(node)
    if found is None:
        node.get_logger().info(f"no body_file given: assuming {ASSUMED}")
    return CONTACTNETS_CUBE if found is None else found
