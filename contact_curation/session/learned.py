"""What a session's model has learned when it ends: its parameters, and how well it predicts held-out tosses."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from contact_curation.contact.loss_config import DEFAULT_LOSS
from contact_curation.motion.toss import Toss
from contact_curation.pipeline.reading import ReadingConfig
from contact_curation.pipeline.tosses import evaluation_tosses
from contact_curation.session.config import SessionConfig, SessionFolder
from contact_curation.session.node_parameters import held_out_inputs
from contact_curation.session.state import SessionState
from contact_curation.stages.held_out_tosses import HeldOutTosses
from contact_curation.storage.stores.tosses import TossStore

if TYPE_CHECKING:
    from contact_curation.pipeline.learned_model import LearnedModel


@dataclass(frozen=True)
class HeldOutSummary:
    """Errors of the trained model on held-out tosses: means of position [% of the width], rotation [deg] and loss."""

    position: float
    rotation: float
    loss: float
    tosses: int


@dataclass(frozen=True)
class LearnedSummary:
    """Parameters of the trained model.

    Attributes:
        friction: its coefficient.
        friction_interval: half its 95 % interval; None where no toss is left that tells the noise.
        described_friction: of the body as it is simulated.
        vertex_error_mm: RMS distance of the vertices from those of the body as it is simulated [mm].
        tosses: how many it was trained on.
        throws: how many were made.
    """

    friction: float
    friction_interval: float | None
    described_friction: float
    vertex_error_mm: float
    tosses: int
    throws: int

    def __str__(self) -> str:
        interval, share = ("", "") if self.friction_interval is None else (f" ± {self.friction_interval:.3f}", "95 %; ")
        return (
            f"friction {self.friction:.3f}{interval} ({share}simulated: {self.described_friction:g}) and vertices to "
            f"{self.vertex_error_mm:.1f} mm RMS, from {self.tosses} tosses of {self.throws} throws"
        )


def learned_of(
    config: SessionConfig, folder: SessionFolder, state: SessionState
) -> tuple[HeldOutSummary | None, LearnedSummary | None]:
    """Errors of the model in the checkpoint, and its parameters; None for what there is not.

    Args:
        config: what was asked for.
        folder: of the session.
        state: of the session at its end.
    """
    if not folder.checkpoint.exists():
        return None, None
    from contact_curation.pipeline.learned_model import load_model  # torch takes over a second to import

    body = config.body()
    learned = load_model(folder.checkpoint, body)
    held_out = HeldOutTosses(())
    if config.evaluate_on:
        held_out = HeldOutTosses(
            evaluation_tosses("--evaluate-on", config.evaluate_on, ReadingConfig(body, held_out_inputs(config)))
        )
    errors = held_out.errors(learned.model, learned.loss or DEFAULT_LOSS)
    summary = HeldOutSummary(errors.position, errors.rotation, errors.loss, len(held_out.tosses)) if held_out.tosses else None
    return summary, _parameters(learned, folder, state, held_out.tosses)


def _parameters(
    learned: "LearnedModel", folder: SessionFolder, state: SessionState, held_out: tuple[Toss, ...]
) -> LearnedSummary | None:
    """None for a network. The noise is that of tosses that were not trained on, of the session's own where there are some."""
    from contact_curation.contact.parameter_form import is_physical
    from contact_curation.learning.evaluation.evaluation import shape_errors
    from contact_curation.learning.evaluation.misfit import sliding_of
    from contact_curation.learning.uncertainty.parameters import KnownConfig, known
    from contact_curation.motion.transitions import transitions_of

    model = learned.model
    shape, geometry = shape_errors(model), model.geometry()
    if shape is None or geometry is None:
        return None
    with TossStore(folder.store("pose_ingest")) as store:
        tosses = [one.toss for one in store.get(state.tosses)]
    fitted = [toss for toss in tosses if toss.toss_id in learned.fitted_to]  # the last selection may be another one
    others = [toss for toss in tosses if toss.toss_id not in learned.learned_from] or list(held_out)
    interval: float | None = None
    if fitted and others and is_physical(geometry):
        scale = model.body.length_scale
        slid = sliding_of((*fitted, *others), model.body)
        config = KnownConfig(learned.loss or DEFAULT_LOSS).with_shape(learned.shape)
        found = known(model, transitions_of(fitted, scale), transitions_of(others, scale), config, slid)
        interval = next(one.interval for one in found.parameters if one.name == "friction")
    return LearnedSummary(shape.friction, interval, model.body.friction, shape.vertex_rms_mm, len(fitted), len(state.throws))
