"""How often `check` says of thrown bodies that they do not move as rigid ones in the air: of rigid and of other ones.

Bodies of random sizes are thrown in MuJoCo onto its board and tracked at 148 Hz. Rigid ones are boxes with a lump off their
middle, which a moving average of 5 frames follows as well, and boxes of foam in the air. The others have a second link of 10 %
to all of the first one's mass at a hinge or a ball joint with a weak spring, or a load of 4 to 40 % on springs of 3 to 10 Hz,
which hangs in the hand. Then come the real tosses. Ratios are those of the departure to its scatter.

    python -m benchmarks.data.moving_parts [--bodies 40] [--throws 20] [--real]

The cube's and the square's tosses (`--real`) are found through CONTACTNETS_DATA and SQUARE_DATA.
"""

import argparse
import sys
from collections.abc import Sequence

import mujoco
import numpy as np

from contact_curation.contact.body import Body
from contact_curation.experiments.bodies import bench_of
from contact_curation.geometry import quaternions
from contact_curation.geometry.polytopes import box
from contact_curation.geometry.quaternions import Array
from contact_curation.motion.pose_noise import RIG_NOISE
from contact_curation.motion.survey.rigidity import departure
from contact_curation.motion.survey.series import PoseSeries, series_of
from contact_curation.pipeline.diagnosis.evidence import Evidence
from contact_curation.pipeline.diagnosis.findings.body import moving_parts
from contact_curation.pipeline.diagnosis.recording import Recording
from contact_curation.pipeline.reading import ReadingConfig

RATE, STEPS, FRAMES = 148, 14, 100
NOISES = ((2.2e-5, 4e-4), (1e-4, 1e-3), (2e-4, 2e-3))
"""Of positions [m] and orientations [rad] per axis: those of ContactNets' rig, and more."""

AIR = 'density="1.2" viscosity="1.8e-5"'
WORLD = """<mujoco><option timestep="{step}" integrator="implicitfast" cone="elliptic" {air}/>
<default><geom friction="0.2" solref="0.004 1"/></default><worldbody><geom type="plane" size="9 9 1"/>
<body pos="0 0 1"><freejoint/><geom type="box" size="{sizes}" mass="{mass}" fluidshape="ellipsoid"/>{more}</body>
</worldbody></mujoco>"""
LUMP = '<geom type="sphere" size="0.004" pos="{place}" mass="{mass}" contype="0" conaffinity="0"/>'
LINK = """<body pos="{x} 0 0"><joint type="{kind}" axis="0 1 0" stiffness="{stiff}" damping="{damp}"/>
<geom type="box" size="{sizes}" pos="{x} 0 0" mass="{mass}" contype="0" conaffinity="0"/></body>"""
LOAD = """<body>{joints}<geom type="sphere" size="0.005" mass="{mass}" contype="0" conaffinity="0"/></body>"""
SLIDE = '<joint type="slide" axis="{axis}" stiffness="{stiff}" damping="{damp}"/>'


def xml(kind: str, rng: np.random.Generator) -> tuple[str, Body]:
    """A world with a random body of a kind, and its description: the box."""
    half = rng.uniform(0.015, 0.06, 3)
    density = rng.uniform(20.0, 80.0) if kind == "foam" else rng.uniform(300.0, 2000.0)
    mass = 8.0 * float(np.prod(half)) * density
    part, more = mass * rng.uniform(0.1, 1.0), ""
    words = {"x": half[0], "sizes": _text(0.8 * half), "mass": part, "damp": 1e-3 * part * half[0]}
    if kind == "lump":
        more = LUMP.format(place=_text(rng.uniform(-0.7, 0.7, 3) * half), mass=0.4 * part)
    elif kind in ("hinge", "ball"):
        more = LINK.format(kind=kind, stiff=rng.uniform(0.0, 2.0) * part * half[0], **words)
    elif kind == "load":
        part, rate = 0.4 * part, 2.0 * np.pi * rng.uniform(3.0, 10.0)
        spring = {"stiff": part * rate**2, "damp": 0.1 * part * rate}
        more = LOAD.format(joints="".join(SLIDE.format(axis=axis, **spring) for axis in ("1 0 0", "0 1 0", "0 0 1")), mass=part)
    inertia = mass / 3.0 * np.diag(np.square(half).sum() - np.square(half))
    body = Body(kind, box(half).vertices, mass, inertia, 0.2, float(np.cbrt(np.prod(half))))
    air = AIR if kind == "foam" else ""
    return WORLD.format(step=1.0 / (RATE * STEPS), air=air, sizes=_text(half), mass=mass, more=more), body


def thrown(model: mujoco.MjModel, rng: np.random.Generator) -> Array:
    """(T, 7) poses from release on, every frame."""
    data = mujoco.MjData(model)
    data.qpos[:7] = [0.0, 0.0, rng.uniform(0.25, 0.45), *quaternions.normalized(rng.standard_normal(4))]
    data.qvel[:6] = [*rng.uniform(-1.2, 1.2, 2), rng.uniform(-0.3, 0.8), *(5.0 * rng.standard_normal(3))]
    down = -9.81 * quaternions.to_matrix(data.qpos[3:7])[2]  # in the body's frame
    for joint in range(1, model.njnt):
        place = model.jnt_qposadr[joint]
        if model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_SLIDE:
            weight = model.body_mass[model.jnt_bodyid[joint]] * down @ model.jnt_axis[joint]
            data.qpos[place] = weight / float(np.ravel(model.jnt_stiffness[joint])[0])
        elif model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_BALL:
            data.qpos[place : place + 4] = quaternions.exp(0.3 * rng.standard_normal(3))
        else:
            data.qpos[place] = rng.uniform(-1.0, 1.0)
    poses = []
    for _ in range(FRAMES):
        poses.append(data.qpos[:7].copy())
        mujoco.mj_step(model, data, nstep=STEPS)
    return np.array(poses)


def tracked(motions: Sequence[Array], noise: tuple[float, float], rng: np.random.Generator) -> tuple[PoseSeries, ...]:
    """As a tracker with white noise sees them."""
    found = []
    for number, poses in enumerate(motions):
        stamps = np.rint((np.arange(len(poses)) / RATE + 10.0 * number) * 1e9).astype(np.int64)
        turned = quaternions.multiply(poses[:, 3:], quaternions.exp(noise[1] * rng.standard_normal((len(poses), 3))))
        found.append(PoseSeries(stamps, poses[:, :3] + noise[0] * rng.standard_normal((len(poses), 3)), turned))
    return tuple(found)


def averaged(series: Sequence[PoseSeries], frames: int = 5) -> tuple[PoseSeries, ...]:
    """As a moving average of poses gives them."""

    def mean(values: Array) -> Array:
        return np.stack([np.convolve(column, np.ones(frames) / frames, "valid") for column in values.T], axis=1)

    found = []
    for one in series:
        near = np.where(np.sum(np.diff(one.orientations_wxyz, axis=0) * one.orientations_wxyz[:-1], axis=1) < -0.5, -1.0, 1.0)
        turns = mean(one.orientations_wxyz * np.cumprod([1.0, *near])[:, np.newaxis])
        found.append(PoseSeries(one.stamps_ns[frames - 1 :], mean(one.positions), quaternions.normalized(turns)))
    return tuple(found)


def ratio(evidence: Evidence) -> float:
    """Of the departure to its scatter; NaN of too few flights."""
    found = departure(evidence.survey, RIG_NOISE)
    return np.nan if found is None else found.times


def evidence_of(series: tuple[PoseSeries, ...], body: Body) -> Evidence:
    """What `check` looks at."""
    return Evidence(ReadingConfig(body), (Recording("made", series=series),))


def main() -> int:
    """Prints a line for each kind and noise."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--bodies", type=int, default=40)
    parser.add_argument("--throws", type=int, default=20)
    parser.add_argument("--real", action="store_true")
    arguments = parser.parse_args()
    for kind in ("lump", "foam", "hinge", "ball", "load"):
        said, ratios, behind = dict.fromkeys(NOISES, 0), [], []
        for number in range(arguments.bodies):
            rng = np.random.default_rng([number, 31])
            world, body = xml(kind, rng)
            model = mujoco.MjModel.from_xml_string(world)
            motions = [thrown(model, rng) for _ in range(arguments.throws)]
            seen = {noise: tracked(motions, noise, rng) for noise in NOISES}
            for noise, series in seen.items():
                said[noise] += moving_parts(evidence_of(series, body)) is not None
            ratios.append(ratio(evidence_of(seen[NOISES[0]], body)))
            behind += [ratio(evidence_of(averaged(series), body)) for series in seen.values() if kind == "lump"]
        shown = ", ".join(f"{count} with {1e3 * noise[0]:g} mm" for noise, count in said.items())
        print(
            f"{kind}: said of {shown}, of {arguments.bodies} bodies each; ratios with the least noise {_span(ratios)}",
            flush=True,
        )
        if behind:
            print(f"{kind}: behind a moving average ratios {_span(behind)}", flush=True)
    for name in ("cube", "square") if arguments.real else ():
        bench = bench_of(name, 0)
        series = tuple(series_of(toss) for toss in (*bench.training, *bench.held_out))
        size = arguments.throws
        parts = [evidence_of(series[first : first + size], bench.body) for first in range(0, len(series), size)]
        told = sum(moving_parts(one) is not None for one in parts)
        print(f"{name}: said of {told} of {len(parts)} sets; ratios {_span([ratio(one) for one in parts])}", flush=True)
    return 0


def _span(ratios: Sequence[float]) -> str:
    return f"{np.nanmin(ratios):.1f} to {np.nanmax(ratios):.1f}"


def _text(values: Array) -> str:
    return " ".join(f"{value:.6g}" for value in values)


if __name__ == "__main__":
    sys.exit(main())
