"""View: the nodes' diagnostics, and what the dashboard had to leave out; details of those that warn only."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from textwrap import shorten

from contact_curation.dashboard.live.screen import Screen, table

TABLE = "health"
HEADER = ("node", "state", "says")
LONGEST_VALUE = 24
"""Letters of a detail that are shown."""

SILENT_AFTER = 5.0
"""[s] without a word."""


@dataclass(frozen=True)
class NodeHealth:
    """A node's own word.

    Attributes:
        name: fully qualified.
        warning: whether someone should look.
        message: one line.
        values: details by name.
        heard: when, by the listener's steady clock [s].
    """

    name: str
    warning: bool
    message: str
    values: Mapping[str, str] = field(default_factory=dict)
    heard: float = 0.0


class HealthView:
    """Writes the nodes' health, when it is another than before.

    Args:
        screen: to write to.
    """

    def __init__(self, screen: Screen) -> None:
        self._screen = screen
        self._page = ""

    def show(
        self, nodes: Mapping[str, NodeHealth], dropped: Mapping[str, int], now: float, ended: Collection[str] = ()
    ) -> None:
        """Writes what is known now.

        Args:
            nodes: by name, what each said last.
            dropped: by topic, messages that the dashboard did not show.
            now: by the same clock as `NodeHealth.heard` [s].
            ended: names of nodes that are in the graph no more.
        """
        page = health_page(nodes, dropped, now, ended)
        if page != self._page:
            self._page = page
            self._screen.text(TABLE, page)


def health_page(nodes: Mapping[str, NodeHealth], dropped: Mapping[str, int], now: float, ended: Collection[str] = ()) -> str:
    """The nodes' health as a page."""
    lost = ", ".join(f"{count} of {topic}" for topic, count in sorted(dropped.items()))
    title = f"**not shown, because the dashboard was behind: {lost}**" if lost else "everything that was heard is shown"
    return f"{title}\n\n{table(HEADER, (_cells(nodes[name], now, name in ended) for name in sorted(nodes)))}"


def _cells(node: NodeHealth, now: float, ended: bool) -> tuple[str, ...]:
    silent = now - node.heard > SILENT_AFTER
    state = "ended" if ended else "**silent**" if silent else "**warns**" if node.warning else "ok"
    details = (
        ", ".join(f"{name} {shorten(value, LONGEST_VALUE)}" for name, value in node.values.items()) if node.warning else ""
    )
    return (node.name.removeprefix("/"), state, "; ".join(part for part in (node.message, details) if part))
