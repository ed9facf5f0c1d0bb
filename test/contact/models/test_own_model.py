"""A model of one's own, by the words of CONTRIBUTING.md: its file, its test and a line are all that it takes."""

import re
import shutil
import subprocess
import sys
import types
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
import torch

from contact_curation.contact.evaluation import Estimator
from contact_curation.contact.loss_config import LossConfig
from contact_curation.contact.models import registry
from contact_curation.contact.models.model import Model, Rows
from contact_curation.contact.parameter_form import Form
from contact_curation.information.curation import curate_particles
from contact_curation.information.model_version import model_version
from contact_curation.information.network.model_scorer import scorer_of_model
from contact_curation.information.pool import pool_of
from contact_curation.information.ranker import RankingConfig
from contact_curation.information.record import TossInformation
from contact_curation.information.scoring import ScoringConfig
from contact_curation.learning.checkpoints.stored_model import model_bytes, model_of_bytes
from contact_curation.learning.evaluation.evaluation import EvaluationConfig, evaluate_model
from contact_curation.learning.training.plan import TrainingPlan, begin, resume, stored
from contact_curation.learning.training.protocols import budgeted, published
from contact_curation.learning.training.reranking import RerankingConfig
from contact_curation.motion.transitions import transitions_of
from test.conftest import REPOSITORY
from test.contact.cases import CUBE
from test.simulated import RIG_NOISE, simulated_tosses

ONE_THREAD = LossConfig(threads=1)
TOSSES = simulated_tosses(7, seed=5, noise=RIG_NOISE)


class Example(NamedTuple):
    """What CONTRIBUTING.md says of a model of one's own.

    Attributes:
        own, text: path and text of its file.
        registry, line: the registry's path, and what is written into its table.
        test, its_test: path and text of its test.
        commands: to run with a recording, session.mcap.
    """

    own: str
    text: str
    registry: str
    line: str
    test: str
    its_test: str
    commands: tuple[str, ...]


def example() -> Example:
    section = (REPOSITORY / "CONTRIBUTING.md").read_text(encoding="utf-8").partition("### Add a model\n")[2]
    section = section.partition("\n## ")[0].partition("\n### ")[0]
    steps = re.findall(r"^`([^`]+)`[^\n]*\n\n```python\n(.*?)```", section, re.MULTILINE | re.DOTALL)
    commands = re.findall(r"```sh\n(.*?)```", section, re.DOTALL)[0].splitlines()
    (own, text), (registered, line), (test, its_test) = steps
    return Example(own, text, registered, line, test, its_test, tuple(commands))


@pytest.fixture
def kind(monkeypatch: pytest.MonkeyPatch) -> str:
    """The name of the example's model, known to this process for the length of a test."""
    told = example()
    module = types.ModuleType(told.own.removesuffix(".py").replace("/", "."))
    exec(compile(told.text, told.own, "exec"), vars(module))
    monkeypatch.setitem(sys.modules, module.__name__, module)
    ((name, entry),) = eval(f"{{{told.line.strip()}}}", {"ModelEntry": registry.ModelEntry}).items()
    monkeypatch.setitem(registry.MODELS, name, entry)
    return str(name)


def initial(kind: str) -> Model:
    rows = transitions_of(TOSSES, CUBE.length_scale)
    data = Rows(rows.before, rows.after, rows.dt)
    return registry.model_class(kind).initial(CUBE, Form.PHYSICAL, data, np.random.default_rng(3))


@pytest.mark.parametrize("estimator", list(Estimator))
def test_its_tosses_are_scored_and_ranked(kind: str, estimator: Estimator) -> None:
    model = initial(kind)
    infos = scorer_of_model(model, ScoringConfig(estimator=estimator, loss=ONE_THREAD)).score(TOSSES)
    scored = [info for info in infos if isinstance(info, TossInformation)]
    assert len(scored) == len(TOSSES)
    assert {(info.model, info.parameters_version) for info in scored} == {(kind, model_version(model))}
    assert [block.name for block in scored[0].blocks] == [name for name, _ in model.named_parameters()]
    assert curate_particles([pool_of(scored)], RankingConfig("log-det", top=3)).ranking.ids


def test_its_scores_are_the_slopes_of_its_loss(kind: str) -> None:
    model, toss = initial(kind), TOSSES[0]
    (info,) = scorer_of_model(model, ScoringConfig(estimator=Estimator.EMPIRICAL, loss=ONE_THREAD)).score([toss])
    assert isinstance(info, TossInformation)
    rows = transitions_of([toss], CUBE.length_scale)
    each = []
    for t in range(len(rows.dt)):
        batch = model.batch_loss(Rows(rows.before, rows.after, rows.dt).take([t]), ONE_THREAD)
        assert batch.solved.all()
        slopes = torch.autograd.grad(batch.losses.sum(), list(model.parameters()))
        each.append(-0.5 * torch.cat([slope.flatten() for slope in slopes]).numpy())
    scores = np.array(each)
    np.testing.assert_allclose(info.score_sum, scores.sum(axis=0), rtol=1e-8, atol=1e-8)
    np.testing.assert_allclose(info.block_traces, np.square(scores).sum(axis=0), rtol=1e-8)
    np.testing.assert_allclose(info.fisher(), scores.T @ scores, rtol=1e-5, atol=1e-6 * info.trace)


def test_it_trains_on_its_own_selection_is_stored_evaluated_and_rolled_out(kind: str) -> None:
    protocol = replace(budgeted(kind), steps=60, batch=32, loss=ONE_THREAD)
    selection = RerankingConfig(RankingConfig("representative", top=4, certificate_steps=0))
    plan = TrainingPlan(kind, CUBE, protocol, TOSSES[:5], TOSSES[5:], selection=selection)
    curated = begin(plan)
    before = evaluate_model(curated.training.model, TOSSES[5:], EvaluationConfig(loss=ONE_THREAD))
    curated.advance(30)
    resumed = resume(plan, stored(plan, curated), "memory")
    for one in (curated, resumed):
        one.advance(30)
    trained = curated.training.trained()
    assert model_bytes(resumed.training.trained()) == model_bytes(trained)
    assert model_version(model_of_bytes(model_bytes(trained), "memory", CUBE)) == model_version(trained)
    after = evaluate_model(trained, TOSSES[5:], EvaluationConfig(loss=ONE_THREAD))
    assert after.mean_loss < 0.5 * before.mean_loss
    assert after.errors.finite.all()
    assert trained.roll_out(after.measured[:1], 20, 1.0 / 148.0).finite.all()
    assert published(kind).batch == 1


@pytest.mark.slow
def test_the_example_of_contributing_works_in_a_copy_of_the_package(tmp_path: Path, golden: Path) -> None:
    """Written, registered and used by the command line, by nothing but what CONTRIBUTING.md says."""
    told = example()
    assert len(told.line.splitlines()) == 1
    shutil.copytree(
        REPOSITORY / "contact_curation", tmp_path / "contact_curation", ignore=shutil.ignore_patterns("__pycache__")
    )
    for path, text in ((told.own, told.text), (told.test, told.its_test)):
        assert not (REPOSITORY / path).exists()
        (tmp_path / path).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / path).write_text(text)
    table = tmp_path / told.registry
    head, rest = table.read_text().split("MODELS = {\n")
    table.write_text(f"{head}MODELS = {{\n{told.line}{rest}")
    shutil.copy(golden, tmp_path / "session.mcap")
    for command in told.commands:
        words = command.split()
        start = ["-m", "contact_curation.cli.main"] if words[0] == "contact-curation" else ["-m", words[0]]
        done = subprocess.run(
            [sys.executable, *start, *words[1:]],
            cwd=tmp_path,
            env={"PYTHONPATH": str(tmp_path), "PATH": "/usr/bin:/bin", "HOME": str(tmp_path)},
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, f"{command}\n{done.stdout}\n{done.stderr}"
    assert sorted(path.name for path in tmp_path.glob("*.json")) == ["ranked.json"]
