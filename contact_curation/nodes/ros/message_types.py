"""Message classes by their ROS type names."""

from importlib import import_module
from importlib.util import find_spec
from typing import Any

from contact_curation.errors import MissingDependencyError


def is_installed(type_name: str) -> bool:
    """Whether the package of a message type is there."""
    return find_spec(type_name.partition("/")[0]) is not None


def message_class(type_name: str) -> Any:
    """The class of a message type such as `nav_msgs/msg/Odometry`.

    Raises:
        MissingDependencyError: the type is not installed.
    """
    package, _, name = type_name.replace("/msg/", "/").partition("/")
    try:
        return getattr(import_module(f"{package}.msg"), name)
    except (ImportError, AttributeError, ValueError) as error:
        raise MissingDependencyError(f"message type {type_name}", f"install the package {package or type_name}") from error
