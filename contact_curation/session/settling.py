"""When a session has come to rest: throws made, tosses scored, trained on, and the buffer ranked at the newest theta."""

from contact_curation.session.stores import KeptBack, Standing, Training


def rejected_motion(standing: Standing, place: int) -> KeptBack | None:
    """The first motion that was kept back after a throw and before the next."""
    after = standing.throws[place].after_ns
    later = standing.throws[place + 1].after_ns if place + 1 < len(standing.throws) else None
    motions = (one for one in standing.kept_back if one.last_ns > after and (later is None or one.last_ns <= later))
    return next(motions, None)


def awaits_motion(standing: Standing) -> bool:
    """Whether neither a toss nor a rejected motion has come of the last throw so far; with earlier ones nobody waits."""
    last = len(standing.throws) - 1
    return last >= 0 and not standing.throws[last].toss_id and rejected_motion(standing, last) is None


def awaits_gain(standing: Standing) -> bool:
    """Whether the last throw's toss was scored, and what it taught is not known so far."""
    last = standing.throws[-1] if standing.throws else None
    return last is not None and bool(last.toss_id) and last.planned is not None and last.realised is None


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
