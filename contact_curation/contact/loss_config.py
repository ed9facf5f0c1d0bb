"""Weights of the loss, and how well its inner problem is solved (method.md 1.2, 1.3)."""

from dataclasses import dataclass, fields, replace
from functools import cached_property

from contact_curation.configs import check_positive, set_whole_numbers
from contact_curation.contact.body import CONTACTNETS_CUBE, Body
from contact_curation.solver.cone_problem import Cone, ConeWeights

GAPS, PENETRATION, SLIP = 2.0, 4.0, 0.25
"""Weights of impulses at gaps, of negative gaps and of slip in the balanced loss, relative to the published ones, for
ContactNets' cube; chosen by friction and motions of five bodies (`benchmarks.learning.loss_weights`)."""

MODERATE_FRICTION = 0.3
"""Contacts of a body with more friction mostly stick, which a tracker sees badly (docs/explanation/learning.md, "Much
friction"): what seems to slip then counts less, and velocities are not filtered (information/impacts.py)."""


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
        balanced: whether the weights are multiplied so that they suit any body, for a theta in the rigid form.
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
    balanced: bool = True

    def __post_init__(self) -> None:
        _ = self.weights  # checks them
        check_positive(self, ("tolerance",), "loss.")
        set_whole_numbers(self, ("max_iterations",), 1, prefix="loss.")
        set_whole_numbers(self, ("threads",), prefix="loss.")

    def for_theta(self, body: Body, rigid: bool) -> "LossConfig":
        """The same with the weights that the loss of a theta has.

        A balanced loss counts impulses relative to the one that carries the body at rest, so that neither its mass nor its
        length scale changes what gaps and slip count, and weighs slip less: the noise of a contact that sticks counts as slip,
        and would make friction too low (docs/explanation/models.md, "Weights of the loss"); still less where the friction is
        described as more than `MODERATE_FRICTION`.

        Args:
            body: mass, gravity, friction and unit of length.
            rigid: whether theta is in the rigid form; others have the weights as they are.
        """
        if not (rigid and self.balanced):
            return self
        cube = CONTACTNETS_CUBE
        share = (cube.mass * cube.scaled_gravity / (body.mass * body.scaled_gravity)) ** 2
        slip = SLIP * MODERATE_FRICTION / max(body.friction, MODERATE_FRICTION)
        factors = dict.fromkeys(OF_IMPULSES, GAPS * share) | {"dissipation": slip * share, "penetration": PENETRATION}
        return replace(self, **{name: factor * getattr(self, name) for name, factor in factors.items()})

    def differences(self, other: "LossConfig", body: Body, rigid: bool) -> tuple[str, ...]:
        """Names of the fields by which another loss of a theta has other values; none where all values are the same."""
        own, others = (each.for_theta(body, rigid) for each in (self, other))
        if (own.weights, own.cone) == (others.weights, others.cone):
            return ()
        return tuple(name for name in OF_VALUES if getattr(self, name) != getattr(other, name))

    @property
    def in_words(self) -> str:
        """What the loss follows from, a word for each field."""
        return " ".join(f"{name}={str(getattr(self, name)).lower()}" for name in OF_VALUES)

    @cached_property
    def weights(self) -> ConeWeights:
        """What the inner problem needs of them."""
        return ConeWeights(**{field.name: getattr(self, field.name) for field in fields(ConeWeights)})


OF_IMPULSES = ("complementarity_normal", "complementarity_tangent", "dissipation", "regularization")
"""Weights of squared impulses."""

OF_VALUES = (*(field.name for field in fields(ConeWeights)), "cone", "balanced")
"""Fields that change the loss; the others say how it is computed."""

DEFAULT_LOSS = LossConfig()
