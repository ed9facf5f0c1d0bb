"""A training's protocol as a JSON document and back."""

from dataclasses import asdict
from typing import Any

from contact_curation.contact.evaluation import Cone
from contact_curation.contact.loss_config import LossConfig
from contact_curation.contact.parameter_form import Form
from contact_curation.learning.training.bounded_influence import InfluenceBound, InfluenceShape
from contact_curation.learning.training.protocols import Pace, Patience, Schedule, TrainingConfig


def document_of(config: TrainingConfig) -> dict[str, Any]:
    """What JSON takes: enumerations are strings already."""
    return asdict(config)


def config_of(document: dict[str, Any]) -> TrainingConfig:
    """The inverse of `document_of`; every record checks its own values.

    Raises:
        KeyError, TypeError, ValueError, InvalidValueError: a document of another form.
    """
    patience, influence, loss = document["patience"], document["influence"], document["loss"]
    return TrainingConfig(
        **{
            **document,
            "form": Form(document["form"]),
            "polytope": Pace(**document["polytope"]),
            "network": Pace(**document["network"]),
            "schedule": Schedule(document["schedule"]),
            "patience": None if patience is None else Patience(**patience),
            "influence": InfluenceBound(**{**influence, "shape": InfluenceShape(influence["shape"])}),
            "loss": LossConfig(**{**loss, "cone": Cone(loss["cone"])}),
        }
    )
