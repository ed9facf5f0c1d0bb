"""A designer that sends one throw and waits for its end: a process that tests can kill.

python -m test.graph.parts.lone_designer
"""

import rclpy
from contact_curation_msgs.action import ExecuteThrow
from rclpy.action import ActionClient

from contact_curation.nodes.messages.headers import Stamped
from contact_curation.nodes.messages.throw import throw_message
from test.simulation.throws import PLAIN


def main() -> None:
    """Sends goals until one is taken, and waits for its result."""
    rclpy.init()
    node = rclpy.create_node("lone_designer")
    client = ActionClient(node, ExecuteThrow, "execute_throw")
    client.wait_for_server()
    goal = ExecuteThrow.Goal(throw_command=throw_message(PLAIN, Stamped(0, "body_surface")))
    while True:
        sent = client.send_goal_async(goal)
        rclpy.spin_until_future_complete(node, sent, timeout_sec=5.0)
        if sent.done():
            break
    rclpy.spin_until_future_complete(node, sent.result().get_result_async())


if __name__ == "__main__":
    main()
