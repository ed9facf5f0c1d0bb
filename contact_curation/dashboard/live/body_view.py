"""Views: the body at its learned vertices, each with the ellipsoid that it is known within; its friction over the session."""

import numpy as np
import rerun as rr
from scipy.spatial.transform import Rotation

from contact_curation.contact.body import Body
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.dashboard.live.screen import Screen
from contact_curation.dashboard.live.wireframe import wireframe_of
from contact_curation.dashboard.style import BLUE, GREEN, GREY, VERMILION, Colour
from contact_curation.dashboard.vertex_uncertainty import VertexUncertainty
from contact_curation.geometry.quaternions import Array

BODY, KNOWN, FRICTION = "body", "known", "friction"

DESCRIBED, LEARNED, SURE, UNSURE, TEXT, BAND = Colour(150, 150, 150), BLUE, GREEN, VERMILION, Colour(20, 20, 20), GREY
SMALL = 0.0005
"""Radius of a point that carries a label [m]."""

MAGNIFIED = 10.0
"""Ellipsoids are drawn so many times as large, to be seen beside the body."""

LARGEST_SHARE = 0.5
"""Largest drawn ellipsoid, as a share of the characteristic length; its label still gives its real size."""

SURE_MM, UNSURE_MM = 0.5, 10.0
"""One standard deviation at the ends of the colours."""

MILLIMETRES = 1e3


class BodyView:
    """Writes what is known of a body.

    Args:
        screen: to write to.
        body: body as it was described.
    """

    def __init__(self, screen: Screen, body: Body) -> None:
        self._screen = screen
        self._body = body
        self._wireframe = wireframe_of(body.vertices)
        edges = self._wireframe.strips(body.vertices)
        screen.always(BODY, rr.ViewCoordinates.RIGHT_HAND_Z_UP)
        screen.always(f"{BODY}/described", rr.LineStrips3D(edges, colors=[DESCRIBED], radii=rr.Radius.ui_points(1.0)))
        screen.curve(f"{KNOWN}/worst", "worst vertex [mm]", UNSURE)
        screen.curve(f"{KNOWN}/median", "median vertex [mm]", LEARNED)
        screen.curve(f"{FRICTION}/estimate", "friction", LEARNED)
        for end in ("low", "high"):
            screen.curve(f"{FRICTION}/{end}", "1 sigma", BAND)

    def show(self, geometry: ContactGeometry | None, uncertainty: VertexUncertainty | None) -> str:
        """Writes the body at a theta; None is that of a network, whose body is as described.

        Args:
            geometry: geometry of theta.
            uncertainty: uncertainty of its vertices and friction, where that is known.

        Returns:
            The friction with its interval of one sigma, in words; empty for a network.
        """
        scale = self._body.length_scale
        vertices = self._body.vertices if geometry is None else geometry.vertices_normal * scale
        edges = self._wireframe.strips(vertices)
        self._screen.log(f"{BODY}/learned/edges", rr.LineStrips3D(edges, colors=[LEARNED], radii=rr.Radius.ui_points(2.0)))
        faces = rr.Mesh3D(vertex_positions=vertices, triangle_indices=self._wireframe.triangles, albedo_factor=(*LEARNED, 40))
        self._screen.log(f"{BODY}/learned/faces", faces)
        if uncertainty is None:
            self._screen.log(f"{BODY}/uncertainty", rr.Clear(recursive=True))
        else:
            self._show_uncertainty(vertices, uncertainty)
        if geometry is None:
            return ""
        friction, sigma = friction_of(geometry), uncertainty.friction if uncertainty else np.nan
        low, high = float(friction * np.exp(-sigma)), float(friction * np.exp(sigma))
        self._screen.values(FRICTION, {"estimate": friction, "low": low, "high": high})
        return f"{friction:.3f}" + (f" (1 sigma at best: {low:.3f} to {high:.3f})" if np.isfinite(sigma) else "")

    def _show_uncertainty(self, vertices: Array, uncertainty: VertexUncertainty) -> None:
        self._screen.log(f"{BODY}/uncertainty", ellipsoids_of(vertices, uncertainty, self._body.length_scale))
        largest = MILLIMETRES * self._body.length_scale * uncertainty.largest
        labels = rr.Points3D(
            vertices, labels=[f"{one:.1f} mm" for one in largest], colors=[TEXT], radii=SMALL, show_labels=True
        )
        self._screen.log(f"{BODY}/uncertainty/labels", labels)
        self._screen.values(KNOWN, {"worst": float(largest.max()), "median": float(np.median(largest))})


def friction_of(geometry: ContactGeometry) -> float:
    """The friction coefficient; in a form that has two tangents of their own, their root mean square."""
    return float(np.sqrt((geometry.tangents**2).sum() / 2.0))


def ellipsoids_of(vertices: Array, uncertainty: VertexUncertainty, length_scale: float) -> rr.Ellipsoids3D:
    """Ellipsoids about vertices (V, 3) [m], drawn larger than they are."""
    drawn = np.minimum(MAGNIFIED * uncertainty.half_axes, LARGEST_SHARE) * length_scale
    millimetres = MILLIMETRES * length_scale * uncertainty.largest
    return rr.Ellipsoids3D(
        centers=vertices,
        half_sizes=drawn,
        quaternions=Rotation.from_matrix(uncertainty.directions).as_quat(),
        colors=[colour_of(one) for one in millimetres],
        fill_mode="solid",
    )


def colour_of(millimetres: float) -> Colour:
    """Colour of a standard deviation [mm], from sure to unsure on a logarithmic scale."""
    share = np.log(max(millimetres, SURE_MM) / SURE_MM) / np.log(UNSURE_MM / SURE_MM)
    mixed = np.array(SURE) + min(float(share), 1.0) * (np.array(UNSURE) - np.array(SURE))
    return Colour(*mixed.astype(int).tolist())
