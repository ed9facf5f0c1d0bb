"""The trainer's held-out tosses: how their recordings are read, and how well a model predicts them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from contact_curation.configs import ranged
from contact_curation.contact.loss_config import DEFAULT_LOSS, LossConfig
from contact_curation.geometry.quaternions import Array
from contact_curation.motion.calibration import NO_CORRECTION, RigCalibration
from contact_curation.motion.toss import Toss
from contact_curation.storage.inputs.records import InputsConfig

if TYPE_CHECKING:
    from contact_curation.contact.models.model import Model


@dataclass(frozen=True)
class HeldOutTracker:
    """The tracker that recorded the held-out tosses.

    Attributes:
        tracker_noise: noise of the held-out recordings, as in pose_ingest's segmenter.tracker_noise; by default measured.
    """

    tracker_noise: float | None = ranged(None, 0.0, 1e3)


@dataclass(frozen=True)
class HeldOutConfig:
    """How recordings are read that a model is evaluated on.

    Attributes:
        segmenter: noise of the tracker of the held-out recordings.
        rig: rig calibration of the held-out recordings.
    """

    segmenter: HeldOutTracker = HeldOutTracker()
    rig: RigCalibration = NO_CORRECTION

    @property
    def inputs(self) -> InputsConfig:
        """The same as the configuration of whoever reads them."""
        default = InputsConfig()
        segmenter = replace(default.segmenter, tracker_noise=self.segmenter.tracker_noise)
        return replace(default, segmenter=segmenter, rig=self.rig)


class HeldOutErrors(NamedTuple):
    """Means over the held-out tosses whose predicted motion is finite; NaN where there are none.

    Attributes:
        loss: over the transitions whose impulses carry a certificate, motions that are not finite included.
        position: [% of the body's width].
        rotation: [deg].
        not_finite: how many motions are not.
    """

    loss: float
    position: float
    rotation: float
    not_finite: int


class HeldOutTosses:
    """Tosses that models are evaluated on; perhaps none."""

    def __init__(self, tosses: Sequence[Toss]) -> None:
        self.tosses = tuple(tosses)

    def errors(self, model: "Model", loss: LossConfig = DEFAULT_LOSS) -> HeldOutErrors:
        """How far the predicted motions are from the measured ones (method.md 1.11), and the loss that training minimises."""
        if not self.tosses:
            return HeldOutErrors(np.nan, np.nan, np.nan, 0)
        from contact_curation.learning.evaluation.evaluation import EvaluationConfig, evaluate_model  # torch takes seconds

        found = evaluate_model(model, self.tosses, EvaluationConfig(loss))
        finite = found.errors.finite
        position, rotation = (_mean(values[finite]) for values in (found.errors.position, found.errors.rotation))
        return HeldOutErrors(found.mean_loss, position, rotation, len(found.not_finite))


def _mean(values: Array) -> float:
    return float(values.mean()) if values.size else np.nan
