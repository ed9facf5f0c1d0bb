"""A finished ranking as a session: the timeline `toss` goes down the ranking, and shows what is known by the first k tosses."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from contact_curation.contact.body import Body
from contact_curation.contact.loss_config import LossConfig
from contact_curation.dashboard.evidence import SelectedSet, evidence_of, selected_spectrum
from contact_curation.dashboard.live.body_view import BodyView
from contact_curation.dashboard.live.motion_view import MotionView
from contact_curation.dashboard.live.ranking_view import GateView, RankingView
from contact_curation.dashboard.live.screen import Moment, Screen
from contact_curation.dashboard.live.summary_view import SessionOverview, SummaryView
from contact_curation.dashboard.live.toss_names import zoned
from contact_curation.dashboard.toss_motion import ShownTheta, motion_of
from contact_curation.dashboard.vertex_uncertainty import uncertainty_if_known
from contact_curation.information.pool import Pool
from contact_curation.information.ranker import RankingConfig
from contact_curation.information.subspace import pool_subspace
from contact_curation.motion.toss import Toss


@dataclass(frozen=True)
class RejectedMotion:
    """A motion that the quality checks rejected: its id, its number of frames, and why."""

    toss_id: str
    frames: int
    reasons: tuple[str, ...]


def show_ranked(
    screen: Screen,
    body: Body,
    theta: ShownTheta,
    loss: LossConfig,
    pool: Pool,
    selected: SelectedSet,
    ranking: RankingConfig,
    tosses: Mapping[str, Toss],
    rejected: Sequence[RejectedMotion],
) -> None:
    """Writes a ranking's views.

    Args:
        screen: to write to.
        body: body that the tosses were scored with.
        theta: theta that the tosses were scored at.
        loss: loss that impulses are found with.
        pool: all tosses that were ranked.
        selected: those that are selected.
        ranking: how they were chosen.
        tosses: the selected ones, by id.
        rejected: what the quality checks rejected.

    Raises:
        InvalidValueError: theta cannot be rolled out.
    """
    bodies, motions = BodyView(screen, body), MotionView(screen, body)
    rankings, gates, summary = RankingView(screen), GateView(screen), SummaryView(screen)
    screen.at(Moment())
    for one in rejected:
        gates.show(one.toss_id, one.frames, one.reasons)
    numbers = {toss_id: place for place, toss_id in enumerate(selected.toss_ids, start=1)}
    shown = {one: place for one, place in numbers.items() if one in tosses}
    rankings.show_page(selected, evidence_of(pool, selected, ranking), shown)
    overview = SessionOverview(tosses=len(pool), selected=len(selected.toss_ids), rejected=len(rejected))
    summary.show(overview)
    subspace = pool_subspace(pool, ranking.cut)
    bodies.show(theta.geometry, uncertainty_if_known(pool, ()))
    for place, toss_id in enumerate(selected.toss_ids, start=1):
        screen.at(Moment(place))
        rankings.show_spectrum(selected_spectrum(pool, subspace, selected.toss_ids[:place]))
        friction = bodies.show(theta.geometry, uncertainty_if_known(pool, selected.toss_ids[:place]))
        if toss_id in tosses:
            motion = motion_of(tosses[toss_id], body, theta, loss)
            motions.show(motion, place, "rank")
            drawn = f"rank {place}, the toss of {zoned(toss_id)}"
            summary.show(replace(overview, friction=friction, drawn=drawn, error=motion.position_error))
