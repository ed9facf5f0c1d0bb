"""LeRobot itself reads what `export --format lerobot` writes, and writes the same files of the same frames.

LeRobot's pins clash with ours, so it has an environment of its own: that of the interpreter in LEROBOT_PYTHON, or one that is
made for the test (minutes and 6 GB, for torch comes along).
"""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest

from contact_curation.cli.main import main
from contact_curation.storage.manifest.file import read_manifest

pytestmark = pytest.mark.slow

LEROBOT = "lerobot[dataset]==0.6.1"
GOLDEN = Path(__file__).resolve().parents[2] / "bags" / "golden.mcap"
TOP = 5
LONGEST_INSTALLATION = 3600.0
"""[s] Half an hour on two busy processors."""

DATA, EPISODES, TASKS = "data/chunk-000/file-000.parquet", "meta/episodes/chunk-000/file-000.parquet", "meta/tasks.parquet"

SCRIPT = """
import json, sys
import torch
from lerobot.datasets.lerobot_dataset import LeRobotDataset

root, again = sys.argv[1:]
whole = LeRobotDataset("local/tosses", root=root, delta_timestamps={"observation.state": [-1 / 148, 0.0]})
batch = next(iter(torch.utils.data.DataLoader(whole, batch_size=16)))
some = LeRobotDataset("local/tosses", root=root, episodes=[1, 3])
plain = LeRobotDataset("local/tosses", root=root)
own = {name: about for name, about in plain.meta.features.items() if name in ("observation.state", "stamp_ns")}
copy = LeRobotDataset.create("local/again", fps=plain.fps, features=own, root=again, use_videos=False)
for episode in range(plain.num_episodes):
    rows = [plain[i] for i in range(len(plain)) if int(plain[i]["episode_index"]) == episode]
    for row in rows:
        frame = {"observation.state": row["observation.state"].numpy(), "stamp_ns": row["stamp_ns"].reshape(1).numpy()}
        copy.add_frame({**frame, "task": row["task"]})
    copy.save_episode()
copy.finalize()
print("REPORT " + json.dumps({
    "frames": len(whole), "episodes": whole.num_episodes, "fps": whole.fps, "task": whole[0]["task"],
    "batch": list(batch["observation.state"].shape), "dtype": str(whole[0]["observation.state"].dtype),
    "states": [row["observation.state"].tolist() for row in plain],
    "stamps": [int(row["stamp_ns"]) for row in plain],
    "some": sorted({int(row["episode_index"]) for row in some}), "some_frames": len(some),
    "best": plain.meta.filter_episodes(lambda episode: episode["curation/rank"] <= 2),
    "toss_ids": list(plain.meta.episodes["curation/toss_id"]), "traces": list(plain.meta.episodes["curation/trace"]),
    "mean": plain.meta.stats["observation.state"]["mean"].tolist(),
}))
"""


@pytest.fixture(scope="module")
def lerobot(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An interpreter that has LeRobot."""
    if "LEROBOT_PYTHON" in os.environ:
        return Path(os.environ["LEROBOT_PYTHON"])
    folder = tmp_path_factory.mktemp("lerobot")
    subprocess.run([sys.executable, "-m", "venv", folder], check=True)
    python = folder / "bin" / "python"
    install = [str(python), "-m", "pip", "install", "--quiet", "--no-compile", LEROBOT]  # most of it is never imported
    subprocess.run(install, check=True, timeout=LONGEST_INSTALLATION)
    return python


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The best tosses of the golden bag as a dataset."""
    folder = tmp_path_factory.mktemp("exported")
    manifest = folder / "manifest.parquet"
    assert main(["rank", str(GOLDEN), "--top", str(TOP), "--out", str(manifest), "--no-figure"]) == 0
    words = ["export", str(GOLDEN), "--manifest", str(manifest), "--format", "lerobot", "--out", str(folder / "dataset")]
    assert main(words) == 0
    return folder


def run(python: Path, dataset: Path, again: Path) -> Any:
    """What LeRobot says of a dataset, and a copy by its own writer."""
    offline = {"HF_HUB_OFFLINE": "1", "HF_HOME": str(again.parent / "hf"), "PYTHONPATH": ""}
    done = subprocess.run(
        [python, "-c", SCRIPT, dataset, again], capture_output=True, text=True, timeout=300, env={**os.environ, **offline}
    )
    assert done.returncode == 0, done.stderr
    (line,) = [line for line in done.stdout.splitlines() if line.startswith("REPORT ")]
    return json.loads(line.removeprefix("REPORT "))


def described(path: Path) -> dict[str, str]:
    schema = pq.read_schema(path)
    return {name: str(schema.field(name).type) for name in schema.names}


def test_lerobot_reads_it_and_would_have_written_it_so(lerobot: Path, exported: Path, tmp_path: Path) -> None:
    dataset, again = exported / "dataset", tmp_path / "again"
    report = run(lerobot, dataset, again)
    kept = read_manifest(exported / "manifest.parquet").selected
    lengths = [row.frames for row in kept]
    assert (report["frames"], report["episodes"], report["fps"]) == (sum(lengths), TOP, 148)
    assert (report["task"], report["dtype"], report["batch"]) == ("toss the cube", "torch.float32", [16, 2, 13])
    assert (report["some"], report["some_frames"]) == ([1, 3], lengths[1] + lengths[3])
    assert report["best"] == [0, 1]
    assert report["toss_ids"] == [row.toss_id for row in kept]
    assert report["traces"] == [row.trace for row in kept]
    table = pq.read_table(dataset / DATA)
    np.testing.assert_array_equal(report["states"], table["observation.state"].to_pylist())
    assert report["stamps"] == table["stamp_ns"].to_pylist()
    np.testing.assert_allclose(report["mean"], np.mean(report["states"], axis=0), rtol=1e-6)

    assert described(dataset / DATA) == described(again / DATA)
    assert described(dataset / TASKS) == described(again / TASKS)
    ours, theirs = described(dataset / EPISODES), described(again / EPISODES)
    assert {name: kind for name, kind in ours.items() if not name.startswith("curation/")} == theirs
    assert pq.read_table(dataset / DATA).equals(pq.read_table(again / DATA))
    infos = [json.loads((root / "meta" / "info.json").read_text()) for root in (dataset, again)]
    assert infos[0] == infos[1]
    stats = [json.loads((root / "meta" / "stats.json").read_text()) for root in (dataset, again)]
    for feature, found in stats[1].items():
        exact = {"min", "max", "mean", "std", "count"} - ({"std"} if feature == "stamp_ns" else set())  # theirs cancels digits
        for name in exact:
            np.testing.assert_allclose(stats[0][feature][name], found[name], rtol=1e-4, atol=1e-6)
