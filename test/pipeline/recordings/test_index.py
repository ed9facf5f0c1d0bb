"""A second ranking reads and scores only what changed, and gives the same manifest; so does one that was killed."""

import json
import os
import signal
import sqlite3
import subprocess
import sys
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from contact_curation.pipeline import scoring
from contact_curation.pipeline.reading import InputReader
from contact_curation.pipeline.recordings import index
from contact_curation.pipeline.recordings.index import _files
from contact_curation.storage.datasets.contactnets import SUBFOLDER
from contact_curation.storage.shards import ShardRow, shard_at, writing_shard
from test.cli.commands import Cli
from test.storage.inputs.test_inputs import mcap_file, storage_file


class Work(list[str]):
    """Names of the recordings that were read, and `scored` for each batch that was scored."""


@pytest.fixture
def work(monkeypatch: pytest.MonkeyPatch) -> Work:
    done = Work()
    outcomes, scored = InputReader.outcomes, scoring._scored

    def heard(reader: Any) -> Any:
        done.append(reader._path.name)
        return outcomes(reader)

    def scored_and_heard(*arguments: Any) -> Any:
        done.append("scored")
        return scored(*arguments)

    monkeypatch.setattr(InputReader, "outcomes", heard)
    monkeypatch.setattr(scoring, "_scored", scored_and_heard)
    return done


@pytest.fixture
def bags(tmp_path: Path) -> Path:
    """A folder of two recordings of two tosses, of which the second repeats the first."""
    folder = tmp_path / "bags"
    folder.mkdir()
    mcap_file(folder)
    (folder / "b.mcap").write_bytes((folder / "a.mcap").read_bytes())
    return folder


def ranked(cli: Cli, bags: Path, *words: object) -> Any:
    """The manifest of a ranking in this process, but for how it was asked for."""
    outcome = cli("rank", *sorted(bags.iterdir()), "--body-frame", "", "--jobs", 1, "--json", *words)
    assert outcome.status == 0, outcome.err
    return outcome.json


def test_a_second_ranking_reads_and_scores_nothing(cli: Cli, bags: Path, work: Work, tmp_path: Path) -> None:
    index = ("--index", tmp_path / "index")
    first = ranked(cli, bags)
    assert work == ["a.mcap", "scored", "b.mcap", "scored"]
    assert ranked(cli, bags, *index) == first
    work.clear()
    assert ranked(cli, bags, *index) == first
    assert work == []


def test_other_parameters_score_and_read_nothing_and_another_rule_reads(
    cli: Cli, bags: Path, work: Work, tmp_path: Path
) -> None:
    index = ("--index", tmp_path / "index")
    ranked(cli, bags, *index)
    work.clear()
    report = ranked(cli, bags, *index, "--influence-bound", "0.5")
    assert work == ["scored", "scored"]
    assert report == ranked(cli, bags, "--influence-bound", "0.5")
    work.clear()
    ranked(cli, bags, *index, "--criterion", "trace")
    assert work == []
    ranked(cli, bags, *index, "--set", "gates.depth=0.02")
    assert work == ["a.mcap", "scored", "b.mcap", "scored"]


def test_a_recording_that_is_new_or_changed_costs_itself_alone(cli: Cli, bags: Path, work: Work, tmp_path: Path) -> None:
    index = ("--index", tmp_path / "index")
    ranked(cli, bags, *index)
    (bags / "c.mcap").write_bytes((bags / "a.mcap").read_bytes())
    os.utime(bags / "b.mcap", ns=(1, 1))
    work.clear()
    ranked(cli, bags, *index)
    assert [name for name in work if name != "scored"] == ["b.mcap", "c.mcap"]


def test_a_recording_replaced_by_one_of_equal_size_and_mtime_is_read(cli: Cli, bags: Path, work: Work, tmp_path: Path) -> None:
    index = ("--index", tmp_path / "index")
    ranked(cli, bags, *index)
    before = (bags / "b.mcap").stat()
    (bags / "b.mcap").write_bytes((bags / "b.mcap").read_bytes())
    os.utime(bags / "b.mcap", ns=(before.st_atime_ns, before.st_mtime_ns))  # as `cp -p` does
    work.clear()
    ranked(cli, bags, *index)
    assert work == ["b.mcap", "scored"]


def test_other_code_of_the_package_reads_and_scores_again(
    cli: Cli, bags: Path, work: Work, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Between two releases, too: what was read by other rules is not taken for what these give."""
    package, option = tmp_path / "package", ("--index", tmp_path / "index")
    monkeypatch.setattr(index, "_code", index._code.__wrapped__)
    monkeypatch.setattr(index, "__file__", str(package / "pipeline" / "recordings" / "index.py"))
    (package / "motion").mkdir(parents=True)
    for number in (1, 2):
        (package / "motion" / "rules.py").write_text(f"LARGEST = {number}\n")
        work.clear()
        ranked(cli, bags, *option)
        assert "a.mcap" in work
        assert "scored" in work
    work.clear()
    ranked(cli, bags, *option)
    assert not work


def test_messages_that_a_recorder_adds_beside_a_database_are_read(cli: Cli, work: Work, tmp_path: Path) -> None:
    """SQLite writes new messages to `bag.db3-wal`; `bag.db3` has the size and times of before until they are moved there."""
    database = storage_file(tmp_path)
    command = ("rank", database, "--body-frame", "", "--jobs", 1, "--json", "--index", tmp_path / "index")
    with closing(sqlite3.connect(database, isolation_level=None)) as live:
        live.execute("PRAGMA journal_mode = WAL")
        half = live.execute("SELECT count(*) / 2 FROM messages").fetchone()
        late = live.execute("SELECT * FROM messages ORDER BY timestamp LIMIT -1 OFFSET ?", half).fetchall()
        live.executemany("DELETE FROM messages WHERE id = ?", [row[:1] for row in late])
        live.execute("PRAGMA wal_checkpoint(TRUNCATE)")
        before, state = cli(*command).json, database.stat()
        live.executemany(f"INSERT INTO messages VALUES ({','.join('?' * len(late[0]))})", late)
        assert (state.st_size, state.st_ctime_ns) == (database.stat().st_size, database.stat().st_ctime_ns)
        work.clear()
        after = cli(*command).json
    assert work == [database.name, "scored"]
    assert len(after["tosses"]) > len(before["tosses"])
    assert before["tosses"][0]["input_sha256"] != after["tosses"][0]["input_sha256"]


def test_folders_in_a_recording_are_not_walked(bags: Path) -> None:
    """Links to itself in a folder would be followed 2^40 times."""
    before = _files(bags)
    for name in ("latest", "current"):
        (bags / name).symlink_to(".")
    (bags / "nothing.mcap").symlink_to("nowhere")
    assert _files(bags) == before == [bags / "a.mcap", bags / "b.mcap"]
    tosses = bags / SUBFOLDER / "0.pt"
    tosses.parent.mkdir()
    tosses.touch()
    assert _files(bags) == [*before, tosses]


def test_a_damaged_shard_is_written_anew(cli: Cli, bags: Path, work: Work, tmp_path: Path) -> None:
    index = ("--index", tmp_path / "index")
    first = ranked(cli, bags, *index)
    for shard in tmp_path.glob("index/*/*.parquet"):
        data = bytearray(shard.read_bytes())
        for place in range(len(data) // 3, len(data) // 3 + 100):
            data[place] ^= 0xFF
        shard.write_bytes(data)
    work.clear()
    assert ranked(cli, bags, *index) == first
    assert "a.mcap" in work
    work.clear()
    assert ranked(cli, bags, *index) == first
    assert work == []


def test_a_flipped_bit_of_a_shard_is_noticed_or_changes_nothing(tmp_path: Path) -> None:
    path, rows = tmp_path / "shard.parquet", [ShardRow(f"toss {k}", '{"frames": 12}', bytes(range(k, 200 + k))) for k in (0, 1)]
    with writing_shard(path) as written:
        for row in rows:
            written.add(row)
        written.note = {"complete": True, "read": 12}
    whole, noticed = path.read_bytes(), 0
    for place in range(0, len(whole), 5):
        path.write_bytes(whole[:place] + bytes([whole[place] ^ 1]) + whole[place + 1 :])
        shard = shard_at(path)
        noticed += shard is None
        assert shard is None or (list(shard.rows()), shard.note) == (rows, written.note), place
    assert noticed > 100


def test_a_bound_of_the_pool_reads_each_recording_once(cli: Cli, bags: Path, work: Work, tmp_path: Path) -> None:
    plain = ranked(cli, bags, "--bound-influence")
    assert [name for name in work if name != "scored"] == ["a.mcap", "b.mcap"]
    assert ranked(cli, bags, "--bound-influence", "--index", tmp_path / "index") == plain


def test_a_shard_holds_what_was_written_or_is_not_there(tmp_path: Path) -> None:
    rows = [ShardRow(f"toss-{number}", '{"a": 1}', bytes([number])) for number in range(150)]
    with writing_shard(tmp_path / "shard.parquet") as shard:
        for row in rows:
            shard.add(row)
        shard.note = {"complete": True}
    read = shard_at(tmp_path / "shard.parquet")
    assert read is not None
    assert (read.note, list(read.rows())) == ({"complete": True}, rows)
    with pytest.raises(ZeroDivisionError), writing_shard(tmp_path / "other.parquet") as shard:
        shard.add(rows[0])
        raise ZeroDivisionError
    assert shard_at(tmp_path / "other.parquet") is None
    assert [path.name for path in tmp_path.iterdir()] == ["shard.parquet"]


SLOW = """
import sys, time
from contact_curation.pipeline import scoring
inner = scoring._score_input
def slowly(config, jobs, bounds, index, source, advance):
    result = inner(config, jobs, bounds, index, source, advance)
    print(source.name, flush=True)
    time.sleep(float(sys.argv[1]) if source.name == "c.mcap" else 0)
    return result
scoring._score_input = slowly
from contact_curation.cli.main import main
sys.exit(main(sys.argv[2:]))
"""


@pytest.mark.slow
def test_what_is_killed_twice_goes_on_where_it_was(cli: Cli, bags: Path, tmp_path: Path) -> None:
    for name in ("c", "d"):
        (bags / f"{name}.mcap").write_bytes((bags / "a.mcap").read_bytes())
    inputs = [str(path) for path in sorted(bags.iterdir())]
    words = ["rank", *inputs, "--body-frame", "", "--jobs", "1", "--index", str(tmp_path / "index")]
    words += ["--out", str(tmp_path / "resumed.json"), "--no-figure"]
    scored: list[list[str]] = []
    for wait in ("60", "60", "0"):
        process = subprocess.Popen([sys.executable, "-c", SLOW, wait, *words], stdout=subprocess.PIPE, text=True)
        assert process.stdout is not None
        lines: list[str] = []
        for line in process.stdout:
            lines.append(line.strip())
            if wait == "60" and lines[-1] == "c.mcap":
                os.kill(process.pid, signal.SIGKILL)
                break
        process.wait()
        process.stdout.close()
        scored.append([line for line in lines if line.endswith(".mcap") and len(line) == 6])
    assert scored == [["a.mcap", "b.mcap", "c.mcap"], ["c.mcap"], ["c.mcap", "d.mcap"]]
    assert cli(*words[: words.index("--index")], "--out", tmp_path / "plain.json", "--no-figure").status == 0
    resumed, plain = (json.loads((tmp_path / f"{name}.json").read_text()) for name in ("resumed", "plain"))
    for manifest in (resumed, plain):
        manifest.pop("command")
    assert resumed == plain
