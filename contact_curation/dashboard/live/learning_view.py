"""Views: the errors of predicted motions on held-out tosses, and the losses, over the session."""

from dataclasses import dataclass
from math import log10

from contact_curation.dashboard.live.screen import Screen
from contact_curation.dashboard.style import BLUE, GREEN, PURPLE, VERMILION

ERRORS, LOSSES = "errors", "losses"
MOST_SHOWN = 100.0
"""Errors before the first training are many times a width; more is drawn as this, so that what follows can be read."""

POSITION, ROTATION, TRAINING, HELD_OUT = BLUE, VERMILION, GREEN, PURPLE


@dataclass(frozen=True)
class TrainingMoment:
    """Where a training stands.

    Attributes:
        state: in a word.
        gradient_steps: so far.
        training_loss, held_out_loss: mean loss of a transition.
        position_error: [% of the body's width].
        rotation_error: [deg].
    """

    state: str
    gradient_steps: int
    training_loss: float
    held_out_loss: float
    position_error: float
    rotation_error: float


class LearningView:
    """Writes how a training goes.

    Args:
        screen: to write to.
    """

    def __init__(self, screen: Screen) -> None:
        self._screen = screen
        screen.curve(f"{ERRORS}/position", "position [% of the width], up to 100", POSITION)
        screen.curve(f"{ERRORS}/rotation", "rotation [deg]", ROTATION)
        screen.curve(f"{LOSSES}/training", "log10 of the training loss", TRAINING)
        screen.curve(f"{LOSSES}/held_out", "log10 of the held-out loss", HELD_OUT)

    def show(self, moment: TrainingMoment) -> None:
        """Writes a moment; what is not finite is left out."""
        errors = {"position": moment.position_error, "rotation": moment.rotation_error}
        self._screen.values(ERRORS, {name: min(error, MOST_SHOWN) for name, error in errors.items()})
        losses = {"training": moment.training_loss, "held_out": moment.held_out_loss}
        self._screen.values(LOSSES, {name: log10(loss) for name, loss in losses.items() if loss > 0.0})
