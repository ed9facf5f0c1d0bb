"""Greedy batches and their refinement: as plain loops would pick them, never worse, the same for the same seed."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from contact_curation.contact.evaluation import Estimator
from contact_curation.design.candidates import Candidates
from contact_curation.design.execution_noise import ERRORS, ExecutionNoise
from contact_curation.design.exploration import exploration_plan
from contact_curation.design.greedy_batch import (
    RefinementConfig,
    accumulated,
    gains,
    greedy_batch,
    prior_coordinates,
    refined,
    with_fishers,
)
from contact_curation.design.planner import STATED, Planner, random_plan, top_trace_plan
from contact_curation.design.predicted_information import Particle, PredictionConfig, predicted_information, predicted_motions
from contact_curation.design.readiness import spearman
from contact_curation.design.releases import Releases
from contact_curation.design.throw import Throw
from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array
from contact_curation.information.accumulated import Accumulated
from contact_curation.information.record import TossInformation
from contact_curation.information.scoring import Scorer, ScoringConfig
from test.design.cases import CUBE, LOSS, PARTICLE, SMALL, TRUE, other_theta, releases
from test.simulated import simulated_tosses

THETAS = (PARTICLE, other_theta())


@pytest.fixture(scope="module")
def planner() -> Planner:
    return Planner([PARTICLE], config=SMALL)


@pytest.fixture(scope="module")
def pools() -> list[Array]:
    """Per theta the information of ten throws."""
    states = releases(10)
    return [predicted_information(theta, predicted_motions(theta, states)).fishers for theta in THETAS]


def known_infos(count: int = 3) -> list[TossInformation]:
    found = PARTICLE.scorer.score(simulated_tosses(count, seed=2))
    return [info for info in found if isinstance(info, TossInformation)]


def log_det(states: Sequence[Accumulated], pools: Sequence[Array], chosen: Sequence[int]) -> float:
    """Mean over the particles of what a set adds, by determinants of whole matrices."""
    return float(gains(states, [pool[list(chosen)].sum(axis=0)[None] for pool in pools])[0])


@pytest.mark.parametrize("particles", [1, 2])
def test_a_lazy_batch_is_what_plain_loops_pick_and_near_the_best_there_is(pools: list[Array], particles: int) -> None:
    used, thetas = pools[:particles], THETAS[:particles]
    states = [Accumulated.prior_only(prior_coordinates(pool, 1e-3)) for pool in used]
    picked = greedy_batch(thetas, states, used, 3)
    plain: list[int] = []
    for _ in range(3):
        rest = [k for k in range(10) if k not in plain]
        plain.append(max(rest, key=lambda k: log_det(states, used, [*plain, k])))
    assert picked.indices.tolist() == plain
    assert picked.gains.sum() == pytest.approx(log_det(states, used, plain), rel=1e-6)
    assert (np.diff(picked.gains) <= 1e-9).all()
    best = max(log_det(states, used, chosen) for chosen in combinations(range(10), 3))
    assert (1.0 - 1.0 / np.e) * best <= log_det(states, used, plain) <= best + 1e-9


def test_what_is_known_is_worth_less_again(planner: Planner) -> None:
    infos = known_infos()
    nothing, something = planner.known(), planner.known([infos])
    fishers = [infos[0].fisher()[None]]
    assert gains(something, fishers)[0] < 0.5 * gains(nothing, fishers)[0]
    again = [with_fishers(nothing[0], np.array([info.fisher() for info in infos]))]
    assert gains(again, fishers)[0] == pytest.approx(gains(something, fishers)[0], rel=1e-6)


def test_tosses_that_were_scored_in_another_way_are_refused(planner: Planner) -> None:
    toss = simulated_tosses(1, seed=2)
    elsewhere = other_theta().scorer.score(toss)
    empirical = Scorer(TRUE, CUBE, ScoringConfig(estimator=Estimator.EMPIRICAL, loss=LOSS)).score(toss)
    for scored, name in ((elsewhere, "parameters_version"), (empirical, "estimator")):
        assert isinstance(scored[0], TossInformation)
        with pytest.raises(InvalidValueError, match=f"{name} of toss"):
            planner.known([[scored[0]]])
    with pytest.raises(InvalidValueError, match="parameters of toss"):
        accumulated(np.eye(3), known_infos(1))


def batch_of(planner: Planner, count: int) -> tuple[Candidates, tuple[Accumulated, ...]]:
    known = planner.known()
    candidates = planner.pool(0)
    usable = candidates.taken(np.flatnonzero(candidates.usable))
    return usable.taken(greedy_batch(planner.particles, known, usable.expected, count).indices), known


def test_refinement_never_loses_and_with_a_few_generations_wins(planner: Planner) -> None:
    batch, known = batch_of(planner, 2)
    value = planner.planned(["a", "b"], batch, known).expected
    values = {}
    for generations in (0, 1, 6):
        config = RefinementConfig(generations=generations, population=6)
        better = refined(planner.evaluator, known, batch, config, 0)
        values[generations] = planner.planned(["a", "b"], better, known).expected
    assert values[0] == value
    assert value <= values[1] <= values[6]
    assert values[6] > value + 0.1


def test_moves_that_lead_astray_are_not_taken(planner: Planner) -> None:
    batch, known = batch_of(planner, 1)
    batch = refined(planner.evaluator, known, batch, RefinementConfig(generations=12, population=8), 0)  # hard to better
    value = gains(known, batch.fishers)[0]
    for seed in range(4):
        config = RefinementConfig(generations=2, population=4, step=3.0)
        assert gains(known, refined(planner.evaluator, known, batch, config, seed).fishers)[0] >= value


def test_refined_throws_keep_the_limits_however_far_moves_go(planner: Planner) -> None:
    batch, known = batch_of(planner, 1)
    for seed in range(4):
        config = RefinementConfig(generations=3, population=6, step=4.0, tries=1)
        better = refined(planner.evaluator, known, batch, config, seed)
        assert planner.evaluator.refusals(better.releases) == (None,)
        assert planner.evaluator.motion_refusals(better.states) == (None,)


def test_a_plan_repeats_by_its_seed_and_names_gains_that_fall_as_more_is_known(planner: Planner) -> None:
    names = ["a", "b"]
    plans = [planner.plan(names, planner.known(), seed) for seed in (4, 4, 5)]
    one, other, third = ([throw.to_mapping() for throw in plan.throws] for plan in plans)
    assert one == other != third
    assert [throw.throw_id for throw in plans[0].throws] == names
    first, second = (throw.expected_information for throw in plans[0].throws)
    assert first > second > 0.0
    assert {throw.parameters_version for throw in plans[0].throws} == {PARTICLE.version}


@pytest.mark.slow
@pytest.mark.parametrize("count", [1, 3])
def test_the_sieve_leaves_what_all_executions_would_have_picked_and_keeps_the_refused(planner: Planner, count: int) -> None:
    candidates = replace(
        SMALL.candidates, forecast=PredictionConfig(executions=8), safety=replace(SMALL.candidates.safety, share=0.01)
    )
    config = replace(SMALL, pool=96, finalists=8, candidates=candidates)
    wide = Planner([PARTICLE], config=config)
    known = wide.known([known_infos()])
    whole, some = wide.pool(5), wide.finalists(5, known, count)
    usable = whole.taken(np.flatnonzero(whole.usable))
    final = some.taken(np.flatnonzero(some.usable))
    assert len(final.states) <= max(8, 16 * count) + count < len(usable.states)
    assert {state.tobytes() for state in final.states} <= {state.tobytes() for state in usable.states}
    picked, sieved = (greedy_batch([PARTICLE], known, one.expected, count) for one in (usable, final))
    assert sieved.gains.sum() > 0.98 * picked.gains.sum()
    assert sum(refusal is not None for refusal in some.refusals) <= sum(refusal is not None for refusal in whole.refusals)


def test_a_search_has_as_many_executions_as_it_asks_for(planner: Planner) -> None:
    judged = Releases.of_states(releases(2))
    few, forecast, many = (planner.evaluator.evaluate(judged, count) for count in (2, None, 6))
    assert [one.fishers[0].shape[1] for one in (few, forecast, many)] == [2, SMALL.candidates.forecast.executions, 6]
    assert np.array_equal(few.fishers[0], many.fishers[0][:, :2])


def test_where_the_thrower_can_make_no_finalist_the_rest_of_the_pool_is_looked_at() -> None:
    config = replace(SMALL, pool=40, finalists=1)
    free = Planner([PARTICLE], config=config)
    final = free.finalists(0, free.known(), 1)
    heights = {float(state[2]) for state in final.taken(np.flatnonzero(final.usable)).states}
    assert 0 < len(heights) < 30

    def picky(throws: Sequence[Throw]) -> list[str | None]:
        return ["no" if float(throw.position[2]) in heights else None for throw in throws]

    planner = Planner([PARTICLE], config=replace(config, refinement=replace(config.refinement, generations=0)), feasible=picky)
    assert float(planner.plan(["a"], planner.known(), 0).throws[0].position[2]) not in heights


def test_known_tosses_change_what_is_planned(planner: Planner) -> None:
    bare = planner.plan(["a"], planner.known(), 0)
    informed = planner.plan(["a"], planner.known([known_infos(8)]), 0)
    assert informed.expected < 0.5 * bare.expected


def test_noise_changes_the_plan_and_not_what_gains_are_measured_from(planner: Planner) -> None:
    noisy = planner.with_noise(ExecutionNoise(planner.evaluator.noise.config, np.full(ERRORS, 1.0), np.eye(ERRORS)))
    fishers = [known_infos(1)[0].fisher()[None]]
    assert gains(noisy.known(), fishers)[0] == gains(planner.known(), fishers)[0]
    assert noisy.pool(0).fishers[0].tobytes() != planner.pool(0).fishers[0].tobytes()


def test_what_reference_throws_tell_is_in_units_of_their_mean_and_agrees_between_thetas_that_are_alike(
    planner: Planner,
) -> None:
    scores = planner.reference_scores()
    assert scores.mean() == pytest.approx(1.0)
    agreement = [
        spearman(scores, Planner([other_theta(*like)], config=SMALL).reference_scores()) for like in ((1.0, 0.182), (1.4, 0.9))
    ]
    assert agreement[0] > 0.8 > agreement[1]


def test_a_thrower_that_can_do_nothing_ends_in_one_line_that_says_why() -> None:
    def never(throws: Sequence[Throw]) -> list[str | None]:
        return ["joint 4: too fast"] * len(throws)

    planner = Planner([PARTICLE], config=SMALL, feasible=never)
    with pytest.raises(InvalidValueError, match=r"releases that may be thrown: found 0 of 16 \(joint 4: too fast\)"):
        planner.plan(["a"], planner.known(), 0)
    with pytest.raises(InvalidValueError, match="releases that may be thrown: found 0 of 16"):
        exploration_plan(planner, ["a"], planner.known(), 0)


def test_only_what_the_thrower_can_do_is_planned() -> None:
    asked = Counter[bool]()

    def low(throws: Sequence[Throw]) -> list[str | None]:
        answers = [None if throw.position[2] < 0.14 else "too high" for throw in throws]
        asked.update(answer is None for answer in answers)
        return answers

    planner = Planner([PARTICLE], config=SMALL, feasible=low)
    known = planner.known()
    for plan in (planner.plan(["a", "b"], known, 0), random_plan(planner, ["a", "b"], known, 0)):
        assert all(throw.position[2] < 0.14 for throw in plan.throws)
    assert all(throw.position[2] < 0.14 for throw in exploration_plan(planner, ["a", "b"], known, 0).throws)
    assert asked[False] > 0


def test_a_board_on_which_nothing_rests_leaves_no_plan() -> None:
    safety = replace(SMALL.candidates.safety, board_half_width=1e-6)
    planner = Planner([PARTICLE], config=replace(SMALL, candidates=replace(SMALL.candidates, safety=safety)))
    with pytest.raises(InvalidValueError, match=r"releases that may be thrown: found 0 of 16 \(rest: found "):
        planner.plan(["a"], planner.known(), 0)


def test_particles_must_be_of_one_body_and_form() -> None:
    published = Particle(replace(TRUE, normal=np.array([0.0, 0.0, 1.1])), CUBE, LOSS)
    for particles in ([], [PARTICLE, published]):
        with pytest.raises(InvalidValueError, match="thetas to design at"):
            Planner(particles, config=SMALL)


def test_the_gain_of_a_throw_is_stated_by_executions_that_did_not_choose_it(planner: Planner) -> None:
    known = planner.known()
    throws = planner.plan(["a", "b"], known, 4).throws
    again = Releases.of_states(np.array([throw.release for throw in throws]))
    chosen, afresh = planner.evaluator.evaluate(again), planner.forecast(again)
    assert [fishers.shape[1] for fishers in (*chosen.fishers, *afresh.fishers)] == [2, STATED]
    stated = gains(known, afresh.fishers)
    assert throws[0].expected_information == pytest.approx(stated[0], rel=1e-3)
    assert throws[0].expected_information != pytest.approx(gains(known, chosen.fishers)[0], rel=1e-3)
    assert throws[1].expected_information < stated[1]  # beside the first


def test_baselines_draw_the_same_pool_and_pick_by_chance_or_by_trace(planner: Planner) -> None:
    known = planner.known()
    candidates = planner.pool(1)
    by_trace = top_trace_plan(planner, ["a", "b"], known, 1)
    traces = np.trace(candidates.expected[0], axis1=1, axis2=2)
    largest = candidates.states[np.argsort(-traces)[:2]]
    np.testing.assert_array_equal([throw.release for throw in by_trace.throws], largest)
    by_chance = random_plan(planner, ["a", "b"], known, 1)
    np.testing.assert_array_equal([throw.release for throw in by_chance.throws], candidates.states[:2])
    designed = planner.plan(["a", "b"], known, 1)
    assert designed.expected > max(by_trace.expected, by_chance.expected)


def test_a_throw_that_tells_of_one_thing_or_another_gains_the_mean_and_not_both() -> None:
    state = Accumulated.prior_only(np.eye(2))
    either = np.array([np.diag([99.0, 0.0]), np.diag([0.0, 9.0])])[None]
    both = np.diag([99.0, 9.0])[None]
    assert gains([state], [either])[0] == pytest.approx(0.5 * np.log(100.0 * 10.0))
    assert gains([state], [both])[0] == pytest.approx(np.log(100.0 * 10.0))
    assert gains([state], [either.mean(axis=1)])[0] == pytest.approx(np.log(50.5 * 5.5))
