"""The parameter that says which body a node works on."""

from rclpy.node import Node

from contact_curation.contact.body import CONTACTNETS_CUBE, Body
from contact_curation.nodes.ros.parameters import declare


def declared_body(node: Node) -> Body:
    """The body that parameter `body` describes; ContactNets' cube where it is empty.

    Raises:
        UnreadableInputError: the file describes no body.
    """
    path = declare(node, "body", "", "YAML file that describes the body; empty: ContactNets' cube")
    return Body.from_file(path) if path else CONTACTNETS_CUBE
