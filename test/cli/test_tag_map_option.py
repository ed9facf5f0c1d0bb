"""`rank --tag-map` reads detections of tags; without it the line says what is missing."""

from pathlib import Path

import pytest

from test.cli.commands import Cli
from test.storage.tag_recordings import write_detections
from test.storage.test_tag_map_file import SHIPPED
from test.tagged_tosses import tagged_tosses


@pytest.mark.slow
def test_detections_are_ranked_with_a_tag_map_and_refused_without_one(cli: Cli, tmp_path: Path) -> None:
    bag = write_detections(tmp_path / "tags.mcap", tagged_tosses(2))
    report = cli("rank", bag, "--tag-map", SHIPPED, "--top", "1", "--json").json
    assert [row["rank"] for row in report["tosses"]] == [1, 2]
    refused = cli("rank", bag, "--top", "1")
    assert refused.status == 1
    assert "are read with a tag map" in refused.err
    missing = cli("rank", bag, "--tag-map", tmp_path / "none.yaml", "--top", "1")
    assert missing.status == 1
    assert "none.yaml: cannot be read" in missing.err
