"""`rank --dashboard` and `--recording`: shows the ranking in a browser, or writes it as a file for Rerun's viewer.

rerun takes most of a second to import, so it is imported only if one of the two options is given.
"""

import argparse
import sys
import time
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

from contact_curation.cli.options.types import PathEndingIn
from contact_curation.cli.stop_signals import StopSignals
from contact_curation.errors import ContactCurationError, InvalidValueError
from contact_curation.files import BLUEPRINT, scratch_folder, writing
from contact_curation.information.curation import Curation
from contact_curation.information.pool import pool_of
from contact_curation.information.scoring import scored_geometry
from contact_curation.pipeline.pool import TossPool
from contact_curation.pipeline.ranking import RankConfig
from contact_curation.pipeline.tosses import read_tosses
from contact_curation.storage.parameters_file import Parameters

if TYPE_CHECKING:
    from contact_curation.dashboard.evidence import SelectedSet
    from contact_curation.dashboard.live.ranked import RejectedMotion
    from contact_curation.dashboard.live.screen import Screen
    from contact_curation.dashboard.toss_motion import ShownTheta

POLL = 0.2
"""[s]"""


def add_dashboard_options(parser: argparse.ArgumentParser) -> None:
    """Adds the options for the dashboard of a ranking."""
    group = parser.add_argument_group("what is shown")
    group.add_argument("--dashboard", action="store_true", help="serve the ranking to a browser, until Ctrl-C")
    group.add_argument(
        "--rrd",
        "--recording",
        type=PathEndingIn(".rrd"),
        metavar="FILE.rrd",
        help="write the dashboard to a file for `rerun FILE.rrd`",
    )
    group.add_argument("--web-port", type=int, metavar="PORT", help="port of the page (default 9090)")
    group.add_argument("--grpc-port", type=int, metavar="PORT", help="port of the page's data (default 9876)")
    group.add_argument(
        "--bind",
        metavar="ADDRESS",
        help="IPv4 address of this machine for page and data; 0.0.0.0 serves other machines, too (default 127.0.0.1)",
    )


class RankDashboard:
    """The dashboard of a ranking; call `end` or `drop` at its end.

    Args:
        arguments: arguments of the command.
        config: configuration of the ranking.

    Raises:
        InvalidValueError: a port is in use, or the file cannot be written.
    """

    def __init__(self, arguments: argparse.Namespace, config: RankConfig) -> None:
        from contact_curation.dashboard.live.layout import ranking_layout
        from contact_curation.dashboard.live.serving import ServingConfig, open_screen

        self._config = config
        theta = config.pool.thetas[0]
        self._body = theta.body if isinstance(theta, Parameters) else config.pool.reading.body
        self._inputs: Sequence[Path] = arguments.inputs
        page = _page_options(arguments) if arguments.dashboard else {"web_port": 0}
        self._recording: Path | None = arguments.rrd
        self._partial: Path | None = None
        self._scratch = ExitStack()
        if self._recording:
            self._partial = self._scratch.enter_context(scratch_folder(self._recording)) / self._recording.name
        try:
            self._serving: ServingConfig = ServingConfig(**page, recording=self._partial, index=True)
            self._screen: Screen = open_screen(self._serving, ranking_layout(self._body))
        except ContactCurationError:
            self.drop()
            raise

    def show(self, pool: TossPool, curation: Curation) -> None:
        """Writes the ranking; call it while the factors of the pool can be read."""
        from contact_curation.dashboard.live.ranked import show_ranked

        selected = _selected_set(pool, curation, self._config.ranking.top)
        show_ranked(
            screen=self._screen,
            body=self._body,
            theta=_theta(self._config, selected.version),
            loss=self._config.pool.scoring.loss,
            pool=pool_of([toss.informations[0] for toss in pool.rankable]),
            selected=selected,
            ranking=self._config.ranking,
            # The tosses are read again, because only their information was kept.
            tosses=read_tosses(self._inputs, self._config.pool.reading, only=selected.toss_ids).by_id,
            rejected=_rejected(pool),
        )

    def end(self) -> None:
        """Serves the dashboard until Ctrl-C or SIGTERM if requested, and closes it.

        Raises:
            UnwritableOutputError: the file is not whole.
        """
        from contact_curation.dashboard.live.serving import close_screen

        if self._serving.web_port:
            with StopSignals() as signals:
                sys.stdout.flush()
                print(f"dashboard at {self._serving.address} (Ctrl-C ends it)", file=sys.stderr, flush=True)
                while not signals.wanted:
                    time.sleep(POLL)
        if not (self._partial and self._recording):
            close_screen(self._screen)
            return
        with writing(self._recording):
            close_screen(self._screen)
            for ending in (self._recording.suffix, BLUEPRINT):
                self._partial.with_suffix(ending).replace(self._recording.with_suffix(ending))

    def drop(self) -> None:
        """Removes an incomplete file; the file of an earlier dashboard stays."""
        self._scratch.close()


def dashboard_of(arguments: argparse.Namespace, config: RankConfig) -> RankDashboard | None:
    """The dashboard that the options describe, or None.

    Raises:
        InvalidValueError: an option of the page without a page; the errors of `RankDashboard`.
    """
    if (without := list(_page_options(arguments))) and not arguments.dashboard:
        raise InvalidValueError(f"--{without[0].replace('_', '-')}", "no --dashboard", "--dashboard, which it belongs to")
    return RankDashboard(arguments, config) if arguments.dashboard or arguments.rrd else None


def _page_options(arguments: argparse.Namespace) -> dict[str, Any]:
    """Those of the page that were given, as fields of `ServingConfig`."""
    given = {name: getattr(arguments, name) for name in ("web_port", "grpc_port", "bind")}
    return {name: value for name, value in given.items() if value is not None}


def _theta(config: RankConfig, version: str) -> "ShownTheta":
    from contact_curation.dashboard.toss_motion import ShownTheta

    theta = config.pool.thetas[0]
    if isinstance(theta, Parameters):
        return ShownTheta(version, geometry=scored_geometry(theta.geometry, config.pool.scoring.form))
    return ShownTheta(version, model=theta.model())


def _selected_set(pool: TossPool, curation: Curation, top: int) -> "SelectedSet":
    from contact_curation.dashboard.evidence import SelectedSet

    entries = [entry for entry in curation.ranking.entries if entry.selected]
    certificate = curation.ranking.certificate
    return SelectedSet(
        criterion=curation.ranking.criterion,
        capacity=top,
        toss_ids=tuple(entry.toss_id for entry in entries),
        gains=tuple(float(entry.marginal_gain) for entry in entries),
        version=pool.rankable[0].informations[0].parameters_version,
        seen=len(pool.rankable),
        bound=certificate.subset if certificate else 0.0,
    )


def _rejected(pool: TossPool) -> "list[RejectedMotion]":
    from contact_curation.dashboard.live.ranked import RejectedMotion

    return [RejectedMotion(toss.seen.toss_id, toss.seen.frames, toss.reasons) for toss in pool.tosses if toss.reasons]
