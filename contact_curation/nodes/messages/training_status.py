"""TrainingStatus, from a moment of the training and how well its model predicts held-out motions."""

from contact_curation_msgs.msg import TrainingStatus

from contact_curation.learning.training.progress import TrainingState
from contact_curation.nodes.messages.headers import Stamped, header_message
from contact_curation.stages.held_out_tosses import HeldOutErrors
from contact_curation.stages.training import Moment

STATES = {
    TrainingState.RUNNING: TrainingStatus.TRAINING,
    TrainingState.SPENT: TrainingStatus.CONVERGED,
    TrainingState.CONVERGED: TrainingStatus.CONVERGED,
    TrainingState.FAILED: TrainingStatus.FAILED,
}


def status_message(moment: Moment, version: str, errors: HeldOutErrors, stamped: Stamped, waiting: bool) -> TrainingStatus:
    """Where training stands.

    Args:
        moment: at a round's start or end.
        version: of the parameters there.
        errors: of the motions that they predict of held-out tosses.
        stamped: of the buffer that the round trains on.
        waiting: whether nothing is left to do until the buffer changes.
    """
    progress = moment.progress
    state = STATES[progress.state]
    lost = f"{errors.not_finite} held-out motions are not finite"
    return TrainingStatus(
        format_version=TrainingStatus.FORMAT_VERSION,
        header=header_message(stamped),
        model=moment.model.kind.value,
        parameters_version=version,
        buffer_revision=moment.round.revision,
        gradient_steps=progress.gradient_steps,
        epochs=progress.epochs,
        training_loss=progress.training_loss,
        held_out_loss=errors.loss,
        position_error=errors.position,
        rotation_error=errors.rotation,
        state=TrainingStatus.WAITING if waiting and state == TrainingStatus.CONVERGED else state,
        detail=progress.reason if state == TrainingStatus.FAILED else lost * bool(errors.not_finite),
    )
