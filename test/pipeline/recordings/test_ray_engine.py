"""Ray schedules recordings: the same manifest as one process, and a recording that breaks its worker is a line."""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest

from contact_curation.errors import ContactCurationError, InvalidValueError
from contact_curation.pipeline.workers import Advance, Broken, unheard
from test.cli.commands import Cli
from test.learning.evaluation.test_held_out import turned
from test.storage.datasets.test_tagslam_bag import save_contactnets, synthetic_toss
from test.storage.inputs.test_inputs import mcap_file

# Not importorskip: the default run, which leaves these tests out, would import ray in each of its processes.
pytestmark = [pytest.mark.slow, pytest.mark.skipif(find_spec("ray") is None, reason="pip install ray")]


@pytest.fixture(scope="module")
def cluster() -> Iterator[str]:
    """The address of a cluster on this machine, with two workers."""
    import ray
    from ray.cluster_utils import Cluster

    running = Cluster(initialize_head=True, head_node_args={"num_cpus": 2, "include_dashboard": False})
    yield str(running.address)
    ray.shutdown()
    running.shutdown()


def work(name: str, advance: Advance) -> str:
    """What its name says: ends its worker always or once, asks for memory, or is done."""
    kind, _, place = name.partition(" ")
    if kind == "ends" or (kind == "ends-once" and not Path(place).exists()):
        Path(place).write_text("tried") if place else None
        os.kill(os.getpid(), signal.SIGKILL)
    if kind == "large":
        raise MemoryError
    advance(2)
    return name.upper()


@pytest.mark.parametrize("option", ["--address", "RAY_ADDRESS"])
def test_an_address_at_which_nothing_listens_is_refused_at_once(option: str, monkeypatch: pytest.MonkeyPatch) -> None:
    from contact_curation.pipeline.recordings.ray_engine import RayEngine

    monkeypatch.setenv("RAY_ADDRESS", "127.0.0.1:1")
    engine = RayEngine("127.0.0.1:1" if option == "--address" else "")
    with pytest.raises(InvalidValueError, match=f"{option}: found 127.0.0.1:1 .*refused.*the address of a Ray cluster"):
        next(engine.as_done(work, ["a"], unheard))


def test_what_breaks_its_worker_twice_is_a_line_and_the_others_are_done(cluster: str, tmp_path: Path) -> None:
    from contact_curation.pipeline.recordings.ray_engine import RayEngine

    counts: list[int] = []

    def advance(count: int, /, *, note: str = "", share: float | None = None) -> None:
        counts.append(count)

    names = ["a", "ends", f"ends-once {tmp_path / 'tried'}", "large", "b"]
    found: dict[int, Any] = dict(RayEngine(cluster).as_done(work, names, advance))
    assert sorted(found) == [0, 1, 2, 3, 4]
    assert [found[place] for place in (0, 2, 4)] == [names[place].upper() for place in (0, 2, 4)]
    assert [isinstance(found[place], Broken) for place in (1, 3)] == [True, True]
    assert sum(counts) == 6


def test_the_manifest_is_that_of_one_process(cluster: str, cli: Cli, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    bag = mcap_file(tmp_path)
    bags = [bag, *(bag.with_name(f"{name}.mcap") for name in "bc")]
    for other in bags[1:]:
        other.write_bytes(bag.read_bytes())
    (tmp_path / "broken.mcap").write_bytes(b"nothing")
    manifests = []
    for name, options in {"ray": ("--engine", "ray", "--address", cluster, "--index", tmp_path / "i"), "local": ()}.items():
        out = tmp_path / f"{name}.json"
        words = ("--criterion", "log-det", "--body-frame", "", "--no-figure", "--out", out)
        outcome = cli("rank", *bags, tmp_path / "broken.mcap", *words, *options)
        assert outcome.status == 0, outcome.err
        manifests.append(json.loads(out.read_text()))
        manifests[-1].pop("command")
    assert manifests[0] == manifests[1]
    assert len(list((tmp_path / "i" / "scores").iterdir())) == 3


def test_held_out_tosses_and_their_duplicates_are_those_of_one_process(cluster: str, cli: Cli, tmp_path: Path) -> None:
    for place, (numbers, heading) in enumerate((((0, 1), 0.0), ((2, 3), 0.0), ((7,), 1.1))):
        (tmp_path / f"files{place}").mkdir()
        for number in numbers:
            one = turned(synthetic_toss(0.2 + 0.01 * (number % 5)), heading, str(number))
            save_contactnets(tmp_path / f"files{place}", number, one)
    inputs = [tmp_path / f"files{place}" for place in (2, 1, 0)]  # the duplicate of 2 comes before it
    ray = ("--engine", "ray", "--address", cluster)
    for spec in ("2", "7", "0,3"):
        words = ("--held-out", spec, "--bound-influence", "--no-gate", "--no-figure", "--json")
        found = [cli("rank", *inputs, *words, *engine) for engine in ((), ray, (*ray, "--index", tmp_path / "index"))]
        assert [one.status for one in found] == [0, 0, 0], found[1].err
        assert [one.json for one in found[1:]] == [found[0].json] * 2
        assert ("duplicate of a held-out toss" in found[0].json["outcomes"]) == (spec != "0,3")


ENDS_ITSELF = """
import os, signal, sys
from contact_curation.pipeline.recordings.index import RecordingIndex

kept, keep_scores = [], RecordingIndex.keep_scores

def keep_some(*scores):
    keep_scores(*scores)
    kept.append(scores)
    if len(kept) == 2:
        os.kill(os.getpid(), signal.SIGKILL)

if sys.argv[1] == "killed":
    RecordingIndex.keep_scores = keep_some
from contact_curation.cli.main import main
sys.exit(main(sys.argv[2:]))
"""


def test_a_driver_that_is_killed_twice_goes_on_where_it_was(cluster: str, cli: Cli, tmp_path: Path) -> None:
    bag = mcap_file(tmp_path)
    bags = [bag, *(bag.with_name(f"{name}.mcap") for name in "bcdef")]
    for other in bags[1:]:
        other.write_bytes(bag.read_bytes())
    words = ["rank", *map(str, bags), "--body-frame", "", "--no-figure"]
    engine = ["--engine", "ray", "--address", cluster, "--index", str(tmp_path / "i"), "--out", str(tmp_path / "ray.json")]
    written: list[dict[str, int]] = []
    for way, status in (("killed", -signal.SIGKILL), ("killed", -signal.SIGKILL), ("whole", 0)):
        process = subprocess.run([sys.executable, "-c", ENDS_ITSELF, way, *words, *engine], capture_output=True, check=False)
        assert process.returncode == status, process.stderr.decode()
        written.append({one.name: one.stat().st_mtime_ns for one in tmp_path.glob("i/scores/*.parquet")})
    assert [len(scores) for scores in written] == [2, 4, 6]
    assert written[0].items() <= written[1].items() <= written[2].items()  # nothing is scored again
    assert cli(*words, "--out", tmp_path / "local.json").status == 0
    manifests = [json.loads((tmp_path / f"{name}.json").read_text()) for name in ("ray", "local")]
    for manifest in manifests:
        manifest.pop("command")
    assert manifests[0] == manifests[1]


def test_another_release_on_a_worker_is_an_error(cluster: str, monkeypatch: pytest.MonkeyPatch) -> None:
    from contact_curation.pipeline.recordings import ray_engine

    monkeypatch.setattr(ray_engine, "__version__", "0.0.1")
    with pytest.raises(ContactCurationError, match=r"expected 0\.0\.1 as on the driver"):
        list(ray_engine.RayEngine(cluster).as_done(work, ["a"], unheard))
