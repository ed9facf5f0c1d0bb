"""A session as it goes: records in, views out.

Cheap views are written as their records come. What follows from many records (the ranking with its evidence and the ellipsoids,
the newest toss at the newest theta) is written when it is asked for, so that whoever feeds the session can leave out what is
overtaken already. Everything may come twice, late, or in another order; what does not fit together yet waits.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from typing import Any

from contact_curation.contact.body import Body
from contact_curation.contact.loss_config import LossConfig
from contact_curation.dashboard.evidence import DEFAULT, SelectedSet, evidence_of
from contact_curation.dashboard.live.body_view import BodyView
from contact_curation.dashboard.live.health_view import HealthView, NodeHealth
from contact_curation.dashboard.live.learning_view import LearningView, TrainingMoment
from contact_curation.dashboard.live.motion_view import MotionView
from contact_curation.dashboard.live.ranking_view import GateView, RankingView
from contact_curation.dashboard.live.screen import Moment, Screen
from contact_curation.dashboard.live.summary_view import SessionOverview, SummaryView
from contact_curation.dashboard.live.throw_view import NEXT_STATE, ThrowMade, ThrowView
from contact_curation.dashboard.live.toss_names import zoned
from contact_curation.dashboard.toss_motion import ShownTheta, motion_of
from contact_curation.dashboard.vertex_uncertainty import uncertainty_if_known
from contact_curation.information.pool import Pool, pool_of
from contact_curation.information.ranker import RankingConfig
from contact_curation.information.record import TossInformation
from contact_curation.motion.toss import Toss

VERSIONS_HELD = 1
"""Newest thetas that are remembered, with their information, beside that of the selected set."""


class LiveSession:
    """Writes a session's views; everything on one thread.

    Args:
        screen: to write to.
        body: body as it was described.
        theta: to begin with.
        loss: loss that impulses are found with.
        throws: throws that are planned in all; 0: not known.
        ranking: how tosses are selected; criterion and number are those of the selected set.
    """

    def __init__(
        self,
        screen: Screen,
        body: Body,
        theta: ShownTheta,
        loss: LossConfig,
        throws: int = 0,
        ranking: RankingConfig = DEFAULT,
    ) -> None:
        self._screen = screen
        self._body = body
        self._loss = loss
        self._ranking = ranking
        self._thetas = {theta.version: theta}
        self._theta = theta
        self._informations: dict[str, dict[str, TossInformation]] = {}
        self._numbers: dict[str, int] = {}
        self._newest: Toss | None = None
        self._stamp_ns = 0
        self._selected: SelectedSet | None = None
        self._throws: dict[str, ThrowMade] = {}
        screen.at(Moment())
        self._bodies = BodyView(screen, body)
        self._motions = MotionView(screen, body)
        self._rankings = RankingView(screen)
        self._learning = LearningView(screen)
        self._flights = ThrowView(screen)
        self._gates = GateView(screen)
        self._healths = HealthView(screen)
        self._summary = SummaryView(screen)
        self._overview = SessionOverview(planned=throws, trained=False)
        self._overview_changed()

    @property
    def tosses(self) -> int:
        """How many tosses there were so far."""
        return len(self._numbers)

    def add_toss(self, toss: Toss) -> None:
        """A toss that passed the quality checks.

        Raises:
            InvalidValueError: it cannot be predicted at the newest theta.
        """
        if toss.toss_id in self._numbers:
            return
        self._numbers[toss.toss_id] = len(self._numbers) + 1
        self._passed(int(toss.stamps_ns[-1]))
        self._overview_changed(tosses=self.tosses)
        self._show_motion(toss)
        if self._newest is None or toss.stamps_ns[-1] > self._newest.stamps_ns[-1]:
            self._newest = toss

    def add_rejected(self, toss_id: str, frames: int, reasons: Sequence[str], stamp_ns: int) -> None:
        """A motion that the quality checks rejected."""
        self._passed(stamp_ns)
        self._screen.at(Moment(len(self._numbers), stamp_ns))
        self._gates.show(toss_id, frames, reasons)
        self._overview_changed(rejected=self._gates.rejected)

    def add_information(self, information: TossInformation) -> None:
        """The information of a toss, at any theta."""
        version = information.parameters_version
        self._informations[version] = self._informations.pop(version, {})  # the newest last
        self._informations[version][information.toss_id] = information
        needed = self._selected.version if self._selected else version
        for old in [one for one in self._informations if one != needed][:-VERSIONS_HELD]:
            del self._informations[old]

    def set_selected(self, selected: SelectedSet, stamp_ns: int) -> None:
        """The selected set that `show_ranking` is about from now on."""
        self._passed(stamp_ns)
        self._selected = selected
        self._now()
        self._overview_changed(selected=len(selected.toss_ids))

    def set_theta(self, theta: ShownTheta) -> None:
        """The newest theta: what `show_motion` and all tosses to come are predicted with."""
        self._theta = theta
        self._thetas.pop(theta.version, None)
        self._thetas[theta.version] = theta  # the newest last
        needed = self._selected.version if self._selected else theta.version
        for old in [one for one in self._thetas if one != needed][:-VERSIONS_HELD]:
            del self._thetas[old]

    def add_training(self, moment: TrainingMoment, stamp_ns: int) -> None:
        """Where the training stands."""
        self._passed(stamp_ns)
        self._now()
        self._learning.show(moment)
        self._overview_changed(trained=True, position_error=moment.position_error, rotation_error=moment.rotation_error)

    def add_throw(self, throw: ThrowMade) -> None:
        """Adds a throw, or news of one."""
        self._throws[throw.commanded.throw_id] = throw
        self._now()
        throws = tuple(self._throws.values())
        self._flights.show(throws, throw)
        waiting = throws[-1].state == NEXT_STATE
        self._overview_changed(throws=len(throws), under_way=waiting)
        self._motions.show_throw(throws[-1].commanded if waiting else None)

    def show_health(
        self, nodes: Mapping[str, NodeHealth], dropped: Mapping[str, int], now: float, ended: Collection[str] = ()
    ) -> None:
        """Writes the nodes' health; arguments as in `HealthView.show`."""
        self._now()
        self._healths.show(nodes, dropped, now, ended)

    def show_motion(self) -> None:
        """Writes the newest toss once more, at the newest theta; errors as in `add_toss`."""
        if self._newest is not None:
            self._show_motion(self._newest)

    def show_ranking(self) -> bool:
        """Writes the selected set's evidence and what is known by it, once all of the selected tosses' information has come.

        Returns:
            Whether the information of all tosses that it was chosen from has come; else it should be shown again later.

        Raises:
            InvalidValueError: information that does not go together.
        """
        selected = self._selected
        if selected is None or not selected.toss_ids:
            return True
        informations = self._informations.get(selected.version, {})
        if not set(selected.toss_ids) <= set(informations):
            return False
        pool = pool_of(informations.values())
        self._now()
        self._rankings.show(selected, evidence_of(pool, selected, self._ranking), self._numbers)
        self._show_body(pool, selected)
        return len(pool) >= selected.seen

    def _show_body(self, pool: Pool, selected: SelectedSet) -> None:
        geometry = self._thetas.get(selected.version, self._theta).geometry
        uncertainty = None if geometry is None else uncertainty_if_known(pool, selected.toss_ids)
        self._overview_changed(friction=self._bodies.show(geometry, uncertainty))

    def _show_motion(self, toss: Toss) -> None:
        number = self._numbers[toss.toss_id]
        motion = motion_of(toss, self._body, self._theta, self._loss)
        self._screen.at(Moment(number, int(toss.stamps_ns[0])))
        self._motions.show(motion, number)
        self._overview_changed(drawn=f"toss {number} of {zoned(toss.toss_id)}", error=motion.position_error)

    def _overview_changed(self, **changes: Any) -> None:
        """Changes the overview and writes it."""
        self._overview = replace(self._overview, **changes)
        self._summary.show(self._overview)

    def _passed(self, stamp_ns: int) -> None:
        self._stamp_ns = max(self._stamp_ns, stamp_ns)

    def _now(self) -> None:
        self._screen.at(Moment(len(self._numbers), self._stamp_ns))
