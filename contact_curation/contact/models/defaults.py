"""Default settings of each model, as plain numbers that need no import of torch."""

from dataclasses import dataclass


@dataclass(frozen=True)
class ModelDefaults:
    """How a model is trained (`learning.training.protocols`) and how its gradients are sketched (method.md 2.7).

    Networks on top of a polytope learn slowly beside it: what it can explain, it shall.

    Attributes:
        published_rate, published_decay: learning rate and weight decay of AdamW in ContactNets' protocol.
        batch: transitions of a gradient step.
        network_rate: learning rate of the networks' weights.
        steps: budget of gradient steps.
        bounds_influence: whether the influence of large losses is bounded.
        sketch_rows: random rows of each projection of a network's gradient.
    """

    published_rate: float = 1e-4
    published_decay: float = 1e-2
    batch: int = 128
    network_rate: float = 1e-4
    steps: int = 1500
    bounds_influence: bool = True
    sketch_rows: int = 8
