"""What waits for the worker keeps its order, has a bound, and is never lost while things go on."""

import threading
import time

import pytest

from contact_curation.nodes.ros import worker
from contact_curation.nodes.ros.worker import Inbox


def test_items_come_out_in_their_order_as_many_as_are_wanted() -> None:
    box = Inbox[int](10, lambda: True)
    for item in range(7):
        box.put(item)
    assert len(box) == 7
    assert (box.take(3), box.take(10), box.take(10)) == ([0, 1, 2], [3, 4, 5, 6], [])
    assert not box


def test_a_full_box_makes_whoever_brings_more_wait_and_nothing_is_lost() -> None:
    box, most = Inbox[int](4, lambda: True), 0

    def bring() -> None:
        for item in range(200):
            box.put(item)

    bringer = threading.Thread(target=bring, daemon=True)
    bringer.start()
    taken: list[int] = []
    while len(taken) < 200:
        most = max(most, len(box))
        taken += box.take(3)
    bringer.join()
    assert taken == list(range(200))
    assert most <= 4


def test_when_nothing_is_taken_any_more_nobody_waits_for_ever(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(worker, "PATIENCE", 0.01)
    goes_on = [True]
    box = Inbox[int](1, lambda: goes_on[0])
    box.put(1)
    bringer = threading.Thread(target=box.put, args=(2,), daemon=True)
    bringer.start()
    time.sleep(0.05)
    assert bringer.is_alive()
    goes_on[0] = False
    bringer.join(5.0)
    assert not bringer.is_alive()
    assert box.take(5) == [1]
