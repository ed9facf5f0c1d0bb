"""A thrower for tests: it makes every throw at once, by rolling the body out, and reports the information of its toss."""

import threading
import time
from typing import Any

import numpy as np
from contact_curation_msgs.action import ExecuteThrow
from contact_curation_msgs.msg import TossInformation as TossInformationMessage
from contact_curation_msgs.srv import GetInformation
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.action.server import ServerGoalHandle
from rclpy.callback_groups import ReentrantCallbackGroup

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.design.execution_noise import ExecutionNoise, NoiseConfig
from contact_curation.design.predicted_information import Particle
from contact_curation.information.record import TossInformation
from contact_curation.motion.toss import NANOSECONDS
from contact_curation.nodes.messages.headers import Stamped
from contact_curation.nodes.messages.throw import throw_message, throw_of
from contact_curation.nodes.messages.toss_information import information_message
from contact_curation.nodes.ros.qos import RESULTS_DEPTH, latched
from contact_curation.simulation.thrown_toss import executed_throw, thrown_toss
from test.graph.parts.graph import Listener

BODY = CONTACTNETS_CUBE


class Thrower:
    """Serves `execute_throw`, and scores the tosses at the body as described, in the form that is fisher_scorer's default.

    Args:
        listener: its node serves.
    """

    def __init__(self, listener: Listener) -> None:
        self._scorer = Particle(ContactGeometry.of_body(BODY).rigid(), BODY).scorer
        self._noise = ExecutionNoise.expected(NoiseConfig())
        self._rng = np.random.default_rng(0)
        self._informations: list[TossInformation] = []
        self._messages: list[Any] = []
        self.commands: list[Any] = []
        self.refuse = False
        self.silent = threading.Event()
        node = listener.node
        self._publisher = node.create_publisher(TossInformationMessage, "toss_information", latched(RESULTS_DEPTH))
        node.create_service(GetInformation, "get_information", self._get)
        self.server = ActionServer(
            node,
            ExecuteThrow,
            "execute_throw",
            self._throw,
            goal_callback=lambda goal: GoalResponse.REJECT if self.refuse else GoalResponse.ACCEPT,
            cancel_callback=lambda handle: CancelResponse.ACCEPT,
            callback_group=ReentrantCallbackGroup(),
        )

    @property
    def toss_ids(self) -> list[str]:
        return [one.toss_id for one in self._informations]

    def _throw(self, handle: ServerGoalHandle) -> Any:
        self.commands.append(handle.request.throw_command)
        executed = executed_throw(throw_of(handle.request.throw_command), self._noise, self._rng)
        stamp_ns = 10 * NANOSECONDS * len(self.commands)
        toss = thrown_toss(BODY, executed, first_stamp_ns=stamp_ns)
        handle.succeed()
        if not self.silent.is_set():
            self._announce(toss)
        return ExecuteThrow.Result(success=True, executed=throw_message(executed, Stamped(stamp_ns, "body_surface")))

    def _announce(self, toss: Any) -> None:
        information = self._scorer.score([toss])[0]
        assert isinstance(information, TossInformation)
        self._informations.append(information)
        stamped = Stamped(int(toss.stamps_ns[-1]), "body_surface")
        self._messages.append(information_message(information, len(self._informations), stamped))
        self._publisher.publish(self._messages[-1])

    def _get(self, request: Any, response: Any) -> Any:
        response.last_sequence = len(self._messages)
        response.information = self._messages[request.after_sequence :][: request.limit or 64]
        return response


def settled(seconds: float) -> None:
    """Lets a graph do what it should not do."""
    time.sleep(seconds)
