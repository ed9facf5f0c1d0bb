"""Shapley values of nearest neighbours against the definition, by all subsets."""

from itertools import combinations
from math import comb

import numpy as np
import pytest

from contact_curation.experiments.counterfactuals.neighbours import knn_shapley, shapley_values
from contact_curation.geometry.quaternions import Array
from test.simulated import simulated_tosses


def by_definition(distances: Array, values: Array, neighbours: int) -> list[float]:
    """The mean over all orders of what a player adds, as a sum over subsets of the others."""

    def worth(players: tuple[int, ...]) -> float:
        nearest = sorted(players, key=lambda player: float(distances[player]))[:neighbours]
        return sum(float(values[player]) for player in nearest) / neighbours

    count = len(values)
    found = []
    for player in range(count):
        others = [other for other in range(count) if other != player]
        found.append(
            sum(
                (worth((*chosen, player)) - worth(chosen)) / (count * comb(count - 1, size))
                for size in range(count)
                for chosen in combinations(others, size)
            )
        )
    return found


@pytest.mark.parametrize("neighbours", [1, 2, 3, 6, 9])
def test_the_recursion_is_the_shapley_value_of_its_definition(neighbours: int) -> None:
    rng = np.random.default_rng(neighbours)
    distances, values = rng.uniform(size=(3, 6)), rng.uniform(size=(3, 6))
    found = shapley_values(distances, values, neighbours)
    for game in range(3):
        assert found[game] == pytest.approx(by_definition(distances[game], values[game], neighbours))


def test_a_toss_that_ends_as_the_judge_does_is_worth_more_than_its_neighbour_that_ends_elsewhere() -> None:
    tosses = simulated_tosses(8, 0)
    found = knn_shapley(tosses, tosses[2:3])
    assert found.argmax() == 2
    assert found.argmin() == 0  # turns twice as far
