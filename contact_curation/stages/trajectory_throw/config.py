"""What a throw by trajectory asks of an arm, and how long it waits."""

from dataclasses import dataclass

from contact_curation.configs import check_positive, set_whole_numbers
from contact_curation.errors import InvalidValueError


@dataclass(frozen=True)
class TrajectoryConfig:
    """What a thrower asks of an arm, and how long it waits.

    Attributes:
        lead: a trajectory is sent so long before it begins [s].
        stop_lead: the trajectory of a stop is sent so long before it begins [s].
        oldest_state: joint states older than this stop the arm [s].
        oldest_signal: a controller's state or a speed scaling older than this stops the arm [s].
        tracking_error: largest distance of a joint from its path, which is as late as the arm is [rad].
        largest_lag: largest time by which the arm may be late [s].
        lag: guess of the time by which the arm is late, before the first throw [s].
        at_home: largest distance of a joint from home before a throw [rad].
        grip_error: largest distance of the held body from where the plan holds it [m].
        grip_turn: largest error of the held body's orientation [rad].
        grip_patience: how long to wait for the body to be put into the gripper so [s].
        learning: number of first releases that may be less certain than steady.window allows: they show the gripper's delay.
        patience: how long to wait for the controller's end after the trajectory's [s].
        speed_scaling: whether a speed scaling is reported and must be at 100 %.
        controller_state: whether the controller reports its state while it is active.
    """

    lead: float = 0.3
    stop_lead: float = 0.05
    oldest_state: float = 0.1
    oldest_signal: float = 0.5
    tracking_error: float = 0.05
    largest_lag: float = 0.2
    lag: float = 0.0
    at_home: float = 0.02
    grip_error: float = 0.02
    grip_turn: float = 0.15
    grip_patience: float = 45.0
    learning: int = 3
    patience: float = 3.0
    speed_scaling: bool = True
    controller_state: bool = True

    def __post_init__(self) -> None:
        check_positive(self, (
            "lead", "stop_lead", "oldest_state", "oldest_signal", "tracking_error", "largest_lag", "at_home", "patience",
            "grip_error", "grip_turn", "grip_patience",
        ), "trajectory.")  # fmt: skip
        if not 0.0 <= self.lag <= self.largest_lag:
            raise InvalidValueError("trajectory.lag", self.lag, f"between 0 and {self.largest_lag:g} s")
        set_whole_numbers(self, ("learning",), prefix="trajectory.")
