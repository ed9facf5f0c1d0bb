"""Weights of the loss, and how well its inner problem is solved (method.md 1.2, 1.3)."""

from dataclasses import dataclass, fields, replace
from functools import cached_property

from contact_curation.configs import check_positive, set_whole_numbers
from contact_curation.solver.cone_problem import Cone, ConeWeights

LIGHTEST, HEAVIEST = 0.09, 1.5
"""[kg] A lighter or heavier body counts in the loss of the rigid form as if of this mass. A mass changes no motion, but gaps
and slip count by squared impulses: fits of light bodies would learn a friction far too high, and of heavy ones one too low
(docs/explanation/models.md). The weights were published for a cube of 0.37 kg."""


def counted_mass(mass: float) -> float:
    """The mass [kg] as which a body's counts in the loss of the rigid form."""
    return min(max(mass, LIGHTEST), HEAVIEST)


@dataclass(frozen=True)
class LossConfig:
    """Weights of the loss and how well its inner problem is solved; the defaults are ContactNets' (method.md 1.2, 1.3).

    Attributes:
        match: weight of the squared velocity error.
        complementarity_normal: weight of normal impulses at open gaps.
        complementarity_tangent: weight of tangential impulses at open gaps.
        dissipation: weight of tangential impulses that do not oppose the slip with full friction.
        penetration: weight of negative gaps.
        regularization: small weight eps that picks the smallest of equally good impulses.
        cone: shape of the friction cone.
        tolerance: largest natural residual at which impulses count as solved.
        max_iterations: iteration limit of the interior point method.
        threads: number of threads that tosses are spread over; 0 for one per processor.
    """

    match: float = ConeWeights.match
    complementarity_normal: float = ConeWeights.complementarity_normal
    complementarity_tangent: float = ConeWeights.complementarity_tangent
    dissipation: float = ConeWeights.dissipation
    penetration: float = ConeWeights.penetration
    regularization: float = ConeWeights.regularization
    cone: Cone = Cone.CIRCULAR
    tolerance: float = 1e-7
    max_iterations: int = 60
    threads: int = 0

    def __post_init__(self) -> None:
        _ = self.weights  # checks them
        check_positive(self, ("tolerance",), "loss.")
        set_whole_numbers(self, ("max_iterations",), 1, prefix="loss.")
        set_whole_numbers(self, ("threads",), prefix="loss.")

    def for_mass(self, mass: float) -> "LossConfig":
        """The same with the weights of impulses such that a body of a mass [kg] counts as `counted_mass` says."""
        share = (counted_mass(mass) / mass) ** 2
        if share == 1.0:
            return self
        return replace(self, **{name: share * getattr(self, name) for name in OF_IMPULSES})

    @cached_property
    def weights(self) -> ConeWeights:
        """What the inner problem needs of them."""
        return ConeWeights(**{field.name: getattr(self, field.name) for field in fields(ConeWeights)})


OF_IMPULSES = ("complementarity_normal", "complementarity_tangent", "dissipation", "regularization")
"""Weights of squared impulses."""

DEFAULT_LOSS = LossConfig()
