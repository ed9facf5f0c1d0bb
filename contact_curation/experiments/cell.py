"""One cell of an experiment: which rule selects which tosses, and how a model learns from them; the key of its row of results.

A cell and the tosses determine its row to the last digit, so that an experiment can stop anywhere and go on.
"""

import json
from dataclasses import asdict, dataclass
from enum import StrEnum
from typing import ClassVar

from contact_curation.contact.models.registry import DEFAULT_MODEL, MODELS, model_class
from contact_curation.contact.parameter_form import Form
from contact_curation.errors import InvalidValueError, UnknownNameError
from contact_curation.experiments.faults import Fault, check_share
from contact_curation.experiments.rules import RULES

ALL = 0
"""The size of a set that is the whole pool."""


class Protocol(StrEnum):
    """How a cell trains: to the optimum, along a budget of gradient steps, or as published (`learning.training.protocols`)."""

    EXACT = "exact"
    BUDGETED = "budgeted"
    PUBLISHED = "published"


@dataclass(frozen=True)
class Planned:
    """What an experiment is to run, of which the ledger tells whether it was.

    Attributes:
        KIND: stands in its key, to tell it from others with the same fields; empty for none.
    """

    KIND: ClassVar[str] = ""

    @property
    def key(self) -> str:
        """The same for equal ones only."""
        return json.dumps({self.KIND: asdict(self)} if self.KIND else asdict(self), sort_keys=True)

    @property
    def fields(self) -> dict[str, float | str]:
        """What its rows begin with."""
        return asdict(self)


@dataclass(frozen=True)
class Cell(Planned):
    """One training.

    Attributes:
        rule: one of `RULES`.
        size: how many tosses are selected, or `ALL`.
        seed: of the pool, the initial parameters and all else that is random: the same for all rules.
        model: what learns.
        protocol: how; networks have no exact one.
        steps: gradient steps of the budgeted protocol; 0 elsewhere.
        fault: what is wrong with some tosses of the pool; empty for nothing.
        share: of the pool that is bad.
        gated: whether the gates see the pool first.
    """

    rule: str
    size: int
    seed: int
    model: str = DEFAULT_MODEL
    protocol: str = Protocol.EXACT.value
    steps: int = 0
    fault: str = ""
    share: float = 0.0
    gated: bool = True

    def __post_init__(self) -> None:
        choices = {"rule": RULES, "model": [*MODELS], "protocol": [*Protocol], "fault": ["", *Fault]}
        for name, accepted in choices.items():
            if getattr(self, name) not in accepted:
                raise UnknownNameError(name, getattr(self, name), accepted)
        check_share(self.share)
        if self.size < 0 or self.seed < 0:
            raise InvalidValueError("size and seed", f"{self.size} and {self.seed}", "numbers of at least 0")
        if self.protocol == Protocol.EXACT and not model_class(self.model).has_exact_fit(Form.PHYSICAL):
            raise InvalidValueError("protocol of a network", self.protocol, "budgeted or published")
        if RULES[self.rule].redrawn and self.protocol == Protocol.EXACT:
            raise InvalidValueError(f"protocol of {self.rule}", self.protocol, "budgeted or published")
        if (self.steps > 0) != (self.protocol == Protocol.BUDGETED):
            raise InvalidValueError("steps", self.steps, "some for the budgeted protocol, 0 for the others")
