"""Every solver on every problem: answers by hand, each other's answers, Clarabel's, and what is not a number."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from contact_curation.solver.certificate import natural_residuals, objectives
from contact_curation.solver.compiled_solver import solve_compiled
from contact_curation.solver.cone_problem import Cone, ConeProblems, ConeSolutions, SolveStatus
from test.solver.known_problems import KNOWN, KnownProblem, random_problems, with_bad_element
from test.solver.reference import clarabel_impulses
from test.solver.torch_solver import solve_in_torch

Solver = Callable[[ConeProblems], ConeSolutions]

SOLVERS = pytest.mark.parametrize("solver", [solve_compiled, solve_in_torch])
CONES = pytest.mark.parametrize("cone", list(Cone))


@SOLVERS
@CONES
@pytest.mark.parametrize("known", KNOWN, ids=lambda known: known.name)
def test_the_impulses_are_those_found_by_hand(known: KnownProblem, solver: Solver, cone: Cone) -> None:
    solutions = solver(replace(known.problems, cone=cone))
    assert solutions.status.tolist() == [SolveStatus.SOLVED]
    np.testing.assert_allclose(solutions.impulses[0], known.impulses, rtol=1e-5, atol=3e-6)


@SOLVERS
@CONES
def test_clarabel_finds_the_same_minimum(solver: Solver, cone: Cone) -> None:
    problems = replace(random_problems(60, 8, seed=1), cone=cone)
    solutions, reference = solver(problems), clarabel_impulses(problems, tolerance=1e-8)
    assert (solutions.status == SolveStatus.SOLVED).all()
    assert np.abs(objectives(problems, solutions.impulses).values - objectives(problems, reference).values).max() < 1e-6
    assert np.median(np.abs(solutions.impulses - reference)) < 1e-6


@CONES
@pytest.mark.parametrize("contacts", [1, 2, 8, 11, 64])
def test_both_solvers_agree_and_certify_themselves(contacts: int, cone: Cone) -> None:
    problems = replace(random_problems(12, contacts, seed=contacts), cone=cone)
    compiled, plain = solve_compiled(problems), solve_in_torch(problems)
    for solutions in (compiled, plain):
        assert (solutions.status == SolveStatus.SOLVED).all()
        assert solutions.residuals.max() < 1e-7
    values = [objectives(problems, solutions.impulses).values for solutions in (compiled, plain)]
    assert np.abs(values[0] - values[1]).max() < 1e-9
    assert np.abs(compiled.impulses - plain.impulses).max() < 1e-4


@SOLVERS
def test_the_reported_residual_is_the_certificate(solver: Solver) -> None:
    problems = random_problems(20, 6, seed=3)
    solutions = solver(problems)
    np.testing.assert_allclose(solutions.residuals, natural_residuals(problems, solutions.impulses), atol=1e-12)


@SOLVERS
@CONES
@pytest.mark.parametrize("batch", [1, 7, 20])
def test_a_problem_is_solved_alike_alone_and_in_a_batch(solver: Solver, cone: Cone, batch: int) -> None:
    problems = replace(random_problems(batch, 5, seed=4), cone=cone)
    together = solver(problems)
    assert together.impulses.shape == (batch, 5, 3)
    for n in range(batch):
        alone = solver(problems.rows(slice(n, n + 1)))
        np.testing.assert_allclose(alone.impulses[0], together.impulses[n], rtol=1e-6, atol=1e-8)


@SOLVERS
@CONES
@pytest.mark.parametrize("bad", [0, 3, 9])
def test_one_bad_problem_has_a_status_and_leaves_its_neighbours_alone(solver: Solver, cone: Cone, bad: int) -> None:
    problems = replace(random_problems(10, 4, seed=5), cone=cone)
    good, disturbed = solver(problems), solver(with_bad_element(problems, bad))
    assert disturbed.status[bad] == SolveStatus.NOT_FINITE
    others = np.arange(10) != bad
    assert (disturbed.status[others] == SolveStatus.SOLVED).all()
    np.testing.assert_allclose(disturbed.impulses[others], good.impulses[others], rtol=1e-6, atol=1e-8)


@CONES
@pytest.mark.parametrize("field", ["jacobians", "gaps", "gaps_next", "free_velocities", "velocities_next", "dt"])
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_number_that_is_not_finite_is_noticed_wherever_it_stands(cone: Cone, field: str, value: float) -> None:
    problems = replace(random_problems(9, 4, seed=6), cone=cone)
    numbers = getattr(problems, field).copy()
    numbers.reshape(9, -1)[4, 0] = value
    for solver in (solve_compiled, solve_in_torch):
        solutions = solver(replace(problems, **{field: numbers}))
        unsolved = solutions.status != SolveStatus.SOLVED
        assert unsolved.tolist() == [n == 4 for n in range(9)], solver.__name__
        assert not np.isnan(value) or solutions.status[4] == SolveStatus.NOT_FINITE, solver.__name__


@SOLVERS
def test_what_misses_its_tolerance_says_so(solver: Callable[..., ConeSolutions]) -> None:
    strict = solver(random_problems(12, 8, seed=7), tolerance=1e-18)
    assert (strict.residuals > 1e-18).any()
    np.testing.assert_array_equal(strict.status == SolveStatus.NOT_SOLVED, strict.residuals > 1e-18)


def test_a_kernel_out_of_iterations_says_so() -> None:
    hurried = solve_compiled(random_problems(12, 8, seed=7), max_iterations=2)
    assert (hurried.status == SolveStatus.NOT_SOLVED).all()
    assert hurried.iterations.max() == 2


def test_the_central_path_helps_where_newtons_method_is_held_up() -> None:
    problems = random_problems(12, 8, seed=7)
    helped, alone = solve_in_torch(problems, max_iterations=2), solve_in_torch(problems)
    assert helped.iterations.max() > 30 > alone.iterations.max()
    assert (helped.status == SolveStatus.SOLVED).all()
    values = [objectives(problems, solutions.impulses).values for solutions in (helped, alone)]
    assert np.abs(values[0] - values[1]).max() < 1e-9


def test_threads_change_nothing_bit_for_bit() -> None:
    problems = random_problems(700, 4, seed=8)
    alone, many = solve_compiled(problems, threads=1), solve_compiled(problems, threads=5)
    for name in ("impulses", "residuals", "status", "iterations"):
        np.testing.assert_array_equal(getattr(alone, name), getattr(many, name))


@SOLVERS
def test_no_problem_is_no_trouble(solver: Solver) -> None:
    assert solver(random_problems(1, 2, seed=9).rows(slice(0, 0))).impulses.shape == (0, 2, 3)
