"""What the information of ContactNets' tosses must satisfy (method.md 6.4 to 6.11, 6.17)."""

import functools
from dataclasses import dataclass, replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import spearmanr

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.contact.evaluation import Estimator, evaluate, fisher_sums
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.parameter_form import Form, parameter_form
from contact_curation.contact.rollout import rollout
from contact_curation.geometry import quaternions
from contact_curation.geometry.quaternions import Array
from contact_curation.information.factors import Compression
from contact_curation.information.pool import Pool, pool_of
from contact_curation.information.ranker import RankingConfig, rank
from contact_curation.information.record import Rows, TossInformation
from contact_curation.information.scoring import Scorer, ScoringConfig
from contact_curation.motion.toss import Toss
from contact_curation.motion.transitions import Transitions

CUBE = CONTACTNETS_CUBE
TRUE = ContactGeometry.of_body(CUBE)
LEGACY = 57
NORMAL = slice(24, 27)
ESTIMATORS = pytest.mark.parametrize("estimator", list(Estimator))
IN_FULL = Compression(max_rows=52)


def block_traces(before: Array, after: Array, dt: Array) -> Array:
    """Empirical traces of the blocks vertices_normal, normal, vertices_tangent, tangents at the truth."""
    squares = np.square(evaluate(TRUE, CUBE, before, after, dt).scores[:, :LEGACY]).sum(axis=0)
    return np.array([part.sum() for part in np.split(squares, [24, 27, 51])])


@functools.cache
def cube_rotations() -> tuple[Array, ...]:
    """The 24 unit quaternions that turn a cube into itself."""
    half = np.sqrt(0.5)
    quarter = [quaternions.exp(np.pi / 2 * axis) for axis in np.eye(3)]
    found = [quaternions.IDENTITY]
    for q in found:
        for turn in quarter:
            new = quaternions.multiply(q, turn)
            if all(abs(new @ old) < half + 0.2 for old in found):
                found.append(new)
    assert len(found) == 24
    return tuple(found)


def test_a_yaw_of_the_board_changes_no_block(real_transitions: Transitions) -> None:
    stop = real_transitions.starts[40]
    before, after, dt = real_transitions.before[:stop], real_transitions.after[:stop], real_transitions.dt[:stop]
    yaw = quaternions.exp([0.0, 0.0, 0.7])

    def turned(states: Array) -> Array:
        parts = (quaternions.rotate(yaw, states[:, :3]), quaternions.multiply(yaw, states[:, 3:7]))
        return np.concatenate([*parts, quaternions.rotate(yaw, states[:, 7:10]), states[:, 10:]], axis=1)

    np.testing.assert_allclose(block_traces(turned(before), turned(after), dt), block_traces(before, after, dt), rtol=1e-12)


def test_no_rotation_of_the_cube_into_itself_changes_a_block(real_transitions: Transitions) -> None:
    stop = real_transitions.starts[10]
    before, after, dt = real_transitions.before[:stop], real_transitions.after[:stop], real_transitions.dt[:stop]
    expected = block_traces(before, after, dt)
    for q in cube_rotations():

        def relabelled(states: Array, q: Array = q) -> Array:
            spin = quaternions.rotate(quaternions.conjugate(q), states[:, 10:])
            return np.concatenate([states[:, :3], quaternions.multiply(states[:, 3:7], q), states[:, 7:10], spin], axis=1)

        np.testing.assert_allclose(block_traces(relabelled(before), relabelled(after), dt), expected, rtol=1e-10)


@pytest.mark.slow
def test_a_shift_of_the_board_changes_the_normals_block_of_the_legacy_form_only(real_transitions: Transitions) -> None:
    rows, shift = real_transitions, np.zeros(13)
    shift[:2] = 3.0, -2.0
    here = block_traces(rows.before, rows.after, rows.dt)
    there = block_traces(rows.before + shift, rows.after + shift, rows.dt)
    np.testing.assert_allclose(there[[0, 2, 3]], here[[0, 2, 3]], rtol=1e-12)
    assert abs(there.sum() / here.sum() - 1.0) > 0.3
    assert here[1] / here.sum() == pytest.approx(0.77, abs=0.02)  # method.md 0.7


@ESTIMATORS
def test_in_the_physical_form_a_shift_changes_nothing(real_tosses: tuple[Toss, ...], estimator: Estimator) -> None:
    tosses = real_tosses[:40]
    moved = [replace(toss, positions=toss.positions + np.array([0.157, -0.105, 0.0])) for toss in tosses]
    scorer = Scorer(TRUE, CUBE, ScoringConfig(estimator=estimator))
    here, there = (pool_of(scored(scorer, given)) for given in (tosses, moved))
    np.testing.assert_allclose(traces_about_the_pivot(there), traces_about_the_pivot(here), rtol=1e-9)
    np.testing.assert_allclose(there.fisher, here.fisher, atol=1e-9 * np.trace(here.fisher))


def traces_about_the_pivot(pool: Pool) -> Array:
    """(K,) traces with the tilt about the pool's centroid."""
    return np.array([np.square(pool.stacked([k])).sum() for k in range(len(pool))])


def scored(scorer: Scorer, tosses: tuple[Toss, ...] | list[Toss]) -> list[TossInformation]:
    found = [info for info in scorer.score(tosses) if isinstance(info, TossInformation)]
    assert len(found) == len(tosses)
    return found


@dataclass(frozen=True, eq=False)
class Sums:
    """Legacy Fisher matrices (570, 57, 57) and losses at one theta."""

    fishers: Array
    losses: Array

    @property
    def traces(self) -> Array:
        return np.asarray(np.trace(self.fishers, axis1=1, axis2=2))


def sums_of(geometry: ContactGeometry, rows: Transitions, estimator: Estimator, bound: float = np.inf) -> Sums:
    found = fisher_sums(geometry, CUBE, rows.before, rows.after, rows.dt, rows.starts, estimator, bound)
    assert (found.status == 0).all()
    return Sums(found.fishers[:, :LEGACY, :LEGACY], found.losses)


def test_the_gauge_is_in_no_score_and_singular_in_the_pool(real_transitions: Transitions) -> None:
    """method.md 6.5."""
    rows = real_transitions
    gauge = parameter_form(TRUE, Form.CONTACTNETS).gauge[0]
    scores = evaluate(TRUE, CUBE, rows.before, rows.after, rows.dt).scores[:, :LEGACY]
    assert np.square(scores @ gauge).sum() / np.square(scores).sum() < 1e-12
    telling = np.square(scores).sum(axis=1) > 1e-6
    assert (np.square(scores[telling] @ gauge) / np.square(scores[telling]).sum(axis=1)).max() < 1e-10
    values, vectors = np.linalg.eigh(sums_of(TRUE, rows, Estimator.EMPIRICAL).fishers.sum(axis=0))
    assert abs(values[0]) / values[-1] < 1e-12
    assert abs(vectors[:, 0] @ gauge) > 1.0 - 1e-6
    assert values[1] / values[-1] > 1e-7


@pytest.mark.slow
@ESTIMATORS
def test_information_adds(real_transitions: Transitions, estimator: Estimator) -> None:
    """method.md 6.6: over any split of the pool."""
    traces = sums_of(TRUE, real_transitions, estimator).traces
    rows = real_transitions
    joined = fisher_sums(TRUE, CUBE, rows.before, rows.after, rows.dt, rows.starts[[0, 200, 570]], estimator).fishers
    parts = np.trace(joined[:, :LEGACY, :LEGACY], axis1=1, axis2=2)
    np.testing.assert_allclose(parts, [traces[:200].sum(), traces[200:].sum()], rtol=1e-12)


@pytest.mark.slow
@ESTIMATORS
def test_flight_teaches_nothing(real_transitions: Transitions, estimator: Estimator) -> None:
    """method.md 6.7: transitions with every corner over 5 mm up before and after."""
    rows = real_transitions
    airborne = np.minimum(TRUE.gaps(rows.before), TRUE.gaps(rows.after)).min(axis=1) > 0.1
    assert airborne.mean() > 0.1
    flying = fisher_sums(
        TRUE, CUBE, rows.before[airborne], rows.after[airborne], rows.dt[airborne], [0, int(airborne.sum())], estimator
    )
    share = np.trace(flying.fishers[0, :LEGACY, :LEGACY]) / sums_of(TRUE, rows, estimator).traces.sum()
    assert share < 1e-3


@pytest.mark.slow
def test_tosses_simulated_by_the_model_itself_have_no_empirical_information(real_transitions: Transitions) -> None:
    """method.md 6.8: and what little they have is in no order; the Gauss-Newton matrix keeps the order."""
    rows = real_transitions
    lengths = np.diff(rows.starts) + 1
    rolled = rollout(TRUE, CUBE, rows.before[rows.starts[:-1]], lengths, 1.0 / 148.0)
    states = [rolled.trajectory(k) for k in range(len(lengths))]
    simulated = replace(rows, before=np.concatenate([s[:-1] for s in states]), after=np.concatenate([s[1:] for s in states]))
    ours, real = ([sums_of(TRUE, given, estimator) for estimator in Estimator] for given in (simulated, rows))
    assert ours[0].losses.mean() < 1e-4
    assert ours[0].traces.sum() < 0.01 * real[0].traces.sum()
    assert abs(spearmanr(ours[0].traces, real[0].traces).statistic) < 0.25
    assert spearmanr(ours[1].traces, real[1].traces).statistic > 0.35


SPIKED, SPIKE = 28, 5e-3 / CUBE.length_scale


def with_spikes(rows: Transitions, seed: int) -> tuple[Transitions, NDArray[np.int64]]:
    """One frame of 28 of 570 tosses 5 mm off, as a tracking outlier: its velocities jump there and back."""
    rng = np.random.default_rng(seed)
    spiked = rng.choice(len(rows.starts) - 1, SPIKED, replace=False)
    before, after = rows.before.copy(), rows.after.copy()
    for k in spiked:
        frame = int(rng.integers(rows.starts[k] + 1, rows.starts[k + 1] - 1))
        jump = rng.standard_normal(3)
        jump *= SPIKE / np.linalg.norm(jump)
        for states, row in ((before, frame), (after, frame - 1)):
            states[row, :3] += jump
            states[row, 7:10] += jump / rows.dt[frame]
            states[row + 1, 7:10] -= jump / rows.dt[frame]
    return replace(rows, before=before, after=after), spiked


@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (1, 2))])
@pytest.mark.slow
def test_tracking_outliers_win_by_trace_and_lose_by_bounded_influence_and_gauss_newton(
    real_transitions: Transitions, fitted: ContactGeometry, seed: int
) -> None:
    """method.md 6.11, at a trained theta."""
    rows, spiked = with_spikes(real_transitions, seed)
    plain = sums_of(fitted, rows, Estimator.EMPIRICAL)
    bound = float(np.quantile(plain.losses, 0.985))
    bounded = sums_of(fitted, rows, Estimator.EMPIRICAL, bound)
    profile = sums_of(fitted, rows, Estimator.GAUSS_NEWTON)
    picked = [np.isin(np.argsort(-sums.traces)[:SPIKED], spiked).sum() for sums in (plain, bounded, profile)]
    assert picked[0] >= 12
    assert picked[1] <= 2
    assert picked[2] <= 5


@pytest.fixture(scope="module")
def profile_infos(real_tosses: tuple[Toss, ...]) -> list[TossInformation]:
    """Gauss-Newton information of tosses 0 to 399 in the physical form, factors in full."""
    return scored(Scorer(TRUE, CUBE, ScoringConfig(compression=IN_FULL)), real_tosses[:400])


def test_copies_of_the_best_toss_fill_the_trace_and_are_worth_less_to_the_others(profile_infos: list[TossInformation]) -> None:
    """method.md 6.9. Log-det may take a toss twice, since it doubles what one toss knows of 50 directions, but not five
    times.
    """
    best = max(profile_infos, key=lambda info: info.trace)
    copies = [replace(best, toss_id=f"copy-{k}") for k in range(4)]
    names = {best.toss_id, *(copy.toss_id for copy in copies)}
    pool = [*profile_infos, *copies]
    taken = {
        criterion: len(names & set(rank(pool, RankingConfig(criterion=criterion, top=24)).selected_ids))
        for criterion in ("trace", "log-det", "orthogonal")
    }
    assert taken["trace"] == 5
    assert taken["log-det"] <= 2
    assert taken["orthogonal"] <= 1
    first, second = rank([best, copies[0]], RankingConfig(criterion="log-det", top=1)).entries
    assert second.marginal_gain < 0.5 * first.marginal_gain


def test_greedy_gains_on_real_tosses_only_fall(profile_infos: list[TossInformation]) -> None:
    """method.md 6.10."""
    ranking = rank(profile_infos, RankingConfig(criterion="log-det", top=32))
    gains = [toss.marginal_gain for toss in ranking.entries if toss.selected]
    assert len(gains) == 32
    assert (np.diff(gains) <= 1e-9).all()


@pytest.mark.slow
def test_new_units_change_the_order_of_the_trace_but_not_of_log_det_and_leverage(profile_infos: list[TossInformation]) -> None:
    """method.md 6.17: theta -> S theta with S from 1e-3 to 1e3, all about one pivot."""
    scale = 10.0 ** np.random.default_rng(8).uniform(-3.0, 3.0, profile_infos[0].parameters)
    pool = pool_of(profile_infos)
    flat = [in_units(info, pool.stacked([k])[0], 1.0) for k, info in enumerate(pool.infos)]
    scaled = [in_units(info, info.factor, scale) for info in flat]
    for criterion, same in (("log-det", True), ("leverage", True), ("trace", False)):
        config = RankingConfig(criterion=criterion, top=32)
        assert (rank(flat, config).selected_ids == rank(scaled, config).selected_ids) == same, criterion


def in_units(info: TossInformation, factor: Rows, scale: float | Array) -> TossInformation:
    """The same toss with a factor in other units and a tilt about a fixed pivot."""
    new = factor * scale
    traces = np.array([np.square(new[:, block.start : block.stop]).sum() for block in info.blocks])
    return replace(info, factor=new, score_sum=info.score_sum * scale, block_traces=traces, tilt_axes=np.zeros((0, 3)))
