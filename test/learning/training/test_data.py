"""Every epoch takes each row once, in batches of nearly equal size, in an order that a seed decides and a state restores."""

import json

import numpy as np
import pytest

from contact_curation.errors import InvalidValueError
from contact_curation.learning.training.data import Batches


def batches(count: int = 10, size: int = 4, seed: int = 0) -> Batches:
    return Batches(count, size, np.random.default_rng(seed))


@pytest.mark.parametrize(("count", "size", "sizes"), [(10, 4, {3, 4}), (8, 4, {4}), (9, 8, {4, 5}), (3, 8, {3}), (3, 1, {1})])
def test_an_epoch_takes_each_row_once_in_batches_of_nearly_equal_size(count: int, size: int, sizes: set[int]) -> None:
    some = batches(count, size)
    for _ in range(3):
        taken = [some.take()]
        while not some.at_epoch_end:
            taken.append(some.take())
        assert {len(rows) for rows in taken} == sizes
        np.testing.assert_array_equal(np.sort(np.concatenate(taken)), np.arange(count))


def test_epochs_differ_and_a_seed_decides_them() -> None:
    first, again, other = batches(100, 100), batches(100, 100), batches(100, 100, seed=1)
    epochs = [first.take() for _ in range(2)]
    assert not np.array_equal(epochs[0], epochs[1])
    np.testing.assert_array_equal([again.take() for _ in range(2)], epochs)
    assert not np.array_equal(other.take(), epochs[0])


@pytest.mark.parametrize("counts", [[1, 2, 1, 3], [5, 9], [2, 2, 2]])
def test_batches_ahead_are_those_that_are_taken_up_to_the_end_of_the_epoch(counts: list[int]) -> None:
    one, other = batches(9, 2), batches(9, 2)
    for count in counts:
        left = one.left
        ahead = one.ahead(count)
        taken = [other.take() for _ in range(min(count, left))]
        np.testing.assert_array_equal(ahead, np.concatenate(taken))
        one.skip(len(taken))
        assert one.at_epoch_end == other.at_epoch_end
    np.testing.assert_array_equal(one.take(), other.take())


@pytest.mark.parametrize("taken", [0, 1, 3, 4])
def test_a_restored_order_goes_on_where_it_was(taken: int) -> None:
    one, other = batches(), batches(seed=9)
    for _ in range(taken):
        one.take()
    other.restore(one.order, json.loads(json.dumps(one.state())))
    for _ in range(7):
        np.testing.assert_array_equal(other.take(), one.take())


@pytest.mark.parametrize(("order", "taken"), [([0, 1, 2], 0), ([0, 0, 1, 2, 3, 4, 5, 6, 7, 8], 0), (list(range(10)), 4)])
def test_what_is_no_order_or_no_place_in_it_is_refused(order: list[int], taken: int) -> None:
    some = batches()
    with pytest.raises(InvalidValueError):
        some.restore(np.array(order), {**some.state(), "taken": taken})
