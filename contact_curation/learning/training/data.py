"""Transitions as a training takes them: checked, as rows of a model, by a digest, and by name."""

import hashlib
import json

import numpy as np

from contact_curation.contact.models.model import Rows
from contact_curation.contact.time_step import checked_states, checked_time_steps
from contact_curation.errors import InvalidValueError
from contact_curation.motion.transitions import Transitions


def rows_of(data: Transitions) -> Rows:
    """Transitions as models take them."""
    return Rows(data.before, data.after, data.dt)


def digest_of(data: Transitions) -> str:
    """Equal ids, states and periods in equal order, equal digest."""
    state = hashlib.sha256(json.dumps(data.toss_ids).encode())
    for values in (data.starts, data.before, data.after, data.dt):
        state.update(np.ascontiguousarray(values).tobytes())
    return state.hexdigest()


def transition_name(data: Transitions, row: int) -> str:
    """How messages name a row."""
    toss = int(np.searchsorted(data.starts, row, side="right")) - 1
    return f"toss {data.toss_ids[toss]}, transition {row - int(data.starts[toss])}"


def checked(data: Transitions) -> Transitions:
    """The same, if a training can have them.

    Raises:
        InvalidValueError: there are none, a state is not finite or turned by no unit quaternion, or a period is not positive.
    """
    if not len(data.dt):
        raise InvalidValueError("transitions", "none", "at least one")
    finite = np.isfinite(data.before).all(axis=1) & np.isfinite(data.after).all(axis=1) & np.isfinite(data.dt)
    if not finite.all():
        row = int(np.argmin(finite))
        raise InvalidValueError(transition_name(data, row), "a state that is not finite", "finite numbers")
    for states in (data.before, data.after):
        checked_states(states)
    checked_time_steps(data.dt, len(data.dt))
    return data
