"""Numbered messages come once and in order, whatever topic and service do."""

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

from contact_curation.errors import InvalidValueError
from contact_curation.nodes.ros.catch_up import PATIENCE, REMEMBERED, CatchUp, Source
from contact_curation.stages.records import Cursor

PAGE = 4


def numbered(number: int, kind: str = "toss") -> SimpleNamespace:
    return SimpleNamespace(sequence=number, toss_id=f"{kind}-{number}")


class Server:
    """A store behind a topic and a service; answers at once, or not at all while it is dead."""

    def __init__(self, count: int, kind: str = "toss") -> None:
        self.stored = [numbered(k, kind) for k in range(1, count + 1)]
        self.alive = self.ready = True
        self.questions = 0
        self.lines: list[str] = []
        self.heard: Callable[[Any], None] = lambda message: None
        self.tick: Callable[[], None] = lambda: None

    # What CatchUp asks of a node
    def create_client(self, service: Any, name: str) -> "Server":
        return self

    def create_subscription(self, kind: Any, topic: str, heard: Callable[[Any], None], qos: Any, raw: bool) -> None:
        self.heard = heard

    def create_timer(self, period: float, tick: Callable[[], None], clock: Any) -> None:
        self.tick = tick

    def get_logger(self) -> "Server":
        return self

    def warning(self, line: str) -> None:
        self.lines.append(line)

    # What CatchUp asks of a client
    def service_is_ready(self) -> bool:
        return self.ready

    def remove_pending_request(self, future: Any) -> None:
        return

    def call_async(self, request: Any) -> "Answer":
        self.questions += 1
        assert request.after_sequence >= 0  # an unsigned number
        page = [one for one in self.stored if one.sequence > request.after_sequence][: request.limit]
        return Answer(SimpleNamespace(items=page, last_sequence=self.stored[-1].sequence if self.stored else 0), self.alive)

    def announce(self, number: int, kind: str = "toss") -> None:
        self.stored.append(numbered(number, kind))
        self.heard(self.stored[-1])


class Answer:
    """A future that is done as soon as somebody waits for it."""

    def __init__(self, response: Any, comes: bool) -> None:
        self._response = response
        self._comes = comes

    def add_done_callback(self, done: Callable[[Any], None]) -> None:
        if self._comes:
            done(self)

    def result(self) -> Any:
        return self._response


class Hand:
    """A worker that works when it is told to."""

    def __init__(self) -> None:
        self.jobs: list[Callable[[], None]] = []

    def do(self, job: Callable[[], None]) -> None:
        self.jobs.append(job)

    @property
    def waiting(self) -> int:
        return len(self.jobs)

    def work(self) -> None:
        while self.jobs:
            self.jobs.pop(0)()


def following(
    server: Server,
    cursor: Cursor = Cursor(),  # noqa: B008  (immutable)
    caught_up: Callable[[], None] = lambda: None,
    read: Callable[[bytes], Any] | None = None,
) -> tuple[CatchUp, Hand, list[str]]:
    hand, taken = Hand(), list[str]()
    request = SimpleNamespace(Request=lambda after_sequence, limit: SimpleNamespace(after_sequence=after_sequence, limit=limit))
    source = Source(object, "topic", request, "service", "items", PAGE, read)

    def handle(messages: Any, _: Cursor) -> None:
        taken.extend(message.toss_id for message in messages)

    node: Any = server
    worker: Any = hand
    return CatchUp(node, worker, source, cursor, handle, caught_up), hand, taken


def read_numbered(data: bytes) -> SimpleNamespace:
    if not data:
        raise InvalidValueError("bytes", "none", "a number")
    return numbered(int(data))


def test_what_cannot_be_read_on_the_topic_comes_from_the_service() -> None:
    server = Server(0)
    _, hand, taken = following(server, read=read_numbered)
    server.stored = [numbered(1), numbered(2)]
    server.heard(b"1")
    assert server.questions == 0
    server.heard(b"")
    hand.work()
    assert (taken, server.questions) == (expected(1, 2), 1)


def expected(first: int, last: int, kind: str = "toss") -> list[str]:
    return [f"{kind}-{number}" for number in range(first, last + 1)]


def test_who_comes_late_gets_everything_page_by_page() -> None:
    server = Server(10)
    _, hand, taken = following(server)
    server.tick()
    hand.work()
    assert taken == expected(1, 10)
    assert server.questions == 3


def test_what_comes_in_order_is_taken_from_the_topic_without_a_question() -> None:
    server = Server(0)
    _, hand, taken = following(server)
    for number in (1, 2, 3):
        server.announce(number)
    hand.work()
    assert taken == expected(1, 3)
    assert server.questions == 0


def test_a_missing_number_is_asked_for_and_order_is_kept() -> None:
    server = Server(0)
    _, hand, taken = following(server)
    server.announce(1)
    server.stored.append(numbered(2))  # stored and never announced
    server.announce(3)
    server.heard(numbered(1))  # and an old one once more
    hand.work()
    assert taken == expected(1, 3)


def test_the_place_of_an_earlier_run_is_gone_on_from() -> None:
    server = Server(9)
    _, hand, taken = following(server, Cursor(6, "toss-6"))
    server.announce(10)
    hand.work()
    assert taken == expected(7, 10)


def test_a_place_in_another_store_is_not_believed() -> None:
    server = Server(9, "new")
    _, hand, taken = following(server, Cursor(6, "toss-6"))
    server.tick()
    hand.work()
    assert taken == expected(1, 9, "new")


def test_a_store_that_is_made_anew_is_taken_from_the_beginning() -> None:
    server = Server(5)
    _, hand, taken = following(server)
    server.tick()
    hand.work()
    server.stored = [numbered(1, "new"), numbered(2, "new")]
    server.tick()
    hand.work()
    assert taken == expected(1, 5) + expected(1, 2, "new")


def test_a_question_that_a_dead_server_never_answers_is_asked_again() -> None:
    server = Server(3)
    server.alive = False
    _, hand, taken = following(server)
    server.tick()
    server.alive = True
    for _ in range(10):
        server.tick()
        hand.work()
    assert taken == expected(1, 3)


def test_starting_over_forgets_what_waits_and_takes_everything_once_more() -> None:
    server = Server(3)
    catch_up, hand, taken = following(server)
    server.tick()
    catch_up.restart()
    hand.work()
    assert taken == expected(1, 3)
    assert catch_up.cursor == Cursor(3, "toss-3")


def test_it_is_complete_when_all_that_the_source_holds_was_handled_and_says_so_then() -> None:
    server = Server(10)
    told: list[int] = []
    catch_up, hand, taken = following(server, caught_up=lambda: told.append(len(taken)))
    complete: list[bool] = []

    def look() -> None:
        complete.append(catch_up.complete)

    server.tick()
    look()  # a page is on its way to the worker
    hand.work()
    look()
    server.announce(11)
    look()
    hand.work()
    look()
    catch_up.restart()
    look()
    hand.work()
    look()
    assert complete == [False, True] * 3
    assert told == [10, 22]


def test_a_source_that_was_away_and_lost_its_last_records_is_taken_from_the_start() -> None:
    """Its numbers go up again meanwhile: the count alone would not tell."""
    server = Server(10)
    _, hand, taken = following(server)
    server.tick()
    hand.work()
    server.ready = False
    server.tick()
    server.stored = [*server.stored[:7], *(numbered(number, "other") for number in range(8, 13))]
    server.ready = True
    server.tick()
    hand.work()
    assert taken == [*expected(1, 10), *expected(1, 7), *expected(8, 12, "other")]


def test_a_late_message_of_a_store_that_was_re_created_does_not_stand_for_the_new_one_s() -> None:
    server = Server(0)
    _, hand, taken = following(server)
    server.announce(1, "former")
    server.stored = []
    server.announce(1, "new")
    server.announce(2, "new")
    hand.work()
    assert taken == ["former-1", "new-1", "new-2"]


def test_a_repetition_costs_a_question_and_nothing_else() -> None:
    server = Server(0)
    _, hand, taken = following(server)
    for number in (1, 2, 3):
        server.announce(number)
    server.heard(numbered(3))
    assert server.questions == 0
    server.heard(numbered(2))
    hand.work()
    assert server.questions == 1
    server.announce(4)
    hand.work()
    assert (taken, server.questions) == (expected(1, 4), 1)


def test_what_is_doubted_while_a_question_is_under_way_is_asked_again() -> None:
    server = Server(3)
    following_it, hand, taken = following(server)
    server.tick()
    hand.work()
    server.alive = False
    server.tick()
    answer = following_it._asked
    server.stored = [numbered(number, "new") for number in (1, 2, 3, 4)]
    server.heard(server.stored[0])
    server.alive = True
    assert answer is not None
    answer._response = SimpleNamespace(items=server.stored[3:], last_sequence=4)
    following_it._answered(answer)
    for _ in range(PATIENCE + 2):
        server.tick()
        hand.work()
    assert taken == [*expected(1, 3), *expected(1, 4, "new")]


def test_a_late_message_of_a_store_that_is_gone_hides_none_of_the_next_one() -> None:
    server = Server(0)
    _, hand, taken = following(server)
    server.heard(numbered(1))  # of the store that is gone
    server.stored = [numbered(1, "new"), SimpleNamespace(sequence=2, toss_id="toss-1")]
    server.heard(server.stored[1])
    hand.work()
    assert set(taken) == {"toss-1", "new-1"}
    server.announce(3, "new")
    hand.work()
    assert taken[-1] == "new-3"


def test_an_answer_that_does_not_fit_what_came_meanwhile_begins_anew() -> None:
    server = Server(0)
    following_it, hand, taken = following(server)
    server.alive = False
    server.tick()
    answer = following_it._asked
    assert answer is not None
    server.heard(numbered(1))
    server.alive = True
    server.stored = [numbered(number, "new") for number in (1, 2)]
    answer._response = SimpleNamespace(items=server.stored, last_sequence=2)
    following_it._answered(answer)
    hand.work()
    assert taken == [*expected(1, 1), *expected(1, 2, "new")]


def test_no_more_numbers_are_remembered_than_are_needed() -> None:
    server = Server(0)
    following_it, hand, _ = following(server)
    for number in range(1, 3 * REMEMBERED):
        server.announce(number)
    hand.work()
    assert len(following_it._taken) == REMEMBERED


def test_a_message_without_a_number_is_said_and_dropped() -> None:
    server = Server(2)
    follower, hand, taken = following(server)
    server.heard(numbered(0, "mine"))
    server.tick()
    hand.work()
    assert taken == ["toss-1", "toss-2"]
    assert server.lines == ["bad number: message of mine-0: found sequence 0, expected 1 or more; dropped"]
    server.heard(numbered(0, "mine"))
    server.announce(3)
    hand.work()
    assert taken == ["toss-1", "toss-2", "toss-3"]
    assert follower.complete
