"""`rank`: the ranking of the library, every toss in the manifest, the same result however it was computed."""

import json
import shutil
import subprocess
import sys
from itertools import cycle
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.parameter_form import Form
from contact_curation.information.curation import curate
from contact_curation.information.ranker import RankingConfig, criterion_names
from contact_curation.information.record import TossInformation
from contact_curation.information.scoring import Scorer, ScoringConfig
from contact_curation.motion.segmenter_config import SegmenterConfig
from contact_curation.motion.toss import Rejected, Toss
from contact_curation.storage.bags.writer import BagWriter
from contact_curation.storage.datasets.tagslam_bag import TagslamRig, record
from contact_curation.storage.inputs.inputs import open_inputs
from contact_curation.storage.manifest.file import read_manifest
from test.cli.commands import Cli, write_parameters
from test.simulated import simulated_tosses
from test.storage.inputs.test_inputs import cut_short, mcap_file

FAULTS = {"displacement beside the velocity", "gap", "lowest corner of the toss"}


def ids(report: Any) -> list[str]:
    return [row["toss_id"] for row in report["tosses"] if row["rank"] is not None]


def test_it_is_the_ranking_of_the_library_and_the_faulty_tosses_are_rejected(cli: Cli, golden: Path) -> None:
    report = cli("rank", golden, "--top", "8", "--json").json
    items = list(open_inputs([golden], CONTACTNETS_CUBE))
    scorer = Scorer(ContactGeometry.of_body(CONTACTNETS_CUBE), CONTACTNETS_CUBE, ScoringConfig(form=Form.RIGID))
    infos = scorer.score([item for item in items if isinstance(item, Toss)])
    expected = curate([one for one in infos if isinstance(one, TossInformation)], RankingConfig(top=8))
    assert ids(report) == list(expected.ranking.ids)
    assert [row["score"] for row in report["tosses"][:21]] == [entry.score for entry in expected.ranking.entries]
    rejected = {row["toss_id"]: row["reasons"] for row in report["tosses"] if row["rejected"]}
    assert rejected == {item.toss.toss_id: list(item.reasons) for item in items if isinstance(item, Rejected)}
    assert {reasons[0].partition(":")[0] for reasons in rejected.values()} == FAULTS
    assert report["outcomes"] == {"selected": 8, "not selected": 13, **dict.fromkeys(sorted(FAULTS), 1)}
    assert report["diagnostics"]["epsilon"] == expected.epsilon
    assert report["diagnostics"]["sufficient_k"] == expected.sufficient_k
    assert report["diagnostics"]["optimum_shift"] == expected.optimum_shift.to_mapping()
    assert report["diagnostics"]["certificate"] is None
    proven = cli("rank", golden, "--top", "8", "--criterion", "log-det", "--json").json["diagnostics"]
    assert 0.0 < proven["certificate"]["subset"] <= 1.0
    assert report["diagnostics"]["optimum_shift"]["distance"] < proven["optimum_shift"]["distance"]


def test_tosses_that_come_again_with_other_stamps_are_told_of(cli: Cli, tmp_path: Path) -> None:
    for name, later in (("a", 0), ("b", 3_600)):
        rig = TagslamRig(rules=SegmenterConfig(), epoch_ns=(1_600_000_000 + later) * 10**9)
        with BagWriter(tmp_path / f"{name}.mcap") as bag:
            record(bag, CONTACTNETS_CUBE, simulated_tosses(3, 1), rig)
    alone, both = cli("rank", tmp_path / "a.mcap"), cli("rank", tmp_path / "a.mcap", tmp_path / "b.mcap")
    assert "count twice" not in alone.err
    assert "3 tosses are copies under another id" in both.err


@pytest.mark.parametrize("ending", ["parquet", "csv", "json"])
def test_the_manifest_says_what_the_report_says_and_a_figure_lies_beside_it(
    cli: Cli, golden: Path, tmp_path: Path, ending: str
) -> None:
    out = tmp_path / f"manifest.{ending}"
    report = cli("rank", golden, "--top", "5", "--out", out, "--json").json
    manifest = read_manifest(out)
    assert [row.toss_id for row in manifest.rows] == [row["toss_id"] for row in report["tosses"]]
    assert [row.toss_id for row in manifest.selected] == ids(report)[:5]
    assert manifest.run.command[:2] == ("contact-curation", "rank")
    assert (manifest.run.criterion, manifest.run.estimator, manifest.run.model) == (
        "representative",
        "gauss-newton",
        "polytope",
    )
    assert manifest.run.inputs[0].sha256 == manifest.rows[0].input_sha256 != ""
    assert manifest.rows[0].topic == "/tagslam/odom/body_cube"
    assert all(row.frames > 0 and row.duration > 0.0 and row.first_stamp_ns < row.last_stamp_ns for row in manifest.rows)
    assert report["figure"] == str(tmp_path / "manifest.png")
    assert (tmp_path / "manifest.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.slow
def test_the_figure_goes_where_it_is_wanted_or_nowhere(cli: Cli, golden: Path, tmp_path: Path) -> None:
    cli("rank", golden, "--out", tmp_path / "a.csv", "--no-figure")
    assert {path.name for path in tmp_path.iterdir()} == {"a.csv", "a.provenance.json"}
    cli("rank", golden, "--figure", tmp_path / "b.png")
    assert {path.name for path in tmp_path.iterdir()} == {"a.csv", "a.provenance.json", "b.png"}


def test_people_get_a_table_totals_and_evidence(cli: Cli, golden: Path, tmp_path: Path) -> None:
    done = cli("rank", golden, "--top", "8", "--out", tmp_path / "m.csv", "--no-figure")
    best = read_manifest(tmp_path / "m.csv").rows[0]
    table = done.out.splitlines()
    assert table[0].split() == ["rank", "toss", "file", "time", "(UTC)", "lasts", "[s]", "info", "[%]", "gain", "why"]
    assert table[1].split()[:4] == ["1", best.toss_id, golden.name, "12:27:17"]
    assert "selected: expected error ×" in table[1]
    assert "rejected: lowest corner of the toss: found -12.1 mm" in done.out
    assert "and 11 more ranked: --out FILE or --json lists all" in table
    for said in (
        "24 tosses of 1 input: 21 ranked by representative, 8 selected, which hold ",
        "rejected: 1 (gap)",
        "epsilon",
        "D-efficiency",
        "the estimate from the selected tosses is",
        "share of the trace: vertices_normal",
        f"manifest: {tmp_path / 'm.csv'}",
    ):
        assert said in done.out
    assert "careful: block tilt holds" not in done.out  # no trace ranks here
    assert "certificate" not in done.out
    assert "nan" not in done.out
    assert "warning" not in done.err
    assert "certificate: D-efficiency at least" in cli("rank", golden, "--top", "8", "--criterion", "log-det").out


def test_recordings_of_one_name_are_told_apart_in_the_table(cli: Cli, tmp_path: Path) -> None:
    bags = [tmp_path / folder / "session.mcap" for folder in ("monday", "tuesday")]
    for day, (bag, toss) in enumerate(zip(bags, simulated_tosses(2, 1), strict=True)):
        bag.parent.mkdir()
        rig = TagslamRig(rules=SegmenterConfig(), epoch_ns=(1_600_000_000 + 86_400 * day) * 10**9)
        with BagWriter(bag) as writer:
            record(writer, CONTACTNETS_CUBE, [toss], rig)
    table = cli("rank", *bags).out.splitlines()
    assert {row.split()[2] for row in table[1:3]} == {str(bag) for bag in bags}


@pytest.mark.parametrize(("shortest", "said"), [(0.3, False), (0.74, True)])
def test_where_most_tosses_are_rejected_the_command_is_named_that_says_why(
    shortest: float, said: bool, cli: Cli, golden: Path
) -> None:
    out = cli("rank", golden, "--no-figure", "--held-out", "12-23", "--set", f"segmenter.shortest={shortest}").out
    assert ("tosses cannot be used: `contact-curation check` says why" in out) is said


@pytest.mark.parametrize(("criterion", "estimator"), list(zip(criterion_names(), cycle(["empirical", "gauss-newton"]))))
def test_every_criterion_and_estimator_ranks_every_sound_toss(cli: Cli, golden: Path, criterion: str, estimator: str) -> None:
    report = cli("rank", golden, "--criterion", criterion, "--estimator", estimator, "--top", "4", "--json").json
    assert len(ids(report)) == len(set(ids(report))) == 21
    assert (report["criterion"], report["estimator"]) == (criterion, estimator)
    assert [row["selected"] for row in report["tosses"]] == [True] * 4 + [False] * 20
    if criterion == "longest":
        durations = [row["duration"] for row in report["tosses"][:21]]
        assert durations == sorted(durations, reverse=True)
    if criterion == "trace":
        traces = [row["trace"] for row in report["tosses"][:21]]
        assert traces == sorted(traces, reverse=True)


@pytest.mark.slow
def test_the_seed_decides_the_random_ranking(cli: Cli, golden: Path) -> None:
    first, again, other = (ids(cli("rank", golden, "--criterion", "random", "--seed", s, "--json").json) for s in (1, 1, 2))
    assert first == again != other


def test_without_the_gate_a_faulty_toss_is_scored_and_motions_without_rest_are_still_no_tosses(cli: Cli, golden: Path) -> None:
    report = cli("rank", golden, "--no-gate", "--json").json
    assert len(ids(report)) == 22
    assert {row["reasons"][0].partition(":")[0] for row in report["tosses"] if row["rejected"]} == FAULTS - {
        "displacement beside the velocity"
    }


@pytest.mark.slow
def test_a_bound_on_influence_is_a_quantile_of_the_pools_losses(cli: Cli, golden: Path, tmp_path: Path) -> None:
    plain = cli("rank", golden, "--estimator", "empirical", "--json").json
    bounded = cli("rank", golden, "--estimator", "empirical", "--bound-influence", "--json").json
    items = [item for item in open_inputs([golden], CONTACTNETS_CUBE) if isinstance(item, Toss)]
    losses = Scorer(ContactGeometry.of_body(CONTACTNETS_CUBE), CONTACTNETS_CUBE, ScoringConfig(form=Form.RIGID)).losses(items)
    copy = shutil.copy(golden, tmp_path / "copy.mcap")
    repeated = cli("rank", golden, copy, "--estimator", "empirical", "--bound-influence", "--json").json
    assert repeated["influence_bound"] == bounded["influence_bound"]
    assert plain["influence_bound"] is None
    assert bounded["influence_bound"] == pytest.approx(np.quantile(np.concatenate(losses), 0.985), rel=1e-12)
    traces = [{row["toss_id"]: row["trace"] for row in report["tosses"] if row["trace"]} for report in (plain, bounded)]
    assert sum(traces[1].values()) < 0.95 * sum(traces[0].values())
    given = cli("rank", golden, "--estimator", "empirical", "--influence-bound", bounded["influence_bound"], "--json").json
    assert given["tosses"] == bounded["tosses"]


@pytest.fixture
def two_inputs(contactnets_folder: Path, tmp_path: Path) -> list[Path]:
    """Six real tosses in two folders."""
    folders = [tmp_path / "one", tmp_path / "two"]
    for place, folder in enumerate(folders):
        folder.mkdir()
        for number in range(3 * place, 3 * place + 3):
            (folder / f"{number}.pt").symlink_to(contactnets_folder / f"{number}.pt")
    return folders


@pytest.mark.slow
def test_processes_change_nothing(golden: Path, two_inputs: list[Path]) -> None:
    # From the door on: the BLAS sums in another order with more threads, and those of this process are started already.
    command = [sys.executable, "-m", "contact_curation.cli.main", "rank", *map(str, [golden, *two_inputs])]
    command += ["--bound-influence", "--json", "--held-out", "1,5"]
    alone, together = (
        subprocess.run([*command, "--jobs", jobs], capture_output=True, check=True).stdout for jobs in ("1", "3")
    )
    assert alone == together
    assert len(ids(json.loads(alone))) == 24
    assert json.loads(alone)["outcomes"]["held out"] == 3  # the fourth of that number, a golden one, fails a gate


def test_the_order_of_the_inputs_does_not_matter_to_the_ranking(cli: Cli, golden: Path, two_inputs: list[Path]) -> None:
    there = cli("rank", golden, *two_inputs, "--jobs", "1", "--json").json
    back = cli("rank", *reversed([golden, *two_inputs]), "--jobs", "1", "--json").json
    assert ids(there) == ids(back)


@pytest.mark.slow
def test_a_toss_that_comes_twice_is_ranked_once_and_said(cli: Cli, golden: Path, tmp_path: Path) -> None:
    copy = tmp_path / "copy.mcap"
    copy.write_bytes(golden.read_bytes())
    for inputs in ([golden, copy], [golden, golden]):
        done = cli("rank", *inputs, "--jobs", "1", "--json")
        assert done.status == 0
        assert ids(done.json) == ids(cli("rank", golden, "--json").json)
        assert sum("found the same one in" in line for line in done.json["warnings"]) == 24
        assert len(done.err_lines) == 2  # the other one says that the cube is assumed
        assert "24 tosses are left out, the first one cube-1600000001810810811-d0afcda0: found the same one in" in done.err
        assert len(done.json["warnings"]) == 24


@pytest.fixture(scope="module")
def cut_and_whole(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """A recording of two throws that ends during the second, and the same one whole."""
    folder = tmp_path_factory.mktemp("cut")
    return [cut_short(folder), mcap_file(folder)]


@pytest.mark.parametrize("jobs", [1, pytest.param(2, marks=pytest.mark.slow)])
@pytest.mark.parametrize("bound", [(), ("--bound-influence",)])
def test_a_toss_that_was_cut_short_in_one_recording_is_ranked_whole_from_another(
    cli: Cli, cut_and_whole: list[Path], jobs: int, bound: tuple[str, ...]
) -> None:
    cut, whole = cut_and_whole
    alone = cli("rank", whole, "--json").json
    for inputs in ([cut, whole], [whole, cut]):
        report = cli("rank", *inputs, "--jobs", jobs, *bound, "--json").json
        assert ids(report) == ids(alone)
        assert report["outcomes"] == alone["outcomes"] == {"selected": 2, "not selected": 0}
        assert [row["frames"] for row in report["tosses"]] == [row["frames"] for row in alone["tosses"]]
        assert any(
            line.startswith(f"{cut}: toss ") and f"rejected here and accepted in {whole}" in line for line in report["warnings"]
        )


def test_parameters_of_a_file_take_the_place_of_the_bodys(cli: Cli, golden: Path, tmp_path: Path) -> None:
    true = write_parameters(tmp_path / "true.json")
    other = write_parameters(tmp_path / "other.json", tangents=[[0.3, 0, 0], [0, 0.3, 0]])
    plain, same, slippery = (
        cli("rank", golden, *options, "--json").json for options in ((), ("--params", true), ("--params", other))
    )
    assert plain["tosses"] == same["tosses"]
    assert plain["parameters_version"] == same["parameters_version"] != slippery["parameters_version"]
    assert slippery["parameters"] == str(other)
    assert slippery["tosses"][0]["trace"] != plain["tosses"][0]["trace"]


def test_theta_that_is_not_physical_is_ranked_in_the_57_parameter_form(cli: Cli, golden: Path, tmp_path: Path) -> None:
    tilted = write_parameters(tmp_path / "tilted.json", normal=[0.02, 0.0, 1.01])
    report = cli("rank", golden, "--params", tilted, "--json").json
    assert report["diagnostics"]["form"] == "contactnets"
    assert cli("rank", golden, "--json").json["diagnostics"]["form"] == "rigid"
    refused = cli("rank", golden, "--params", tilted, "--form", "physical")
    assert refused.status == 1
    assert "use the contactnets form" in refused.err


def test_several_thetas_are_averaged_over(cli: Cli, golden: Path, tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    corners = ContactGeometry.of_body(CONTACTNETS_CUBE).vertices_normal
    particles = [
        write_parameters(tmp_path / f"{k}.json", vertices_normal=(corners + 0.1 * rng.normal(size=(8, 3))).tolist())
        for k in range(2)
    ]
    single = [cli("rank", golden, "--params", path, "--top", "6", "--json").json for path in particles]
    both = cli("rank", golden, "--params", particles[0], "--params", particles[1], "--top", "6", "--json").json
    assert both["parameters"] == f"{particles[0]}, {particles[1]}"
    assert both["parameters_version"] == "+".join(report["parameters_version"] for report in single)
    mean = {row["toss_id"]: row["score"] / 2.0 for row in single[0]["tosses"] if row["rank"]}
    for row in single[1]["tosses"]:
        if row["rank"]:
            mean[row["toss_id"]] += row["score"] / 2.0
    assert {row["toss_id"]: row["score"] for row in both["tosses"] if row["rank"]} == pytest.approx(mean)


def test_a_body_of_ones_own_is_ranked_under_its_name(cli: Cli, golden: Path, tmp_path: Path) -> None:
    body = tmp_path / "body.yaml"
    shape = "half_extents: [0.0524, 0.0524, 0.0524]\ninertia: [0.00081, 0.00081, 0.00081]\nlength_scale: 0.0524"
    body.write_text(f"name: cube\nmass: 0.4\nfriction: 0.2\n{shape}\n")
    report = cli("rank", golden, "--body", body, "--json").json
    assert len(ids(report)) == 21
    assert report["parameters_version"] != cli("rank", golden, "--json").json["parameters_version"]


def test_a_setting_reaches_its_stage(cli: Cli, golden: Path) -> None:
    report = cli("rank", golden, "--set", "segmenter.shortest=0.72", "--json").json
    assert any("expected at least 0.72" in reason for row in report["tosses"] for reason in row["reasons"])
    assert cli("rank", golden, "--set", "ranking.top=3", "--json").json["outcomes"]["selected"] == 3


def test_json_is_one_object_and_nothing_else(cli: Cli, golden: Path) -> None:
    done = cli("rank", golden, "--json")
    assert done.out.count("\n") == 1
    assert isinstance(json.loads(done.out), dict)


@pytest.mark.slow
def test_real_tosses_all_pass_the_gates(cli: Cli, contactnets_folder: Path) -> None:
    report = cli("rank", contactnets_folder, "--json").json
    assert report["outcomes"] == {"selected": 32, "not selected": 538}
    assert sum(row["transitions"] for row in report["tosses"]) == 59_383
    assert sum(row["not_scored"] for row in report["tosses"]) == 0


def test_contactnets_is_the_polytope_in_its_published_form(cli: Cli, golden: Path, tmp_path: Path) -> None:
    by_name, by_form = tmp_path / "name.json", tmp_path / "form.json"
    assert cli("rank", golden, "--model", "contactnets", "--top", "4", "--out", by_name, "--no-figure").status == 0
    assert cli("rank", golden, "--form", "contactnets", "--top", "4", "--out", by_form, "--no-figure").status == 0
    one, other = (json.loads(path.read_text()) for path in (by_name, by_form))
    assert one["tosses"] == other["tosses"]
    wrong = cli("rank", golden, "--model", "contactnets", "--form", "physical")
    assert (wrong.status, "--form: found physical, expected contactnets or none" in wrong.err) == (1, True)
