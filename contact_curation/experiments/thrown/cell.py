"""One cell of `designed-throws`: one way of choosing throws, and one learner (method.md 1.12).

The throws themselves are made in `designed_throws.py`.
"""

from dataclasses import asdict, dataclass

from contact_curation.contact.models.registry import DEFAULT_MODEL, MODELS
from contact_curation.errors import InvalidValueError, UnknownNameError
from contact_curation.experiments.cell import Planned, Protocol

RANDOM, RAW, DESIGNED = "random", "raw", "designed"
ARMS = (RANDOM, RAW, "exploration", DESIGNED)
"""Ways of choosing throws: at random from the prior fitted to real ones, at random from the paper's normal, spread over first
impacts all the time, and designed as soon as theta passes the readiness check."""

PROTOCOLS = (Protocol.EXACT.value, Protocol.BUDGETED.value)

FIRM = "firm"
WORLDS = {FIRM: (0.006, 1.0), "soft": (0.01, 1.0), "bouncing": (0.006, 0.72), "springy": (0.006, 0.35)}
"""Worlds by name: time constant [s] and damping ratio of MuJoCo's contacts. A cube that falls on a face from 80 mm leaves with
0.13, 0.13, 0.19 and 0.41 of its speed, and sinks in by 2.6, 4.4, 2.2 and 1.6 mm."""


@dataclass(frozen=True)
class ThrowsCell(Planned):
    """One learner, from its first throw to its last.

    Attributes:
        rule: one of `ARMS`.
        judged: numbers of throws after which held-out motion judges; the last is how many are made.
        seed: of the initial parameters, the arm, the tracker and the pools: the same for all arms.
        protocol, steps: how it learns after each throw, a round of the trainer's exact protocol or of its budgeted one with so
            many steps.
        model: that learns; a polytope.
        world: that the throws land in, one of `WORLDS`.
        restitution: whether the learner has one.
    """

    KIND = "throws"

    rule: str
    judged: tuple[int, ...]
    seed: int
    protocol: str = Protocol.EXACT.value
    steps: int = 0
    model: str = DEFAULT_MODEL
    world: str = FIRM
    restitution: bool = False

    def __post_init__(self) -> None:
        models = [name for name, entry in MODELS.items() if entry.is_geometry]
        choices = {"rule": ARMS, "protocol": PROTOCOLS, "model": models, "world": tuple(WORLDS)}
        for name, accepted in choices.items():
            if getattr(self, name) not in accepted:
                raise UnknownNameError(f"{name} of designed-throws", getattr(self, name), accepted)
        if not self.judged or min(self.judged) < 1 or list(self.judged) != sorted(set(self.judged)):
            raise InvalidValueError("numbers of throws", self.judged, "rising numbers from 1 on")
        if self.restitution and self.protocol != Protocol.EXACT:
            raise InvalidValueError("restitution", f"protocol {self.protocol}", "protocol exact, which learns one")
        if (self.steps > 0) != (self.protocol == Protocol.BUDGETED):
            raise InvalidValueError("steps", self.steps, "some for the budgeted protocol, 0 for the exact one")

    @property
    def fields(self) -> dict[str, float | str]:
        """What its rows begin with."""
        return {name: value for name, value in asdict(self).items() if name != "judged"}
