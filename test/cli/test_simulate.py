"""`simulate`: throws become a bag, and the bag is ranked like any other recording."""

import json
from argparse import Namespace
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from contact_curation.cli.simulate import _digest
from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.design.releases import published_releases
from contact_curation.design.throw import throw_of_state
from contact_curation.storage.datasets.tagslam_bag import made_up_time
from contact_curation.storage.throws_file import write_throws
from test.cli.commands import Cli

STATES = published_releases(4, np.random.default_rng(2))


@pytest.fixture
def throws(tmp_path: Path) -> Path:
    path = tmp_path / "throws.json"
    write_throws(path, [throw_of_state(f"throw-{number}", "cube", state) for number, state in enumerate(STATES)])
    return path


def test_every_throw_is_a_toss_that_passes_the_gates_and_is_ranked(cli: Cli, throws: Path, tmp_path: Path) -> None:
    bag = tmp_path / "thrown.mcap"
    outcome = cli("simulate", throws, "--out", bag)
    assert outcome.status == 0, outcome.err
    assert outcome.out.startswith(f"{bag}: 4 of 4 throws, ")
    ranked = cli("rank", bag, "--no-figure", "--json", "--out", tmp_path / "manifest.json")
    assert ranked.status == 0, ranked.err
    rows = json.loads((tmp_path / "manifest.json").read_text())
    assert "4 tosses of 1 input" in cli("rank", bag, "--no-figure").out
    assert rows


def test_a_toss_in_the_bag_starts_as_the_throw_says(cli: Cli, throws: Path, tmp_path: Path) -> None:
    bag = tmp_path / "thrown.mcap"
    assert cli("simulate", throws, "--out", bag).status == 0
    design = ("design", "--throws", 1, "--known", bag, "--out", tmp_path / "next.json", "--json")
    small = ("design.pool=16", "design.reference=8", "forecast.executions=2", "refinement.generations=0", "safety.share=0.2")
    outcome = cli(*design, *(word for setting in small for word in ("--set", setting)))
    assert outcome.status == 0, outcome.err
    assert outcome.json["known"] == 4


def test_noise_of_executions_repeats_by_its_seed(cli: Cli, throws: Path, tmp_path: Path) -> None:
    said = [
        cli("simulate", throws, "--out", tmp_path / f"{number}.mcap", "--execution-noise", "--seed", seed, "--json").json
        for number, seed in enumerate((1, 1, 2))
    ]
    executed = [[throw["position"] for throw in one["executed"]] for one in said]
    assert executed[0] == executed[1] != executed[2]
    np.testing.assert_allclose(executed[0], STATES[:, :3], atol=0.03)
    alone = cli("simulate", throws, "--out", tmp_path / "alone.mcap", "--set", "noise.speed=0.2")
    assert (alone.status, len(alone.err_lines)) == (1, 1)
    assert "--set noise.*: found no --execution-noise, expected --execution-noise, which it belongs to" in alone.err
    exact = cli("simulate", throws, "--out", tmp_path / "exact.mcap", "--json").json
    assert [throw["position"] for throw in exact["executed"]] == STATES[:, :3].tolist()


def test_a_throw_that_does_not_come_to_rest_is_left_out_and_named(cli: Cli, tmp_path: Path) -> None:
    fast = STATES[0].copy()
    fast[7:10] *= 4.0
    throws = tmp_path / "throws.json"
    write_throws(throws, [throw_of_state("fast", "cube", fast), throw_of_state("slow", "cube", STATES[1])])
    outcome = cli("simulate", throws, "--out", tmp_path / "b.mcap", "--set", "simulation.longest=1.2")
    assert outcome.status == 0
    assert outcome.out.startswith(f"{tmp_path / 'b.mcap'}: 1 of 2 throws")
    assert len(outcome.err_lines) == 2  # the other one says that the cube is assumed
    assert "left out: motion of throw fast: found no rest within 1.2 s" in outcome.err
    short = cli("simulate", throws, "--out", tmp_path / "c.mcap", "--set", "simulation.longest=0.1")
    assert short.status == 1
    assert "found no throw that comes to rest" in short.err
    assert not (tmp_path / "c.mcap").exists()


def test_throws_of_another_body_and_files_without_throws_are_one_line(cli: Cli, tmp_path: Path) -> None:
    path = tmp_path / "brick.json"
    write_throws(path, [throw_of_state("a", "brick", STATES[0])])
    outcome = cli("simulate", path, "--out", tmp_path / "b.mcap")
    assert outcome.status == 1
    assert "body of throw a: found brick, expected cube; see --body" in outcome.err
    path.write_text("{}")
    outcome = cli("simulate", path, "--out", tmp_path / "b.mcap")
    assert (outcome.status, len(outcome.err_lines)) == (1, 1)
    assert "holds no throws" in outcome.err


def test_bags_of_other_throws_have_tosses_of_other_ids(cli: Cli, throws: Path, tmp_path: Path) -> None:
    others = tmp_path / "others.json"
    write_throws(others, [throw_of_state("throw-0", "cube", STATES[0]), throw_of_state("throw-1", "cube", STATES[2])])
    ids = []
    for number, file in enumerate((throws, others, others)):
        assert cli("simulate", file, "--out", tmp_path / f"{number}.mcap").status == 0
        manifest = tmp_path / f"{number}.json"
        assert cli("rank", tmp_path / f"{number}.mcap", "--no-figure", "--out", manifest).status == 0
        ids.append({row["toss_id"] for row in json.loads(manifest.read_text())["tosses"]})
    assert not ids[0] & ids[1]
    assert ids[1] == ids[2]


def test_thousands_of_bags_have_tosses_of_other_ids() -> None:
    """Bags that begin at the same time would lose tosses when they are ranked together."""
    throws = [throw_of_state("throw-0", "cube", STATES[0])]
    slippery = replace(CONTACTNETS_CUBE, friction=0.1)
    said = [
        (body, Namespace(execution_noise=True, seed=seed, settings=[]))
        for body in (CONTACTNETS_CUBE, slippery)
        for seed in range(2000)
    ]
    assert len({made_up_time(_digest(body, throws, arguments)) for body, arguments in said}) == len(said)
