"""Checks the parameters that a node was started with: ROS ignores unknown names silently, here they are refused.

While it runs, changes that rclpy does not judge are refused in one line, too: of an unknown name it says "[]", the empty name
it takes for a new parameter, and a number that is no type's ends the process.
"""

from collections.abc import Callable, Collection, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

from rcl_interfaces.msg import ParameterValue
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.utilities import remove_ros_args

from contact_curation.errors import InvalidValueError, UnknownNameError
from contact_curation.session.node_parameters import FORMER_NAMES, OF_ROS, declared_parameters

PAGE = "docs/ros/reference.md"
"""That lists all parameters."""

PARAMS_FILE, PARAMETER = "--params-file", ("-p", "--param")

TYPES = {kind.value for kind in Parameter.Type}
"""Numbers of the types that a parameter may have."""


def check_files(words: Sequence[str]) -> None:
    """Refuses missing parameter files in one line, where rcl would print several.

    Args:
        words: arguments of the command line.

    Raises:
        InvalidValueError: a file does not exist.
    """
    for word, path in pairwise(words):
        if word == PARAMS_FILE and not Path(path).is_file():
            raise InvalidValueError(PARAMS_FILE, f"no file {path}", "a parameter file, such as config/nodes.yaml")


def check_words(words: Sequence[str]) -> None:
    """Refuses words that ROS does not know, such as parameters without `--ros-args` before them.

    Args:
        words: arguments of the command line; ROS has read its own.

    Raises:
        InvalidValueError: there is one.
    """
    unknown = remove_ros_args([*words])[1:]
    if unknown:
        raise InvalidValueError("arguments", " ".join(unknown), f"--ros-args -p NAME:=VALUE; parameters: {PAGE}")


def take_former_names(node: Node, name: str) -> None:
    """Renames parameters that were given under a former name, and logs a line.

    Args:
        node: node that has not declared any parameter yet.
        name: name of the node in config/nodes.yaml.
    """
    given = node._parameter_overrides
    for former, now in FORMER_NAMES.items():
        if former in given and now in declared_parameters().get(name, {}):
            given.setdefault(now, Parameter(now, value=given.pop(former).value))
            node.get_logger().warning(f"parameter {former} is now called {now}: use that name")


def check_names(node: Node, name: str, words: Sequence[str], beside: Collection[str] = ()) -> None:
    """Refuses parameters that the node does not have.

    A file may set parameters of all nodes at once, so in a file a name may also belong to another node.

    Args:
        node: node that has declared all its parameters.
        name: name of the node in config/nodes.yaml.
        words: arguments of the command line.
        beside: names of the nodes in the same process, whose parameters the words may set, too.

    Raises:
        UnknownNameError: there is no parameter of that name.
    """
    declared = declared_parameters()
    own = {*node._parameters, *declared.get(name, {})}
    others = {one for each in declared.values() for one in each}
    of_others = {one for each in beside for one in declared.get(each, {})}
    said = {text.partition(":=")[0].rpartition(":")[2] for word, text in pairwise(words) if word in PARAMETER}
    for given in node._parameter_overrides:
        if given not in own | of_others and not given.startswith(OF_ROS) and (given in said or given not in others):
            raise UnknownNameError("parameter", given, own)


def without_foreign_types(change: Callable[[Any, Any], Any]) -> Callable[[Any, Any], Any]:
    """The callback of a service that sets parameters, for which a value of a type that does not exist is none.

    Args:
        change: callback of rclpy, which raises there.
    """

    def checked(request: Any, response: Any) -> Any:
        for one in request.parameters:
            if one.value.type not in TYPES:
                one.value = ParameterValue()
        return change(request, response)

    return checked


def why_unchanged(node: Node, changed: Sequence[Parameter]) -> str:
    """In one line why parameters cannot be changed, for what rclpy does not explain; empty for nothing.

    Args:
        node: node that has declared all its parameters.
        changed: what its parameters shall be.
    """
    for one in changed:
        if not node.has_parameter(one.name):
            return str(UnknownNameError("parameter", one.name or "''", node._parameters))
        if one.type_ is Parameter.Type.NOT_SET:
            return str(InvalidValueError(f"parameter {one.name}", "no value", "one of its type: it cannot be deleted"))
    return ""
