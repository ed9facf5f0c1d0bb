"""What is tried under failures: the verbs that write, each store as its node uses it, a recorder's session."""

import json
import pickle
import shutil
import sqlite3
from collections.abc import Callable, Mapping
from dataclasses import replace
from io import BytesIO
from itertools import batched
from math import inf
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from mcap.exceptions import McapError
from mcap.reader import make_reader

from contact_curation.cli import progress
from contact_curation.cli.main import main
from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.design.releases import published_releases
from contact_curation.design.throw import throw_of_state
from contact_curation.information.ranker import RankingConfig
from contact_curation.information.scoring import ScoringConfig
from contact_curation.pipeline.export import FORMATS as EXPORTS
from contact_curation.stages.buffer_manifest import manifest_of
from contact_curation.stages.curation import CurationConfig, CurationStage
from contact_curation.stages.design import DesignStage
from contact_curation.stages.ingest import Arrival, IngestJournal
from contact_curation.stages.records import Cursor
from contact_curation.stages.scored_theta import theta_of_geometry
from contact_curation.stages.scoring import ScoringStage
from contact_curation.stages.throw_log import ThrowLog
from contact_curation.stages.training import SelectedSet
from contact_curation.storage.bags.reader import BagReader
from contact_curation.storage.bags.session import SessionBag
from contact_curation.storage.checkpoint_file import read_notes
from contact_curation.storage.manifest.file import read_manifest, write_manifest
from contact_curation.storage.stores.information import InformationStore
from contact_curation.storage.stores.seal import CHECKSUM
from contact_curation.storage.stores.state import StateStore
from contact_curation.storage.stores.tosses import TossStore
from contact_curation.storage.throws_file import write_throws
from test.cli.commands import write_parameters
from test.cli.simulated_files import write_simulated
from test.conftest import GOLDEN
from test.design.cases import CUBE
from test.graph.parts.measured import fresh_ingest, measured_of
from test.reliability.every_call import Program
from test.simulated import simulated_tosses
from test.stages.test_design import CONFIG, SECOND
from test.stages.test_training import CONFIG as TRAINING
from test.stages.test_training import stage, until_idle
from test.storage.bags.test_session import LATCHED, said

TRUE = ContactGeometry.of_body(CONTACTNETS_CUBE)
LARGER = replace(TRUE, vertices_normal=TRUE.vertices_normal * 1.01)
COUNT = 2
"""Tosses of the inputs."""
SMALL_DESIGN = ("design.pool=8", "design.reference=4", "forecast.executions=2", "refinement.generations=0", "safety.share=0.2")


def verb(*words: str) -> Callable[[Path, Path], int]:
    """Runs a command line; OUT and IN in its words stand for the folders."""

    def run(out: Path, inputs: Path) -> int:
        progress.SECONDS_BETWEEN_LINES = inf  # of this process: how many there are depends on the machine
        return main([word.replace("OUT", str(out)).replace("IN", str(inputs)) for word in words])

    return run


def tosses(inputs: Path) -> None:
    (inputs / "tosses").mkdir()
    write_simulated(inputs / "tosses", COUNT)
    write_parameters(inputs / "true.json")


def bag(inputs: Path) -> None:
    """Tosses in a bag, and a ranking of them."""
    throws(inputs)
    assert verb("simulate", "IN/throws.json", "--out", "IN/bag.mcap")(inputs, inputs) == 0
    ranking = ("rank", "IN/bag.mcap", "--top", "2", "--criterion", "longest", "--no-figure", "--out", "IN/manifest.json")
    assert verb(*ranking)(inputs, inputs) == 0


def earlier(*words: str) -> Callable[[Path, Path], None]:
    """An earlier run with other settings has left its files."""

    def before(out: Path, inputs: Path) -> None:
        folder = inputs / "earlier"
        if not folder.exists():
            folder.mkdir()
            assert verb(*words)(folder, inputs) == 0
        shutil.copytree(folder, out, dirs_exist_ok=True)

    return before


def throws(inputs: Path) -> None:
    states = published_releases(2, np.random.default_rng(2))
    write_throws(inputs / "throws.json", [throw_of_state(f"throw-{n}", "cube", state) for n, state in enumerate(states)])


def poses(inputs: Path) -> None:
    (inputs / "poses").write_bytes(pickle.dumps(measured_of(GOLDEN)[POSES]))


def ingested(out: Path, inputs: Path) -> int:
    """pose_ingest's store: poses in batches, each with its tosses; what is known already is not sent again."""
    measured = pickle.loads((inputs / "poses").read_bytes())
    with TossStore(out / "tosses.sqlite") as store:
        journal = IngestJournal(fresh_ingest(), store, "as it is", "/odom")
        arrivals = [Arrival("/odom", 1000 + k, one) for k, one in enumerate(measured)]
        for batch in batched([one for one in arrivals if one.published_ns > journal.newest.get("/odom", 0)], 100):
            journal.take(batch)
            announce(journal)
        announce(journal)
    return 0


def announce(journal: IngestJournal) -> None:
    """What the node does after each batch, and when it starts."""
    stored, rejected = journal.unannounced()
    if stored or rejected:
        journal.announced(*(one[-1].sequence if one else 0 for one in (stored, rejected)))


POSES = slice(1200, 1700)
"""Of the golden recording: a toss or two."""


def known_tosses(inputs: Path) -> None:
    (inputs / "known").write_bytes(pickle.dumps(simulated_tosses(4, seed=8)))


def scored(out: Path, inputs: Path) -> int:
    """fisher_scorer's store: tosses two at a time, then a second theta."""
    known = pickle.loads((inputs / "known").read_bytes())
    frames = {toss.toss_id: "board" for toss in known}
    with InformationStore(out / "information.sqlite") as store:
        stage = ScoringStage(CONTACTNETS_CUBE, ScoringConfig(), store, theta_of_geometry(TRUE))
        stage.postpone(theta_of_geometry(LARGER))
        while missed := stage.unannounced(2):
            stage.announced(missed)
        for _ in range(2):
            for first in range(stage.cursor.sequence, len(known), 2):
                batch = stage.score(known[first : first + 2], frames)
                stage.advance(Cursor(first + 2, known[first + 1].toss_id))
                stage.announced(batch.new)
            if stage.postponed is not None:
                stage.renew(stage.postponed)
    return 0


def curated(out: Path, inputs: Path) -> int:
    """curator's store and the manifest of its buffer."""
    with InformationStore(inputs / "scored.sqlite") as made, InformationStore(out / "information.sqlite") as store:
        stage = CurationStage(RankingConfig(top=2), CurationConfig(), store)
        for number, one in enumerate(made.after(0, 100), start=1):
            if number <= stage.cursor.sequence:
                continue
            stage.add(one.information, 1000 * number, "board")
            buffer = stage.buffer()
            assert buffer is not None
            write_manifest(manifest_of(buffer, stage.last_stamp_ns), out / "buffer.json")
            stage.advance(Cursor(number, one.information.toss_id))
    return 0


def to_curate(inputs: Path) -> None:
    known = simulated_tosses(4, seed=8)
    with InformationStore(inputs / "scored.sqlite") as store:
        stage = ScoringStage(CONTACTNETS_CUBE, ScoringConfig(), store, theta_of_geometry(TRUE))
        stage.score(known, {toss.toss_id: "board" for toss in known})


def trained(out: Path, inputs: Path) -> int:
    """trainer's tosses and its checkpoint."""
    known = pickle.loads((inputs / "known").read_bytes())
    with TossStore(out / "tosses.sqlite") as store:
        training = stage(out, store, replace(TRAINING, steps=10, evaluation_steps=10))
        for revision, count in enumerate((3, 4), start=1):
            if revision < training.round.revision:
                continue  # the curator sends its newest buffer alone
            training.follow(SelectedSet(revision, count, tuple(toss.toss_id for toss in known[:count])))
            for toss in known[:count]:
                if toss.toss_id in training.missing:
                    training.add(toss)
            until_idle(training)
    return 0


def designed(out: Path, _: Path) -> int:
    """throw_designer's log: two throws."""
    with StateStore(out / "throws.sqlite") as store:
        stage = DesignStage(CUBE, CONFIG, store)
        while len(stage.throws) < THROWS:
            proposal = stage.propose()
            stage.begin(proposal)
            stage.finish(proposal.throw, SECOND * (1 + len(stage.throws)))
    return 0


THROWS = 2


def recorded(out: Path, _: Path) -> int:
    """session_recorder's bag: latched messages, which come again after a restart, and others, which do not."""
    with SessionBag(out / "session.mcap") as session:
        for number in range(40):
            session.write(said("/poses", number), LATCHED)
            if number % 10 == 9:
                session.flush()
    return 0


def rows_of(path: Path) -> object:
    """All rows of a SQLite file and of the write-ahead log beside it."""
    if path.name.endswith(("-wal", "-shm", "-journal")):
        return None
    if path.suffix != ".sqlite":
        return path.read_bytes()
    with TemporaryDirectory() as folder:  # whoever opens a store may change it
        copy = Path(shutil.copy(path, folder))
        log = path.with_name(f"{path.name}-wal")
        if log.exists():
            shutil.copy(log, folder)
        connection = sqlite3.connect(copy)
        try:
            names = [
                name for (name,) in connection.execute("SELECT name FROM sqlite_master WHERE type = 'table' ORDER BY name")
            ]
            return {name: sorted(connection.execute(f"SELECT * FROM {name}"), key=repr) for name in names}  # no row has a place
        except sqlite3.DatabaseError:
            return path.read_bytes()
        finally:
            connection.close()


def throws_of(path: Path) -> object:
    """How many throws a log has that were made, and whether it knows of one under way: which numbers they have may differ."""
    tables = rows_of(path)
    if not isinstance(tables, dict):
        return tables
    found = [json.loads(value[: -CHECKSUM.size]) for key, value in tables.get("states", ()) if key == "throws"]
    return [(len({one["commanded"]["throw_id"] for one in log["made"]}), log["under_way"]) for log in found]


def messages_of(path: Path) -> object:
    """The messages of a bag: in which chunks they stand depends on when it was flushed."""
    data = path.read_bytes()
    if path.suffix != ".mcap":
        return data
    try:
        return [message for _, _, message in make_reader(BytesIO(data)).iter_messages()]
    except (McapError, ValueError):  # it has no end yet
        return data


def opens(check: Callable[[Path, Path], str]) -> Callable[[Path, Path], str]:
    """Looks at a copy: whoever opens a store may change it."""

    def look(out: Path, reference: Path) -> str:
        copy = out.parent.parent / "aside" / "copy"
        shutil.rmtree(copy, ignore_errors=True)
        shutil.copytree(out, copy)
        return check(copy, reference)

    return look


def _toss_ids(path: Path) -> list[tuple[str, str]]:
    with TossStore(path) as store:
        return [(one.toss.toss_id, one.toss.digest()) for one in store.after(0, 1000)]


def part_of_tosses(out: Path, reference: Path) -> str:
    """Stored tosses are the first ones of an undisturbed run."""
    if not (out / "tosses.sqlite").exists():
        return ""
    found, whole = (_toss_ids(one / "tosses.sqlite") for one in (out, reference))
    return "" if found == whole[: len(found)] else "other tosses"


def part_of_information(out: Path, reference: Path) -> str:
    def known(folder: Path) -> Mapping[int, Any]:
        with InformationStore(folder / "information.sqlite") as store:
            return {one.sequence: one.information.toss_id for one in store.after(0, 1000)}

    if not (out / "information.sqlite").exists():
        return ""
    found, whole = known(out), known(reference)
    return "" if all(whole.get(number, toss_id) == toss_id for number, toss_id in found.items()) else "other information"


def part_of_training(out: Path, reference: Path) -> str:
    checkpoint = out / "model.safetensors"
    if checkpoint.exists():
        read_notes(checkpoint)
    return part_of_tosses(out, reference)


def part_of_throws(out: Path, reference: Path) -> str:
    if (out / "throws.sqlite").exists():
        with StateStore(out / "throws.sqlite") as store:
            ThrowLog(store)
    return ""


def part_of_session(out: Path, reference: Path) -> str:
    path = out / "session.mcap"
    if not path.exists():
        return ""
    with BagReader(path) as found, BagReader(reference / "session.mcap") as whole:
        parts, all_of_them = list(found.raw_messages()), list(whole.raw_messages())
    return "" if parts == all_of_them[: len(parts)] else "other messages"


def one_manifest(out: Path, reference: Path) -> str:
    """A table and its provenance are two files, which say one thing together."""
    found, old, new = (read_manifest(one / "m.csv") for one in (out, reference.parent / "inputs" / "earlier", reference))
    return "" if found in (old, new) else "the manifest is neither the old nor the new one"


def part_of_checkpoint(out: Path, reference: Path) -> str:
    if (out / "model.safetensors").exists():
        read_notes(out / "model.safetensors")
    metrics = out / "model.jsonl"
    whole = (reference / "model.jsonl").read_text()
    text = metrics.read_text() if metrics.exists() else ""
    if not whole.startswith(text):
        return "metrics are no beginning of the whole"
    for line in text.splitlines()[: None if text.endswith("\n") else -1]:
        json.loads(line)
    return ""


RANK = ("rank", "IN/tosses", "--jobs", "1", "--params", "IN/true.json")
PROGRAMS: dict[str, Program] = {
    "rank-json": Program(
        verb(*RANK, "--top", "2", "--out", "OUT/m.json"),
        tosses,
        earlier(*RANK, "--top", "1", "--out", "OUT/m.json"),
    ),
    "rank-csv": Program(
        verb(*RANK, "--top", "2", "--no-figure", "--out", "OUT/m.csv"),
        tosses,
        earlier(*RANK, "--top", "1", "--no-figure", "--out", "OUT/m.csv"),
        grows=opens(one_manifest),
    ),
    "rank-parquet": Program(
        verb(*RANK, "--top", "2", "--no-figure", "--out", "OUT/m.parquet"),
        tosses,
        earlier(*RANK, "--top", "1", "--no-figure", "--out", "OUT/m.parquet"),
    ),
    "score": Program(
        verb("score", "IN/tosses", "--params", "IN/true.json", "--out", "OUT/s.npz"),
        tosses,
        earlier("score", "IN/tosses/0.pt", "--params", "IN/true.json", "--out", "OUT/s.npz"),
    ),
    "train": Program(
        verb(
            *("train", "IN/tosses", "--out", "OUT/model.safetensors", "--steps", "4", "--set", "training.evaluation_steps=2"),
            *("--resume", "--checkpoint-every", "0", "--held-out", "1"),
        ),
        tosses,
        grows=opens(part_of_checkpoint),
    ),
    "evaluate": Program(
        verb("evaluate", "IN/true.json", "IN/tosses", "--set", "bootstrap.resamples=20", "--figure", "OUT/f.png"),
        tosses,
        earlier("evaluate", "IN/true.json", "IN/tosses/0.pt", "--set", "bootstrap.resamples=20", "--figure", "OUT/f.png"),
    ),
    "import": Program(
        verb("import", "contactnets", "IN/tosses", "--out", "OUT/bag.mcap", "--overwrite"),
        tosses,
        earlier("import", "contactnets", "IN/tosses/0.pt", "--out", "OUT/bag.mcap"),
    ),
    "import-folder": Program(
        verb("import", "contactnets", "IN/tosses", "--out", "OUT/bag"), tosses, wholes=("bag",), once=True
    ),
    "design": Program(
        verb("design", "--throws", "2", "--out", "OUT/t.json", *(w for one in SMALL_DESIGN for w in ("--set", one))),
        before=earlier("design", "--throws", "1", "--out", "OUT/t.json", *(w for one in SMALL_DESIGN for w in ("--set", one))),
    ),
    "simulate": Program(
        verb("simulate", "IN/throws.json", "--out", "OUT/bag.mcap", "--overwrite"),
        throws,
    ),
    **{
        f"export-{form}": Program(
            verb("export", "IN/bag.mcap", "--manifest", "IN/manifest.json", "--format", form, "--out", f"OUT/{form}"),
            bag,
            wholes=(form,),
            once=True,
        )
        for form in EXPORTS
    },
    "toss-store": Program(ingested, poses, plain=rows_of, grows=opens(part_of_tosses)),
    "scorer-store": Program(scored, known_tosses, plain=rows_of, grows=opens(part_of_information)),
    "curator-store": Program(curated, to_curate, plain=rows_of, grows=opens(part_of_information)),
    "trainer": Program(trained, known_tosses, plain=rows_of, grows=opens(part_of_training)),
    "throw-log": Program(designed, plain=throws_of, grows=opens(part_of_throws)),
    "recorder": Program(recorded, plain=messages_of, grows=opens(part_of_session)),
}
