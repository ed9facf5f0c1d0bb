"""Where each view stands: the blueprint that the viewer opens with."""

import rerun.blueprint as rrb

from contact_curation.dashboard import body_view, gate_view, health_view, learning_view, motion_view, ranking_view, throw_view
from contact_curation.dashboard.screen import TOSS

WHITE = (250, 250, 250)
EYE = (-1.05, -1.15, 0.75)
"""[m] Where the toss is looked at from."""


def live_layout() -> rrb.Blueprint:
    """Of a session: everything."""
    seen = rrb.Vertical(_motion(), _body(), row_shares=[1.15, 1.0])
    chosen = rrb.Vertical(_ranking(), rrb.Horizontal(_spectrum(), _epsilon()), _gated(), row_shares=[1.5, 0.85, 0.55])
    errors = rrb.Horizontal(_errors(), _losses())
    known = rrb.Horizontal(_known(), _gains())
    learned = rrb.Vertical(errors, known, _throws(), _health(), row_shares=[0.8, 0.8, 0.75, 1.0])
    return _blueprint(rrb.Horizontal(seen, chosen, learned, column_shares=[0.85, 1.05, 1.1]))


def ranking_layout() -> rrb.Blueprint:
    """Of a ranking of recordings: what there is without a session."""
    seen = rrb.Vertical(_motion(), _body(), row_shares=[1.15, 1.0])
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
        name="Newest toss: measured (black), predicted (blue), impulses (orange), next throw (pink)",
        background=WHITE,
        line_grid=False,
        eye_controls=rrb.EyeControls3D(position=EYE, look_target=(0.0, 0.0, 0.05), eye_up=(0.0, 0.0, 1.0)),
    )


def _body() -> rrb.Spatial3DView:
    larger = f"{body_view.MAGNIFIED:g} x as large"
    return rrb.Spatial3DView(
        origin=body_view.BODY,
        name=f"Body as learned (blue) and described (grey); one standard deviation of each vertex, drawn {larger}",
        background=WHITE,
        line_grid=False,
    )


def _ranking() -> rrb.TextDocumentView:
    return rrb.TextDocumentView(origin=ranking_view.TABLE, name="Ranking")


def _spectrum() -> rrb.BarChartView:
    name = "Kept information against the pool's, log10 (0: as the pool)"
    return rrb.BarChartView(origin=ranking_view.SPECTRUM, name=name)


def _epsilon() -> rrb.TimeSeriesView:
    return _curves(ranking_view.EPSILON, "How the kept set stands for all tosses")


def _known() -> rrb.TimeSeriesView:
    return _curves(body_view.KNOWN, "Standard deviation of the vertices [mm]")


def _errors() -> rrb.TimeSeriesView:
    return _curves(learning_view.ERRORS, "Errors on held-out tosses")


def _losses() -> rrb.TimeSeriesView:
    return _curves(learning_view.LOSSES, "Losses")


def _gains() -> rrb.TimeSeriesView:
    return _curves(throw_view.GAINS, "Throws: planned and realised gain")


def _throws() -> rrb.TextDocumentView:
    return rrb.TextDocumentView(origin=throw_view.TABLE, name="Throws")


def _gated() -> rrb.TextLogView:
    return rrb.TextLogView(origin=gate_view.GATED, name="Kept back by the gates")


def _health() -> rrb.TextDocumentView:
    return rrb.TextDocumentView(origin=health_view.TABLE, name="Health of the nodes")


def _curves(origin: str, name: str) -> rrb.TimeSeriesView:
    return rrb.TimeSeriesView(origin=origin, name=name, plot_legend=rrb.PlotLegend(corner=rrb.Corner2D.RightTop))
