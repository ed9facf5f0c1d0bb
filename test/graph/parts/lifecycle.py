"""A node's lifecycle, as `ros2 lifecycle` asks for it."""

from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetState

from test.graph.parts.graph import LONGEST, Listener


def changed(listener: Listener, node: str, label: str) -> bool:
    """Asks for a transition of a node; whether it was made."""
    request = ChangeState.Request(transition=Transition(label=label))
    return bool(listener.call(ChangeState, f"{node}/change_state", request, LONGEST).success)


def state_of(listener: Listener, node: str) -> str:
    """Name of a node's state."""
    return str(listener.call(GetState, f"{node}/get_state", GetState.Request()).current_state.label)
