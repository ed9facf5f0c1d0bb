"""View: motions that the gates kept back, with their reasons, as a log."""

from collections.abc import Sequence

import rerun as rr

from contact_curation.dashboard.live.ranking_view import short_id
from contact_curation.dashboard.live.screen import Screen

GATED = "gated"


class GateView:
    """Writes what was kept back.

    Args:
        screen: to write to.
    """

    def __init__(self, screen: Screen) -> None:
        self._screen = screen

    def show(self, toss_id: str, frames: int, reasons: Sequence[str]) -> None:
        """Writes a motion and why it is no toss to learn from."""
        text = f"{short_id(toss_id)}, {frames} frames: {'; '.join(reasons)}"
        self._screen.log(GATED, rr.TextLog(text, level=rr.TextLogLevel.WARN))
