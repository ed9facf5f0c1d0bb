"""Every format names its version: files of today and of the previous release are read, a newer one is refused in one line.

previous_release/ holds a file of each format as version 0.1.0 wrote it, from the records that the tests of the formats use.
"""

import json
import sqlite3
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from shutil import copyfile
from typing import Any

import numpy as np
import pytest

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.errors import NewerVersionError, UnreadableInputError
from contact_curation.learning.checkpoints import safetensors_bytes
from contact_curation.learning.checkpoints.selection_document import selections_of
from contact_curation.learning.training.reranking import Trigger
from contact_curation.storage.checkpoint_file import read_model, read_notes, resume_training
from contact_curation.storage.manifest.file import read_manifest, write_manifest
from contact_curation.storage.manifest.manifest import Diagnostic
from contact_curation.storage.parameters_file import read_parameters
from contact_curation.storage.score_file import read_scores
from contact_curation.storage.stores.information import InformationStore
from contact_curation.storage.stores.state import StateStore
from contact_curation.storage.stores.tosses import TossStore
from contact_curation.storage.throws_file import read_throws
from test.contact.cases import CUBE, tracked_transitions
from test.design.test_throw import a_throw
from test.storage.manifest.test_manifest import ENDINGS, MANIFEST, assert_equal
from test.storage.stored_records import information, rejected, toss
from test.storage.test_parameters_file import TRUE, plain, written
from test.storage.test_score_file import NAMES, evaluation

PREVIOUS = Path(__file__).parent / "previous_release"
STORES: dict[str, Callable[[Path], Any]] = {
    "tosses.sqlite": TossStore,
    "information.sqlite": InformationStore,
    "state.sqlite": StateStore,
}


def assert_refused(read: Callable[[Path], object], path: Path, what: str, version: int, newest: int = 1) -> None:
    with pytest.raises(NewerVersionError) as caught:
        read(path)
    assert str(caught.value) == f"{path}: found version {version} of {what}, expected at most {newest}: update contact_curation"


@pytest.fixture
def previous(tmp_path: Path) -> Callable[[str], Path]:
    """A copy of a file of the previous release: stores are opened for writing."""
    return lambda name: Path(copyfile(PREVIOUS / name, tmp_path / name))


def test_stores_of_the_previous_release_are_read(previous: Callable[[str], Path]) -> None:
    with TossStore(previous("tosses.sqlite")) as tosses:
        (stored,), (rejected_motion,) = tosses.after(0, 9), tosses.rejected_after(0, 9)
        assert (stored.toss.digest(), stored.provenance.number) == (toss(1).digest(), 7)
        assert rejected_motion.rejected.reasons == rejected(2).reasons
        assert tosses.states.load("ingest") == b"{}"
        assert [pose.position for _, pose in tosses.poses_since()] == [(1.0, 2.0, 3.0)]
    with InformationStore(previous("information.sqlite")) as records:
        for found in records.after(0, 9):
            np.testing.assert_array_equal(found.information.factor, information(found.sequence).factor)
        assert records.count("v1") == 2
        assert records.states.load("cursor") is None
    with StateStore(previous("state.sqlite")) as states:
        assert states.load("cursor") == b"12"


def test_an_information_store_of_the_previous_release_takes_over_the_states_that_stood_beside_it(
    previous: Callable[[str], Path], tmp_path: Path
) -> None:
    path = previous("information.sqlite")
    copyfile(PREVIOUS / "state.sqlite", tmp_path / "information.sqlite.state")
    for _ in range(2):
        with InformationStore(path) as records:
            assert (records.states.load("cursor"), records.count("v1")) == (b"12", 2)
    (tmp_path / "information.sqlite.state").unlink()
    with InformationStore(path) as records:
        assert records.states.load("cursor") == b"12"


def test_states_left_beside_a_new_information_store_are_none_of_its_own(tmp_path: Path) -> None:
    copyfile(PREVIOUS / "state.sqlite", tmp_path / "new.sqlite.state")
    with InformationStore(tmp_path / "new.sqlite") as records:
        assert records.states.all() == []


@pytest.mark.parametrize(
    ("name", "what"),
    [("tosses.sqlite", "a toss store"), ("information.sqlite", "an information store"), ("state.sqlite", "a state store")],
)
def test_stores_of_a_later_release_are_refused_and_left_alone(tmp_path: Path, name: str, what: str) -> None:
    path = tmp_path / name
    STORES[name](path).close()
    with sqlite3.connect(path) as newer:
        (newest,) = newer.execute("PRAGMA user_version").fetchone()
        newer.execute(f"PRAGMA user_version = {newest + 1}")
    newer.close()
    before = path.read_bytes()
    assert_refused(STORES[name], path, what, newest + 1, newest)
    assert path.read_bytes() == before


@pytest.mark.parametrize("ending", ENDINGS)
def test_manifests_of_the_previous_release_are_read(ending: str) -> None:
    settings_were_not_said = replace(MANIFEST, run=replace(MANIFEST.run, settings=()))
    assert_equal(read_manifest(PREVIOUS / f"manifest{ending}"), settings_were_not_said)


def test_diagnostics_of_the_previous_release_are_read_by_their_names_of_today(tmp_path: Path) -> None:
    shift: dict[str, Diagnostic] = {"distance": 0.5, "at_random": 1.0}
    gram: dict[str, Diagnostic] = {"largest": 2.0}
    path = tmp_path / "manifest.json"
    write_manifest(replace(MANIFEST, diagnostics={"optimum_shift": shift, "selected_gram": gram}), path)
    names = {"optimum_shift": "answer", "distance": "off", "at_random": "by_chance", "selected_gram": "kept_gram"}
    text = path.read_text()
    for name, was in names.items():
        assert f'"{name}"' in text
        text = text.replace(f'"{name}"', f'"{was}"')
    path.write_text(text.replace('_manifest": 2', '_manifest": 1'))
    assert read_manifest(path).diagnostics == {"optimum_shift": shift, "selected_gram": gram}


@pytest.mark.parametrize("ending", ENDINGS)
def test_manifests_of_a_later_release_are_refused_whatever_their_rows_hold(
    tmp_path: Path, ending: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / f"manifest{ending}"
    with monkeypatch.context() as later:
        later.setattr("contact_curation.storage.manifest.file.VERSION", 3)
        write_manifest(MANIFEST, path)
    if ending != ".parquet":
        path.write_text(path.read_text().replace("cube-2-ab", "cube-2-ab,1,2").replace("mean_loss", "average_loss"))
    assert_refused(read_manifest, path, "a manifest", 3, newest=2)


@pytest.mark.parametrize("version", ['"1"', "0", "true", "null", "1.5"])
def test_what_is_no_version_is_refused_in_a_line(tmp_path: Path, version: str) -> None:
    path = tmp_path / "manifest.json"
    write_manifest(MANIFEST, path)
    path.write_text(path.read_text().replace('"contact_curation_manifest": 2', f'"contact_curation_manifest": {version}'))
    with pytest.raises(UnreadableInputError, match=r"manifest\.json: found version .* of a manifest, expected 1 to 2"):
        read_manifest(path)


def test_throws_of_the_previous_release_are_read_and_of_a_later_one_refused(tmp_path: Path) -> None:
    (found,) = read_throws(PREVIOUS / "throws.json")
    assert found.to_mapping() == a_throw().to_mapping()
    path = tmp_path / "throws.json"
    path.write_text('{"version": 2, "releases": []}')
    assert_refused(read_throws, path, "throws", 2)


def test_score_files_of_the_previous_release_are_read_and_of_a_later_one_refused(tmp_path: Path) -> None:
    scores = read_scores(PREVIOUS / "scores.npz")
    np.testing.assert_array_equal(scores["score"], evaluation(3, 1).scores[:, : len(NAMES)])
    path = tmp_path / "scores.npz"
    np.savez(path, format_version=2)
    assert_refused(read_scores, path, "a score file", 2)


def test_parameters_may_name_their_version(tmp_path: Path) -> None:
    for named in ({}, {"version": 1}):
        read = read_parameters(written(tmp_path, {**plain(), **named}), CONTACTNETS_CUBE)
        np.testing.assert_array_equal(read.geometry.vertices_normal, TRUE.vertices_normal)
    path = written(tmp_path, {"version": 2, "vertices": []})
    assert_refused(lambda path: read_parameters(path, CONTACTNETS_CUBE), path, "parameters", 2)


def test_checkpoints_of_the_previous_release_are_read(previous: Callable[[str], Path]) -> None:
    path = previous("checkpoint.safetensors")
    assert resume_training(path, tracked_transitions(), None, CUBE).progress.gradient_steps == 2
    assert read_notes(path) == {"buffer": "4"}
    assert read_model(previous("model.safetensors"), CUBE).settings() == read_model(path, CUBE).settings()


def test_selections_in_checkpoints_of_the_previous_release_are_read() -> None:
    numbers = {"gradient_steps": 3, "epochs": 1, "trigger": "canary", "spearman": 0.5, "overlap": 0.25, "retained": None}
    entry = {**numbers, "kept": ["a", "b"], "canaries": ["c"], "not_scored": []}
    (found,) = selections_of(json.dumps([entry]))
    assert (found.toss_ids, found.monitored, found.trigger) == (("a", "b"), ("c",), Trigger.STALE)


def test_checkpoints_of_a_later_release_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "model.safetensors"
    with monkeypatch.context() as later:
        later.setattr(safetensors_bytes, "FORMAT", "contact_curation.model/2")
        path.write_bytes(safetensors_bytes.pack({"theta": np.zeros(2)}, {"networks": json.dumps([])}))
    assert_refused(read_model, path, "a checkpoint or a model", 2)
