"""Cells of experiments: what a rule keeps along gradient steps, and what its model is judged by."""

from functools import cache

import numpy as np
import pytest

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.errors import InvalidValueError
from contact_curation.experiments.cell import Cell, Protocol
from contact_curation.experiments.cell_run import Bench, Row, pool_of_cell, run_cell
from contact_curation.motion.gate_config import GateConfig
from test.simulated import simulated_tosses


@cache
def bench() -> Bench:
    tosses = simulated_tosses(12, seed=3)
    return Bench(CONTACTNETS_CUBE, tosses[:10], tosses[10:], GateConfig())


def budgeted(rule: str, steps: int, seed: int = 0) -> Row:
    return run_cell(Cell(rule, 3, seed, protocol=Protocol.BUDGETED, steps=steps), bench())


def kept(row: Row) -> set[str]:
    return set(str(row["selected"]).split())


@pytest.mark.slow
def test_redrawn_tosses_are_others_at_every_look_of_the_same_size_and_follow_from_the_seed() -> None:
    row = budgeted("random-redrawn", 110)
    assert row == budgeted("random-redrawn", 110)
    sets = [kept(row), kept(budgeted("random-redrawn", 60)), kept(budgeted("random-redrawn", 20))]
    assert len({frozenset(one) for one in sets}) == 3
    assert all(len(one) == 3 for one in sets)
    pool = {toss.toss_id for toss in pool_of_cell(Cell("random", 3, 0), bench()).tosses}
    assert set().union(*sets) <= pool
    assert sets[2] == kept(budgeted("random", 20))  # until the first look


def test_redrawn_tosses_need_gradient_steps() -> None:
    with pytest.raises(InvalidValueError, match=r"random-redrawn.*expected budgeted or published"):
        Cell("random-redrawn", 3, 0)


def test_a_polytope_is_judged_with_its_own_friction_vertices_and_with_those_of_the_gaps() -> None:
    row = run_cell(Cell("random", 4, 1), bench())
    own, rigid = (np.array([row[f"{kind}{name}"] for name in ("position", "rotation")], dtype=float) for kind in ("", "rigid_"))
    assert np.isfinite([own, rigid]).all()
    assert (own != rigid).all()
