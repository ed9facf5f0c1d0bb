"""A graph of real processes, each test in its own ROS domain."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from contact_curation.session.free_domain import free_domain
from test.graph.parts.graph import Graph


@pytest.fixture
def graph(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Graph]:
    """Nodes and listeners that hear nobody else; all are stopped at the end."""
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    monkeypatch.setenv("ROS_LOG_DIR", str(tmp_path / "ros_logs"))
    with free_domain() as domain, Graph(tmp_path, domain) as made:
        yield made
