"""Makes TrainingStatus messages, from the state of the training and the errors of held-out motions."""

from collections.abc import Sequence

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


def waiting_message(kind: str, revision: int, stamped: Stamped) -> TrainingStatus:
    """The status `waiting` before anything is trained: this buffer needs no round.

    Args:
        kind: kind of the model.
        revision: revision of the buffer.
        stamped: stamp and frame of the buffer.
    """
    unknown = dict.fromkeys(("training_loss", "held_out_loss", "position_error", "rotation_error"), float("nan"))
    return TrainingStatus(
        format_version=TrainingStatus.FORMAT_VERSION,
        header=header_message(stamped),
        model=kind,
        buffer_revision=revision,
        state=TrainingStatus.WAITING,
        **unknown,
    )


def status_message(
    moment: Moment,
    version: str,
    errors: HeldOutErrors,
    stamped: Stamped,
    rests_on: int | None,
    told: Sequence[str] = (),
) -> TrainingStatus:
    """The status of the training at a moment.

    Args:
        moment: state of the training at the start or end of a round.
        version: version of its parameters.
        errors: errors of the motions that they predict for held-out tosses.
        stamped: stamp and frame of the newest buffer.
        rests_on: revision of the buffer for which nothing is left to train; None while a round is needed.
        told: what the model lacks, and how far more throws would change it, one line each.
    """
    progress = moment.progress
    state = STATES[progress.state]
    lost = [f"{errors.not_finite} held-out motions are not finite"] if errors.not_finite else []
    return TrainingStatus(
        format_version=TrainingStatus.FORMAT_VERSION,
        header=header_message(stamped),
        model=moment.model.kind,
        parameters_version=version,
        buffer_revision=moment.round.revision if rests_on is None else rests_on,
        gradient_steps=progress.gradient_steps,
        epochs=progress.epochs,
        training_loss=progress.training_loss,
        held_out_loss=errors.loss,
        position_error=errors.position,
        rotation_error=errors.rotation,
        state=TrainingStatus.WAITING if rests_on is not None and state == TrainingStatus.CONVERGED else state,
        detail=progress.reason if state == TrainingStatus.FAILED else "; ".join([*lost, *told]),
    )
