"""`rank --model deep|deepvertex|end_to_end`: from a checkpoint, by every criterion, or one line why not."""

import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from contact_curation.contact.evaluation import Estimator
from contact_curation.contact.models.registry import model_class
from contact_curation.contact.parameter_form import Form
from contact_curation.information.model_version import model_version
from contact_curation.information.network.scoring import NetworkScorer
from contact_curation.information.ranker import criterion_names
from contact_curation.information.record import TossInformation
from contact_curation.information.scoring import ScoringConfig
from contact_curation.motion.toss import Toss
from contact_curation.storage.checkpoint_file import save_model
from contact_curation.storage.inputs.inputs import open_inputs
from test.cli.commands import Cli, write_parameters
from test.contact.cases import CUBE
from test.information.network_cases import NETWORKS, network, rows_of, tosses
from test.storage.inputs.test_inputs import mcap_file


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two tosses in a.mcap, and a checkpoint of every model."""
    made = tmp_path_factory.mktemp("networks")
    mcap_file(made)
    for kind in NETWORKS:
        save_model(made / f"{kind}.safetensors", network(kind))
    polytope = model_class("polytope").initial(CUBE, Form.PHYSICAL, rows_of(tosses()), np.random.default_rng(7))
    save_model(made / "polytope.safetensors", polytope)
    return made


@pytest.fixture(autouse=True)
def one_processor(monkeypatch: pytest.MonkeyPatch) -> None:
    """Torch's threads wait for each other on busy cores."""
    monkeypatch.setattr("os.cpu_count", lambda: 1)


def ranked(cli: Cli, folder: Path, kind: str, *words: object) -> Any:
    """The report of a ranking."""
    params = folder / f"{kind}.safetensors"
    done = cli("rank", folder / "a.mcap", "--model", kind, "--params", params, "--no-figure", "--json", *words)
    assert done.status == 0, done.err
    return done.json


@pytest.mark.slow
@pytest.mark.parametrize("criterion", criterion_names())
def test_every_criterion_ranks_for_a_deep_model(cli: Cli, folder: Path, criterion: str) -> None:
    report = ranked(cli, folder, "deep", "--criterion", criterion, "--estimator", "empirical", "--top", 1)
    assert [row["rank"] for row in report["tosses"]] == [1, 2]
    assert (report["criterion"], report["model"]) == (criterion, "deep")
    assert report["parameters_version"] == model_version(network("deep"))
    assert set(report["diagnostics"]["block_shares"]) >= {"friction", "normal_network", "tangent_network"}


@pytest.mark.parametrize("estimator", list(Estimator))
@pytest.mark.parametrize(
    "kind", [one if one == "deepvertex" else pytest.param(one, marks=pytest.mark.slow) for one in NETWORKS]
)
def test_every_estimator_ranks_for_every_network_as_the_library_does(
    cli: Cli, folder: Path, kind: str, estimator: Estimator
) -> None:
    report = ranked(cli, folder, kind, "--criterion", "trace", "--estimator", estimator.value)
    given = [item for item in open_inputs([folder / "a.mcap"], CUBE) if isinstance(item, Toss)]
    infos = NetworkScorer(network(kind), ScoringConfig(estimator=estimator)).score(given)
    traces = {info.toss_id: info.trace for info in infos if isinstance(info, TossInformation)}
    assert {row["toss_id"]: row["trace"] for row in report["tosses"]} == pytest.approx(traces, rel=1e-12)
    assert report["diagnostics"]["form"] == ("physical" if kind == "deep" else None)
    assert report["diagnostics"]["network"]["draws"] == 6


@pytest.mark.slow
def test_orthogonal_takes_the_exact_scores(cli: Cli, folder: Path) -> None:
    """A sketch of one row and column per layer knows next to nothing, and the lengths of the scores are right all the same."""
    words = ("--criterion", "orthogonal", "--estimator", "empirical")
    rough = ranked(cli, folder, "deepvertex", *words, "--set", "network.sketch.leading=0", "--set", "network.sketch.random=1")
    fine = ranked(cli, folder, "deepvertex", *words)
    assert [row["score"] for row in rough["tosses"]] == pytest.approx([row["score"] for row in fine["tosses"]], rel=1e-12)
    assert rough["diagnostics"]["selected_gram"] == pytest.approx(fine["diagnostics"]["selected_gram"], rel=1e-9)
    assert fine["diagnostics"]["selected_gram"]["largest"] > 0.0


def test_a_bound_from_the_pool_and_several_thetas_and_processes_go_together(cli: Cli, folder: Path) -> None:
    words = ("--criterion", "trace", "--estimator", "empirical", "--bound-influence")
    report = ranked(cli, folder, "deepvertex", "--params", folder / "deepvertex.safetensors", *words)
    assert np.isfinite(report["influence_bound"])
    assert len(report["parameters_version"].split("+")) == 2


def test_the_physical_block_alone_has_no_networks_in_it(cli: Cli, folder: Path) -> None:
    report = ranked(cli, folder, "deep", "--block", "physical")
    expected = {"vertices_normal", "vertices_tangent", "friction", "tilt", "height"}
    assert set(report["diagnostics"]["block_shares"]) == expected
    assert report["diagnostics"]["network"] is None
    assert report["diagnostics"]["dimension"] <= 52


@pytest.mark.slow
def test_tosses_that_are_evaluated_together_are_ranked_alike(cli: Cli, folder: Path) -> None:
    apart, together = (ranked(cli, folder, "deepvertex", "--device-memory", memory) for memory in (0, 500))
    ids, traces = ([[row[name] for row in report["tosses"]] for report in (apart, together)] for name in ("toss_id", "trace"))
    assert ids[1] == ids[0]
    assert traces[1] == pytest.approx(traces[0], rel=1e-6)
    assert together["diagnostics"]["network"] == apart["diagnostics"]["network"]


def test_a_polytope_is_ranked_for_from_its_checkpoint(cli: Cli, folder: Path) -> None:
    report = ranked(cli, folder, "polytope")
    assert (report["model"], report["diagnostics"]["form"], report["diagnostics"]["network"]) == ("polytope", "physical", None)


REFUSED = (
    (("--model", "deep"), "theta of model deep: found none, expected --params CHECKPOINT.safetensors"),
    (("--model", "deep", "--params", "true.json"), "expected a checkpoint, a .safetensors file"),
    (("--model", "deep", "--params", "deepvertex.safetensors"), "found deepvertex, expected deep, or --model deepvertex"),
    (("--params", "deep.safetensors"), "found deep, expected polytope; networks go with `rank --model deep`"),
    (("--model", "deep", "--params", "deep.safetensors", "--form", "physical"), "its checkpoint says which"),
    (("--model", "deepvertex", "--params", "deepvertex.safetensors", "--block", "physical"), "expected deep"),
    (("--model", "end_to_end", "--params", "end_to_end.safetensors", "--block", "physical"), "expected deep"),
    (("--model", "deep", "--params", "deep.safetensors", "--device", "cuda:99"), "device: found cuda:99, expected one of cpu"),
    (("--model", "deep", "--params", "deep.safetensors", "--device", "gpu"), "device: found gpu, expected cpu, cuda or cuda:N"),
    (("--model", "deep", "--params", "missing.safetensors"), "cannot be read: No such file"),
)


@pytest.mark.parametrize(("words", "line"), REFUSED)
def test_what_cannot_be_ranked_for_is_one_line(cli: Cli, folder: Path, words: tuple[str, ...], line: str) -> None:
    write_parameters(folder / "true.json")
    given = [str(folder / word) if word.endswith((".safetensors", ".json")) else word for word in words]
    done = cli("rank", folder / "a.mcap", *given)
    assert (done.status, done.out) == (1, "")
    assert len(done.err_lines) == 1
    assert line in done.err


def test_transitions_are_not_scored_for_a_network_and_it_says_so(cli: Cli, folder: Path) -> None:
    done = cli("score", folder / "a.mcap", "--params", folder / "deep.safetensors", "--out", folder / "s.npz")
    assert done.status == 1
    assert done.err.endswith("found deep, expected polytope; networks go with `rank --model deep`\n")


def test_ranking_for_a_polytope_imports_no_torch(golden: Path) -> None:
    code = (
        "import sys; from contact_curation.cli.main import main; "
        f"status = main(['rank', {str(golden)!r}, '--no-figure', '--held-out', '0']); "
        "assert status == 0 and 'torch' not in sys.modules"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
