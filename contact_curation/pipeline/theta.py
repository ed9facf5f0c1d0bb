"""The theta at which tosses are scored: the body as described, a polytope's JSON files, or checkpoints of any model.

Importing torch takes over a second, which a polytope's ranking does without: it is imported only to read a checkpoint and to
score for a network.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

from contact_curation.contact.body import Body
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.models.registry import model_class, model_entry
from contact_curation.contact.parameter_form import Form, form_of_geometry, parameter_form
from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array
from contact_curation.motion.calibration import RigCalibration
from contact_curation.motion.toss import Toss
from contact_curation.pipeline.reading import settings_of
from contact_curation.storage.parameters_file import CHECKPOINT, Parameters, is_checkpoint, read_theta

if TYPE_CHECKING:
    from contact_curation.contact.models.model import Model
    from contact_curation.pipeline.learned_model import GivenModel, LearnedModel


@dataclass(frozen=True, eq=False)
class NetworkTheta:
    """A network in plain arrays, which go to other processes as they are.

    Attributes:
        kind: which model.
        settings, tensors: as the model gives them.
        body: it belongs to.
    """

    kind: str
    settings: Mapping[str, str]
    tensors: Mapping[str, Array]
    body: Body

    def model(self) -> "Model":
        """The network."""
        return model_class(self.kind).of_tensors(self.settings, self.tensors, self.body)


type Theta = Parameters | NetworkTheta


def thetas_of(model: str, paths: Sequence[Path], body: Body, form: str | None = None) -> tuple[Theta, ...]:
    """The thetas in some files, at least one: without a file, that of the object as it is described, in a form.

    Raises:
        ContactCurationError: a file cannot be used, or is for another model; or a network without a file.
    """
    if model_entry(model).is_geometry:
        return tuple(polytope_of(path, body) for path in paths) or (described_polytope(body, form),)
    if not paths:
        how = f"--params CHECKPOINT{CHECKPOINT}, as `contact-curation train --model {model}` writes it"
        raise InvalidValueError(f"theta of model {model}", "none", how)
    return tuple(_network(path, model, body) for path in paths)


def described_polytope(body: Body, form: str | None = None) -> Parameters:
    """The polytope of the object as it is described; in the rigid form, unless another one is named."""
    geometry = ContactGeometry.of_body(body)
    return Parameters(geometry.rigid() if form in (None, Form.RIGID) else geometry, body)


def theta_of(model: "Model") -> Theta:
    """The parameters of a model, in plain arrays."""
    geometry = model.geometry()
    if geometry is None:
        return NetworkTheta(model.kind, model.settings(), model.tensors(), model.body)
    return Parameters(geometry, model.body)


def form_of(wanted: str | None, thetas: Sequence[Theta]) -> Form:
    """The form that was asked for; else rigid where every polytope has one set of vertices; of networks physical.

    Raises:
        InvalidValueError: a polytope does not have the form that was asked for.
    """
    if wanted is not None:
        for theta in thetas:
            if isinstance(theta, Parameters):
                parameter_form(theta.geometry, Form(wanted))
        return Form(wanted)
    polytopes = [theta.geometry for theta in thetas if isinstance(theta, Parameters)]
    if any(form_of_geometry(one) is Form.CONTACTNETS for one in polytopes):
        return Form.CONTACTNETS
    return Form.RIGID if polytopes and not any(one.has_own_friction_vertices for one in polytopes) else Form.PHYSICAL


def polytope_of(path: Path, body: Body) -> Parameters:
    """The polytope in a JSON file or a checkpoint.

    Raises:
        ContactCurationError: the file cannot be used, or holds another model.
    """
    model = read_theta(path, body)
    if isinstance(model, Parameters):
        return model
    geometry = model.geometry()
    if geometry is None:
        raise InvalidValueError(f"model of {path}", model.kind, f"polytope; networks go with `rank --model {model.kind}`")
    return Parameters(geometry, model.body)


def of_other_rigs(models: "Iterable[GivenModel | None]", rig: RigCalibration) -> tuple[str, ...]:
    """A line for each model that learned from tosses that were calibrated otherwise than those that it is used with.

    Args:
        models: models or their files; of parameters in JSON, and of a body as described, nobody knows of any tosses.
        rig: how the tosses here are calibrated.
    """
    now, lines = settings_of(rig), []
    for model in filter(None, map(_learned, models)):
        if model.rig is not None and model.rig != now:
            learned, here = (f"calibrated by {one}" if one else "as recorded" for one in (model.rig, now))
            lines.append(f"{model.name}: it learned from tosses {learned}, and those here are {here}")
    return tuple(lines)


def learned_before(start: "GivenModel | None") -> frozenset[str]:
    """Ids of the tosses that a model to start from, or that of its file, ever learned from, as far as its file says."""
    model = _learned(start)
    return model.learned_from if model else frozenset()


def of_start(start: "GivenModel | None", rig: RigCalibration, held_out: Sequence[Toss]) -> tuple[str, ...]:
    """What speaks against a model to start from: tosses of another calibration, or some that are held out of the training.

    Args:
        start: model or its file, or None.
        rig: how the tosses here are calibrated.
        held_out: from which nothing is to be learned.
    """
    model, lines = _learned(start), list(of_other_rigs([start], rig))
    if model and (count := len({toss.toss_id for toss in held_out} & model.learned_from)):
        lines.append(f"{model.name}: it learned from {count} of the {len(held_out)} held-out tosses")
    return tuple(lines)


def _learned(model: "GivenModel | None") -> "LearnedModel | None":
    """The model, or that of a checkpoint; None for parameters in JSON."""
    if model is None or (isinstance(model, str | PathLike) and not is_checkpoint(Path(model))):
        return None
    from contact_curation.pipeline.learned_model import model_of

    return model_of(model)


def _network(path: Path, kind: str, body: Body) -> NetworkTheta:
    if not is_checkpoint(path):
        raise InvalidValueError(f"theta of model {kind}", str(path), f"a checkpoint, a {CHECKPOINT} file")
    from contact_curation.storage.checkpoint_file import read_model

    model = read_model(path, body)
    if model.kind != kind:
        raise InvalidValueError(f"model of {path}", model.kind, f"{kind}, or --model {model.kind}")
    found = theta_of(model)
    assert isinstance(found, NetworkTheta)
    return found
