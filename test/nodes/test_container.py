"""A container takes the nodes that it is asked for, and hands each numbered message over once, before it is published."""

import re
from types import SimpleNamespace
from typing import Any

import pytest
import rclpy

from contact_curation.errors import InvalidValueError, UnknownNameError
from contact_curation.nodes.container import DEFAULT, SHARING, chosen
from contact_curation.nodes.ros.given_parameters import check_names
from contact_curation.nodes.ros.hand_over import hand_over
from contact_curation.nodes.ros.node_main import StageNode
from contact_curation.nodes.ros.parameters import declare
from contact_curation.session.free_domain import free_domain
from test.nodes.test_catch_up import Server, following, numbered


def test_a_container_makes_the_nodes_that_it_is_asked_for_and_else_those_of_the_ranking() -> None:
    assert tuple(chosen(["container", "--ros-args", "-p", "curator:top:=4"])) == DEFAULT
    assert tuple(chosen(["container", "curator", "trainer", "--ros-args", "-r", "__ns:=/cell"])) == ("curator", "trainer")
    assert set(DEFAULT) < set(SHARING)


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["curatr"], "unknown node curatr: did you mean curator?"),
        (["curator", "curator"], "nodes: found curator curator, expected each node once"),
        (["curator", "--ros-args", "-r", "__node:=mine"], "expected a name for one node, such as curator:__node:=mine"),
        (["--ros-args", "-p", "store:=a.sqlite"], "expected a file for one node, such as -p pose_ingest:store:=a.sqlite"),
    ],
)
def test_what_two_nodes_cannot_share_is_refused_in_one_line(words: list[str], says: str) -> None:
    with pytest.raises(InvalidValueError, match=re.escape(says)):
        chosen(["container", *words])


def test_a_message_is_handed_over_once_before_it_is_published_and_its_copy_is_dropped() -> None:
    server, order = Server(0), list[str]()
    _, hand, taken = following(server)
    publisher = SimpleNamespace(topic_name="/toss", publish=lambda message: order.append(f"published, {hand.waiting} taken"))
    other = SimpleNamespace(topic_name="/cell_2/toss", publish=lambda message: None)
    unheard = other.publish
    speaks: Any = SimpleNamespace(subscriptions=[], publishers=[publisher, other])
    hears: Any = SimpleNamespace(subscriptions=[SimpleNamespace(topic_name="/toss", callback=server.heard)], publishers=[])
    assert hand_over([speaks, hears]) == {"/toss": 1}
    assert other.publish is unheard
    message = numbered(1)
    publisher.publish(message)
    server.heard(message)
    hand.work()
    assert (taken, order) == (["toss-1"], ["published, 1 taken"])


class Pair(StageNode):
    """Stands for a node beside the trainer."""

    def __init__(self) -> None:
        super().__init__("curator")
        declare(self, "top", 32, "number", bounds=(1, 1000))


def test_a_word_for_a_node_in_the_same_process_is_accepted_and_for_another_one_refused() -> None:
    words = ["--ros-args", "-p", "evaluate_on:=[a.mcap]"]
    with free_domain() as domain:
        rclpy.init(args=words, domain_id=domain)
        try:
            node = Pair()
            check_names(node, "curator", words, ["curator", "trainer"])
            with pytest.raises(UnknownNameError, match="evaluate_on"):
                check_names(node, "curator", words, ["curator", "fisher_scorer"])
            node.destroy_node()
        finally:
            rclpy.try_shutdown()
