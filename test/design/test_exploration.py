"""Exploration throws meet the board in different ways, whatever theta is."""

import numpy as np

from contact_curation.design.exploration import VELOCITY_WEIGHT, coverage, exploration_plan, impact_features, spread
from contact_curation.design.planner import Planner
from contact_curation.geometry import quaternions
from contact_curation.geometry.quaternions import Array
from test.design.cases import CUBE, PARTICLE, SMALL, other_theta, releases
from test.design.test_releases import turned

DROP = np.array([0.0, 0.0, 0.1524, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])


def test_a_cube_that_is_dropped_level_lands_on_its_lower_face_at_the_speed_of_its_fall() -> None:
    feature = impact_features(CUBE, DROP[None])[0]
    np.testing.assert_allclose(feature[:3], [0.0, 0.0, -1.0], atol=1e-12)
    fall = np.sqrt(2 * 9.81 * (0.1524 - 0.0524))
    np.testing.assert_allclose(feature[3:], [0.0, 0.0, -VELOCITY_WEIGHT * fall], atol=VELOCITY_WEIGHT * 9.81 / 148.0)


def test_a_cube_that_is_dropped_on_its_side_lands_on_that() -> None:
    state = DROP.copy()
    state[3:7] = quaternions.exp(np.array([np.pi / 2.0, 0.0, 0.0]))
    np.testing.assert_allclose(impact_features(CUBE, state[None])[0, :3], [0.0, -1.0, 0.0], atol=1e-12)


def test_impacts_do_not_depend_on_place_and_heading() -> None:
    states = releases(6)
    np.testing.assert_allclose(
        impact_features(CUBE, turned(states, 0.9, (0.2, 0.1))), impact_features(CUBE, states), atol=1e-12
    )


def loop_spread(features: Array, count: int, seen: Array) -> list[int]:
    """The same by plain loops."""
    picks: list[int] = []
    for _ in range(count):
        points = [*seen, *features[picks]]
        distances = [-1.0 if k in picks else min(((f - p) ** 2).sum() for p in points) for k, f in enumerate(features)]
        picks.append(int(np.argmax(distances)))
    return picks


def test_each_pick_is_the_farthest_from_all_before_it_and_from_what_was_seen() -> None:
    features = impact_features(CUBE, releases(30))
    seen = features[:2]
    assert spread(features, 5, seen, 0).tolist() == loop_spread(features, 5, seen)
    unseen = spread(features, 5, features[:0], 0).tolist()
    assert unseen[1:] == loop_spread(features, 4, features[unseen[:1]])
    assert unseen == spread(features, 5, features[:0], 0).tolist()
    assert len(set(spread(features, 99, seen, 0).tolist())) == 30


def test_spread_throws_cover_more_than_random_ones() -> None:
    features = impact_features(CUBE, releases(200))
    picked, random = features[spread(features, 12, features[:0], 0)], features[:12]
    assert coverage(features, picked, 0.5) > coverage(features, random, 0.5)
    assert coverage(features, features[:0], 0.5) == 0.0


def test_an_exploration_throw_is_the_same_at_any_theta_and_goes_on_from_what_was_thrown() -> None:
    plans = [exploration_plan(planner, ["a", "b"], planner.known(), 0) for planner in _planners()]
    one, other = ([throw.release.tolist() for throw in plan.throws] for plan in plans)
    assert one == other
    planner = _planners()[0]
    third = exploration_plan(planner, ["c"], planner.known(), 0, [throw.release for throw in plans[0].throws])
    assert third.throws[0].release.tolist() not in one


def _planners() -> list[Planner]:
    return [Planner([theta], config=SMALL) for theta in (PARTICLE, other_theta())]
