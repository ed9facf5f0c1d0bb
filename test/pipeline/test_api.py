"""`import contact_curation as cc`: the examples of its documentation run, and its digits are those of the commands."""

import copy
import doctest
import json
import pickle
import shutil
import subprocess
import sys
from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

import contact_curation as cc
from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.errors import (
    ContactCurationError,
    InvalidValueError,
    MissingDependencyError,
    NothingFoundError,
    UnreadableInputError,
)
from contact_curation.geometry.tags import CornerOrder
from contact_curation.learning.checkpoints.safetensors_bytes import unpack
from contact_curation.pipeline import ranked
from contact_curation.pipeline.reading import inputs_config
from contact_curation.storage.manifest.file import read_manifest
from contact_curation.storage.parameters_file import read_parameters
from contact_curation.storage.throws_file import read_throws
from test.cli.commands import Cli
from test.conftest import REPOSITORY

SHORT = 30
"""Gradient steps."""

ANY: Any = cc
"""The same functions, for arguments of the wrong type."""


@pytest.fixture(scope="module")
def tosses(golden_bag: Path) -> cc.Tosses:
    return cc.read(golden_bag)


@pytest.fixture(scope="module")
def body(tosses: cc.Tosses) -> cc.Body:
    return tosses.body


@pytest.fixture(scope="module")
def ranking(tosses: cc.Tosses) -> cc.RankedTosses:
    return cc.rank(tosses, top=8)


@pytest.fixture(scope="module")
def model(ranking: cc.RankedTosses) -> cc.LearnedModel:
    return cc.train(ranking.selected, steps=SHORT)


@pytest.fixture(scope="module")
def deep(ranking: cc.RankedTosses) -> cc.LearnedModel:
    return cc.train(ranking.selected, "deep", steps=1)


@pytest.fixture
def bench(golden_bag: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with the files that examples name."""
    for name in ("session.mcap", "test.mcap"):
        shutil.copy(golden_bag, tmp_path / name)
    shutil.copy(REPOSITORY / "contact_curation" / "config" / "cube.yaml", tmp_path / "brick.yaml")
    monkeypatch.chdir(tmp_path)
    return tmp_path


IMPORTED_FIRST = """
import sys
import contact_curation as cc
loaded = {name for name in sys.modules if name.startswith("contact_curation.")}
assert loaded <= {"contact_curation.version"}, loaded
assert not {"numpy", "torch", "yaml"} & set(sys.modules)
assert {"rank", "Body"} <= set(dir(cc))
from contact_curation.design import planner  # a part that has the name of a function
assert callable(cc.design) and cc.design.__module__ == "contact_curation.pipeline.api"
assert "torch" not in sys.modules or "torch" in str(planner.__dict__)
"""


def test_it_imports_nothing_until_a_name_is_used_and_design_stays_a_function() -> None:
    subprocess.run([sys.executable, "-c", IMPORTED_FIRST], check=True)


def test_ranking_a_polytope_imports_no_torch(golden_bag: Path) -> None:
    code = (
        f"import sys, contact_curation as cc; cc.rank(cc.read({str(golden_bag)!r}), top=2); assert 'torch' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.mark.slow
def test_without_torch_every_name_and_function_says_what_to_install(bench: Path, model: cc.LearnedModel) -> None:
    """In a process of its own, whose finder of modules finds no torch."""
    model.save(bench / "of_torch.safetensors")
    program = """
import sys
import contact_curation as cc
from contact_curation import extras
from contact_curation.errors import MissingDependencyError
class NoTorch:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] == "torch":
            raise ModuleNotFoundError("No module named 'torch'", name="torch")
sys.meta_path.insert(0, NoTorch())
extras.find_spec = lambda name: None
tosses = cc.read("session.mcap", body="brick.yaml")
cc.score(tosses)
path = "of_torch.safetensors"
for call in (
    lambda: cc.score(tosses, model=path), lambda: cc.rank(tosses, model=path), lambda: cc.load_model(path),
    lambda: cc.train(tosses), lambda: cc.evaluate(path, tosses), lambda: cc.LearnedModel,
):
    try:
        call()
    except MissingDependencyError as error:
        print(error)
"""
    done = subprocess.run([sys.executable, "-c", program], cwd=bench, capture_output=True, text=True)
    assert done.stderr == ""
    assert done.stdout == "torch is missing: pip install 'contact-curation[train]'\n" * 6


def test_every_name_has_a_home_and_a_documentation() -> None:
    for name in cc.__all__:
        assert (getattr(cc, name).__doc__ or "").strip(), name
    with pytest.raises(AttributeError, match="no attribute 'ranks'"):
        cc.ranks  # noqa: B018


@pytest.mark.slow
def test_the_examples_in_the_documentation_run(
    bench: Path, body: cc.Body, tosses: cc.Tosses, ranking: cc.RankedTosses, model: cc.LearnedModel
) -> None:
    given = {"cc": cc, "np": np, "body": body, "tosses": tosses, "ranking": ranking, "model": model}
    runner = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS)
    finder = doctest.DocTestFinder(recurse=False)
    names = sorted((name for name in cc.__all__ if name.islower()), key=lambda name: name != "train")  # it saves a model
    documented = {"Body.from_file": cc.Body.from_file, **{name: getattr(cc, name) for name in names}}
    for name, function in documented.items():
        (example,) = finder.find(function, name, globs=dict(given))
        assert example.examples, name
        assert runner.run(example).failed == 0, name


@pytest.mark.slow
def test_the_first_page_of_the_face_works_as_it_stands(bench: Path) -> None:
    page = (REPOSITORY / "docs" / "how-to" / "python.md").read_text()
    code = page.partition("```python\n")[2].partition("```")[0]
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False, cwd=bench)
    assert done.returncode == 0, done.stderr
    assert "evaluated on 13 of 24 tosses" in done.stdout  # which the model did not learn from


def test_without_a_body_a_warning_says_that_the_cube_is_assumed(bench: Path) -> None:
    assert cc.read(bench / "session.mcap").warnings[0] == "no body given: assuming ContactNets' cube (0.37 kg, 105 mm)"


NO_BODY = "no body given: assuming ContactNets' cube (0.37 kg, 105 mm)"


@pytest.mark.slow
def test_every_function_that_assumes_the_cube_says_so(bench: Path, body: cc.Body) -> None:
    session = bench / "session.mcap"
    checked = cc.check(session)
    assert checked.warnings == (NO_BODY,)
    assert "warnings" not in checked.document()
    assert cc.check(session, body).warnings == ()
    assert cc.score(session).warnings[0] == NO_BODY
    assert NO_BODY not in cc.score(session, body=body).warnings
    assert cc.train(session, steps=1).warnings[0] == NO_BODY
    assert cc.design(throws=1, method="prior").warnings == (NO_BODY,)


class Counts:
    """A progress that remembers what was begun, and how much was done."""

    def __init__(self) -> None:
        self.begun: list[tuple[str, str, int | None]] = []
        self.done = 0

    def __call__(self, what: str, unit: str, total: int | None = None, done: int = 0) -> AbstractContextManager["Counts"]:
        self.begun.append((what, unit, total))
        return nullcontext(self)

    def advance(self, count: int = 1, note: str = "", share: float | None = None) -> None:
        self.done += count


@pytest.mark.slow
def test_design_of_a_given_body_warns_of_nothing_and_shows_its_progress(body: cc.Body) -> None:
    progress = Counts()
    assert cc.design(throws=1, method="prior", body=body, progress=progress).warnings == ()
    assert progress.begun == [("designing", "simulated throws", None)]
    assert progress.done > 0


def test_a_pattern_a_path_and_several_are_recordings(bench: Path, tosses: cc.Tosses) -> None:
    several: list[str | Path] = ["session.mcap", bench / "test.mcap"]
    for inputs in ("*.mcap", bench / "session.mcap", several):
        assert cc.read(inputs).ids == tosses.ids
    twice = cc.read("*.mcap", body=CONTACTNETS_CUBE)
    assert len(twice.duplicates) == len(twice.warnings) == 24
    with pytest.raises(UnreadableInputError, match="nothing matches this pattern"):
        cc.read("*.db3")
    missing = cc.read("none.mcap", body=CONTACTNETS_CUBE)
    assert (len(missing), len(missing.warnings)) == (0, 1)
    with pytest.raises(NothingFoundError, match=r"none\.mcap"):
        cc.rank(missing)


def test_what_was_rejected_has_its_reasons(tosses: cc.Tosses) -> None:
    assert sum(tosses.reasons.values()) == len(tosses.rejected) == 3
    assert all(one.reasons for one in tosses.rejected)
    assert "21 tosses of cube, 3 rejected" in repr(tosses)


def test_a_ranking_is_that_of_the_command(
    cli: Cli, golden_bag: Path, body: cc.Body, tosses: cc.Tosses, ranking: cc.RankedTosses, tmp_path: Path
) -> None:
    report = cli("rank", golden_bag, "--top", 8, "--out", tmp_path / "command.json", "--no-figure", "--json").json
    for mine in (ranking, cc.rank(golden_bag, top=8, body=body)):
        assert json.loads(json.dumps(mine.document()["tosses"])) == report["tosses"]
        assert list(mine.selected_ids) == [row["toss_id"] for row in report["tosses"] if row["selected"]]
        assert [toss.toss_id for toss in mine.selected] == list(mine.selected_ids)
        assert [toss.digest() for toss in mine.selected] == [tosses.by_id[name].digest() for name in mine.selected_ids]
    ranking.save(tmp_path / "mine.json")
    mine_, command = (read_manifest(tmp_path / f"{name}.json") for name in ("mine", "command"))
    assert (mine_.rows, mine_.diagnostics) == (command.rows, command.diagnostics)
    assert str(ranking).splitlines()[0] == cli("rank", golden_bag, "--top", 8).out.splitlines()[0]


def test_held_out_tosses_are_neither_ranked_from_memory_nor_from_recordings(golden_bag: Path, tosses: cc.Tosses) -> None:
    rankings = [cc.rank(source, top=3, held_out="0-3", criterion="trace") for source in (tosses, golden_bag)]
    assert rankings[0].outcomes == rankings[1].outcomes
    assert rankings[0].outcomes["held out"] == 4
    assert rankings[0].ids == rankings[1].ids


def test_an_index_gives_the_same_ranking_of_recordings_and_is_refused_for_tosses(
    golden_bag: Path, tosses: cc.Tosses, body: cc.Body, tmp_path: Path
) -> None:
    plain, *indexed = (cc.rank(golden_bag, body=body, held_out="0-3", index=index) for index in (None, *[tmp_path / "i"] * 2))
    assert len(list(tmp_path.glob("i/scores/*"))) == 1
    assert [one.manifest for one in indexed] == [plain.manifest] * 2
    with pytest.raises(ContactCurationError, match=r"index: found .*, expected none for tosses that were read"):
        cc.rank(tosses, index=tmp_path / "i")


def test_a_training_is_that_of_the_command(
    cli: Cli, golden_bag: Path, ranking: cc.RankedTosses, model: cc.LearnedModel, tmp_path: Path
) -> None:
    ranking.save(tmp_path / "m.csv")
    words = ("--manifest", tmp_path / "m.csv", "--held-out", "none", "--steps", SHORT)
    assert cli("train", golden_bag, *words, "--out", tmp_path / "command.safetensors").status == 0
    model.save(tmp_path / "mine.safetensors")
    mine, command = (unpack((tmp_path / name).read_bytes(), name) for name in ("mine.safetensors", "command.safetensors"))
    assert mine.documents == command.documents
    assert {name: array.tobytes() for name, array in mine.arrays.items()} == {
        name: array.tobytes() for name, array in command.arrays.items()
    }
    again = cc.load_model(tmp_path / "mine.safetensors")
    assert (again.learned_from, again.kind, again.body.name) == (frozenset(ranking.selected_ids), "polytope", "cube")


def test_an_evaluation_is_that_of_the_command(
    cli: Cli, golden_bag: Path, tosses: cc.Tosses, model: cc.LearnedModel, tmp_path: Path
) -> None:
    model.save(tmp_path / "m.safetensors")
    report: dict[str, Any] = cli("evaluate", tmp_path / "m.safetensors", golden_bag, "--json").json
    mine = cc.evaluate(cc.load_model(tmp_path / "m.safetensors"), tosses)
    for name in ("tosses", "chosen", "bootstrap", "known_why_not"):
        assert json.loads(json.dumps(mine.document()[name])) == report[name]
    assert [row["loss"] for row in mine.document()["models"][0]["per_toss"]] == [
        row["loss"] for row in report["models"][0]["per_toss"]
    ]
    assert "careful: " in str(mine)  # it is judged by tosses that it learned from


@pytest.mark.slow
def test_designed_throws_are_those_of_the_command(cli: Cli, golden_bag: Path, ranking: cc.RankedTosses, tmp_path: Path) -> None:
    ranking.save(tmp_path / "m.csv")
    words = ("--known", golden_bag, "--manifest", tmp_path / "m.csv", "--throws", 2, "--baseline", "prior")
    assert cli("design", *words, "--out", tmp_path / "command.json").status == 0
    cc.design(known=ranking.selected, throws=2, method="prior").save(tmp_path / "mine.json")
    assert [throw.to_mapping() for throw in read_throws(tmp_path / "mine.json")] == [
        throw.to_mapping() for throw in read_throws(tmp_path / "command.json")
    ]


def test_scores_are_those_of_the_ranking_with_names_and_units(tosses: cc.Tosses, ranking: cc.RankedTosses) -> None:
    info = cc.score(tosses)
    assert info.toss_ids == tosses.ids
    assert info.scores.shape == (len(tosses), len(info.parameter_names)) == (21, len(info.parameter_units))
    assert dict(zip(info.parameter_names, info.parameter_units))["tilt[1]"] == "rad"
    rows = {row.toss_id: row for row in ranking.manifest.rows}
    for toss_id, losses, factor in zip(info.toss_ids, info.losses, info.factors, strict=True):
        assert float(losses.mean()) == pytest.approx(rows[toss_id].mean_loss, rel=1e-12)
        assert len(losses) == rows[toss_id].transitions
        assert factor.shape[1] == len(info.parameter_names)
    traces = np.array([rows[toss_id].trace for toss_id in info.toss_ids], dtype=float)
    np.testing.assert_allclose(info.traces, traces, rtol=1e-3)
    assert not info.not_scored


def test_models_of_files_are_scored_and_ranked_for(
    tosses: cc.Tosses, body: cc.Body, model: cc.LearnedModel, true_parameters: Path, tmp_path: Path
) -> None:
    true = read_parameters(true_parameters, body)
    assert true.geometry.vertex_count == 8
    assert cc.rank(tosses, 4, model=true_parameters).ids == cc.rank(tosses, 4).ids
    model.save(tmp_path / "m.safetensors")
    by_file, by_model = cc.rank(tosses, 4, model=tmp_path / "m.safetensors"), cc.rank(tosses, 4, model=model)
    assert by_file.ids == by_model.ids
    assert by_file.manifest.run.parameters_version == by_model.manifest.run.parameters_version
    with pytest.raises(InvalidValueError, match="the body that the polytope in"):
        cc.load_model(true_parameters)
    with pytest.raises(UnreadableInputError, match="No such file"):  # and not that its body is missing
        cc.load_model(tmp_path / "none.json")


@pytest.mark.slow
def test_the_command_that_check_proposes_has_the_body_and_the_settings(golden_bag: Path, tmp_path: Path) -> None:
    (tmp_path / "own.yaml").write_text(json.dumps(CONTACTNETS_CUBE.to_mapping()))
    settings = {"gates.depth": 0.0101, "poses.rectified": False, "rig.centre": [0.1, 0.0, 0.0]}
    for given, word in ((str(tmp_path / "own.yaml"), tmp_path / "own.yaml"), (replace(CONTACTNETS_CUBE, mass=0.4), "BODY")):
        found = cc.check(golden_bag, given, config=settings).next
        words = f"--body {word} --set poses.rectified=false --set gates.depth=0.0101 --set rig.centre=0.1,0.0,0.0"
        assert found == f"contact-curation rank {golden_bag} {words} --out ranked.csv"
        assert found == cc.check(golden_bag, given, config=inputs_config(settings)).next
    assert "--body" not in cc.check(golden_bag, CONTACTNETS_CUBE).next


@pytest.mark.slow
def test_a_body_and_a_model_may_be_their_files(bench: Path, tosses: cc.Tosses, model: cc.LearnedModel) -> None:
    model.save("m.safetensors")
    assert cc.read("session.mcap", "brick.yaml").ids == tosses.ids
    assert cc.check("session.mcap", body=bench / "brick.yaml").ok
    assert cc.rank("session.mcap", 4, body="brick.yaml").ids == cc.rank(tosses, 4).ids
    Path("own.yaml").write_text(json.dumps(tosses.body.to_mapping()))
    assert cc.load_model("m.safetensors", "own.yaml").learned_from == model.learned_from
    assert len(cc.evaluate("m.safetensors", tosses, against=bench / "m.safetensors").evaluations) == 2
    assert cc.design(throws=1, method="prior", body="own.yaml").body.first_difference(tosses.body) == ""


def test_a_kind_of_model_is_no_model(tosses: cc.Tosses) -> None:
    for call in (lambda: cc.rank(tosses, model="deep"), lambda: cc.score(tosses, model="deep"), lambda: cc.load_model("deep")):
        with pytest.raises(InvalidValueError, match=r"^model: found 'deep', a kind of model, expected a trained model"):
            call()


def test_settings_have_the_names_that_the_command_takes(cli: Cli, golden_bag: Path, body: cc.Body) -> None:
    settings = {"gates.rest_tilt": 4e-4, "rig.scale": 1.01, "rig.normal": [0.0, 0.0, 1.0]}
    words = [f"--set={name}={str(value).strip('[]').replace(' ', '')}" for name, value in settings.items()]
    done = cli("rank", golden_bag, *words, "--json")
    found = cc.read(golden_bag, body, config=settings)
    assert len(found.rejected) > 3
    ranked = cc.rank(found)
    assert json.loads(json.dumps(ranked.document()["tosses"])) == json.loads(done.out)["tosses"]
    assert ranked.manifest.run.settings == ("gates.rest_tilt=0.0004", "rig.scale=1.01")  # the normal is as it is by default
    again = cli("rank", golden_bag, *(f"--set={word}" for word in ranked.manifest.run.settings), "--json")
    assert json.loads(again.out)["tosses"] == json.loads(done.out)["tosses"]


def test_settings_with_a_choice_take_its_name() -> None:
    assert inputs_config({"poses.tags.corner_order": "opencv"}).poses.tags.corner_order is CornerOrder.OPENCV


@pytest.mark.slow
def test_a_manifest_has_the_settings_of_reading_and_loss(cli: Cli, golden_bag: Path, tmp_path: Path) -> None:
    settings = ("gates.rest_tilt=0.0004", "loss.match=0.2")
    done = cli("rank", golden_bag, *(f"--set={one}" for one in settings), "--out", tmp_path / "best.json")
    assert done.status == 0, done.err
    assert read_manifest(tmp_path / "best.json").run.settings == settings


def test_a_training_goes_on_from_a_model_in_memory_as_from_its_file(
    ranking: cc.RankedTosses, model: cc.LearnedModel, tmp_path: Path
) -> None:
    before = model.model.tensors()
    model.save(tmp_path / "start.safetensors")
    from_memory = cc.train(ranking.selected, steps=2, start=model)
    from_file = cc.train(ranking.selected, steps=2, start=tmp_path / "start.safetensors")
    for name, values in from_memory.model.tensors().items():
        np.testing.assert_array_equal(values, from_file.model.tensors()[name])
        np.testing.assert_array_equal(before[name], model.model.tensors()[name])  # left as it is
    with pytest.raises(InvalidValueError, match=r"^start: found 3, expected a model, or the path of its file$"):
        ANY.train(ranking.selected, start=3)


def test_what_the_model_to_start_from_learned_from_stays_known(
    cli: Cli, golden_bag: Path, ranking: cc.RankedTosses, model: cc.LearnedModel, tmp_path: Path
) -> None:
    excluded = ranking.selected.accepted[0].toss_id
    again = cc.train(ranking.selected, steps=2, start=model, held_out=[ranking.selected.taken[excluded].seen.number])
    assert again.fitted_to == model.learned_from - {excluded}
    assert again.learned_from == model.learned_from
    assert f"{model.name}: it learned from 1 of the 1 held-out tosses" in again.warnings
    model.save(tmp_path / "start.safetensors")
    (tmp_path / "excluded.txt").write_text(excluded)
    words = ("--params", tmp_path / "start.safetensors", "--held-out", tmp_path / "excluded.txt", "--steps", 2)
    done = cli("train", golden_bag, *words, "--out", tmp_path / "again.safetensors")
    assert f"{tmp_path / 'start.safetensors'}: it learned from 1 of the 1 held-out tosses" in done.err
    judged = cli("evaluate", tmp_path / "again.safetensors", golden_bag)
    assert f"{tmp_path / 'again.safetensors'}: it learned from 1 of the 1 tosses it is evaluated on" in judged.err


@pytest.mark.slow
def test_the_number_of_threads_of_torch_is_the_callers_again(tosses: cc.Tosses, deep: cc.LearnedModel) -> None:
    before, few = torch.get_num_threads(), cc.rank(tosses, 4).selected
    torch.set_num_threads(3)
    try:
        model = cc.train(few, steps=1)
        assert torch.get_num_threads() == 3
        cc.evaluate(model, few, held_out="none")
        assert torch.get_num_threads() == 3
        cc.score(few, model=deep)
        assert torch.get_num_threads() == 3
        cc.rank(few, model=deep)
        assert torch.get_num_threads() == 3
    finally:
        torch.set_num_threads(before)


def test_a_model_that_was_changed_is_saved_as_it_is(model: cc.LearnedModel, deep: cc.LearnedModel, tmp_path: Path) -> None:
    changed = copy.deepcopy(model)
    with torch.no_grad():
        next(changed.model.parameters()).add_(0.01)
    for number, (one, data) in enumerate(((model, True), (changed, False), (replace(model, model=deep.model), False))):
        path = tmp_path / f"{number}.safetensors"
        one.save(path)
        again = cc.load_model(path)
        assert (path.read_bytes() == one.data) == data
        assert (again.kind, again.learned_from) == (one.kind, model.learned_from)
        for name, values in one.model.tensors().items():
            np.testing.assert_array_equal(again.model.tensors()[name], values)


def test_a_body_that_contradicts_the_tosses_or_the_model_is_refused(
    golden_bag: Path, tosses: cc.Tosses, body: cc.Body, model: cc.LearnedModel
) -> None:
    heavy = replace(body, mass=0.5)
    for call in (
        lambda: cc.rank(tosses, body=heavy),
        lambda: cc.score(tosses, body=heavy),
        lambda: cc.train(tosses, body=heavy, steps=1),
        lambda: cc.rank(golden_bag, body=heavy, model=model),
        lambda: cc.design(model, body=heavy),
    ):
        with pytest.raises(InvalidValueError, match=r"not the 'cube' of .* \(other mass\), expected the same body: leave out"):
            call()
    assert cc.rank(tosses, 4, body=replace(body, name="other")).ids == cc.rank(tosses, 4).ids


def test_a_model_of_another_body_than_that_of_the_tosses_is_refused(tosses: cc.Tosses, model: cc.LearnedModel) -> None:
    heavy = cc.Tosses.of(tosses.accepted, replace(tosses.body, mass=0.5))
    for call in (
        lambda: cc.rank(heavy, model=model),
        lambda: cc.score(heavy, model=model),
        lambda: cc.train(heavy, start=model, steps=1),
        lambda: cc.evaluate(model, heavy),
        lambda: cc.evaluate(cc.train(heavy, steps=1), heavy, against=model),
        lambda: cc.design(model, known=heavy, throws=1),
    ):
        with pytest.raises(InvalidValueError, match=r"not the 'cube' of the tosses \(other mass\), expected the same body"):
            call()


@pytest.mark.slow
def test_a_result_is_saved_over_what_can_be_made_again_only(
    bench: Path, tosses: cc.Tosses, ranking: cc.RankedTosses, model: cc.LearnedModel
) -> None:
    throws = cc.design(throws=1, method="prior")
    saves = {
        "mine.json": throws.save,
        "mine.csv": ranking.save,
        "mine.png": ranking.save_figure,
        "motion.png": cc.evaluate(model, tosses).save_figure,
        "mine.safetensors": model.save,
    }
    for name, save in saves.items():
        with pytest.raises(InvalidValueError, match=r"path: found session.mcap, expected a file ending in"):
            save("session.mcap", overwrite=True)
        Path(name).write_text("notes")
        with pytest.raises(InvalidValueError, match=r"path: found a file at .*, expected a new name, or overwrite=True"):
            save(name)
        assert Path(name).read_text() == "notes"
        save(name, overwrite=True)
        if save != model.save:
            save(name)  # in place of an earlier one
    Path("other.provenance.json").write_text("{}")
    with pytest.raises(InvalidValueError, match=r"found a file at other.provenance.json"):
        ranking.save("other.csv")


@pytest.mark.parametrize(
    ("spec", "text"), [(3, "3"), (np.int64(4), "4"), ([3, 7, 8], "3,7-8"), (range(4), "0-3"), (0.3, "0.3")]
)
def test_held_out_tosses_may_be_numbers_or_a_share(tosses: cc.Tosses, spec: Any, text: str) -> None:
    by_number, by_text = (cc.rank(tosses, 3, criterion="longest", held_out=one) for one in (spec, text))
    assert by_number.outcomes == by_text.outcomes
    assert "held out" in by_number.outcomes


def test_numbers_of_numpy_are_accepted_and_saved(tosses: cc.Tosses, tmp_path: Path) -> None:
    found = ANY.rank(tosses, np.int64(3), criterion="random", seed=np.int64(4))
    found.save(tmp_path / "m.json")
    assert read_manifest(tmp_path / "m.json").run.seed == 4


def test_a_ranking_is_a_table_and_a_figure(ranking: cc.RankedTosses, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    table = ranking.to_arrow()
    assert (table.num_rows, "toss_id" in table.column_names) == (24, True)
    assert "<table>" in ranking._repr_html_()
    ranking.plot().savefig(tmp_path / "mine.png")
    assert (tmp_path / "mine.png").stat().st_size > 10_000
    monkeypatch.setattr(ranked, "find_spec", lambda name: None)
    with pytest.raises(MissingDependencyError, match="pip install pandas"):
        ranking.to_pandas()


def test_a_ranking_is_pickled_and_copied(ranking: cc.RankedTosses) -> None:
    for again in (pickle.loads(pickle.dumps(ranking)), copy.deepcopy(ranking)):
        assert again.manifest == ranking.manifest
        assert [toss.digest() for toss in again.selected] == [toss.digest() for toss in ranking.selected]
        assert again.plot().axes


def test_tosses_of_no_recording_are_ranked(tosses: cc.Tosses, body: cc.Body, ranking: cc.RankedTosses) -> None:
    live = cc.Tosses.of(list(reversed(tosses.accepted)), body)
    assert cc.rank(live, top=8).ids == ranking.ids
    assert cc.Tosses.of(iter(tosses.accepted), body).ids == tosses.ids
    with pytest.raises(InvalidValueError, match="twice"):
        cc.Tosses.of([tosses.accepted[0]] * 2, body)


@pytest.mark.parametrize(
    "call",
    [
        lambda tosses: ANY.rank(tosses, criterion="luck"),
        lambda tosses: ANY.rank(tosses, top=0),
        lambda tosses: ANY.rank(tosses, estimator="guess"),
        lambda tosses: ANY.rank(tosses, held_out="900-901"),
        lambda tosses: ANY.train(tosses, "sphere"),
        lambda tosses: ANY.train(tosses, protocol="luck"),
        lambda tosses: ANY.design(method="luck"),
        lambda tosses: ANY.read("session.mcap", body={}),
        lambda tosses: ANY.read("session.mcap", body=""),
        lambda tosses: ANY.read("session.mcap", jobs=-1),
        lambda tosses: ANY.check([]),
        lambda tosses: ANY.check("session.mcap", most_messages=-1),
        *(lambda tosses, top=top: ANY.rank(tosses, top=top) for top in (2.5, "8", None, True)),
        lambda tosses: ANY.rank(tosses, seed=1.5),
        lambda tosses: ANY.rank(tosses, criterion=None),
        lambda tosses: ANY.rank(tosses, model=3),
        *(
            lambda tosses, spec=spec: ANY.rank(tosses, held_out=spec)
            for spec in (True, -1, 1.5, [], ["a"], Path("none"), b"0-3", np.array(1))
        ),
        lambda tosses: ANY.train(tosses, steps=1.5),
        lambda tosses: ANY.train(tosses, protocol="exact", steps=1),
        lambda tosses: ANY.train(tosses, steps=1, seed=-1),
        lambda tosses: ANY.train(tosses, start=3),
        *(lambda tosses, count=count: ANY.design(throws=count) for count in (0, 1.5, "2")),
        lambda tosses: ANY.design(seed=-1),
        lambda tosses: ANY.design(known="session.mcap"),
        *(lambda tosses, some=some: ANY.rank(some(tosses)) for some in (lambda _: None, lambda given: given.accepted)),
        lambda tosses: ANY.score(ANY.rank(tosses)),
        lambda tosses: ANY.train(list(tosses.accepted)),
        *(lambda tosses, inputs=inputs: ANY.read(inputs) for inputs in (5, np.zeros((2, 2)), "a\0")),
        lambda tosses: ANY.Tosses.of([1], tosses.body),
        lambda tosses: ANY.Tosses.of(tosses, "none.yaml"),
        *(lambda tosses, body=body: ANY.write_body("b.xml", body) for body in ("cube.yaml", None)),
        *(lambda tosses, e=e: ANY.write_body("b.xml", tosses.body, restitution=e) for e in ("high", -0.1, 1.1, np.nan)),
        lambda tosses: ANY.write_poses(None, [0.0], np.zeros((1, 3)), [[1.0, 0.0, 0.0, 0.0]], tosses.body),
        lambda tosses: ANY.rank(tosses).save("a" * 400 + ".json"),
        *(lambda tosses, read=read: read(None) for read in (cc.Body.from_file, cc.Body.from_mapping, cc.load_model)),
        lambda tosses: ANY.read("session.mcap", config=[]),
        *(
            lambda tosses, path=path, value=value: ANY.read("session.mcap", config={path: value})
            for path, value in (
                ("gates.dpth", 0.01),
                ("gates.depth", -1.0),
                ("gates.depth", "deep"),
                ("rig.normal", "up"),
                ("poses.topic", 5),
                ("poses.rectified", "false"),
                ("poses.tags.corner_order", "clockwise"),
                ("gates.depth", 10**400),
                (5, 1),
            )
        ),
        lambda tosses: ANY.rank(tosses, device=None),
        lambda tosses: ANY.rank("session.mcap", index=5),
        lambda tosses: ANY.train(tosses, shape_known_to="1 mm"),
        lambda tosses: ANY.train(tosses, restitution="no"),
        lambda tosses: ANY.design(arm="no"),
        *(
            lambda tosses, path=path, overwrite=overwrite: ANY.rank(tosses).save(path, overwrite=overwrite)
            for path, overwrite in (("none.json", "no"), (None, True), (3, False))
        ),
        lambda tosses: tosses.only(["cube-0"]),
        lambda tosses: ANY.load_model("none.safetensors"),
        lambda tosses: ANY.Body.from_file("none.yaml"),
    ],
)
def test_what_is_not_accepted_is_an_error_of_ours(tosses: cc.Tosses, call: Any) -> None:
    with pytest.raises(ContactCurationError, match=r"^.+$"):
        call(tosses)


@pytest.mark.slow
def test_what_is_meant_is_accepted(golden_bag: Path, tosses: cc.Tosses, tmp_path: Path) -> None:
    assert ANY.score(tosses, device=torch.device("cpu")).version == cc.score(tosses).version
    assert ANY.read(golden_bag, progress=None).ids == tosses.ids
    assert cc.check(golden_bag, tosses.body, most_messages=10**20).ok
    ANY.rank(tosses).save(tmp_path / "m.json", overwrite=np.True_)
    cc.write_body(tmp_path / "cube.yaml", tosses.body)
    assert cc.Tosses.of(tosses, tmp_path / "cube.yaml").ids == tosses.ids


@pytest.mark.slow
def test_each_toss_counts_once(tosses: cc.Tosses) -> None:
    first, second = tosses.ids[:2]
    assert tosses.only(toss_id for toss_id in (second, first, second)).ids == (second, first)
    assert len(tosses.only([first] * 3)) == len(tosses.only([first] * 3).accepted) == 1
    assert cc.design(known=[tosses.by_id[first]] * 2, throws=1, method="prior").known == 1


def test_a_result_is_not_changed_by_what_it_hands_out(tosses: cc.Tosses) -> None:
    ranking, info = cc.rank(tosses, 4), cc.score(tosses)
    document = ranking.document()
    before = json.dumps(document, allow_nan=False)
    assert document["influence_bound"] is None  # not inf, as the command has it
    document["outcomes"].clear()
    document["rejected"][0]["reasons"].clear()
    ranking.outcomes.clear()
    assert json.dumps(ranking.document()) == before
    assert not hasattr(tosses.by_id, "clear")
    for array in (info.scores, info.factors[0], info.losses[0]):
        assert not array.flags.writeable


@pytest.mark.parametrize("more", [-1, 0, 1.5])
def test_how_many_more_throws_is_a_whole_number_from_one_on(tosses: cc.Tosses, model: cc.LearnedModel, more: Any) -> None:
    with pytest.raises(InvalidValueError, match=r"more: found .*, expected a whole number of at least 1"):
        cc.evaluate(model, tosses, more=more)


def test_a_message_about_held_out_tosses_names_the_parameter(tosses: cc.Tosses) -> None:
    with pytest.raises(InvalidValueError, match=r"^held_out: found '20%', expected numbers"):
        cc.rank(tosses, held_out="20%")
    with pytest.raises(InvalidValueError, match=r"^held_out: found numbers 900-901, expected some of the 21"):
        cc.train(tosses, held_out="900-901", steps=1)
