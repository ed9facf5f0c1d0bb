"""When the next throw of an automatic loop is due, by a steady clock that is passed in."""

from collections.abc import Callable
from dataclasses import dataclass, replace

from contact_curation.design.throw import Throw, ThrowReport
from contact_curation.errors import ContactCurationError
from contact_curation.stages.design import DesignStage
from contact_curation.stages.records import Proposal


@dataclass(frozen=True)
class LoopConfig:
    """How long the loop waits.

    Attributes:
        max_throws: stop after this many throws; 0 for no end.
        toss_timeout: how long to wait for the toss of a throw [s].
        theta_timeout: how long to wait after that until the trainer has used all tosses [s]; 0 designs with the theta that is
            there.
        retry_period: pause after a throw that was not made [s].
        goal_timeout: time without feedback after which a throw is given up [s].
    """

    max_throws: int = 0
    toss_timeout: float = 15.0
    theta_timeout: float = 0.0
    retry_period: float = 2.0
    goal_timeout: float = 60.0

    def at_rate(self, rate: float) -> "LoopConfig":
        """The same with a simulated thrower: as patient as with a real one, and more so with one in slow motion.

        Args:
            rate: simulated seconds per second; 0: as fast as possible.
        """
        longer = max(1.0 / rate, 1.0) if rate else 1.0
        return replace(self, toss_timeout=longer * self.toss_timeout, goal_timeout=longer * self.goal_timeout)


class ThrowLoop:
    """Throw after throw: each when the toss of the one before was scored or rejected, or has not come for long.

    `due` is asked on one thread; all else happens on the thread of the stage.

    Args:
        stage: that designs.
        config: how long it waits.
        now: a steady clock [s].
    """

    def __init__(self, stage: DesignStage, config: LoopConfig, now: Callable[[], float]) -> None:
        self._stage, self._config, self._now = stage, config, now
        self._not_before = now()
        self._toss_until = now() + config.toss_timeout
        self._at_work = False

    def due(self) -> bool:
        """Whether the next throw is to be designed; once so, it is at work until that throw has ended."""
        waits = self._stage.awaits_toss and self._now() < self._toss_until
        theta_until = self._toss_until + self._config.theta_timeout
        waits |= bool(self._config.theta_timeout) and not self._stage.is_up_to_date and self._now() < theta_until
        done = self._config.max_throws and len(self._stage.throws) >= self._config.max_throws
        due = not (self._at_work or waits or done or self._now() < self._not_before)
        self._at_work = self._at_work or due
        return due

    def next(self) -> Proposal:
        """Designs the next throw.

        Raises:
            ContactCurationError: there is none; the loop goes on after a pause.
        """
        try:
            return self._stage.propose()
        except ContactCurationError as error:
            self._stage.refuse(str(error))
            self._rest()
            raise

    def finish(self, executed: Throw, released_ns: int) -> tuple[ThrowReport, ...]:
        """The throw was made; gives what is known of all.

        Raises:
            InvalidValueError: it cannot be the throw that was commanded, which is to be abandoned.
        """
        self._stage.finish(executed, released_ns)
        self._toss_until = self._now() + self._config.toss_timeout
        self._at_work = False
        return self._stage.reports

    def abandon(self, reason: str) -> tuple[ThrowReport, ...]:
        """The throw was not made; gives what is known of it, and of all that were."""
        report = self._stage.abandon(reason)
        self._rest()
        return (report, *self._stage.reports)

    def _rest(self) -> None:
        self._not_before, self._at_work = self._now() + self._config.retry_period, False
