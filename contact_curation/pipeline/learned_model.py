"""A model and the record of its training, from a training, a checkpoint, or a polytope's JSON file."""

from dataclasses import dataclass
from os import PathLike
from pathlib import Path

from contact_curation.contact.body import Body
from contact_curation.contact.loss_config import LossConfig
from contact_curation.contact.models.model import Model
from contact_curation.contact.models.polytope import PolytopeModel
from contact_curation.contact.models.registry import MODELS
from contact_curation.contact.models.torch_state import own_torch
from contact_curation.contact.parameter_form import form_of_geometry
from contact_curation.errors import InvalidValueError, UnreadableInputError
from contact_curation.files import path_of, read_bounded, read_json, write_atomically
from contact_curation.learning.checkpoints.checkpoint import how_trained
from contact_curation.learning.checkpoints.safetensors_bytes import LARGEST_BYTES
from contact_curation.learning.checkpoints.selection_document import selections_of
from contact_curation.learning.checkpoints.stored_model import MALFORMED, model_bytes, model_of_bytes, notes_of_bytes
from contact_curation.pipeline.carried_body import GivenBody, body_of
from contact_curation.storage.parameters_file import CHECKPOINT, Parameters, is_checkpoint, read_theta
from contact_curation.storage.parameters_file import LARGEST_BYTES as PARAMETERS_BYTES
from contact_curation.storage.saved_path import saved_path


@dataclass(frozen=True, eq=False)
class LearnedModel:
    """A model and the ids of its training tosses.

    Attributes:
        model: itself: `model.kind`, `model.body`, and its parameters as torch has them.
        name: its file; of a model without one, what it is.
        learned_from: ids of all tosses that it ever learned from, as far as its file says.
        fitted_to: ids of those that it learned from last.
        held_out: ids of those that its training held out, likewise.
        rig: how these were calibrated, in words of `--set`; None where its file does not say.
        at_optimum: whether its training says that it ended at the optimum of its tosses.
        shape_known_to: how exactly its training knew the corners beforehand [m]; None for the published initialisation.
        loss: that its training minimised; None where its file does not say.
        data: the checkpoint; empty for a model that comes from none.
        warnings: what was left out of the recordings it learned from just now, and what was assumed, one line each.
    """

    model: Model
    name: str = "model"
    learned_from: frozenset[str] = frozenset()
    fitted_to: frozenset[str] = frozenset()
    held_out: frozenset[str] = frozenset()
    rig: str | None = None
    at_optimum: bool = False
    shape_known_to: float | None = None
    loss: LossConfig | None = None
    data: bytes = b""
    warnings: tuple[str, ...] = ()

    @property
    def kind(self) -> str:
        """Which model: polytope, deep, deepvertex or end_to_end."""
        return self.model.kind

    @property
    def body(self) -> Body:
        """The body whose motion the model describes."""
        return self.model.body

    @property
    def shape(self) -> float | None:
        """`shape_known_to` in the body's characteristic lengths."""
        return None if self.shape_known_to is None else self.shape_known_to / self.body.length_scale

    @property
    @own_torch()
    def restitution(self) -> float | None:
        """What a polytope learned of its bounces; None where it learned nothing of them."""
        geometry = self.model.geometry()
        return None if geometry is None else geometry.restitution

    @own_torch()
    def learned_body(self) -> Body:
        """The body with the vertices and the friction that a polytope learned; all else is as described.

        Raises:
            InvalidValueError: the model is a network, whose weights have no vertices.
        """
        geometry = self.model.geometry()
        if geometry is None:
            raise InvalidValueError(self.name, f"a network ({self.kind}), which has no vertices", "a polytope for its shape")
        return geometry.as_body(self.body)

    def save(self, path: str | Path, *, overwrite: bool = False) -> None:
        """Writes the checkpoint, whole or not at all, as a .safetensors file.

        Where the parameters are others than those of the checkpoint, the model is written as it is now: `train` can start from
        it, but its training cannot be resumed.

        Args:
            path: of the file.
            overwrite: whether to replace any file that is there.

        Raises:
            InvalidValueError: another ending, a file is there, or the file cannot be written.
        """
        write_atomically(saved_path(path, (CHECKPOINT,), overwrite=overwrite), self._bytes())

    @own_torch()
    def _bytes(self) -> bytes:
        if not self.data:
            return model_bytes(self.model)
        unchanged = model_bytes(self.model) == model_bytes(model_of_bytes(self.data, self.name))
        return self.data if unchanged else model_bytes(self.model, notes_of_bytes(self.data, self.name))

    def __repr__(self) -> str:
        return f"<{self.kind} of {self.body.name}, learned from {len(self.learned_from)} tosses>"


type GivenModel = LearnedModel | str | PathLike[str]
"""A model, or the path of its file."""


def model_of(given: GivenModel, body: Body | None = None) -> LearnedModel:
    """The model, or that of the file; `body` and errors as of `load_model`."""
    return given if isinstance(given, LearnedModel) else load_model(given, body)


@own_torch()
def load_model(path: str | PathLike[str], body: GivenBody | None = None) -> LearnedModel:
    """Reads a model from a file.

    Args:
        path: a `.safetensors` checkpoint or model, or the parameters of a polytope as JSON.
        body: body that the model must be for, or its file; it also provides the values that a JSON file lacks. None for the
            body in the checkpoint.

    Returns:
        The model, with the ids of the tosses that it learned from.

    Raises:
        UnreadableInputError: the file contains no model, or one for another body.
        InvalidValueError: the file is JSON, and no body is given; or `path` is no path.

    Examples:
        >>> model = cc.load_model("model.safetensors")
        >>> model.kind
        'polytope'
    """
    path = path_of("model", path, "a model, or the path of its file")
    if str(path) in MODELS and not path.exists():  # as --model of the commands takes it
        raise InvalidValueError("model", f"{str(path)!r}, a kind of model", "a trained model, or the path of its file")
    body = None if body is None else body_of(body)
    if is_checkpoint(path):
        return model_of_checkpoint(read_bounded(path, LARGEST_BYTES, "a checkpoint or a model"), str(path), body)
    if body is None:
        read_json(path, PARAMETERS_BYTES, "a model")  # where there is none, its body is not missed
        raise InvalidValueError("body", "none", f"the body that the polytope in {path} is for")
    theta = read_theta(path, body)
    assert isinstance(theta, Parameters)
    return LearnedModel(PolytopeModel(theta.geometry, theta.body, form_of_geometry(theta.geometry)), str(path))


def model_of_checkpoint(data: bytes, name: str, body: Body | None = None) -> LearnedModel:
    """The model in the bytes of a checkpoint; errors as of `load_model`.

    Args:
        data: untrusted.
        name: of the file, or what it is.
        body: which it must be for.
    """
    model, notes = model_of_bytes(data, name, body), notes_of_bytes(data, name)
    keys = ("training ids", "fitted ids", "held-out ids", "earlier ids")
    learned, last, held_out, earlier = (_ids(notes.get(key, "")) for key in keys)
    selections = _selected(notes, name)
    if selections:
        learned, last = frozenset[str]().union(*selections), selections[-1]
    return LearnedModel(
        model=model,
        name=name,
        learned_from=learned | earlier,
        fitted_to=last or learned,
        held_out=held_out,
        rig=notes.get("rig"),
        **how_trained(data, name)._asdict(),
        data=data,
    )


def _ids(note: str) -> frozenset[str]:
    return frozenset(note.split("\n")) - {""}


def _selected(notes: dict[str, str], name: str) -> tuple[frozenset[str], ...]:
    """What was selected, one after the other; nothing where the training took all that it could have."""
    try:
        selections = selections_of(notes["selections"]) if "selections" in notes else ()
    except MALFORMED as error:
        raise UnreadableInputError(name, f"says not what was selected ({type(error).__name__}: {error})") from error
    return tuple(frozenset(one.toss_ids) for one in selections)
