"""The option --model: the name of a model, which may also determine the form of its theta."""

import argparse

from contact_curation.contact.models.registry import DEFAULT_MODEL, MODELS
from contact_curation.contact.parameter_form import Form
from contact_curation.errors import InvalidValueError

IN_FORM = {"contactnets": ("polytope", Form.CONTACTNETS)}
"""Further names, each for a model and a form of its theta; `contactnets` is the polytope in the published 57 numbers."""


def add_model_option(group: argparse._ActionsContainer) -> None:
    """Adds --model."""
    group.add_argument(
        "--model",
        choices=[*MODELS, *IN_FORM],
        default=DEFAULT_MODEL,
        help="the model; contactnets: a polytope in the published 57 numbers (default polytope)",
    )


def model_and_form(name: str, form: Form | None = None) -> tuple[str, Form | None]:
    """The model and the form of its theta that a value of --model stands for.

    Args:
        name: value of --model.
        form: value of --form; None where it was not given.

    Raises:
        InvalidValueError: the name determines a form, and `form` is another one.
    """
    model, own = IN_FORM.get(name, (name, form))
    if form not in (None, own):
        raise InvalidValueError("--form", form, f"{own} or none with --model {name}")
    return model, own
