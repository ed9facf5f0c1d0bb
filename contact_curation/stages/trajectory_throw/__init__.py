"""A throw by an arm of one's own, as one trajectory: `throwing` decides, `signals` and `following` watch the arm."""

from contact_curation.stages.trajectory_throw.config import TrajectoryConfig as TrajectoryConfig
from contact_curation.stages.trajectory_throw.throwing import Phase as Phase
from contact_curation.stages.trajectory_throw.throwing import Sent as Sent
from contact_curation.stages.trajectory_throw.throwing import Step as Step
from contact_curation.stages.trajectory_throw.throwing import TrajectoryThrow as TrajectoryThrow
