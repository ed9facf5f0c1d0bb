"""What designed throws are compared with: throws at random, and the paper's, the best of many by the trace of each alone."""

from collections.abc import Sequence

import numpy as np

from contact_curation.design.candidates import Candidates
from contact_curation.design.planner import Plan, Planner
from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array
from contact_curation.information.accumulated import Accumulated
from contact_curation.information.ties import descending


def random_plan(planner: Planner, names: Sequence[str], known: Sequence[Accumulated], seed: int) -> Plan:
    """The first throws of the pool that may be made; errors as `Planner.plan`."""
    candidates = planner.pool(seed)
    return _first(planner, names, known, candidates, -np.arange(len(candidates.states), dtype=float))


def top_trace_plan(planner: Planner, names: Sequence[str], known: Sequence[Accumulated], seed: int) -> Plan:
    """The throws of the largest trace each, summed over the particles (Algorithm 2 of the paper); errors as `Planner.plan`.

    By the Gauss-Newton matrix: by the empirical one that the paper takes, throws that the model itself predicted would be
    ranked by rounding errors (METHOD 0.4).
    """
    candidates = planner.pool(seed)
    traces = np.sum([np.trace(fishers, axis1=1, axis2=2) for fishers in candidates.fishers], axis=0)
    return _first(planner, names, known, candidates, traces)


def _first(planner: Planner, names: Sequence[str], known: Sequence[Accumulated], candidates: Candidates, scores: Array) -> Plan:
    """The safe throws of the largest scores."""
    picked: list[int] = []
    for index in descending(scores):
        if len(picked) == len(names):
            break
        if candidates.refusals[index] is None and planner.outlook.last_refusals(candidates.states[[index]])[0] is None:
            picked.append(int(index))
    if len(picked) < len(names):
        raise InvalidValueError("releases that may be thrown", f"{len(picked)} of {len(scores)}", f"{len(names)}")
    return planner.planned(names, candidates.taken(picked), known, candidates.refusals)
