"""Parameters of nodes in files, as ROS reads them (`--params-file`): by node, of every node (`/**`), with dots or nested."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from contact_curation.errors import UnreadableInputError
from contact_curation.files import read_yaml, write_atomically

LARGEST_BYTES = 1 << 17
"""YAML takes some 20 microseconds each."""
EVERY_NODE = "/**"
KEY = "ros__parameters"

Parameters = dict[str, Any]
"""Values by name."""


def read_node_parameters(path: Path) -> dict[str, Parameters]:
    """What a file sets, by node name; those of every node under `/**`.

    Raises:
        UnreadableInputError: it is no such file.
    """
    content = read_yaml(path, LARGEST_BYTES, "parameters of nodes")
    if not isinstance(content, dict) or not all(_is_section(section) for section in content.values()):
        raise UnreadableInputError(path, f"expected {KEY} under the name of each node, as in config/nodes.yaml")
    found: dict[str, Parameters] = {}
    for name, section in content.items():
        node = EVERY_NODE if name == EVERY_NODE else str(name).rpartition("/")[2]
        found.setdefault(node, {}).update(_flat(section[KEY]))
    return found


def write_node_parameters(path: Path, parameters: Mapping[str, Parameters]) -> None:
    """Writes them by node, for nodes of these names in any namespace.

    Raises:
        InvalidValueError: the file cannot be written there.
    """
    content = {f"{EVERY_NODE}/{node}": {KEY: values} for node, values in parameters.items()}
    write_atomically(path, yaml.dump(content, Dumper=_NoAliases, sort_keys=False).encode())


class _NoAliases(yaml.SafeDumper):  # type: ignore[misc]
    """Writes equal lists out again: ROS knows no aliases."""

    def ignore_aliases(self, data: object) -> bool:
        return True


def _is_section(section: object) -> bool:
    return isinstance(section, dict) and set(section) == {KEY} and isinstance(section[KEY], dict)


def _flat(nested: Mapping[str, Any], prefix: str = "") -> Parameters:
    """Names with dots."""
    flat: Parameters = {}
    for name, value in nested.items():
        if isinstance(value, dict):
            flat.update(_flat(value, f"{prefix}{name}."))
        else:
            flat[f"{prefix}{name}"] = value
    return flat
