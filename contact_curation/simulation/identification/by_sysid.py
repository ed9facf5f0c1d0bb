"""`mujoco.sysid`: its least squares and its confidence intervals, on the residuals of `shooting`.

Over windows of 20 frames the sum has local minima, in which descents end 5 % from the body. So short windows come first, with
coarse differences, from every start; the best end begins the descent over longer windows. Of the settings that were tried, on
throws without noise and on the cube's tosses of another split, none was better.
"""

from collections.abc import Sequence
from contextlib import redirect_stdout
from dataclasses import dataclass
from io import StringIO

import numpy as np
from mujoco import minimize, sysid

from contact_curation.contact.body import Body
from contact_curation.errors import MissingDependencyError
from contact_curation.geometry.quaternions import Array
from contact_curation.motion.toss import Toss
from contact_curation.simulation.identification.box import NAMES, Identified, IdentifiedBox, bounds_of
from contact_curation.simulation.identification.shooting import FRAMES, Windows


@dataclass(frozen=True)
class Stage:
    """One descent.

    Attributes:
        frames: of a window.
        difference: step of the finite differences of logarithms; contacts make residuals rough below it.
        steps: largest number of evaluations beside those of differences.
    """

    frames: int
    difference: float
    steps: int = 30


STAGES = (Stage(5, 1e-2), Stage(FRAMES, 1e-3))


class _Problem:
    """The residuals of tosses as `mujoco.sysid` wants them, and how often they were evaluated."""

    def __init__(self, windows: Windows) -> None:
        self._windows, self.evaluations = windows, 0

    def __call__(self, vectors: Array, _: object = None) -> tuple[list[Array], None, None]:
        """Of one vector (6,), or of several (6, B)."""
        columns = vectors.reshape(len(NAMES), -1)
        self.evaluations += columns.shape[1]
        found = np.stack([self._windows.residuals(IdentifiedBox.of_vector(column)) for column in columns.T], axis=1)
        return [found[:, 0] if vectors.ndim == 1 else found], None, None

    def descent(self, start: Array, stage: Stage) -> Array:
        """(6,) where least squares with a robust loss end."""
        low, high = bounds_of(self._windows.body)
        box = sysid.ParameterDict({"box": sysid.Parameter("box", np.clip(start, low, high), low, high)})
        settings = {"loss": "soft_l1", "diff_step": stage.difference, "max_iters": stage.steps}
        with redirect_stdout(StringIO()):  # its optimizer reports every step, whatever it is told
            _, result = sysid.optimize(box, self, "scipy_parallel_fd", verbose=False, **settings)
        return np.asarray(result.x, dtype=float)

    def misfit(self, vector: Array) -> float:
        """What a descent lowers."""
        self.evaluations += 1
        return self._windows.misfit(IdentifiedBox.of_vector(vector))

    def half_widths(self, vector: Array, stage: Stage) -> Array:
        """(6,) of the 95 % intervals."""
        residuals, column = self(vector)[0], vector.reshape(-1, 1)
        edges = [edge.reshape(-1, 1) for edge in bounds_of(self._windows.body)]
        values = residuals[0].reshape(-1, 1)
        jacobian, _ = minimize.jacobian_fd(lambda each: self(each)[0][0], column, values, stage.difference, 0, edges)
        return np.asarray(sysid.calculate_intervals(residuals, jacobian)[1], dtype=float)


def by_sysid(body: Body, tosses: Sequence[Toss], starts: Sequence[IdentifiedBox]) -> Identified:
    """Identifies a box by least squares from one start or several.

    Raises:
        MissingDependencyError: `mujoco.sysid` lacks what it needs.
        InvalidValueError: the body is no box.
    """
    if not hasattr(sysid, "optimize"):  # it can be imported without what it needs, and is then empty
        raise MissingDependencyError("mujoco.sysid", "pip install 'mujoco[sysid]'")
    ends, evaluations = [start.vector for start in starts], 0
    for stage in STAGES:
        problem = _Problem(Windows.of(body, tosses, stage.frames))
        ends = [min((problem.descent(end, stage) for end in ends), key=problem.misfit)]
        evaluations += problem.evaluations
    widths = problem.half_widths(ends[0], stage)
    return Identified(IdentifiedBox.of_vector(ends[0]), widths, evaluations)
