"""How many histories a run takes: a few that are always the same, or as many new ones as an environment variable asks for."""

import os

from hypothesis import HealthCheck, settings


def histories(variable: str, default: int, steps: int) -> settings:
    """Hypothesis's settings for histories of up to `steps` steps.

    Args:
        variable: environment variable with their number.
        default: their number without it.
        steps: of a history.
    """
    asked = os.environ.get(variable)
    return settings(
        max_examples=int(asked or default),
        stateful_step_count=steps,
        derandomize=not asked,
        database=None,
        deadline=None,
        suppress_health_check=list(HealthCheck),
    )
