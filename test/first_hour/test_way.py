"""The way of a new user, for a wedge described by hand and for a URDF, with recordings of a tracker that nobody here knows.

From the recording to a diagnosis, a ranking with its figure, a model and its evaluation, and a live buffer. What `check` says
to type next is typed.
"""

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from rosbags.highlevel import AnyReader

from contact_curation.storage.manifest.file import read_manifest
from test.cli.commands import Cli
from test.first_hour.recordings import Own, own_sled, own_wedge
from test.graph.parts.graph import Graph

pytestmark = pytest.mark.slow

TOSSES, SELECTED = 8, 6
LONG = 120.0


@pytest.fixture(scope="module", params=[own_wedge, own_sled], ids=["a wedge in YAML", "a sled in URDF"])
def own(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Own:
    made: Own = request.param(tmp_path_factory.mktemp("own"), TOSSES)
    return made


def test_from_a_recording_to_a_ranking_a_model_and_figures(cli: Cli, own: Own) -> None:
    folder, said = own.bag.parent, [own.bag, *own.words, *own.poses]
    with AnyReader([own.bag]) as bag:
        assert not [one for one in bag.topics if "tagslam" in one or "cube" in one]  # nothing of it is ours

    understood = cli("body", *own.words[1:], "--out", folder / "body.png", "--json")
    assert understood.status == 0, understood.err
    assert understood.json["name"] == own.bag.stem
    assert understood.json["warnings"] == []

    checked = cli("check", *said, "--json")
    assert (checked.status, checked.json["ok"]) == (0, True), checked.out
    assert f"all {TOSSES} motions are sound tosses of {own.bag.stem}" in checked.json["verdict"]

    rig = cli("rig", *said)
    assert rig.status == 0, rig.err

    words = checked.json["next"].split()[1:]
    assert words[0] == "rank"
    manifest = folder / "ranked.csv"
    ranked = cli(*[manifest if word.endswith("ranked.csv") else word for word in words], "--top", SELECTED)
    assert ranked.status == 0, ranked.err
    assert f"{TOSSES} ranked by representative, {SELECTED} selected" in ranked.out
    assert (folder / "ranked.png").exists()

    model = folder / "model.safetensors"
    trained = cli("train", *said, "--manifest", manifest, "--protocol", "exact", "--held-out", "none", "--out", model)
    assert trained.status == 0, trained.err
    assert f"polytope trained on {SELECTED} tosses" in trained.out

    evaluated = cli("evaluate", model, own.bag, *own.poses, "--figure", folder / "motion.png", "--json")
    assert evaluated.status == 0, evaluated.err
    shape: dict[str, Any] = evaluated.json["models"][0]["shape"]
    assert shape["vertex_rms_mm"] < 15.0
    assert 0.1 < shape["friction"] < 0.5
    for name in ("body", "ranked", "motion"):
        assert (folder / f"{name}.png").read_bytes().startswith(b"\x89PNG")


def test_a_recording_that_is_played_gives_a_live_buffer_with_the_tosses_that_rank_selects(
    cli: Cli, tmp_path: Path, graph: Graph
) -> None:
    own = own_wedge(tmp_path, TOSSES)
    manifest = tmp_path / "ranked.json"
    assert cli("rank", own.bag, *own.words, *own.poses, "--top", SELECTED, "--out", manifest).status == 0
    buffers, body = graph.buffers(), own.words[1]
    graph.start("pose_ingest", body=body, topic="/mocap/wedge/pose", board_frame="table")
    graph.start("fisher_scorer", body=body)
    graph.start("curator", body=body, top=SELECTED)
    play = [sys.executable, "-m", "contact_curation.cli.main", "play", str(own.bag), "--rate", "4", "--loop"]
    with subprocess.Popen(play, env={**os.environ, "ROS_DOMAIN_ID": str(graph.domain)}) as player:
        try:
            graph.until(lambda: buffers and buffers[-1].tosses_seen == TOSSES, LONG, "every toss to be curated")
        finally:
            player.kill()
    assert list(buffers[-1].toss_ids) == [row.toss_id for row in read_manifest(manifest).selected]
