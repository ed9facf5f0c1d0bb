"""The parameter `body`, which describes the body of a node."""

from pathlib import Path

from rclpy.node import Node

from contact_curation.contact.body import CONTACTNETS_CUBE, Body
from contact_curation.contact.body_description import read_description
from contact_curation.nodes.ros.parameters import declare
from contact_curation.pipeline.carried_body import ASSUMED


def declared_body(node: Node) -> Body:
    """Declares `body` and reads the body; if it is empty, assumes ContactNets' cube and logs a line.

    Raises:
        UnreadableInputError: the file describes no body.
    """
    path = declare(node, "body", "", "YAML, URDF, MJCF or mesh file that describes the body; empty: ContactNets' cube")
    if not path:
        node.get_logger().info(f"no body given: assuming {ASSUMED}")
        return CONTACTNETS_CUBE
    found = read_description(Path(path))
    for line in found.warnings:
        node.get_logger().warning(f"{path}: {line}")
    return Body.described(found)
