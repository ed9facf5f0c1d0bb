"""Makes the scorer of any model, and defines the protocol that all scorers share.

Importing torch takes over a second. Whoever scores a polytope by its geometry makes a `Scorer` and needs no torch; this factory
is for models, which are torch's.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Protocol

from contact_curation.contact.parameter_form import Form
from contact_curation.geometry.quaternions import Array
from contact_curation.information.network.config import Device, NetworkConfig
from contact_curation.information.network.score_folder import ScoreFolder
from contact_curation.information.record import ParameterBlock, TossInformation
from contact_curation.information.scoring import BegunToss, NotScored, Scorer, ScoringConfig
from contact_curation.motion.toss import Toss

if TYPE_CHECKING:
    from contact_curation.contact.models.model import Model


ON_CPU = Device()


class TossScorer(Protocol):
    """Scores tosses at a theta, of a polytope or a network."""

    @property
    def version(self) -> str:
        """Of theta."""

    @property
    def blocks(self) -> tuple[ParameterBlock, ...]:
        """Of theta's parameters."""

    def losses(self, tosses: Sequence[Toss]) -> tuple[Array, ...]:
        """Losses (N,) of all scored transitions of each toss."""

    def score(self, tosses: Sequence[Toss]) -> tuple[TossInformation | NotScored, ...]:
        """The information of each toss, in the order given."""

    def begin(self, toss: Toss, earlier: BegunToss | None = None) -> BegunToss | None:
        """Scores what can be scored of a toss whose last velocities are not known yet, and was not `earlier`; None: nothing."""


def scorer_of_model(
    model: "Model",
    config: ScoringConfig,
    network: NetworkConfig | None = None,
    scores: ScoreFolder | None = None,
    device: Device = ON_CPU,
    jobs: int = 1,
) -> TossScorer:
    """Makes the scorer of tosses at the parameters of a model.

    Args:
        model: any; a polytope's own form takes the place of the config's.
        config: how tosses are scored.
        network: what is peculiar to networks; None for what their kind is scored with by default.
        scores: takes the exact scores of networks; None to do without them.
        device: where networks are evaluated.
        jobs: number of processes that share the device.

    Raises:
        InvalidValueError: parameters that are not finite, or a block that the model does not have.
    """
    from contact_curation.information.network.scoring import NetworkScorer

    geometry = model.geometry()
    if geometry is None:
        return NetworkScorer(model, config, network, scores, device, jobs)
    return Scorer(geometry, model.body, replace(config, form=Form(model.settings()["form"])))
