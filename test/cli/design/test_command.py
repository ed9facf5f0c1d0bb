"""`design`: throws on disk, the same for the same seed, and what is expected of them."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from contact_curation.cli import progress
from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.models.polytope import PolytopeModel
from contact_curation.contact.parameter_form import Form
from contact_curation.information.scoring import parameters_version
from contact_curation.simulation.arm.feasibility import feasible
from contact_curation.storage.bags.reader import BagReader
from contact_curation.storage.bags.writer import BagWriter
from contact_curation.storage.checkpoint_file import save_model
from contact_curation.storage.throws_file import read_throws
from test.cli.commands import Cli, Outcome, write_parameters
from test.storage.inputs.test_inputs import mcap_file

SMALL = ("design.pool=16", "design.reference=8", "forecast.executions=2", "refinement.generations=1", "safety.motions=20")
SETTINGS = [word for setting in (*SMALL, "safety.share=0.1", "loss.threads=1") for word in ("--set", setting)]


def design(cli: Cli, out: Path, *words: object) -> Outcome:
    return cli("design", "--out", out, "--throws", 2, *SETTINGS, *words)


def test_throws_are_written_and_a_table_says_what_is_expected_of_them(cli: Cli, tmp_path: Path) -> None:
    outcome = design(cli, tmp_path / "throws.json")
    assert outcome.status == 0, outcome.err
    throws = read_throws(tmp_path / "throws.json")
    assert [throw.throw_id for throw in throws] == ["throw-0-0", "throw-0-1"]
    lines = outcome.out.splitlines()
    assert lines[0].split() == ["throw", "gain", "height", "speed", "spin"]
    assert lines[2].split()[:2] == ["throw-0-0", f"{throws[0].expected_information:.2f}"]
    assert "2 throws" in lines[-1]
    assert throws[0].expected_information > throws[1].expected_information > 0.0
    described = ContactGeometry.of_body(CONTACTNETS_CUBE).rigid()
    assert throws[0].parameters_version == parameters_version(described, CONTACTNETS_CUBE)


def test_progress_counts_the_simulated_throws_of_all_that_there_will_be(
    cli: Cli, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(progress, "SECONDS_BETWEEN_LINES", 0.0)
    lines = [line for line in design(cli, tmp_path / "throws.json").err_lines if line.startswith("designing: ")]
    counts = [
        re.fullmatch(r"designing: (\d+) of (\d+) simulated throws, .* simulated throws/s, .* left", line) for line in lines
    ]
    assert all(counts)
    done = [int(one[1]) for one in counts if one]
    total = (8 + 16) * 2 + 16 * 2 + 2 * 1 * 12 * 4 + 2 * 32  # reference and finalists, sieve, search, what is stated
    assert {int(one[2]) for one in counts if one} == {total}
    assert done == sorted(done)
    assert 0.5 * total <= done[-1] <= 1.1 * total  # of the releases that are refused early nothing more is simulated


def test_the_same_seed_gives_the_same_bytes_and_another_other_throws(cli: Cli, tmp_path: Path) -> None:
    paths = [tmp_path / f"{number}.json" for number in range(3)]
    for path, seed in zip(paths, (1, 1, 2)):
        assert design(cli, path, "--seed", seed).status == 0
    one, other, third = (path.read_bytes() for path in paths)
    assert one == other != third


def test_json_says_the_same_as_the_file(cli: Cli, tmp_path: Path) -> None:
    outcome = design(cli, tmp_path / "throws.json", "--json")
    said: dict[str, Any] = outcome.json
    assert said["throws"] == [throw.to_mapping() for throw in read_throws(tmp_path / "throws.json")]
    assert said["expected_information"] == pytest.approx(sum(throw["expected_information"] for throw in said["throws"]))
    assert (said["pool"], said["known"], said["seed"]) == (16, 0, 0)


def test_known_tosses_leave_less_to_gain_and_give_the_prior(
    cli: Cli, tmp_path: Path, golden: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(progress, "SECONDS_BETWEEN_LINES", 0.0)
    bare = design(cli, tmp_path / "bare.json", "--json").json
    outcome = design(cli, tmp_path / "informed.json", "--known", golden, "--prior", golden, "--json")
    assert outcome.json["known"] == 21
    assert outcome.json["expected_information"] < 0.5 * bare["expected_information"]
    assert [line for line in outcome.err_lines if line.startswith("reading: 21 tosses")]  # reading is shown, too


def test_known_tosses_are_read_where_the_user_says_that_the_poses_are(cli: Cli, tmp_path: Path, golden: Path) -> None:
    bag = tmp_path / "two.mcap"
    with BagReader(golden) as reader, BagWriter(bag) as writer:
        for message in reader.messages():
            for topic in ("/mine", "/theirs") if message.topic.startswith("/tagslam") else (message.topic,):
                writer.write(topic, message.message, message.log_time_ns, latched=message.topic == "/tf_static")
    lost = design(cli, tmp_path / "throws.json", "--known", bag)
    assert (lost.status, len(lost.err_lines)) == (1, 1)
    assert "name it (`topic`) if there are several" in lost.err
    assert design(cli, tmp_path / "throws.json", "--known", bag, "--topic", "/mine", "--json").json["known"] == 21


def test_json_alone_is_on_standard_output_also_where_there_are_warnings(cli: Cli, tmp_path: Path, golden: Path) -> None:
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(golden.read_bytes()[: golden.stat().st_size // 2])
    said = design(cli, tmp_path / "throws.json", "--known", cut, "--json")
    assert said.err_lines[:-1] == [f"contact-curation: warning: {line}" for line in said.json["warnings"]]
    assert said.json["warnings"][0].startswith(f"{cut}: cut short at byte ")


def test_of_known_tosses_a_manifest_chooses(cli: Cli, tmp_path: Path, golden: Path) -> None:
    manifest = tmp_path / "kept.json"
    assert cli("rank", golden, "--top", 3, "--no-figure", "--out", manifest).status == 0
    said = design(cli, tmp_path / "throws.json", "--known", golden, "--manifest", manifest, "--json").json
    assert said["known"] == 3
    absent = design(cli, tmp_path / "throws.json", "--known", mcap_file(tmp_path), "--manifest", manifest, "--overwrite")
    assert f"inputs: found 3 of 3 selected tosses of {manifest} not in them" in absent.err
    assert f"expected the recordings that were ranked ({golden})" in absent.err


def test_known_tosses_may_be_given_by_a_pattern(cli: Cli, tmp_path: Path, golden: Path) -> None:
    for name in ("a.mcap", "b.mcap"):
        (tmp_path / name).symlink_to(golden)
    said = design(cli, tmp_path / "throws.json", "--known", tmp_path / "*.mcap", "--prior", tmp_path / "b*.mcap", "--json")
    assert said.status == 0, said.err
    assert said.json["known"] == 21


def test_checkpoints_and_json_files_are_particles_that_gains_are_averaged_over(cli: Cli, tmp_path: Path) -> None:
    parameters = write_parameters(tmp_path / "true.json")
    checkpoint = tmp_path / "model.safetensors"
    rough = ContactGeometry.of_body(CONTACTNETS_CUBE)
    save_model(checkpoint, PolytopeModel(rough, CONTACTNETS_CUBE, Form.PHYSICAL))
    outcome = design(cli, tmp_path / "throws.json", "--params", parameters, "--checkpoint", checkpoint)
    assert outcome.status == 0, outcome.err
    versions = {throw.parameters_version for throw in read_throws(tmp_path / "throws.json")}
    assert len(versions) == 1
    assert len(versions.pop().split("+")) == 2


@pytest.mark.parametrize("words", [("--baseline", "paper"), ("--baseline", "prior"), ("--exploration-throws",)])
def test_other_ways_to_choose_throws_expect_less(cli: Cli, tmp_path: Path, words: tuple[str, ...]) -> None:
    designed = design(cli, tmp_path / "designed.json", "--json").json["expected_information"]
    other = design(cli, tmp_path / "other.json", *words, "--json").json
    assert 0.0 < other["expected_information"] < designed
    speeds = [np.linalg.norm(throw["linear_velocity"]) for throw in other["throws"]]
    assert max(speeds) < 1.4


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (("--set", "safety.board_half_width=0.00001"), "releases that may be thrown: found 0 of 16"),
        (("--set", "safety.largest_speed=0.1"), "safe releases: found 0 of "),
        (("--set", "forecast.executions=3"), "forecast.executions: found 3, expected an even number"),
        (("--params", "nowhere.json"), "nowhere.json: cannot be read"),
        (("--known", "nowhere.mcap"), "nowhere.mcap"),
        (("--body-frame", "cube"), "--body-frame: found no --known and no --prior, expected recordings, which it is about"),
        (("--set", "rig.scale=1.01"), "--set rig.scale=1.01: found no --known and no --prior, expected recordings"),
    ],
)
def test_what_cannot_be_designed_is_one_line(cli: Cli, tmp_path: Path, words: tuple[str, ...], line: str) -> None:
    outcome = design(cli, tmp_path / "throws.json", *words)
    assert outcome.status == 1
    assert line in outcome.err
    assert len(outcome.err_lines) == 1
    assert not (tmp_path / "throws.json").exists()


@pytest.mark.slow
def test_with_an_arm_only_throws_that_it_can_make_are_written(cli: Cli, tmp_path: Path) -> None:
    outcome = design(cli, tmp_path / "throws.json", "--arm")
    assert outcome.status == 0, outcome.err
    assert feasible(read_throws(tmp_path / "throws.json"), CONTACTNETS_CUBE) == (None, None)


def test_bad_usage_is_status_2(cli: Cli, tmp_path: Path) -> None:
    assert cli("design", "--throws", 0, "--out", tmp_path / "throws.json").status == 2
    assert cli("design", "--out", tmp_path / "throws.txt").status == 2
