"""Where each view stands: the blueprint that the viewer opens with."""

import rerun.blueprint as rrb

from contact_curation.contact.body import Body
from contact_curation.dashboard.live import (
    body_view,
    health_view,
    learning_view,
    motion_view,
    ranking_view,
    summary_view,
    throw_view,
)
from contact_curation.dashboard.live.screen import TOSS

SKY = (228, 231, 235)
"""Behind the scenes: what is selected has a white outline, which is seen on it."""

EYE, LOOKED_AT = (-0.25, -0.95, 0.42), (-0.03, 0.0, 0.05)
"""[m] Where tosses are looked at from, and where to."""

BODY_EYE = (2.6, -3.6, 2.2)
"""The same for the body about its origin [characteristic lengths]."""

UP = (0.0, 0.0, 1.0)


def live_layout(body: Body) -> rrb.Blueprint:
    """Layout of a session: all views."""
    seen = rrb.Vertical(_motion(), _body(body), row_shares=[1.1, 1.0])
    chosen = rrb.Vertical(_summary(), _ranking(), _throws(), _rejected(), row_shares=[0.6, 1.3, 0.9, 0.5])
    more = rrb.Tabs(_health(), _spectrum(), _epsilon(), _losses())
    learned = rrb.Vertical(_friction(), _known(), _errors(), _gains(), more, row_shares=[1.0, 1.0, 1.0, 1.0, 1.5])
    return _blueprint(rrb.Horizontal(seen, chosen, learned, column_shares=[0.85, 1.15, 1.0]))


def ranking_layout(body: Body) -> rrb.Blueprint:
    """Layout of a ranking of recordings: the views that need no session."""
    seen = rrb.Vertical(_motion(), _body(body), row_shares=[1.1, 1.0])
    chosen = rrb.Vertical(_summary(), _ranking(), _rejected(), row_shares=[0.5, 2.2, 0.6])
    known = rrb.Vertical(_friction(), _known(), rrb.Tabs(_spectrum(), _epsilon()), row_shares=[1.0, 1.0, 1.3])
    return _blueprint(rrb.Horizontal(seen, chosen, known, column_shares=[0.85, 1.15, 1.0]))


def _blueprint(views: rrb.Horizontal) -> rrb.Blueprint:
    return rrb.Blueprint(
        views,
        rrb.TopPanel(state="collapsed"),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline=TOSS, play_state="following"),
        auto_views=False,
        auto_layout=False,
    )


def _summary() -> rrb.TextDocumentView:
    return rrb.TextDocumentView(origin=summary_view.PAGE, name="Session")


def _motion() -> rrb.Spatial3DView:
    return rrb.Spatial3DView(
        origin=motion_view.SCENE,
        name="Toss: measured black, predicted blue",
        background=SKY,
        line_grid=False,
        eye_controls=rrb.EyeControls3D(position=EYE, look_target=LOOKED_AT, eye_up=UP),
    )


def _body(body: Body) -> rrb.Spatial3DView:
    x, y, z = (body.length_scale * coordinate for coordinate in BODY_EYE)
    return rrb.Spatial3DView(
        origin=body_view.BODY,
        name=f"Learned body, 1 sigma at best, drawn x {body_view.MAGNIFIED:g}",
        background=SKY,
        line_grid=False,
        eye_controls=rrb.EyeControls3D(position=(x, y, z), look_target=(0.0, 0.0, 0.0), eye_up=UP),
    )


def _ranking() -> rrb.TextDocumentView:
    return rrb.TextDocumentView(origin=ranking_view.TABLE, name="Ranking: a click on a number points the toss out")


def _throws() -> rrb.TextDocumentView:
    return rrb.TextDocumentView(origin=throw_view.TABLE, name="Throws")


def _rejected() -> rrb.TextDocumentView:
    return rrb.TextDocumentView(origin=ranking_view.REJECTED, name="Rejected by the quality checks")


def _health() -> rrb.TextDocumentView:
    return rrb.TextDocumentView(origin=health_view.TABLE, name="Nodes")


def _friction() -> rrb.TimeSeriesView:
    return _curves(body_view.FRICTION, "Friction: estimate blue, 1 sigma at best grey")


def _known() -> rrb.TimeSeriesView:
    return _curves(body_view.KNOWN, "Vertices, 1 sigma at best [mm]: worst orange, median blue")


def _errors() -> rrb.TimeSeriesView:
    return _curves(learning_view.ERRORS, "Held-out: position [%] blue, rotation [deg] orange")


def _gains() -> rrb.TimeSeriesView:
    return _curves(throw_view.GAINS, "Gain [nats]: planned pink, realised blue")


def _losses() -> rrb.TimeSeriesView:
    legend = rrb.PlotLegend(visible=True)  # the tab is too narrow for a title that names the colours
    return rrb.TimeSeriesView(origin=learning_view.LOSSES, name="Losses", plot_legend=legend)


def _epsilon() -> rrb.TimeSeriesView:
    return _curves(ranking_view.EPSILON, "Epsilon")


def _spectrum() -> rrb.BarChartView:
    hidden = rrb.PlotLegend(visible=False)
    return rrb.BarChartView(origin=ranking_view.SPECTRUM, name="Directions", plot_legend=hidden)


def _curves(origin: str, name: str) -> rrb.TimeSeriesView:
    """A view of curves whose colours its name gives; Rerun can draw a legend only on top of the curves."""
    return rrb.TimeSeriesView(origin=origin, name=name, plot_legend=rrb.PlotLegend(visible=False))
