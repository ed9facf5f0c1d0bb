"""`online` without its nodes: what each is told, what is read of a session's stores, and when a session has come to rest."""

import argparse
import json
import socket
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from unittest.mock import Mock

import pytest

from contact_curation.cli.main import main
from contact_curation.cli.online import command as online
from contact_curation.cli.online.options import add_online_options, session_config
from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.design.designer import Realised
from contact_curation.design.throw import throw_of_state
from contact_curation.errors import InvalidValueError, UnreadableInputError
from contact_curation.motion.calibration import RigCalibration
from contact_curation.motion.pose_stream import FramePose
from contact_curation.session import session
from contact_curation.session.config import SessionConfig, SessionFolder
from contact_curation.session.events import EventLog
from contact_curation.session.free_domain import graph_domain
from contact_curation.session.graph import graph_environment
from contact_curation.session.node_parameters import (
    changed_parameters,
    declared_parameters,
    free_port,
    held_out_inputs,
    session_parameters,
)
from contact_curation.session.offline_ranking import rank_command
from contact_curation.session.parameter_files import Parameters
from contact_curation.session.session import Session, run_session
from contact_curation.session.state import SessionState, SessionStores
from contact_curation.session.summary import gains, outcome_of
from contact_curation.session.supervisor import ProgramFailedError
from contact_curation.solver import compiled
from contact_curation.stages.records import (
    BufferRecord,
    ServedDashboard,
    ThrowLogRecord,
    ThrowRecord,
    TrainingRecord,
    stored_records,
    write_record,
)
from contact_curation.storage.inputs.inputs import InputsConfig
from contact_curation.storage.inputs.pose_messages import POSE
from contact_curation.storage.stores.information import InformationStore
from contact_curation.storage.stores.state import StateStore
from contact_curation.storage.stores.tosses import TossStore
from test.design.cases import releases
from test.motion.streams import stream
from test.storage.pose_recordings import recorded
from test.storage.stored_records import information, rejected, toss
from test.storage.written_bags import write_ours

COMMANDED = throw_of_state("throw-0", "cube", releases(1)[0], 2.5, "theta")
THROW = ThrowRecord(COMMANDED, COMMANDED, 100, 90, None, "toss-0", Realised("throw-0", "toss-0", 2.0, 1.5))
UNSEEN = ThrowRecord(COMMANDED, COMMANDED, 200, 190)
BUFFER = BufferRecord(4, ("b", "a"), "theta", "trace", 3)
TRAINING = TrainingRecord(round=3, gradient_steps=900, running=False, version="theta", revision=4, tosses_seen=3)
AT_REST = SessionState((THROW,), "", ("a", "b", "c"), (), BUFFER, ranked=3, scored=3, training=TRAINING)


def parameters_of(folder: Path, text: str = "", **options: object) -> dict[str, Parameters]:
    path = folder / "nodes.yaml"
    path.write_text(text)
    config = SessionConfig(params_file=path if text else None, **options)  # type: ignore[arg-type]
    return session_parameters(config, CONTACTNETS_CUBE, SessionFolder(folder))


def test_options_go_before_the_file_and_the_session_before_both(tmp_path: Path) -> None:
    text = """
/**: {ros__parameters: {seed: 3}}
/**/curator: {ros__parameters: {top: 5, criterion: trace, store: elsewhere.sqlite}}
/**/sim_arm: {ros__parameters: {rate: 0.5, armed: false}}
"""
    found = parameters_of(tmp_path, text, top=7, throws=12)
    assert found["curator"] == {"seed": 3, "top": 7, "criterion": "trace", "store": str(tmp_path / "stores" / "curator.sqlite")}
    assert found["sim_arm"]["rate"] == 0.5
    assert found["sim_arm"]["armed"] is True
    assert found["throw_designer"]["max_throws"] == 12
    assert found["throw_designer"]["toss_timeout"] == 30.0
    slow = parameters_of(tmp_path, "sim_arm: {ros__parameters: {rate: 1.0}}")["throw_designer"]
    usual = declared_parameters()["throw_designer"]
    assert all(slow[name] == usual[name] for name in ("toss_timeout", "goal_timeout"))


def test_designer_and_arm_are_told_of_the_same_arm(tmp_path: Path) -> None:
    text = "sim_arm: {ros__parameters: {arm: {base: [0.0, -0.6]}, gate.largest_speed: 1.0}}"
    designer = parameters_of(tmp_path, text)["throw_designer"]
    assert designer["arm.base"] == [0.0, -0.6]
    assert "gate.largest_speed" not in designer


def test_listeners_run_only_where_they_are_wanted(tmp_path: Path) -> None:
    assert set(parameters_of(tmp_path)) & {"dashboard", "session_recorder"} == set()
    recorded = parameters_of(tmp_path, record=tmp_path)
    assert recorded["session_recorder"] == {"bag": str(tmp_path / "session.mcap")}
    assert recorded["dashboard"]["web_port"] == 0
    served = parameters_of(tmp_path, dashboard=True)
    assert "session_recorder" not in served
    assert served["dashboard"]["web_port"] != served["dashboard"]["grpc_port"]


def test_a_port_that_is_taken_is_not_given_to_the_dashboard(tmp_path: Path) -> None:
    with socket.socket() as taken:
        taken.bind(("", 0))
        taken.listen()
        port = taken.getsockname()[1]
        assert free_port(port) != port
    own = "dashboard: {ros__parameters: {web_port: 1234}}"
    assert parameters_of(tmp_path, own, dashboard=True)["dashboard"]["web_port"] == 1234


def test_a_rendering_camera_and_who_reads_it_share_a_tag_map(tmp_path: Path) -> None:
    found = parameters_of(tmp_path, camera="rendered")
    assert found["sim_camera"]["mode"] == "rendered"
    assert found["pose_ingest"]["tag_map"] == str(tmp_path / "tag_map.yaml")
    assert found["pose_ingest"]["topic"] == ""
    assert found["throw_designer"]["toss_timeout"] > 300.0  # images take long


def test_the_tracked_poses_are_named_so_that_the_ground_truth_is_never_taken_for_them(tmp_path: Path) -> None:
    assert parameters_of(tmp_path)["pose_ingest"]["topic"] == "/tagslam/odom/body_cube"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("/**/curador: {ros__parameters: {top: 5}}", r"unknown node in .*: curador: did you mean curator\?"),
        (
            "/**/curator: {ros__parameters: {topp: 5}}",
            r"unknown parameter of curator in .*: topp: did you mean top\?",
        ),
        ("/**: {ros__parameters: {settling: 5}}", r"unknown parameter of /\*\* in .*: settling: "),
        ("/**/trainer: {ros__parameters: {top: 5}}", "unknown parameter of trainer in .*: top: "),
        (
            "/**/sim_arm: {ros__parameters: {rate: fast}}",
            "rate of sim_arm in .*: found fast, expected a number with a point, such as 1.0",
        ),
        ("/**/sim_arm: {ros__parameters: {rate: .nan}}", "found nan, expected a number"),
        (
            "/**/sim_arm: {ros__parameters: {rate: 2}}",
            "rate of sim_arm in .*: found 2, expected a number with a point, such as 1.0",
        ),
        (
            "/**/trainer: {ros__parameters: {rig.normal: [0, 0, 1]}}",
            r"found \[0, 0, 1\], expected a list, such as \[0.0, 0.0, 1.0\]",
        ),
        ("/**/trainer: {ros__parameters: {rig.normal: [a, b, c]}}", r"found \['a', 'b', 'c'\], expected a list, such as"),
        ("/**/trainer: {ros__parameters: {least_tosses: 2.5}}", "found 2.5, expected a whole number"),
        ("/**/curator: {ros__parameters: {criterion: 2024-02-30}}", "no YAML"),
        ("curator: {top: 5}", "expected ros__parameters under the name of each node"),
        ("- a", "expected ros__parameters"),
        ("a: [", "no YAML"),
    ],
)
def test_a_file_that_holds_something_else_is_refused(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises((InvalidValueError, UnreadableInputError), match=message):
        parameters_of(tmp_path, text)


def test_parameters_that_every_node_of_ros_has_are_taken(tmp_path: Path) -> None:
    found = parameters_of(tmp_path, "/**: {ros__parameters: {use_sim_time: false}}")
    assert found["curator"]["use_sim_time"] is False


@pytest.mark.parametrize("name", ["events.jsonl", "session.mcap"])
def test_a_folder_with_a_session_is_not_used_again(tmp_path: Path, name: str) -> None:
    SessionFolder(tmp_path).make()
    (tmp_path / name).touch()
    with pytest.raises(InvalidValueError, match="expected a folder without a session in it"):
        SessionFolder(tmp_path).make()


def test_a_folder_in_which_a_session_is_running_is_not_gone_on_with(tmp_path: Path) -> None:
    folder = SessionFolder(tmp_path)
    folder.make()
    config = SessionConfig(record=tmp_path, resume=True)
    with EventLog(folder.events), folder.claimed():
        before = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*")}
        with pytest.raises(InvalidValueError, match="in which a session is running, expected a new folder"):
            run_session(config, SessionFolder(tmp_path), (), lambda: True, online._Lines())
        assert {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*")} == before
    with SessionFolder(tmp_path).claimed():
        pass


def test_a_session_goes_on_where_it_was_and_only_where_there_is_one(tmp_path: Path) -> None:
    with pytest.raises(InvalidValueError, match="found no --record DIR"):
        SessionConfig(resume=True)
    folder = SessionFolder(tmp_path)
    with pytest.raises(InvalidValueError, match="expected a folder with a session in it"):
        folder.make(resume=True)
    folder.make()
    with EventLog(folder.events) as events:
        events.note("throw", number=1)
        events.note("restarted", node="curator", pid=1)
    first = folder.events.read_bytes()
    folder.events.write_bytes(first + b'{"time": 3.2, "ev')  # killed in mid-write
    folder.make(resume=True)
    with EventLog(folder.events, resume=True) as events:
        assert (events.count("throw"), events.restarts) == (1, {"curator": 1})
        last = events.note("throw", number=2)
    assert last["time"] >= events.events[0]["time"]
    lines = folder.events.read_bytes()
    assert lines.startswith(first)
    assert [json.loads(line)["event"] for line in lines.splitlines()] == ["throw", "restarted", "throw"]


def test_parameters_with_which_a_session_goes_on_otherwise_are_named(tmp_path: Path) -> None:
    text = "/**/pose_ingest: {ros__parameters: {rig.scale: 1.01}}"
    before = parameters_of(tmp_path, text, throws=4, top=3)
    assert changed_parameters(before, parameters_of(tmp_path, text, throws=8, top=3, rate=None)) == ""
    changed = changed_parameters(before, parameters_of(tmp_path, throws=8))
    assert changed == "curator top 3 before, now 32; pose_ingest rig.scale 1.01 before, now 1.0"


@pytest.fixture
def stopped_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """A session ends by Ctrl-C before anything is started."""

    def stopping(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(session, "write_tag_map", stopping)


@pytest.mark.usefixtures("stopped_at_once")
def test_a_session_that_goes_on_with_other_parameters_says_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = SessionFolder(tmp_path)
    for resume, top in ((False, 3), (True, 5), (True, 5)):
        with pytest.raises(KeyboardInterrupt):
            run_session(SessionConfig(record=tmp_path, resume=resume, top=top), folder, (), lambda: True, online._Lines())
    assert capsys.readouterr().out == "the session goes on with other parameters: curator top 3 before, now 5\n"


@pytest.mark.usefixtures("stopped_at_once")
def test_a_session_that_goes_on_forgets_where_its_dashboard_was_served(tmp_path: Path) -> None:
    folder = SessionFolder(tmp_path)
    folder.make()
    folder.events.touch()
    write_record(folder.dashboard, ServedDashboard("http://127.0.0.1:9090"))
    with pytest.raises(KeyboardInterrupt):
        run_session(SessionConfig(record=tmp_path, resume=True), folder, (), lambda: True, online._Lines())
    assert SessionStores(folder).look().dashboard == ""


@pytest.mark.parametrize("stay", [False, True])
def test_a_summary_names_a_dashboard_that_is_still_served(stay: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    served, reporter = replace(SessionState(), dashboard="http://127.0.0.1:9090"), Mock()
    monkeypatch.setattr(session, "supervised", lambda *_: nullcontext(Mock()))
    monkeypatch.setattr(Session, "follow", lambda own, *_: setattr(own, "state", served))
    monkeypatch.setattr(Session, "stay", Mock())
    run_session(SessionConfig(dashboard=True, stay=stay), SessionFolder(tmp_path), (), lambda: False, reporter)
    (summary,) = reporter.conclude.call_args.args
    assert summary.dashboard == (served.dashboard if stay else "")


@pytest.mark.usefixtures("stopped_at_once")
def test_a_session_does_not_go_on_with_another_camera(tmp_path: Path) -> None:
    folder = SessionFolder(tmp_path)
    with pytest.raises(KeyboardInterrupt):
        run_session(SessionConfig(record=tmp_path), folder, (), lambda: True, online._Lines())
    told = folder.parameters.read_bytes()
    other = SessionConfig(record=tmp_path, resume=True, camera="rendered")
    with pytest.raises(InvalidValueError, match="--camera: found rendered, expected poses, which the session has"):
        run_session(other, folder, (), lambda: True, online._Lines())
    assert folder.parameters.read_bytes() == told


def test_a_session_does_not_go_on_with_another_body(tmp_path: Path) -> None:
    folder = SessionFolder(tmp_path)
    folder.make()
    with EventLog(folder.events) as events:
        events.note_body("brick, 0.5 kg (12345678)")
    before = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    with pytest.raises(InvalidValueError, match=r"--body: found cube.*expected brick, 0.5 kg"):
        run_session(SessionConfig(record=tmp_path, resume=True), folder, (), lambda: True, online._Lines())
    assert {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()} == before


def test_throws_that_were_told_of_before_are_not_told_of_again(tmp_path: Path) -> None:
    folder, said = SessionFolder(tmp_path), list[str]()
    folder.make()
    with StateStore(folder.store("throw_designer")) as states:
        states.save(stored_records(ThrowLogRecord(2, None, (THROW, THROW), "")))
    with EventLog(folder.events) as events:
        events.note("throw", number=1)
    with EventLog(folder.events, resume=True) as events:
        Session(SessionConfig(throws=2), parameters_of(tmp_path, throws=2), folder, events, said.append)._look()
    assert [line.partition("  gain")[0] for line in said] == ["throw   2 of 2"]


@pytest.mark.parametrize("line", ["[1]", '{"time": 1.0}', "no JSON"])
def test_events_that_are_none_are_refused_in_one_line(tmp_path: Path, line: str) -> None:
    path = tmp_path / "events.jsonl"
    path.write_text(line + "\n")
    with pytest.raises(UnreadableInputError, match="expected the events of a session"):
        EventLog(path, resume=True)
    assert path.read_text() == line + "\n"


def test_a_full_disk_is_named_with_the_file() -> None:
    with (
        pytest.raises(InvalidValueError, match="found /dev/full, expected a file that can be written"),
        EventLog(Path("/dev/full")) as events,
    ):
        events.note("started")


def test_the_domain_is_the_users_or_one_of_its_own_on_this_machine(tmp_path: Path) -> None:
    with graph_domain({}) as domain:
        own = graph_environment({"ROS_STATIC_PEERS": "far", "A": "1"}, tmp_path, domain)
    assert own["ROS_AUTOMATIC_DISCOVERY_RANGE"] == "SYSTEM_DEFAULT"
    assert "127.0.0.1" in Path(own["FASTRTPS_DEFAULT_PROFILES_FILE"]).read_text()
    for others in ({"RMW_IMPLEMENTATION": "rmw_cyclonedds_cpp"}, {"FASTRTPS_DEFAULT_PROFILES_FILE": "own.xml"}):
        assert graph_environment(others, tmp_path, 7)["ROS_AUTOMATIC_DISCOVERY_RANGE"] == "LOCALHOST"
    assert 1 <= int(own["ROS_DOMAIN_ID"]) <= 101
    assert "ROS_STATIC_PEERS" not in own
    given = {"ROS_DOMAIN_ID": "7", "ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET", "ROS_STATIC_PEERS": "far"}
    with graph_domain(given) as domain:
        users = graph_environment(given, tmp_path, domain)
    assert (users["ROS_DOMAIN_ID"], users["ROS_AUTOMATIC_DISCOVERY_RANGE"], users["ROS_STATIC_PEERS"]) == ("7", "SUBNET", "far")


def test_the_offline_ranking_is_told_what_the_nodes_were_told(tmp_path: Path) -> None:
    text = """
pose_ingest:
  ros__parameters: {segmenter: {rest_frames: 5, region_x: [-1.0, 1.0], frame_period: 0.0, gravity: 9.7}, gates.depth: 0.01,
    rig.normal: [0.01, 0.0, 1.0], rig.scale: 1.0}
fisher_scorer: {ros__parameters: {estimator: empirical, influence_bound: .inf, loss.threads: 1}}
curator: {ros__parameters: {criterion: trace, prior: 0.01, whiten: false}}
"""
    parameters = parameters_of(tmp_path, text, top=5)
    words = rank_command(SessionConfig(), SessionFolder(tmp_path), parameters)
    settings = [words[place + 1] for place, word in enumerate(words) if word == "--set"]
    wanted = [
        "segmenter.region_x=-1.0,1.0",
        "segmenter.rest_frames=5",
        "gates.depth=0.01",
        "ranking.prior=0.01",
        "rig.normal=0.01,0.0,1.0",
    ]
    assert sorted(settings) == sorted(wanted)
    assert words[words.index("--criterion") + 1] == "trace"
    assert words[words.index("--top") + 1] == "5"
    assert words[words.index("--estimator") + 1] == "empirical"
    assert "--influence-bound" not in words
    assert "--params" not in words  # nothing was trained


def test_a_session_is_read_from_its_stores(tmp_path: Path) -> None:
    folder = SessionFolder(tmp_path)
    folder.make()
    stores = SessionStores(folder)
    assert stores.look() == SessionState()
    first, second, bad = toss(1), toss(2), rejected(3)
    with TossStore(folder.store("pose_ingest")) as tosses:
        tosses.add(first)
        tosses.add_rejected(bad)
    with StateStore(folder.store("throw_designer")) as states:
        states.save(stored_records(ThrowLogRecord(2, None, (THROW, UNSEEN), "releases: found 0")))
    scored = information(1)
    with InformationStore(folder.store("fisher_scorer")) as informations:
        informations.add(scored)
    buffer = BufferRecord(1, ("a",), scored.parameters_version, "trace", 1)
    with InformationStore(folder.store("curator")) as curated:
        curated.states.save(stored_records(buffer))
    with TossStore(folder.store("trainer")) as tosses:
        tosses.states.save(stored_records(TRAINING))
    write_record(folder.dashboard, ServedDashboard("http://here"))
    seen = stores.look()
    assert [(one.toss_id, one.planned_gain, one.after_ns) for one in seen.throws] == [("toss-0", 2.0, 100), ("", 2.5, 200)]
    assert (seen.no_throw, seen.dashboard) == ("releases: found 0", "http://here")
    assert seen.tosses == (first.toss_id,)
    assert seen.rejected == ((bad.toss.toss_id, tuple(bad.reasons)),)
    assert (seen.buffer, seen.scored, seen.ranked, seen.training) == (buffer, 1, 0, TRAINING)
    assert stores.look() == seen  # nothing has changed
    with TossStore(folder.store("pose_ingest")) as tosses:
        tosses.add(second)
    assert stores.look().tosses == (first.toss_id, second.toss_id)
    assert stores.look().throws is seen.throws


def test_a_record_of_a_newer_node_is_refused_in_one_line(tmp_path: Path) -> None:
    folder = SessionFolder(tmp_path)
    folder.make()
    with StateStore(folder.store("throw_designer")) as states:
        states.save({"throws": json.dumps({"format": 2}).encode()})
    message = "throw_designer.sqlite: holds a ThrowLogRecord of format 2, this package knows formats up to 1"
    with pytest.raises(UnreadableInputError, match=message):
        SessionStores(folder).look()


def test_a_session_is_trained_when_the_trainer_has_nothing_to_do_with_its_buffer_at_its_theta() -> None:
    assert AT_REST.is_trained
    assert not replace(AT_REST, training=replace(TRAINING, running=True)).is_trained
    assert not replace(AT_REST, buffer=replace(BUFFER, revision=5)).is_trained  # it has not heard of it yet
    assert not replace(AT_REST, buffer=replace(BUFFER, seen=4)).is_trained
    assert not replace(AT_REST, training=replace(TRAINING, revision=0)).is_trained  # a round is due
    assert not replace(AT_REST, training=replace(TRAINING, version="newer")).is_trained  # tosses are being scored again
    assert replace(AT_REST, training=TrainingRecord(revision=4, tosses_seen=3)).is_trained  # too few to train on
    assert SessionState().is_trained


def test_a_toss_that_is_not_scored_yet_keeps_a_session_from_rest() -> None:
    assert AT_REST.is_scored
    assert not replace(AT_REST, ranked=2).is_scored
    assert not replace(AT_REST, tosses=("a", "b", "c", "d")).is_scored


def test_only_the_last_throw_is_waited_for_until_its_motion_was_seen() -> None:
    assert not SessionState().awaits_motion
    assert SessionState((THROW, UNSEEN)).awaits_motion
    assert not SessionState((UNSEEN, THROW)).awaits_motion
    assert not SessionState((THROW, replace(UNSEEN, rejected=("gap: found 3",)))).awaits_motion
    assert SessionState((replace(THROW, realised=None),)).awaits_gain
    assert not SessionState((replace(THROW, realised=None, exploration="few tosses"),)).awaits_gain
    assert not SessionState((UNSEEN,)).awaits_gain


def test_what_became_of_a_throw_is_told_in_words() -> None:
    bad = replace(UNSEEN, rejected=("gap: found 3", "more"))
    state = SessionState((THROW, UNSEEN, bad), buffer=replace(BUFFER, selected=("x", "toss-0")))
    assert [outcome_of(state, place) for place in range(3)] == [
        "selected, rank 2 of 2",
        "no motion was seen",
        "rejected: gap: found 3",
    ]
    assert outcome_of(replace(state, buffer=BUFFER), 0) == "not selected"
    assert gains(THROW) == "gain 2 planned, 1.5 realised"
    exploring = replace(THROW, exploration="few tosses", realised=None)
    assert gains(exploring) == exploring.report.kind.value


def test_a_session_says_once_where_the_dashboard_is_and_why_there_is_no_throw(tmp_path: Path) -> None:
    folder, said = SessionFolder(tmp_path), list[str]()
    folder.make()
    parameters = parameters_of(tmp_path, throws=2)
    with EventLog(folder.events) as events:
        session = Session(SessionConfig(throws=2), parameters, folder, events, said.append)
        write_record(folder.dashboard, ServedDashboard("http://here"))
        log = ThrowLogRecord(1, None, (THROW,), "")
        for reason in ("", "releases: found 0", "releases: found 0", "", "releases: found 0", "the kernel"):
            with StateStore(folder.store("throw_designer")) as states:
                states.save(stored_records(replace(log, no_throw=reason)))
            session._look()
    assert said == [
        "dashboard: http://here",
        "throw   1 of 2  gain 2 planned, 1.5 realised        accepted  (0 s)",
        "no throw: releases: found 0",
        "no throw: releases: found 0",  # the same again, after a throw
        "no throw: the kernel",
    ]


def test_a_session_whose_throws_are_made_awaits_the_dashboard_that_is_to_stay(tmp_path: Path) -> None:
    folder = SessionFolder(tmp_path)
    folder.make()
    with EventLog(folder.events) as events:
        config = SessionConfig(throws=1, stay=True)
        session = Session(config, parameters_of(tmp_path, throws=1), folder, events, lambda _: None)
        session.state, session._changed = replace(SessionState(), throws=(THROW,)), session._changed - 100.0
        assert not session._is_over()


def test_a_dashboard_that_stays_is_served() -> None:
    parser = argparse.ArgumentParser()
    add_online_options(parser)
    assert session_config(parser.parse_args(["--stay"])).dashboard
    assert not session_config(parser.parse_args([])).dashboard
    assert session_config(parser.parse_args(["--held-out", "a", "b"])).evaluate_on == (Path("a"), Path("b"))


@pytest.mark.parametrize("words", [["--throws", "0"], ["--rate", "-1"], ["--camera", "eye"], ["--criterion", "best"]])
def test_bad_usage_is_refused(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["online", *words])
    assert ended.value.code == 2
    assert capsys.readouterr().err


def test_a_file_that_is_not_there_is_one_line_and_starts_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    record = tmp_path / "session"
    assert main(["online", "--record", str(record), "--params-file", str(tmp_path / "none.yaml")]) == 1
    assert main(["online", "--record", str(record), "--body-file", str(tmp_path / "none.yaml")]) == 1
    assert capsys.readouterr().err.count("\n") == 2
    assert not record.exists()


def test_recordings_to_judge_by_are_read_as_the_trainer_is_told_to(tmp_path: Path) -> None:
    told = tmp_path / "told.yaml"
    told.write_text(
        "/**:\n  ros__parameters: {segmenter.tracker_noise: 5.0}\ntrainer:\n  ros__parameters: {rig.normal: [0.01, 0.0, 1.0]}\n"
    )
    inputs = held_out_inputs(SessionConfig(params_file=told))
    assert (inputs.segmenter.tracker_noise, inputs.rig) == (5.0, RigCalibration(normal=(0.01, 0.0, 1.0)))
    assert held_out_inputs(SessionConfig()) == InputsConfig()


@pytest.mark.parametrize(("name", "says"), [("none.mcap", "No such file"), ("folder", "is a folder without storage files")])
def test_a_recording_to_judge_by_that_cannot_be_read_is_one_line_and_starts_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str, says: str
) -> None:
    (tmp_path / "folder").mkdir()
    record = tmp_path / "session"
    assert main(["online", "--record", str(record), "--held-out", str(tmp_path / name)]) == 1
    err = capsys.readouterr().err
    assert err.startswith(f"contact-curation: error: {tmp_path / name}: ")
    assert says in err
    assert err.count("\n") == 1
    assert not record.exists()


def test_recordings_without_a_toss_judge_nobody_and_start_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    poses = [FramePose(one.stamp_ns, "table", "body_cube", one.pose) for one in stream()[:15]]
    bag = write_ours(tmp_path / "short.mcap", recorded("/pose", POSE, poses))
    record = tmp_path / "session"
    assert main(["online", "--record", str(record), "--held-out", str(bag)]) == 1
    said = capsys.readouterr().err
    assert f"error: --evaluate-on: found {bag}: " in said
    assert "expected recordings of tosses" in said
    assert not record.exists()


@pytest.mark.parametrize(
    ("kept", "says"), [(True, "status 1: no (a.log)"), (False, "status 1: no; --record DIR keeps its log")]
)
def test_the_log_of_a_node_that_died_is_named_only_where_it_stays(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, kept: bool, says: str
) -> None:
    def died(*_: object) -> None:
        raise ProgramFailedError("a died with status 1: no", Path("a.log"))

    monkeypatch.setattr(online, "run_session", died)
    assert main(["online", *(["--record", str(tmp_path / "session")] if kept else [])]) == 1
    assert capsys.readouterr().err == f"contact-curation: error: a died with {says}\n"


def test_without_the_compiled_kernel_a_session_ends_before_it_begins(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(compiled, "KERNEL_FOLDER", tmp_path)
    compiled.load_kernel.cache_clear()
    try:
        assert main(["online", "--throws", "1", "--record", str(tmp_path / "session")]) == 1
    finally:
        compiled.load_kernel.cache_clear()
    said = capsys.readouterr()
    assert said.err.startswith("contact-curation: error: ")
    assert "the compiled kernel" in said.err
    assert (said.err.count("\n"), said.out) == (1, "")
    assert not (tmp_path / "session").exists()
