"""How tosses are scored for networks, as plain numbers that cost no import of torch."""

from dataclasses import dataclass, field

from contact_curation.contact.models.kind import ModelKind
from contact_curation.errors import InvalidValueError


@dataclass(frozen=True)
class SketchConfig:
    """How large a sketched gradient is (`network_sketch`).

    Attributes:
        leading: rows of each projection that are leading directions of the reference.
        random: rows that are random.
        seed: of these and of the reference.
    """

    leading: int = 16
    random: int = 8
    seed: int = 0

    def __post_init__(self) -> None:
        for name in ("leading", "random", "seed"):
            if getattr(self, name) < 0:
                raise InvalidValueError(f"sketch.{name}", getattr(self, name), "a number of at least 0")
        if self.size < 1:
            raise InvalidValueError("sketch", "no rows", "at least 1 row, leading or random")

    @property
    def size(self) -> int:
        """Rows of a projection."""
        return self.leading + self.random


END_TO_END_SKETCH = SketchConfig(random=32)
"""Five layers of ReLU are less alike: with 8 the leverages' Spearman correlation is below 0.95; leading rows mend less."""


@dataclass(frozen=True)
class NetworkConfig:
    """What is peculiar to networks; a model has a form of its own, so that that of `ScoringConfig` says nothing.

    Attributes:
        draws: backward passes per transition that stand for the Gauss-Newton matrix (METHOD 1.5), all but one along its
            strongest directions (`leading_slopes`); an end-to-end model and the polytope alone are taken exactly.
        seed: of the draws.
        sketch: how large gradients are kept.
        physical_only: whether only the parameters of a deep model's polytope count.
    """

    draws: int = 6
    seed: int = 0
    sketch: SketchConfig = field(default_factory=SketchConfig)
    physical_only: bool = False

    def __post_init__(self) -> None:
        for name, least in (("draws", 1), ("seed", 0)):
            if getattr(self, name) < least:
                raise InvalidValueError(f"network.{name}", getattr(self, name), f"at least {least}")


def network_config_for(kind: ModelKind) -> NetworkConfig:
    """What is used for a model where nothing else is said: a sketch that meets METHOD 6, check 15, for it."""
    return NetworkConfig(sketch=END_TO_END_SKETCH if kind is ModelKind.END_TO_END else SketchConfig())
