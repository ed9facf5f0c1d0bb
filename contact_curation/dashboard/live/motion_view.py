"""View: the newest toss over the board, as measured and as predicted, with the board's impulses, and the next throw.

What the whole toss was like stands still: its paths, outlines of the body at a few moments, every impulse as an arrow. On the
timeline of stamps the measured body also moves, frame by frame.
"""

import numpy as np
import rerun as rr

from contact_curation.contact.body import Body
from contact_curation.dashboard.live.screen import Screen, quaternions_xyzw
from contact_curation.dashboard.live.toss_names import path_of, zoned
from contact_curation.dashboard.live.wireframe import wireframe_of
from contact_curation.dashboard.style import BLUE, PURPLE, VERMILION, Colour
from contact_curation.dashboard.toss_motion import TossMotion
from contact_curation.design.throw import Throw
from contact_curation.geometry.quaternions import Array

SCENE = "scene"
MEASURED, PREDICTED, IMPULSE, NEXT = Colour(30, 30, 30), BLUE, VERMILION, PURPLE
BOARD, PAST = Colour(195, 195, 195), Colour(140, 140, 140)

BOARD_SIDE, BOARD_THICKNESS = 0.9, 0.004
"""[m]"""

NAME_ABOVE = 0.12
"""[m] A toss's name stands so far above its release."""

IMPULSE_SCALE = 1.0
"""[m] of arrow for 1 N s."""

SPEED_SCALE = 0.12
"""[m] of arrow for 1 m/s."""

MOMENTS = 6
"""Outlines of a motion from its release to its rest."""


class MotionView:
    """Writes tosses and the next throw.

    Args:
        screen: to write to.
        body: body as it was described.
    """

    def __init__(self, screen: Screen, body: Body) -> None:
        self._screen = screen
        self._body = body
        self._wireframe = wireframe_of(body.vertices)
        size = (BOARD_SIDE / 2, BOARD_SIDE / 2, BOARD_THICKNESS / 2)
        board = rr.Boxes3D(half_sizes=[size], centers=[(0.0, 0.0, -BOARD_THICKNESS / 2)], colors=[BOARD], fill_mode="solid")
        screen.always(SCENE, rr.ViewCoordinates.RIGHT_HAND_Z_UP)
        screen.always(f"{SCENE}/board", board)

    def show(self, motion: TossMotion, number: int, called: str = "toss") -> None:
        """Writes a toss, the `number`th of what it is called; its path stays among those of all tosses."""
        toss = motion.toss
        above = toss.positions[:1] + np.array([0.0, 0.0, NAME_ABOVE])
        name = f"{called} {number}, {zoned(toss.toss_id)}"
        label = rr.Points3D(above, labels=[name], colors=[MEASURED], radii=NAME_ABOVE / 100.0, show_labels=True)
        self._path("measured", toss.positions, toss.orientations_wxyz, self._body.vertices, MEASURED)
        finite = np.isfinite(motion.predicted).all(axis=1)
        states = motion.predicted[finite]
        self._path("predicted", states[:, :3], states[:, 3:7], motion.vertices, PREDICTED)
        arrows = rr.Arrows3D(
            vectors=IMPULSE_SCALE * motion.impulses.vectors,
            origins=motion.impulses.places,
            colors=[IMPULSE],
            radii=rr.Radius.ui_points(1.5),
        )
        self._screen.log(f"{SCENE}/impulses", arrows)
        self._screen.log(f"{SCENE}/name", label)
        path = rr.LineStrips3D([toss.positions], colors=[PAST], radii=rr.Radius.ui_points(1.0))
        self._screen.always(path_of(number), path)
        moving = f"{SCENE}/moving"
        poses = rr.Transform3D.columns(translation=toss.positions, quaternion=quaternions_xyzw(toss.orientations_wxyz))
        self._screen.frames(moving, number, toss.stamps_ns, poses)
        body = rr.Mesh3D(
            vertex_positions=motion.vertices, triangle_indices=self._wireframe.triangles, albedo_factor=(*PREDICTED, 90)
        )
        self._screen.log(f"{moving}/body", body)

    def show_throw(self, throw: Throw | None) -> None:
        """Writes the throw that comes next; None: there is none now."""
        if throw is None:
            self._screen.log(f"{SCENE}/next", rr.Clear(recursive=True))
            return
        outline = self._wireframe.strips_at(self._body.vertices, throw.position[None], throw.orientation_wxyz[None])
        thin = rr.Radius.ui_points(1.5)
        self._screen.log(f"{SCENE}/next/release", rr.LineStrips3D(outline, colors=[NEXT], radii=thin))
        arrow = rr.Arrows3D(
            vectors=[SPEED_SCALE * throw.linear_velocity],
            origins=[throw.position],
            colors=[NEXT],
            radii=rr.Radius.ui_points(2.5),
            labels=[f"next: {np.linalg.norm(throw.linear_velocity):.2f} m/s"],
        )
        self._screen.log(f"{SCENE}/next/velocity", arrow)

    def _path(self, name: str, positions: Array, orientations: Array, vertices: Array, colour: Colour) -> None:
        """The way of the centre, and outlines at a few moments."""
        trail = rr.LineStrips3D([positions], colors=[colour], radii=rr.Radius.ui_points(2.5))
        self._screen.log(f"{SCENE}/{name}/trail", trail)
        at = np.linspace(0, len(positions) - 1, MOMENTS).astype(int)
        outlines = self._wireframe.strips_at(vertices, positions[at], orientations[at])
        lines = rr.LineStrips3D(outlines, colors=[colour], radii=rr.Radius.ui_points(0.8))
        self._screen.log(f"{SCENE}/{name}/outlines", lines)
