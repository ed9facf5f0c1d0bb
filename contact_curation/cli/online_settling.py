"""When a session has come to rest: throws made, tosses scored, trained on, and the buffer ranked at the newest theta."""

from contact_curation.cli.online_stores import Standing, ThrowMade, Training


def unresolved(standing: Standing) -> tuple[ThrowMade, ...]:
    """Throws of which neither a toss nor a rejected motion has come so far."""
    open_throws = []
    for place, throw in enumerate(standing.throws):
        later = standing.throws[place + 1].after_ns if place + 1 < len(standing.throws) else None
        rejected = any(one.last_ns > throw.after_ns and (later is None or one.last_ns <= later) for one in standing.kept_back)
        if not throw.toss_id and not rejected:
            open_throws.append(throw)
    return tuple(open_throws)


def is_scored(standing: Standing) -> bool:
    """Whether every toss was scored, and ranked at one theta."""
    return standing.scored == standing.ranked == len(standing.tosses)


def training_is_due(standing: Standing, least_tosses: int, settling_rounds: int) -> bool:
    """Whether the trainer is in a round, or begins another one with this buffer.

    Args:
        standing: of the session.
        least_tosses: the trainer's parameter.
        settling_rounds: likewise.
    """
    training = standing.training
    if training is not None and training.running:
        return True
    if len(standing.kept) < least_tosses:
        return False
    if training is None:
        return True
    return set(standing.kept) != set(training.toss_ids) and _may_train(standing, training, settling_rounds)


def _may_train(standing: Standing, training: Training, settling_rounds: int) -> bool:
    return standing.ranked > training.tosses_seen or training.settling < settling_rounds
