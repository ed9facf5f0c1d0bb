"""Of a topic with poses of several bodies, a live graph takes the body's own from the first message on, as recordings do."""

from unittest.mock import MagicMock

from geometry_msgs.msg import Point, Pose, Quaternion
from nav_msgs.msg import Odometry

from contact_curation.motion.pose_stream import FramePose
from contact_curation.nodes.ros.pose_topics import MOST_CHILDREN, PoseTopics, Received
from contact_curation.storage.inputs.pose_source import PoseTopicConfig, TypedTopic, find_pose_source

ODOMETRY = TypedTopic("/odometry", "nav_msgs/msg/Odometry")


def topics_of_the_cube() -> PoseTopics:
    """With the topic found."""
    config = PoseTopicConfig(topic=ODOMETRY.name)
    node = MagicMock(resolve_topic_name=lambda name: name)
    topics = PoseTopics(node, "cube", config, "", 10, lambda _: {}, lambda _: None)
    topics.source = find_pose_source("graph", [ODOMETRY], "cube", config)
    return topics


def read(topics: PoseTopics, children: list[str]) -> list[int]:
    """The places of the messages that give poses of the body, where messages are of these frames."""
    taken = list[int]()
    for place, child in enumerate(children):
        message = Odometry(child_frame_id=child)
        message.pose.pose = Pose(position=Point(x=float(place)), orientation=Quaternion(w=1.0))
        _, _, measured = topics.read(Received(ODOMETRY.name, place + 1, message))
        taken += [int(one.pose.position[0]) for one in measured if isinstance(one, FramePose)]
    return taken


def test_no_pose_of_another_body_is_taken_whichever_comes_first() -> None:
    assert read(topics_of_the_cube(), ["body_cube", "body_brick", "body_cube", "body_brick"]) == [0, 2]
    assert read(topics_of_the_cube(), ["body_brick", "/cube", "body_brick", "body_ball", "cube"]) == [1, 4]


def test_where_no_message_names_the_body_all_are_taken_in_order() -> None:
    assert read(topics_of_the_cube(), ["base_link"] * (MOST_CHILDREN - 1)) == []
    assert read(topics_of_the_cube(), ["base_link"] * 2 * MOST_CHILDREN) == list(range(2 * MOST_CHILDREN))


def test_a_body_that_is_named_late_is_told_from_the_others_from_then_on() -> None:
    late = ["body_brick"] * (MOST_CHILDREN + 1) + ["body_cube", "body_brick", "body_cube"]
    assert read(topics_of_the_cube(), late)[MOST_CHILDREN + 1 :] == [MOST_CHILDREN + 1, MOST_CHILDREN + 3]
