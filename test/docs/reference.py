"""docs/ros/reference.md, made of the nodes and of the interface package.

python -m test.docs.reference          writes it
"""

import sys
from typing import Any

from test.conftest import REPOSITORY
from test.graph.parts.declared_parameters import Declared, all_declared

PAGE = REPOSITORY / "docs" / "ros" / "reference.md"
MSG_DEFS = REPOSITORY / "msg_defs"

HEAD = """# Parameters and messages

Written by `python -m test.docs.reference` from the nodes and from `msg_defs`; a test holds it to them. What they are for
is told in [nodes.md](nodes.md).

"""


def page() -> str:
    """The whole of it."""
    nodes = [_node_section(name, found) for name, found in all_declared().items()]
    return HEAD + "\n".join([*nodes, *_interfaces()])


def _node_section(name: str, found: list[Declared]) -> str:
    lines = [f"## {name}", "", "| parameter | default | |", "|---|---|---|"]
    for one in sorted(found):
        told = "; ".join(
            part
            for part in (one.description.rstrip("."), one.constraint, "" if one.fixed else "can be changed at any time")
            if part
        )
        lines.append(f"| `{one.name}` | {_value(one.default)} | {told.replace('|', chr(92) + '|')} |")
    return "\n".join([*lines, ""])


def _value(value: Any) -> str:
    if isinstance(value, bool | int):
        return str(value).lower()
    if isinstance(value, float):
        return f"{value:g}" if f"{value:g}" not in ("inf", "-inf") else f"{value:g}".replace("inf", ".inf")
    if isinstance(value, list | tuple):
        return f"[{', '.join(_value(each) for each in value)}]"
    return f"`{value}`" if value != "" else ""


def _interfaces() -> list[str]:
    lines = ["## contact_curation_msgs", ""]
    for path in sorted(path for kind in ("msg", "srv", "action") for path in MSG_DEFS.glob(f"{kind}/*")):
        lines += [f"### {path.parent.name}/{path.stem}", "", "```", path.read_text().strip(), "```", ""]
    return lines


if __name__ == "__main__":
    PAGE.write_text(page())
    sys.exit(0)
