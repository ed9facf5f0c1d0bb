"""One theta that throws are designed at: a body's contact geometry, and the parameters that information is about."""

from dataclasses import dataclass
from functools import cached_property

from contact_curation.contact.body import Body
from contact_curation.contact.evaluation import Estimator
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.loss_config import DEFAULT_LOSS, LossConfig
from contact_curation.contact.parameter_form import Form, is_physical
from contact_curation.information.scoring import Scorer, ScoringConfig


@dataclass(frozen=True, eq=False)
class Particle:
    """A theta; several of them stand for what is not known about it (METHOD 2.4).

    Attributes:
        geometry: theta.
        body: mass, inertia, gravity.
        loss: weights and solver of the information.
    """

    geometry: ContactGeometry
    body: Body
    loss: LossConfig = DEFAULT_LOSS

    @cached_property
    def scorer(self) -> Scorer:
        """What says how much measured tosses teach at this theta, by the same parameters and estimator as designs use.

        Always Gauss-Newton: of a motion that the model itself predicted the empirical matrix is almost zero, and what is left
        of it has nothing to do with what a real toss teaches (METHOD 0.4).
        """
        form = Form.PHYSICAL if is_physical(self.geometry) else Form.CONTACTNETS
        return Scorer(self.geometry, self.body, ScoringConfig(estimator=Estimator.GAUSS_NEWTON, form=form, loss=self.loss))

    @property
    def version(self) -> str:
        """Digest of theta."""
        return self.scorer.version
