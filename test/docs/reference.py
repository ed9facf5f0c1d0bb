"""docs/ros/reference.md, made of the nodes and of the interface package.

python -m test.docs.reference          writes it
"""

import re
import sys
import textwrap
from collections.abc import Iterator
from typing import Any

from test.conftest import REPOSITORY
from test.graph.parts.declared_parameters import Declared, all_declared

PAGE = REPOSITORY / "docs" / "ros" / "reference.md"
MSG_DEFS = REPOSITORY / "msg_defs"
WIDTH = 118

CUT = re.compile(rf"^(#.{{{WIDTH - 1},}}[^.])\n# ", re.MULTILINE)
"""Where a comment that is too wide goes on in the next line."""

HEAD = """# Parameters and messages

Written by `python -m test.docs.reference` from the nodes and from `msg_defs`; a test compares them.
[Nodes](nodes.md) explains what they are for.

"""


def page() -> str:
    """The whole of it."""
    nodes = [_node_section(name, found) for name, found in all_declared().items()]
    return HEAD + "\n".join([*nodes, *_interfaces()])


def _node_section(name: str, found: list[Declared]) -> str:
    lines = [f"## {name}", ""]
    for one in sorted(found):
        default = _value(one.default)
        told = "; ".join(
            part
            for part in (one.description.rstrip("."), one.constraint, "" if one.fixed else "can be changed at any time")
            if part
        )
        entry = f"- `{one.name}` ({f'default {default}' if default else 'empty by default'}): {told}"
        lines += textwrap.wrap(entry, WIDTH, subsequent_indent="  ", break_on_hyphens=False, break_long_words=False)
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
        lines += [f"### {path.parent.name}/{path.stem}", "", "```", *_definition(path.read_text().strip()), "```", ""]
    return lines


def _definition(text: str) -> Iterator[str]:
    """The lines of a definition; a comment that makes one too wide stands above it."""
    for line in CUT.sub(r"\1 ", text).splitlines():
        code, mark, comment = line.partition("#")
        if len(line) <= WIDTH or not mark:
            yield line
            continue
        yield from textwrap.wrap(comment.strip(), WIDTH, initial_indent="# ", subsequent_indent="# ")
        if code.strip():
            yield code.rstrip()


if __name__ == "__main__":
    PAGE.write_text(page())
    sys.exit(0)
