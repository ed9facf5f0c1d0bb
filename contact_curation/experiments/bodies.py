"""Bodies that experiments compare rules on, by name, and their tosses.

- cube: ContactNets' tosses below 400, from the folder tosses_processed/ of the one that CONTACTNETS_DATA names; those from
  400 on, and duplicates of them, are left out
- square: 350 throws of a bouncing square prism in a vertical plane (Fazeli; DAIRLab/ImpactModeling), as poses (K, 200, 3) of
  x [m], z [m] and theta [rad], from x towards z, at 250 Hz in throws.npz, in the folder that SQUARE_DATA names; of these
  the motions up to rest that the quality checks accept
- slab, wedge, irregular: thrown in MuJoCo from random releases, with the noise of ContactNets' tracker; the truth is known

A third of the tosses, drawn by a seed, judges what is learned from the others.
"""

import os
from collections.abc import Callable
from hashlib import sha256
from pathlib import Path

import numpy as np

from contact_curation.contact.body import CONTACTNETS_CUBE, Body
from contact_curation.design.throw import throw_of_state
from contact_curation.errors import InvalidValueError, UnreadableInputError
from contact_curation.experiments.cell_run import Bench
from contact_curation.geometry import quaternions
from contact_curation.geometry.polytopes import box
from contact_curation.geometry.quaternions import Array
from contact_curation.geometry.scalars import ScalarPose
from contact_curation.geometry.solids.mass_properties import of_hull
from contact_curation.learning.evaluation.held_out import HeldOutRule, NumberedToss, split, toss_number
from contact_curation.motion.body_tracker import TrackerConfig
from contact_curation.motion.calibration import RigCalibration, calibration_of
from contact_curation.motion.gate_config import GateConfig
from contact_curation.motion.ingest import IngestConfig, TossIngest
from contact_curation.motion.pose_stream import FramePose
from contact_curation.motion.segmenter_config import SegmenterConfig
from contact_curation.motion.smoothing import kinematics
from contact_curation.motion.toss import NANOSECONDS, Toss, toss_identity
from contact_curation.motion.transitions import states_of
from contact_curation.simulation.tracker_noise import TrackerNoiseConfig
from contact_curation.storage.inputs.inputs import open_inputs

CUBE_DATA, SQUARE_DATA = "CONTACTNETS_DATA", "SQUARE_DATA"
DATA_OF = {"cube": (CUBE_DATA, "tosses_processed/*.pt"), "square": (SQUARE_DATA, "throws.npz")}
"""Variable of the folder of a body's data, and the files in it."""

NEVER = HeldOutRule(spans=((400, 569),))
"""The cube's tosses that are neither learned from nor judge here."""

SIMULATED, DENSITY, FRICTION = 300, 900.0, 0.2
"""Throws of a simulated body, its density [kg/m^3] and friction."""

SQUARE_PERIOD, SQUARE_SIDE, SQUARE_MASS = 0.004, 0.06, 0.1
"""Of the recorded square [s, m, kg]. Depth and mass are not published: it is taken for a cube about as dense as ContactNets'.
The mass changes no motion, but slip and gaps count by squared impulses in the loss: with 1 kg fits end without friction."""

SQUARE_INGEST = IngestConfig(
    TrackerConfig("square", "board"),
    SegmenterConfig(tracker_noise=2.0),
    rig=RigCalibration(height=0.00132, marker_turn=(0.0, 0.02975, 0.0)),
)
"""How its throws become tosses; the rig is what `contact-curation rig` says of them."""

RELEASE_SPEED, RELEASE_SPIN, RELEASE_HEIGHT = 1.1, 4.0, 0.15
"""Of simulated throws: speed along [m/s], standard deviation of the spin per axis [rad/s], height of the lowest corner [m]."""


def bench_of(name: str, seed: int) -> Bench:
    """A body's tosses, divided by a seed; the cube's are corrected by the rig calibration of those for training.

    Raises:
        InvalidValueError: there is no such body, or its data are not given.
        UnreadableInputError: its data cannot be read.
    """
    if name not in BODIES:
        raise InvalidValueError("--bodies", name, f"one of {', '.join(BODIES)}")
    body, tosses = BODIES[name]()
    bench = Bench(body, tosses, (), GateConfig()).divided(seed)
    return bench.on(calibration_of(bench.training, body.polytope)) if name == "cube" else bench


def data_digest(name: str) -> str:
    """Of the files that a body's tosses are read from; empty where there are none."""
    variable, pattern = DATA_OF.get(name, ("", ""))
    folder, state = os.environ.get(variable, ""), sha256()
    paths = sorted(Path(folder).glob(pattern)) if folder else []
    for path in paths:
        state.update(path.name.encode())
        state.update(sha256(path.read_bytes()).digest())
    return state.hexdigest()[:16] if paths else ""


def _folder(variable: str, what: str) -> Path:
    folder = os.environ.get(variable, "")
    if not folder:
        raise InvalidValueError(variable, "nothing", f"the folder of {what}; or other --bodies")
    return Path(folder)


def _cube() -> tuple[Body, tuple[Toss, ...]]:
    folder = _folder(CUBE_DATA, "ContactNets' tosses_processed/") / "tosses_processed"
    found = [one for one in open_inputs([folder], CONTACTNETS_CUBE) if isinstance(one, Toss)]
    numbered = [NumberedToss(one, toss_number(one, place)) for place, one in enumerate(found)]
    return CONTACTNETS_CUBE, tuple(split(numbered, NEVER).training)


def _square() -> tuple[Body, tuple[Toss, ...]]:
    path = _folder(SQUARE_DATA, "the square's throws.npz") / "throws.npz"
    try:
        with np.load(path, allow_pickle=False) as file:
            poses = np.asarray(file["poses"], dtype=float)  # (K, T, 3)
    except (OSError, KeyError, ValueError) as error:
        raise UnreadableInputError(path, f"expected poses (K, T, 3) of x, z, theta ({error})") from error
    half = 0.5 * SQUARE_SIDE
    inertia = SQUARE_MASS * SQUARE_SIDE**2 / 6.0 * np.eye(3)
    body = Body("square", box([half] * 3).vertices, SQUARE_MASS, inertia, 0.3, half)
    turns = np.stack([np.zeros_like(poses[..., 2]), -poses[..., 2], np.zeros_like(poses[..., 2])], axis=-1)
    lifted = np.stack([poses[..., 0], np.zeros_like(poses[..., 0]), poses[..., 1]], axis=-1)
    orientations = np.stack([quaternions.exp(turn) for turn in turns])
    motions = zip(lifted, orientations, strict=True)
    return body, tuple(toss for k, motion in enumerate(motions) for toss in _accepted(body, f"throw-{k + 1:03d}", *motion))


def _accepted(body: Body, source: str, positions: Array, orientations_wxyz: Array) -> list[Toss]:
    """The tosses in a throw of the square: one, or none."""
    ingest, events = TossIngest(SQUARE_INGEST, body, source=source), list[object]()
    for frame, ((x, y, z), (w, i, j, k)) in enumerate(zip(positions.tolist(), orientations_wxyz.tolist(), strict=True)):
        stamp = round(frame * SQUARE_PERIOD * NANOSECONDS)
        events += ingest.push(FramePose(stamp, "board", "square", ScalarPose((x, y, z), (w, i, j, k))))
    return [event for event in [*events, *ingest.flush()] if isinstance(event, Toss)]


def _seen(body: Body, source: str, positions: Array, orientations_wxyz: Array, period: float) -> Toss:
    """A toss from poses; the first, of which no difference to an earlier one is known, only gives the second's velocity."""
    stamps = np.rint(np.arange(len(positions)) * period * NANOSECONDS).astype(np.int64)
    rates = kinematics(stamps, positions, orientations_wxyz)
    return Toss(
        toss_identity(body.name, source, 0), body.name, source, period, stamps[1:], positions[1:], orientations_wxyz[1:],
        rates.linear_velocities[1:], rates.angular_velocities[1:],
    )  # fmt: skip


def _hull(name: str, corners: Array) -> tuple[Body, tuple[Toss, ...]]:
    """A simulated body of even density that is the convex hull of some corners [m], and its throws."""
    unit = of_hull(corners)
    vertices = corners - unit.center
    size = float(np.linalg.norm(vertices, axis=1).mean() / np.sqrt(3.0))  # a cube's half width
    body = Body(name, vertices, DENSITY * unit.mass, DENSITY * unit.inertia, FRICTION, size)
    return body, _thrown(body)


def _thrown(body: Body) -> tuple[Toss, ...]:
    """Throws of a body that come to rest, as a tracker with the noise of ContactNets' sees them."""
    from contact_curation.simulation.thrown_toss import ThrownTossConfig, thrown_toss  # MuJoCo takes a second to import

    tosses, config, tracker = list[Toss](), ThrownTossConfig(), TrackerNoiseConfig()
    for number in range(SIMULATED):
        rng = np.random.default_rng([number, 5])
        try:
            true = thrown_toss(body, throw_of_state(f"{body.name}-{number:03d}", body.name, _release(body, rng)), config)
        except InvalidValueError:
            continue  # still rolling when the recording ends
        states = states_of(true, 1.0)
        positions = states[:, :3] + tracker.position * rng.standard_normal((len(states), 3))
        turns = quaternions.exp(tracker.turn * rng.standard_normal((len(states), 3)))
        tosses.append(_seen(body, true.source, positions, quaternions.multiply(states[:, 3:7], turns), true.frame_period))
    return tuple(tosses)


def _release(body: Body, rng: np.random.Generator) -> Array:
    """(13,) any orientation and heading, above the board."""
    orientation, heading = quaternions.normalized(rng.standard_normal(4)), rng.uniform(-np.pi, np.pi)
    lowest = float(body.polytope.corner_heights(np.zeros(3), orientation).min())
    speed = RELEASE_SPEED * rng.uniform(0.8, 1.2)
    velocity = [speed * np.cos(heading), speed * np.sin(heading), rng.normal(0.0, 0.15)]
    spin = RELEASE_SPIN * rng.standard_normal(3)
    return np.concatenate([[0.0, 0.0, RELEASE_HEIGHT - lowest], orientation, velocity, spin])


def _slab() -> tuple[Body, tuple[Toss, ...]]:
    return _hull("slab", box([0.06, 0.045, 0.02]).vertices)


def _wedge() -> tuple[Body, tuple[Toss, ...]]:
    outline = np.array([(0.0, 0.0), (0.1, 0.0), (0.0, 0.07)])
    return _hull("wedge", np.array([(x, y, z) for z in (-0.04, 0.04) for x, y in outline]))


def _irregular() -> tuple[Body, tuple[Toss, ...]]:
    """Ten corners on an ellipsoid, all of its hull."""
    directions = np.random.default_rng(7).standard_normal((10, 3))
    return _hull("irregular", 0.05 * np.array([1.2, 1.0, 0.8]) * directions / np.linalg.norm(directions, axis=1)[:, None])


BODIES: dict[str, Callable[[], tuple[Body, tuple[Toss, ...]]]] = {
    "cube": _cube,
    "square": _square,
    "slab": _slab,
    "wedge": _wedge,
    "irregular": _irregular,
}
BOUNCING = ("square",)
"""Bodies whose models have a restitution."""
