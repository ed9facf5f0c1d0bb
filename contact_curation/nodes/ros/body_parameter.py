"""The parameter `body`, which describes the body of a node, and `params`, which may be a checkpoint that carries it."""

from pathlib import Path

from rclpy.node import Node

from contact_curation.contact.body import CONTACTNETS_CUBE, Body
from contact_curation.contact.body_description import read_description
from contact_curation.nodes.ros.parameters import declare
from contact_curation.pipeline.carried_body import ASSUMED, carried_body


def declared_body(node: Node) -> Body:
    """Declares `body` and reads the body; if it is empty, assumes ContactNets' cube and logs a line.

    Raises:
        UnreadableInputError: the file describes no body.
    """
    return _read(node, _declared(node), "")


def declared_body_and_params(node: Node, about_params: str) -> tuple[Body, str]:
    """As `declared_body`, and declares `params`; the body of a checkpoint there is taken where `body` is empty.

    Raises:
        UnreadableInputError: the file describes no body, or the checkpoint is none.
    """
    path, params = _declared(node), str(declare(node, "params", "", about_params))
    return _read(node, path, params), params


def warn_of_kept(node: Node, params: str) -> None:
    """Says that the file of `params` does not count, since a store keeps newer parameters."""
    node.get_logger().warning(
        f"params: the store keeps newer parameters than those of {params}, and they count; name another store"
    )


def _declared(node: Node) -> str:
    about = "YAML, URDF, MJCF or mesh file that describes the body; empty: ContactNets' cube"
    return str(declare(node, "body", "", about))


def _read(node: Node, path: str, params: str) -> Body:
    if path:
        found = read_description(Path(path))
        for line in found.warnings:
            node.get_logger().warning(f"{path}: {line}")
        return Body.described(found)
    if carried := carried_body([Path(params)] if params else ()):
        name, mass = carried.body.name, carried.body.mass
        node.get_logger().info(f"no body given: taking {name} ({mass:g} kg) of {params}; give it to the other nodes, too")
        return carried.body
    node.get_logger().info(f"no body given: assuming {ASSUMED}")
    return CONTACTNETS_CUBE
