"""Whether the body that was thrown is the described one."""

import numpy as np

from contact_curation.pipeline.diagnosis.evidence import Evidence
from contact_curation.pipeline.diagnosis.finding import Finding, Severity
from contact_curation.pipeline.diagnosis.findings.orientations import ASKEW, off_flat

LARGEST = 3.0
"""Times its description: a body that is larger or smaller by more is described in another unit."""

USUAL = 0.98
"""What `size_ratio` is for a body as described: rounded corners make it small."""

BETTER = 0.03
"""By so much nearer must a wrong size be to what is seen than a wrong height of the board."""

SMALLEST = 0.0025
"""[m] Of a body that is higher over the board than described."""


def other_shape(evidence: Evidence) -> Finding | None:
    """Bodies that come to rest on none of the described faces."""
    found = off_flat(evidence)
    if found is None or found["as read"] < ASKEW:
        return None
    what = f"bodies at rest stand {found['as read']:.0f} degrees off every face of {evidence.body.name} as described (median)"
    return Finding(Severity.FAULT, what, "is it the right --body, and are the tags in its frame?")


def other_size(evidence: Evidence) -> Finding | None:
    """A body larger or smaller than described, where heights on edges and at rest agree on it."""
    rig = evidence.rig
    if rig is None:
        return None
    vertices = evidence.body.vertices
    width = float(np.ptp(vertices, axis=0).max())
    half = float(np.median(rig.rest_depths))
    by_rest = 1.0 + rig.height.value / half
    if not 1.0 / LARGEST < by_rest < LARGEST and half > 0.5:
        what = f"{evidence.body.name} is {width:.3g} m wide as described, and lies {half + rig.height.value:.3g} m high"
        return Finding(Severity.FAULT, what, "are its vertices in mm? expected metres")
    size = evidence.size
    if size is None or abs(rig.height.value) < SMALLEST:
        return None
    if abs(size.value - by_rest) + BETTER > abs(size.value - USUAL):
        return None
    off = 100.0 * (by_rest - 1.0)
    larger = "larger" if off > 0.0 else "smaller"
    what = f"the body is {abs(off):.0f} % {larger} than {evidence.body.name} as described ({1e3 * width:.0f} mm wide), at rest and on its edges"
    return Finding(Severity.FAULT, what, "measure the body and correct its --body file")
