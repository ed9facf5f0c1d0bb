"""Where each view stands: the blueprint that the viewer opens with."""

import rerun.blueprint as rrb

from contact_curation.contact.body import Body
from contact_curation.dashboard.live import (
    body_view,
    health_view,
    learning_view,
    motion_view,
    ranking_view,
    throw_view,
)
from contact_curation.dashboard.live.screen import TOSS

WHITE = (250, 250, 250)
EYE, LOOKED_AT = (-0.25, -0.95, 0.42), (-0.03, 0.0, 0.05)
"""[m] Where tosses are looked at from, and where to."""

BODY_EYE = (2.6, -3.6, 2.2)
"""The same for the body about its origin [characteristic lengths]."""

COLUMNS = rrb.TextLogColumns(
    timeline_columns=[rrb.encodings.TimelineColumn(timeline=TOSS)],
    text_log_columns=[rrb.encodings.TextLogColumn(kind="body")],
)

UP = (0.0, 0.0, 1.0)


def live_layout(body: Body) -> rrb.Blueprint:
    """Of a session: everything."""
    seen = rrb.Vertical(_motion(), _body(body), row_shares=[1.15, 1.0])
    chosen = rrb.Vertical(_ranking(), rrb.Horizontal(_spectrum(), _epsilon()), _gated(), row_shares=[1.35, 1.0, 0.55])
    errors = rrb.Horizontal(_errors(), _losses())
    known = rrb.Horizontal(_known(), _gains())
    learned = rrb.Vertical(errors, known, _throws(), _health(), row_shares=[0.8, 0.8, 0.75, 1.0])
    return _blueprint(rrb.Horizontal(seen, chosen, learned, column_shares=[0.95, 1.05, 1.1]))


def ranking_layout(body: Body) -> rrb.Blueprint:
    """Of a ranking of recordings: what there is without a session."""
    seen = rrb.Vertical(_motion(), _body(body), row_shares=[1.15, 1.0])
    numbers = rrb.Horizontal(_spectrum(), _epsilon(), _known())
    chosen = rrb.Vertical(_ranking(), numbers, _gated(), row_shares=[1.5, 0.8, 0.7])
    return _blueprint(rrb.Horizontal(seen, chosen, column_shares=[0.8, 1.2]))


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


def _motion() -> rrb.Spatial3DView:
    return rrb.Spatial3DView(
        origin=motion_view.SCENE,
        name="Toss: measured black, predicted blue, next pink",
        background=WHITE,
        line_grid=False,
        eye_controls=rrb.EyeControls3D(position=EYE, look_target=LOOKED_AT, eye_up=UP),
    )


def _body(body: Body) -> rrb.Spatial3DView:
    x, y, z = (body.length_scale * coordinate for coordinate in BODY_EYE)
    return rrb.Spatial3DView(
        origin=body_view.BODY,
        name=f"Body learned; 1 sigma of each vertex (x {body_view.MAGNIFIED:g})",
        background=WHITE,
        line_grid=False,
        eye_controls=rrb.EyeControls3D(position=(x, y, z), look_target=(0.0, 0.0, 0.0), eye_up=UP),
    )


def _ranking() -> rrb.TextDocumentView:
    return rrb.TextDocumentView(origin=ranking_view.TABLE, name="Ranking")


def _spectrum() -> rrb.BarChartView:
    hidden = rrb.PlotLegend(visible=False)
    return rrb.BarChartView(origin=ranking_view.SPECTRUM, name="Spectrum of the selected set, log10", plot_legend=hidden)


def _epsilon() -> rrb.TimeSeriesView:
    return _curves(ranking_view.EPSILON, "Selected set against all", rrb.Corner2D.RightBottom)


def _known() -> rrb.TimeSeriesView:
    return _curves(body_view.KNOWN, "Vertices, 1 sigma")


def _errors() -> rrb.TimeSeriesView:
    return _curves(learning_view.ERRORS, "Held-out errors")


def _losses() -> rrb.TimeSeriesView:
    return _curves(learning_view.LOSSES, "Losses")


def _gains() -> rrb.TimeSeriesView:
    return _curves(throw_view.GAINS, "Gain of throws")


def _throws() -> rrb.TextDocumentView:
    return rrb.TextDocumentView(origin=throw_view.TABLE, name="Throws")


def _gated() -> rrb.TextLogView:
    return rrb.TextLogView(origin=ranking_view.REJECTED, name="Rejected by the gates", columns=COLUMNS)


def _health() -> rrb.TextDocumentView:
    return rrb.TextDocumentView(origin=health_view.TABLE, name="Health of the nodes")


def _curves(origin: str, name: str, legend: rrb.Corner2D = rrb.Corner2D.RightTop) -> rrb.TimeSeriesView:
    return rrb.TimeSeriesView(origin=origin, name=name, plot_legend=rrb.PlotLegend(corner=legend))
