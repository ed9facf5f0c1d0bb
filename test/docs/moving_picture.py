"""docs/images/session.gif: the tosses of bags/golden.mcap one after the other, what becomes of each, and what is learned.

python -m test.docs.moving_picture          draws it again; about two minutes, nearly all of it fits of the polytope
"""

import sys
from collections.abc import Iterator, Sequence
from io import BytesIO
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from PIL import Image

import contact_curation as cc
from contact_curation.contact.models.polytope import PolytopeModel
from contact_curation.dashboard.live.wireframe import wireframe_of
from contact_curation.dashboard.style import BLUE, INK, PALE, VERMILION
from contact_curation.geometry import quaternions
from test.conftest import GOLDEN, REPOSITORY

PICTURE = REPOSITORY / "docs" / "images" / "session.gif"
TOP, FIRST_FIT = 8, 4
FRAMES, MILLISECONDS, LAST_MILLISECONDS = 5, 130, 3000
COLOURS = 48
"""Of the palette."""

VIEW = np.array([[0.82, 0.57, 0.0], [-0.2, 0.29, 0.94]])
"""(2, 3) from the board to the picture: seen from the side and a little from above."""


class Moment(NamedTuple):
    """What is known after a toss.

    Attributes:
        toss: the newest one.
        rejected: why it is rejected; empty where it is not.
        states: "selected", "not selected" or "rejected" of each toss so far.
        friction: fitted to the selected tosses; nan before the first fit.
    """

    toss: cc.Toss
    rejected: str
    states: tuple[str, ...]
    friction: float


def moments(tosses: cc.Tosses) -> Iterator[Moment]:
    """The session, toss by toss."""
    why = {one.toss.toss_id: one.reasons[0].partition(":")[0] for one in tosses.rejected}
    motions = sorted([*tosses.accepted, *(one.toss for one in tosses.rejected)], key=lambda toss: int(toss.stamps_ns[0]))
    friction = float("nan")
    for count in range(1, len(motions) + 1):
        accepted = [toss for toss in motions[:count] if toss.toss_id not in why]
        ranking = cc.rank(cc.Tosses.of(accepted, tosses.body), top=TOP)
        selected = set(ranking.selected_ids)
        states = ["rejected" if toss.toss_id in why else "not selected" for toss in motions[:count]]
        states = ["selected" if toss.toss_id in selected else state for toss, state in zip(motions, states, strict=False)]
        newest = motions[count - 1]
        if len(accepted) >= FIRST_FIT and newest.toss_id not in why:
            model = cc.train(ranking.selected, protocol="exact").model
            assert isinstance(model, PolytopeModel)
            friction = float(np.linalg.norm(model.geometry().tangents, axis=1).mean())
        yield Moment(newest, why.get(newest.toss_id, ""), tuple(states), friction)


def draw(told: Sequence[Moment], total: int, frame: float, body: cc.Body) -> Image.Image:
    """One picture: the newest toss at a share of its duration, the states of all, the friction so far."""
    figure = Figure(figsize=(9.0, 3.7), dpi=80, layout="constrained")
    left, right = np.ravel(np.asarray(figure.subfigures(1, 2, width_ratios=(1.0, 1.1)), dtype=object))
    _draw_toss(left.subplots(), told[-1], len(told), total, frame, body)
    states, friction = right.subplots(2, 1, height_ratios=(1.0, 2.2))
    _draw_states(states, told[-1].states, total)
    _draw_friction(friction, [one.friction for one in told], total, body.friction)
    out = BytesIO()
    figure.savefig(out)
    return Image.open(out).convert("RGB").quantize(COLOURS, dither=Image.Dither.NONE)


def _draw_toss(axes: Axes, moment: Moment, number: int, total: int, frame: float, body: cc.Body) -> None:
    toss = moment.toss
    last = round(frame * (toss.frames - 1))
    along = toss.positions[-1, :2] - toss.positions[0, :2]
    turn = np.arctan2(along[1], along[0])
    level = np.array([[np.cos(turn), np.sin(turn), 0.0], [-np.sin(turn), np.cos(turn), 0.0], [0.0, 0.0, 1.0]])
    places = (toss.positions - [*toss.positions[0, :2], 0.0]) @ level.T  # (T, 3), the flight along x
    for near in np.linspace(-0.3, 0.3, 4):
        for ends in ([[-0.2, near, 0.0], [0.8, near, 0.0]], [[0.3 + 1.67 * near, -0.3, 0.0], [0.3 + 1.67 * near, 0.3, 0.0]]):
            axes.plot(*(VIEW @ np.transpose(ends)), color=PALE.web, linewidth=0.8)
    axes.plot(*(VIEW @ places[: last + 1].T), color=INK.web, linewidth=1.0)
    colour = (VERMILION if moment.rejected else BLUE).web
    corners = places[last] + quaternions.rotate(toss.orientations_wxyz[last], body.vertices) @ level.T  # (V, 3)
    for one, other in wireframe_of(body.vertices).edges:
        axes.plot(*(VIEW @ corners[[one, other]].T), color=colour, linewidth=1.8)
    axes.set(xlim=(-0.36, 0.86), ylim=(-0.38, 0.32), aspect="equal", title=f"Toss {number} of {total}")
    axes.text(0.25, -0.36, f"rejected: {moment.rejected}" if moment.rejected else "", ha="center", color=colour)
    axes.set_axis_off()


def _draw_states(axes: Axes, states: Sequence[str], total: int) -> None:
    fills = {"selected": BLUE.web, "not selected": PALE.web, "rejected": VERMILION.web}
    for place in range(total):
        filled = fills[states[place]] if place < len(states) else "none"
        axes.add_patch(Rectangle((place + 0.6, 0.0), 0.8, 1.0, facecolor=filled, edgecolor=PALE.web))
    counts = ", ".join(f"{sum(state == name for state in states)} {name}" for name in fills)
    axes.set(xlim=(0.4, total + 0.6), ylim=(-0.1, 1.1), title=counts)
    axes.set_axis_off()


def _draw_friction(axes: Axes, values: Sequence[float], total: int, true: float) -> None:
    axes.axhline(true, color=INK.web, linestyle="--", linewidth=1.0)
    axes.text(1.0, true + 0.003, f"true: {true:g}", color=INK.web)
    axes.plot(np.arange(1, len(values) + 1), values, color=BLUE.web, marker="o", markersize=4)
    axes.set(xlim=(0.4, total + 0.6), ylim=(0.12, 0.22), xlabel="tosses recorded")
    axes.set_title(f"Friction learned from the {TOP} selected tosses")
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)


def main() -> int:
    """Draws it."""
    tosses = cc.read(GOLDEN)
    told = list(moments(tosses))
    shares = np.linspace(0.0, 1.0, FRAMES)
    pictures = [draw(told[:count], len(told), share, tosses.body) for count in range(1, len(told) + 1) for share in shares]
    times = [MILLISECONDS] * (len(pictures) - 1) + [LAST_MILLISECONDS]
    pictures[0].save(PICTURE, save_all=True, append_images=pictures[1:], duration=times, loop=0, optimize=True)
    sys.stdout.write(f"{PICTURE} {PICTURE.stat().st_size / 1e6:.2f} MB\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
