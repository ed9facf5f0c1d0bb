"""`check` names the fault of a recording in its first line, and what settings can mend they mend."""

import json
import re
import shlex
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.data.check_faults import FAULTS, Fault, Session, diagnosed, in_map, simulated_session, spoilt_bag, write
from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.motion.survey.series import SPAN
from contact_curation.motion.toss import NANOSECONDS, Toss
from contact_curation.pipeline.diagnosis import Diagnosis, diagnose
from contact_curation.pipeline.diagnosis.diagnosis import concluded
from contact_curation.pipeline.diagnosis.evidence import Evidence
from contact_curation.pipeline.diagnosis.findings.facts import identifiable
from contact_curation.pipeline.diagnosis.findings.tosses import HINTS
from contact_curation.pipeline.diagnosis.recording import read_recording
from contact_curation.pipeline.reading import ReadingConfig
from contact_curation.pipeline.tosses import read_tosses
from contact_curation.storage.inputs.pose_messages import ODOMETRY, POSE, POSE_ARRAY
from test.cli.commands import Cli
from test.conftest import REPOSITORY
from test.storage.inputs.test_inputs import ON_BOARD
from test.storage.pose_recordings import recorded
from test.storage.written_bags import write_ours

BY_NAME = {fault.name: fault for fault in FAULTS}
QUICK = (
    "sound",
    "millimetres",
    "z down",
    "stamps 0",
    "jitter 2 ms",
    "mean of 5",
    "poses repeated",
    "wxyz",
    "no transform",
    "another board",
    "nothing moves",
    "described 12 % large",
)


@pytest.fixture(scope="module")
def session() -> Session:
    return simulated_session(tosses=6)


@pytest.mark.parametrize("name", QUICK)
def test_the_first_line_names_the_fault(session: Session, tmp_path: Path, name: str) -> None:
    fault = BY_NAME[name]
    found = diagnosed(spoilt_bag(tmp_path / "a.mcap", fault, session), fault)
    assert found.ok == fault.ok
    assert re.search(fault.verdict, found.verdict), found.verdict
    assert found.next.startswith("contact-curation ")


def test_positions_on_a_map_grid_are_told_from_other_bad_poses(session: Session, tmp_path: Path) -> None:
    write(tmp_path / "a.mcap", session.moved(lambda positions: positions + np.array([5e5, 5.4e6, 0.0])))
    verdict = diagnosed(tmp_path / "a.mcap", BY_NAME["sound"]).verdict
    assert "expected one within 1e+06 m: give positions from an origin near the board" in verdict


def test_inches_of_throws_at_one_place_are_not_taken_for_noise(session: Session, tmp_path: Path) -> None:
    noise = 8e-4 * np.random.default_rng(1).standard_normal((len(session.poses), 3))
    write(tmp_path / "a.mcap", session.moved(lambda positions: 39.3701 * positions * [0.2, 0.2, 1.0] + noise))
    assert "per s^2: inches? expected metres" in diagnosed(tmp_path / "a.mcap", BY_NAME["sound"]).verdict


def test_windows_that_noise_bends_as_gravity_in_feet_would_are_no_falls(session: Session, tmp_path: Path) -> None:
    write(tmp_path / "a.mcap", session)
    config = ReadingConfig(CONTACTNETS_CUBE)
    seen = Evidence(config, (read_recording(tmp_path / "a.mcap", config, 20_000),))
    frames = int(SPAN / seen.period)
    short = tuple(replace(one, span=one.span._replace(stop=one.span.first + frames)) for one in seen.survey.throws)
    noise = replace(seen.survey, noise=1e-3, gravity=np.array([0.0, 0.0, 31.1]))
    for throws, unit in ((seen.survey.throws, "feet"), (short, "")):
        told = Evidence(config, seen.recordings)
        told.__dict__.update(survey=replace(noise, throws=throws), mass_centre=None)
        assert (told.fall.unit if told.fall is not None else "") == unit


@pytest.mark.parametrize(("times", "said"), [(2.0, "about 2 times too long"), (0.5, "about 2 times too short")])
def test_times_by_a_wrong_rate_are_neither_another_unit_nor_a_body_that_was_carried(
    session: Session, tmp_path: Path, times: float, said: str
) -> None:
    stamps = session.stamps_ns[0] + ((session.stamps_ns - session.stamps_ns[0]) * times).astype(np.int64)
    write(tmp_path / "a.mcap", replace(session, stamps_ns=stamps, logged_ns=stamps))
    found = diagnosed(tmp_path / "a.mcap", BY_NAME["sound"])
    assert f"times are {said}" in found.verdict
    assert not any("feet" in line or "never let go" in line for line in found.reasons)


@pytest.mark.parametrize(("times", "said"), [(1.6, "1.6 times too long"), (0.5, "2 times too short")])
def test_lengths_by_tags_of_another_size_are_not_said_to_be_times(
    session: Session, tmp_path: Path, times: float, said: str
) -> None:
    write(tmp_path / "a.mcap", session.moved(lambda positions: times * positions))
    assert f", or lengths {said}: " in diagnosed(tmp_path / "a.mcap", BY_NAME["sound"]).verdict


def test_a_tracker_that_sees_positions_alone_is_named(session: Session, tmp_path: Path) -> None:
    poses = session.poses.copy()
    poses[:, 3:] = [1.0, 0.0, 0.0, 0.0]
    write(tmp_path / "a.mcap", replace(session, poses=poses))
    assert diagnosed(tmp_path / "a.mcap", BY_NAME["sound"]).verdict.startswith("orientations never change in ")


@pytest.mark.slow
@pytest.mark.parametrize("name", ["10 mm low", "tilted 2 degrees", "lengths 5 % short", "marker aside", "marker askew"])
def test_its_settings_mend_what_they_can(cli: Cli, session: Session, tmp_path: Path, name: str) -> None:
    bag = spoilt_bag(tmp_path / "a.mcap", BY_NAME[name], simulated_session() if name.startswith("marker") else session)
    spoilt = cli("check", bag, "--json")
    assert (spoilt.status, spoilt.json["ok"]) == (1, False)
    assert re.search(BY_NAME[name].verdict, spoilt.json["verdict"])
    mended = cli("check", bag, *spoilt.json["settings"].split(), "--json")
    assert (mended.status, mended.json["ok"]) == (0, True), mended.json
    assert spoilt.json["settings"] in spoilt.json["next"]


def test_the_diagnosis_has_its_five_parts_in_json_and_begins_with_the_verdict(cli: Cli, golden: Path) -> None:
    found = cli("check", golden, "--json").json
    assert set(found) == {"verdict", "ok", "reasons", "settings", "next"}
    assert (found["ok"], found["settings"]) == (True, "")
    assert found["next"] == f"contact-curation rank {golden} --out ranked.csv"
    assert cli("check", golden).out.splitlines()[0] == found["verdict"]


def test_a_recording_that_is_longer_than_what_is_looked_at_still_lacks_its_board(session: Session, tmp_path: Path) -> None:
    fault = BY_NAME["no transform"]
    bag = spoilt_bag(tmp_path / "a.mcap", fault, session)
    found = diagnose([bag], ReadingConfig(CONTACTNETS_CUBE), most_messages=1)
    assert any(line.startswith("looked at the first 2000 messages") for line in found.reasons)
    assert not found.ok
    assert re.search(fault.verdict, found.verdict), found.verdict


def test_of_a_split_bag_read_part_by_part_the_folder_is_asked_for(session: Session, tmp_path: Path) -> None:
    poses = in_map(session)
    parts = [replace(session, board=board, published=lambda _: poses) for board in (session.board, None)]
    paths = [tmp_path / f"rec_{number}.mcap" for number in range(len(parts))]
    for path, part in zip(paths, parts, strict=True):
        write(path, part)
    found = diagnose(paths, ReadingConfig(CONTACTNETS_CUBE))
    assert found.verdict.startswith("rec_1.mcap")
    assert found.verdict.endswith("give the folder of a split bag, whose first file alone has /tf_static")
    assert "--board-frame" not in found.next


def test_the_next_command_names_all_inputs_or_none(tmp_path: Path) -> None:
    bag = write_ours(tmp_path / "a.mcap", recorded("/a", POSE, ON_BOARD))
    config = ReadingConfig(CONTACTNETS_CUBE)
    one = read_recording(bag, config, 10000)
    for count, expected in ((8, " ".join(f"{number}.mcap" for number in range(8))), (9, "INPUTS")):
        several = tuple(replace(one, path=f"{number}.mcap") for number in range(count))
        words = concluded(Evidence(config, several)).next.split()
        assert " ".join(words[2 : 2 + len(expected.split())]) == expected


@pytest.mark.slow
def test_the_next_command_reads_inputs_that_look_like_options_and_patterns_as_they_were_written(
    cli: Cli, golden: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for number in range(9):
        (tmp_path / f"-{number}.mcap").symlink_to(golden)
    for inputs, shown in ((["-0.mcap", "./-1.mcap"], "./-0.mcap ./-1.mcap"), (["-*.mcap"], "'./-*.mcap'")):
        found = cli("check", "--json", "--", *inputs).json["next"]
        assert found == f"contact-curation rank {shown} --out ranked.csv"
    assert "9 inputs" in cli(*shlex.split(found)[1:]).out


def test_a_recording_that_is_no_bag_is_a_diagnosis_too(cli: Cli, golden: Path, tmp_path: Path) -> None:
    (tmp_path / "bad.mcap").write_bytes(b"garbage" * 99)
    alone = cli("check", tmp_path / "bad.mcap", "--json")
    assert (alone.status, alone.json["ok"]) == (1, False)
    assert alone.json["verdict"].startswith("cannot be read: bad.mcap: begins with")
    assert alone.json["next"] == ""
    assert "next:" not in cli("check", tmp_path / "bad.mcap").out
    beside = cli("check", golden, tmp_path / "bad.mcap", "--json").json
    assert beside["ok"]
    assert "but cannot be read: bad.mcap" in beside["verdict"]


def test_a_board_whose_static_transform_has_a_quaternion_of_zeros_is_named(session: Session, tmp_path: Path) -> None:
    assert session.board is not None
    poses = in_map(session)
    unset = replace(session, board=np.append(session.board[:3], np.zeros(4)), published=lambda _: poses)
    write(tmp_path / "a.mcap", unset)
    found = diagnose([tmp_path / "a.mcap"], ReadingConfig(CONTACTNETS_CUBE))
    assert "quaternion norm of the static transform from 'map' to 'body_surface': found 0" in found.verdict


def test_a_topic_with_poses_of_other_bodies_is_named_before_what_follows_from_them(tmp_path: Path) -> None:
    wands = [replace(one, child=f"wand_{number}") for one in ON_BOARD for number in (1, 2)]
    found = diagnose([write_ours(tmp_path / "a.mcap", recorded("/odom", ODOMETRY, wands))], ReadingConfig(CONTACTNETS_CUBE))
    assert found.verdict == "/odom has poses of 'wand_1', 'wand_2', none of them cube's: name one with --body-frame"


def test_of_an_array_of_poses_the_setting_is_named_that_says_which_is_the_body_s(tmp_path: Path) -> None:
    found = diagnose([write_ours(tmp_path / "a.mcap", recorded("/a", POSE_ARRAY, ON_BOARD))], ReadingConfig(CONTACTNETS_CUBE))
    assert found.verdict.endswith("which of them is the body: say --set poses.array_index=N, counted from 0")


def test_of_poses_that_come_seldom_no_noise_is_told(tmp_path: Path) -> None:
    """One a second of a moving body: what they scatter by says nothing of the tracker."""
    seldom = [replace(one, stamp_ns=one.stamp_ns * 148) for one in ON_BOARD]
    found = diagnose([write_ours(tmp_path / "a.mcap", recorded("/a", POSE, seldom))], ReadingConfig(CONTACTNETS_CUBE))
    assert any(line.startswith("poses come at 1 Hz") for line in (found.verdict, *found.reasons))
    assert found.settings == ""


def test_a_recording_given_twice_is_told_as_duplicates(golden: Path, tmp_path: Path) -> None:
    copy = tmp_path / "copy.mcap"
    copy.write_bytes(golden.read_bytes())
    found = diagnose([golden, copy], ReadingConfig(CONTACTNETS_CUBE))
    assert "21 tosses of 42 are duplicates" in found.verdict


def beginning_alike(folder: Path, start_ns: int) -> list[Path]:
    """Three recordings of different tosses with the same header stamps from this one on."""
    bags = []
    for number in range(3):
        to = [one.pose._replace(position=(one.pose.position[0] + 0.01 * number, *one.pose.position[1:])) for one in ON_BOARD]
        later_ns = start_ns - ON_BOARD[0].stamp_ns
        poses = [replace(one, pose=pose, stamp_ns=one.stamp_ns + later_ns) for one, pose in zip(ON_BOARD, to, strict=True)]
        bags.append(write_ours(folder / f"{number}.mcap", recorded("/pose", ODOMETRY, poses)))
    return bags


def test_tosses_under_the_ids_of_others_are_told_to_be_left_out(tmp_path: Path) -> None:
    found = diagnose(beginning_alike(tmp_path, 1_600_000_000 * NANOSECONDS), ReadingConfig(CONTACTNETS_CUBE))
    assert re.match(
        r"4 of 6 tosses start with the header stamp of another one and are left out: cube-\S+ of 1\.mcap", found.verdict
    )


def test_of_recordings_that_each_begin_at_time_0_all_tosses_count(tmp_path: Path) -> None:
    """As simulations write them: their ids hold the first poses, too, in any order of the recordings."""
    bags = beginning_alike(tmp_path, 0)
    read = read_tosses(bags, ReadingConfig(CONTACTNETS_CUBE))
    assert len(read) == 6
    assert not read.warnings
    assert sorted(read.ids) == sorted(read_tosses(bags[::-1], ReadingConfig(CONTACTNETS_CUBE)).ids)
    assert "left out" not in diagnose(bags, ReadingConfig(CONTACTNETS_CUBE)).verdict


def test_of_a_long_recording_only_the_first_messages_are_looked_at(golden: Path) -> None:
    found = diagnose([golden], ReadingConfig(CONTACTNETS_CUBE), most_messages=2000)
    assert found.ok
    looked = sum(read_recording(golden, ReadingConfig(CONTACTNETS_CUBE), 2000).counted.values())
    assert looked >= 2000
    assert any(f"looked at the first {looked} messages" in line for line in found.reasons)


def test_what_tosses_identify_is_said_in_plain_words(session: Session, tmp_path: Path) -> None:
    write(tmp_path / "a.mcap", session)
    found: Diagnosis = diagnose([tmp_path / "a.mcap"], ReadingConfig(CONTACTNETS_CUBE))
    line = next(line for line in found.reasons if line.startswith("to be estimated from these tosses: "))
    accuracy = re.search(r"(all|\d of) 8 vertices to ([\d.]+) mm", line)
    assert accuracy is not None
    assert 0.05 < float(accuracy[2]) < 0.1 * 52.4
    friction = re.search(r"the friction coefficient \(0.18\) to ([\d.]+) at best \(Cramer-Rao bound, one", line)
    assert friction is not None
    assert 0.0 < float(friction[1]) < 0.1 * 0.18
    assert "; mass and inertia stay as described" in line
    assert ("throws that land on (" in line) is (accuracy[1] != "all")


def test_tosses_that_always_land_alike_say_which_throws_are_missing(session: Session, tmp_path: Path) -> None:
    """Two tosses, of the same throw: some vertices never touch the board."""
    write(tmp_path / "a.mcap", session)
    whole = read_recording(tmp_path / "a.mcap", ReadingConfig(CONTACTNETS_CUBE), 10**6)
    alike = replace(whole, outcomes=tuple(one for one in whole.outcomes if isinstance(one, Toss))[:2])
    found = identifiable(Evidence(ReadingConfig(CONTACTNETS_CUBE), (alike,)))
    assert found is not None
    assert re.search(r"throws that land on \(-?52, -?52, -?52\)", found.what)
    assert re.search(r"\d of 8 vertices|neither vertices|the friction", found.what)


def test_a_log_that_is_out_of_order_is_told_from_stamps_that_are(session: Session, tmp_path: Path) -> None:
    late = np.random.default_rng(5).uniform(0.0, 1e9, len(session.logged_ns)).astype(np.int64)
    write(tmp_path / "a.mcap", replace(session, logged_ns=session.logged_ns + late))
    found = diagnose([tmp_path / "a.mcap"], ReadingConfig(CONTACTNETS_CUBE))
    assert re.search(r"poses were logged out of order \(by up to [\d.]+ s\); their stamps are sound", found.verdict)


def test_hints_are_for_reasons_that_there_are() -> None:
    folder = REPOSITORY / "contact_curation" / "motion"
    source = "".join(path.read_text() for path in folder.glob("*.py"))
    assert [name for name in HINTS if name not in source] == []


def test_the_document_is_json(golden: Path) -> None:
    found = diagnose([golden], ReadingConfig(CONTACTNETS_CUBE))
    assert json.loads(json.dumps(found.document()))["verdict"] == found.verdict


def test_faults_are_put_in_from_the_seed_alone(session: Session) -> None:
    fault: Fault = BY_NAME["jitter 2 ms"]
    one, other = (fault.change(session, np.random.default_rng(5)).stamps_ns for _ in range(2))
    assert np.array_equal(one, other)


@pytest.mark.parametrize("verb", [["rank"], ["train", "--out", "a.safetensors"]], ids=["rank", "train"])
def test_verbs_that_find_no_toss_say_why(
    cli: Cli, session: Session, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, verb: list[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    bag = spoilt_bag(tmp_path / "a.mcap", BY_NAME["10 mm low"], session)
    done = cli(verb[0], bag, *verb[1:])
    assert done.status == 1
    assert done.err_lines[-1].startswith(f"contact-curation: error: {bag}: bodies at rest lie 10.0 mm under the board")
    assert "`contact-curation check` gives the reasons and the settings" in done.err_lines[-1]
