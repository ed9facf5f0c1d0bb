"""The models that `evaluate` judges, out of checkpoints or JSON files, with what they say of their own training."""

from dataclasses import dataclass
from pathlib import Path

from contact_curation.contact.body import Body
from contact_curation.contact.models.model import Model
from contact_curation.contact.models.polytope import PolytopeModel
from contact_curation.contact.parameter_form import Form, is_physical
from contact_curation.errors import UnreadableInputError
from contact_curation.learning.checkpoints.selection_document import selections_of
from contact_curation.learning.checkpoints.stored_model import MALFORMED
from contact_curation.storage.checkpoint_file import read_notes
from contact_curation.storage.parameters_file import Parameters, read_theta


@dataclass(frozen=True, eq=False)
class JudgedModel:
    """A model to judge.

    Attributes:
        path: its file.
        model: itself.
        learned_from: ids of all tosses that it ever learned from, as far as its file says.
        fitted_to: ids of those that it learned from last.
        held_out: ids of those that its training held out, likewise.
        rig: how these were put right, in words of `--set`; None where its file does not say.
    """

    path: Path
    model: Model
    learned_from: frozenset[str] = frozenset()
    fitted_to: frozenset[str] = frozenset()
    held_out: frozenset[str] = frozenset()
    rig: str | None = None


def judged_model(path: Path, body: Body) -> JudgedModel:
    """The model in a file.

    Args:
        path: a checkpoint, or a polytope as JSON.
        body: which it must be for.

    Raises:
        ContactCurationError: there is none, or it is for another body.
    """
    theta = read_theta(path, body)
    if isinstance(theta, Parameters):
        form = Form.PHYSICAL if is_physical(theta.geometry) else Form.CONTACTNETS
        return JudgedModel(path, PolytopeModel(theta.geometry, theta.body, form))
    notes = read_notes(path)
    learned, last, held_out = (_ids(notes.get(name, "")) for name in ("training ids", "fitted ids", "held-out ids"))
    selections = _selected(notes, path)
    if selections:
        learned, last = frozenset[str]().union(*selections), selections[-1]
    return JudgedModel(path, theta, learned, last or learned, held_out, notes.get("rig"))


def _ids(note: str) -> frozenset[str]:
    return frozenset(note.split("\n")) - {""}


def _selected(notes: dict[str, str], path: Path) -> tuple[frozenset[str], ...]:
    """What was selected, one after the other; nothing where the training took all that it could have."""
    try:
        selections = selections_of(notes["selections"]) if "selections" in notes else ()
    except MALFORMED as error:
        raise UnreadableInputError(path, f"says not what was selected ({type(error).__name__}: {error})") from error
    return tuple(frozenset(one.kept) for one in selections)
