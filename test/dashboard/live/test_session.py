"""What a session leaves in a recording."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import rerun as rr

from contact_curation.dashboard.live.health_view import NodeHealth
from contact_curation.dashboard.live.learning_view import TrainingMoment
from contact_curation.dashboard.live.screen import number
from contact_curation.dashboard.live.session import LiveSession
from contact_curation.dashboard.live.summary_view import SessionOverview, summary_page
from contact_curation.dashboard.live.throw_view import ThrowMade, throws_page
from contact_curation.dashboard.toss_motion import ShownTheta
from contact_curation.information.curation import curate
from contact_curation.information.ranker import RankingConfig
from test.dashboard.recorded import Recorded, finite, recorded, recording_screen
from test.dashboard.sessions import BODY, CONFIG, Scored, fed, scored, selected_set, throw_of

COUNT, TOP = 6, 4
CURVES = (
    *("friction/estimate", "friction/low", "friction/high", "known/worst", "known/median", "epsilon/epsilon"),
    *("errors/position", "errors/rotation", "losses/training", "losses/held_out", "gains/planned", "gains/realised"),
)


@pytest.fixture(scope="module")
def made() -> Scored:
    return scored(COUNT)


@pytest.fixture(scope="module")
def session(made: Scored, tmp_path_factory: pytest.TempPathFactory) -> Recorded:
    path = tmp_path_factory.mktemp("session") / "session.rrd"
    screen = recording_screen(path)
    live = fed(screen, made, TOP)
    nodes = {name: NodeHealth(name, False, "fine", {"queue": "0"}, heard=9.0) for name in ("curator", "trainer")}
    nodes |= {"player": NodeHealth("player", True, "slow", {"queue": "9"}, 9.0), "scorer": NodeHealth("scorer", False, "fine")}
    live.show_health(nodes, {"toss": 3}, now=10.0, ended={"trainer"})
    return recorded(screen, path)


@pytest.mark.parametrize("curve", CURVES)
def test_every_curve_has_a_point_for_every_toss(session: Recorded, curve: str) -> None:
    points = session.scalars(f"/{curve}")
    assert len(points) == COUNT
    assert finite(points)


def test_the_ellipsoids_shrink_while_tosses_come(session: Recorded) -> None:
    sizes = np.array(session.column("/body/uncertainty", "Ellipsoids3D:half_sizes"))
    assert sizes.shape == (COUNT, 8, 3)
    worst = session.scalars("/known/worst")
    assert worst[-1] < 0.5 * worst[0]
    assert sizes.max() == pytest.approx(0.5 * BODY.length_scale)
    assert sizes[-1].prod(axis=1).mean() < 0.7 * sizes[0].prod(axis=1).mean()


def test_the_moving_body_is_where_the_toss_was_at_its_own_stamps(session: Recorded, made: Scored) -> None:
    stamps = np.concatenate([toss.stamps_ns for toss in made.tosses])
    order = np.argsort(session.times("/scene/moving", "ros_time"), kind="stable")
    assert np.array_equal(np.array(session.times("/scene/moving", "ros_time"))[order], np.sort(stamps))
    (last,) = session.column("/scene/moving", "Transform3D:translation")[-1]
    assert last == pytest.approx(made.tosses[-1].positions[-1], abs=1e-6)
    assert set(session.times("/scene/moving", "toss")) == set(range(1, COUNT + 1))


def test_a_toss_has_measured_and_predicted_paths_and_impulses_at_its_vertices(session: Recorded, made: Scored) -> None:
    for name in ("measured", "predicted"):
        assert session.rows(f"/scene/{name}/trail") == session.rows(f"/scene/{name}/outlines") == COUNT
    (trail,) = session.column("/scene/measured/trail", "LineStrips3D:strips")[0]
    assert trail == pytest.approx(made.tosses[0].positions, abs=1e-6)
    vectors = np.array(session.column("/scene/impulses", "Arrows3D:vectors")[0])
    places = np.array(session.column("/scene/impulses", "Arrows3D:origins")[0])
    assert (vectors[:, 2] > 0.0).all()
    assert np.average(np.abs(places[:, 2]), weights=np.linalg.norm(vectors, axis=1)) < 0.005


def test_the_page_of_the_ranking_says_of_every_toss_why(session: Recorded) -> None:
    page = session.texts("/ranking")[-1]
    assert f"{TOP} of {COUNT} tosses selected" in page
    inside, others = page.split("**Not selected**")
    assert inside.count("without it |") == TOP
    assert others.count(" with it |") == COUNT - TOP
    assert all(f"[#{number}](recording://scene/tosses/{number})" in page for number in range(1, COUNT + 1))


def test_a_row_leads_to_a_path_that_is_there(session: Recorded, made: Scored) -> None:
    for place, toss in enumerate(made.tosses, start=1):
        ((strip,),) = session.column(f"/scene/tosses/{place}", "LineStrips3D:strips")
        assert strip == pytest.approx(toss.positions, abs=1e-6)
    assert session.column("/scene/name", "Points3D:labels")[-1] == [f"toss {COUNT}, 12:27:30 UTC"]


def test_the_friction_becomes_surer_and_stays_between_its_ends(session: Recorded) -> None:
    low, estimate, high = (np.array(session.scalars(f"/friction/{name}")) for name in ("low", "estimate", "high"))
    assert estimate == pytest.approx(np.full(COUNT, BODY.friction))
    assert low * high == pytest.approx(estimate**2)
    assert np.log(high / low)[-1] < 0.5 * np.log(high / low)[0]


def test_a_few_lines_say_where_the_session_stands(session: Recorded) -> None:
    page = session.texts("/session")[-1]
    assert (
        f"**Throw {COUNT} of 9** is done. {COUNT} tosses: **{TOP} selected**, {COUNT - TOP} not selected; 1 rejected." in page
    )
    assert "Friction 0.180 (1 sigma at best: 0.1" in page
    assert f"Drawn: **toss {COUNT} of 12:27:30 UTC**, predicted " in page


def test_the_page_says_why_the_held_out_errors_are_empty_and_what_they_are_once_there_are_some(
    session: Recorded, made: Scored, tmp_path: Path
) -> None:
    assert "Held-out errors: none before the first training." in session.texts("/session")[0]
    assert "Held-out errors: **30.0 % of the width**, 40.0 degrees." in session.texts("/session")[-1]
    screen = recording_screen(tmp_path / "none.rrd")
    live = LiveSession(screen, BODY, made.theta, CONFIG.loss)
    live.add_training(TrainingMoment("training", 1, 0.1, float("nan"), float("nan"), float("nan")), 1)
    assert "the trainer has no recordings to evaluate on" in recorded(screen, tmp_path / "none.rrd").texts("/session")[-1]
    assert "Held-out" not in summary_page(SessionOverview(tosses=3))  # of a ranking, where nobody trains


def test_a_rejected_throw_has_its_reason_in_short_and_its_own_view_has_it_whole(made: Scored) -> None:
    detail = "rejected: displacement beside the velocity: found 0.7 m/s at frame 56, expected at most 0.4 m/s"
    throw = ThrowMade("designed", "executed", throw_of(made.tosses[0], "t"), 1.0, float("nan"), detail)
    assert "| rejected: displacement beside the velocity |" in throws_page([throw])


def test_the_spectrum_is_relative_to_all_tosses(session: Recorded, made: Scored) -> None:
    (tensor,) = session.column("/spectrum", "BarChart:values")[-1]
    drawn = np.asarray(tensor["buffer"])
    assert drawn == pytest.approx(made.curation(TOP).spectrum, abs=1e-6)


def test_gated_motions_throws_and_health_are_told(session: Recorded) -> None:
    assert session.texts("/rejected")[1:] == ["- **12:35:00** (33 frames): found a jump, expected none"]
    assert session.times("/rejected", "toss") == [0, COUNT]
    assert "designed | commanded" in session.texts("/throws")[1]
    assert "No throw is under way" in session.texts("/throws")[-1]
    (health,) = session.texts("/health")
    assert "not shown, because the dashboard was behind: 3 of toss" in health
    assert "| trainer | ended | fine |" in health
    assert "| curator | ok | fine |" in health
    assert "| scorer | **silent** | fine |" in health
    assert "| player | **warns** | slow; queue 9 |" in health


def test_a_throw_that_is_under_way_is_an_arrow_until_it_was_made(made: Scored, tmp_path: Path) -> None:
    screen = recording_screen(tmp_path / "one.rrd")
    live = LiveSession(screen, BODY, made.theta, CONFIG.loss)
    throw = throw_of(made.tosses[0], "one")
    live.add_throw(ThrowMade("exploration", "commanded", throw, 0.0, float("nan"), "theta is not trusted"))
    live.add_throw(ThrowMade("exploration", "executed", throw, 0.0, float("nan"), "theta is not trusted"))
    written = recorded(screen, tmp_path / "one.rrd")
    (arrow,) = written.column("/scene/next/velocity", "Arrows3D:vectors")[0]
    assert arrow == pytest.approx(0.12 * throw.linear_velocity, abs=1e-6)
    assert written.rows("/scene/next") == 1
    assert written.scalars("/gains/realised") == []


def test_stamps_of_a_simulation_are_durations_and_those_of_a_robot_are_dates(made: Scored, tmp_path: Path) -> None:
    kinds = {}
    for name, shift in (("robot", 0), ("simulation", made.tosses[0].stamps_ns[0])):
        path = tmp_path / f"{name}.rrd"
        screen = recording_screen(path)
        screen.frames(
            "thing", 1, made.tosses[0].stamps_ns - shift, rr.Points3D.columns(positions=np.zeros((made.tosses[0].frames, 3)))
        )
        kinds[name] = recorded(screen, path).kind("/thing", "ros_time")
    assert kinds == {"robot": "timestamp[ns]", "simulation": "duration[ns]"}


def test_errors_far_beyond_the_width_are_drawn_at_the_top_and_what_is_not_finite_not_at_all(
    made: Scored, tmp_path: Path
) -> None:
    screen = recording_screen(tmp_path / "errors.rrd")
    live = LiveSession(screen, BODY, made.theta, CONFIG.loss)
    live.add_training(TrainingMoment("training", 0, 0.0, float("nan"), 2150.0, float("nan")), 1)
    live.add_training(TrainingMoment("training", 1, 0.01, 0.1, 20.0, 30.0), 2)
    written = recorded(screen, tmp_path / "errors.rrd")
    assert written.scalars("/errors/position") == [100.0, 20.0]
    assert written.scalars("/errors/rotation") == [30.0]
    assert written.scalars("/losses/training") == [-2.0]
    assert written.scalars("/losses/held_out") == [-1.0]


def test_a_kept_set_waits_for_information_that_has_not_come(made: Scored, tmp_path: Path) -> None:
    screen = recording_screen(tmp_path / "waits.rrd")
    live = LiveSession(screen, BODY, made.theta, CONFIG.loss)
    live.set_selected(selected_set(made.curation(TOP), TOP, COUNT, made.theta.version), 0)
    for information in made.informations[:-1]:
        live.add_information(information)
    missing = made.informations[-1]
    drawable = missing.toss_id not in made.curation(TOP).ranking.selected_ids
    assert not live.show_ranking()
    live.add_information(missing)
    assert live.show_ranking()
    assert recorded(screen, tmp_path / "waits.rrd").rows("/ranking") == 1 + drawable


def test_the_page_follows_the_prior_of_the_ranking(made: Scored, tmp_path: Path) -> None:
    config = RankingConfig(top=TOP, prior=0.3)
    curation = curate(made.informations, config)
    screen = recording_screen(tmp_path / "prior.rrd")
    live = LiveSession(screen, BODY, made.theta, CONFIG.loss, ranking=config)
    live.set_selected(selected_set(curation, TOP, COUNT, made.theta.version), 0)
    for information in made.informations:
        live.add_information(information)
    assert live.show_ranking()
    page = recorded(screen, tmp_path / "prior.rrd").texts("/ranking")[-1]
    assert f"their estimate is {number(curation.optimum_shift.distance)} sigma from" in page


def test_a_toss_that_comes_twice_is_one_and_a_new_theta_predicts_the_newest_again(made: Scored, tmp_path: Path) -> None:
    screen = recording_screen(tmp_path / "twice.rrd")
    live = LiveSession(screen, BODY, made.theta, CONFIG.loss)
    for toss in (made.tosses[0], made.tosses[1], made.tosses[0]):
        live.add_toss(toss)
    assert live.tosses == 2
    assert made.theta.geometry is not None
    live.set_theta(ShownTheta("next", made.theta.geometry))
    live.show_motion()
    written = recorded(screen, tmp_path / "twice.rrd")
    assert written.times("/scene/predicted/trail", "toss") == [1, 2, 2]


def test_information_of_old_thetas_is_forgotten(made: Scored, tmp_path: Path) -> None:
    live = LiveSession(recording_screen(tmp_path / "old.rrd"), BODY, made.theta, CONFIG.loss)
    for version in "abcdefgh":
        live.add_information(replace(made.informations[0], parameters_version=version))
        live.set_theta(replace(made.theta, version=version))
    assert list(live._informations) == list(live._thetas) == ["g", "h"]
