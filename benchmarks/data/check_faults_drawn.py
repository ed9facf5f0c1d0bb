"""Does `check` name what is wrong with recordings that it was never tuned on? One fault each, drawn by a seed.

`check_faults` has fixed cases, by which `check` was made. Here the body, the throws, the rate, the noise, and the kind and size
of the fault are drawn: some bodies of `thrown_bodies` in MuJoCo at 75 to 250 Hz with 1 to 1.5 times the rig's noise (more is a
fault), and where they are at hand ContactNets' tosses other than those of `check_faults`. A verdict is right as there.

    python -m benchmarks.data.check_faults_drawn [--seed N] [--cases N] [--only WORD] [--json]
"""

import argparse
import json
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bags.make_golden import BOARD
from benchmarks._data import contactnets_folder
from benchmarks.data import check_faults as fixed
from benchmarks.data.check_faults import Fault, Session
from benchmarks.data.gate_false_alarms import noisy
from benchmarks.data.thrown_bodies import FINE_PERIOD, HELD, SWUNG, ThrownBody, bodies, release, thrown
from contact_curation.contact.body import CONTACTNETS_CUBE, Body
from contact_curation.geometry.quaternions import Array
from contact_curation.motion.toss import NANOSECONDS

CASES, SIMULATED_BODIES, THROWS = 64, 4, 10
RATES, NOISES = (75, 100, 120, 150, 200, 250), (1.0, 1.5)
"""Frames a second, and least and most noise in multiples of that of ContactNets' rig."""

REAL = [number for number in range(570) if number not in fixed.REAL]
"""ContactNets' tosses that no fixed case is made of."""

REAL_THROWS, REAL_RATE, REAL_SHARE = 20, 148, 0.3


@dataclass(frozen=True, eq=False)
class Source:
    """What recordings are made of.

    Attributes:
        name: for the table.
        body: that was thrown.
        motions: (T, 7) poses of each throw, every `FINE_PERIOD`; none where `files` are.
        files: of ContactNets' tosses.
        others: bodies it may be taken for.
    """

    name: str
    body: Body
    motions: tuple[Array, ...]
    files: Path | None
    others: tuple[Body, ...]

    def session(self, rng: np.random.Generator) -> tuple[Session, int]:
        """A recording without a fault, and its rate."""
        if self.files is not None:
            numbers = sorted(int(number) for number in rng.choice(REAL, REAL_THROWS, replace=False))
            return fixed.real_session(self.files, numbers), REAL_RATE
        rate, noise = int(rng.choice(RATES)), float(rng.uniform(*NOISES))
        stamps: list[NDArray[np.int64]] = []
        poses: list[Array] = []
        releases: list[int] = []
        start, frames = 1_700_000_000 * NANOSECONDS, 0
        for motion in self.motions:
            seen = noisy(motion[:: round(1.0 / (rate * FINE_PERIOD))], noise, rng)
            releases.append(frames + round((HELD + SWUNG) * rate))
            stamps.append(start + np.rint(np.arange(len(seen)) * (NANOSECONDS / rate)).astype(np.int64))
            poses.append(seen)
            frames, start = frames + len(seen), int(stamps[-1][-1]) + NANOSECONDS
        board, together = np.concatenate([BOARD.position, BOARD.orientation_wxyz]), np.concatenate(stamps)
        frame, topic = f"body_{self.body.name}", f"/tagslam/odom/body_{self.body.name}"
        made = Session(together, together + 8_000_000, np.concatenate(poses), board, tuple(releases))
        return replace(made, body_frame=frame, topic=topic), rate


@dataclass(frozen=True, eq=False)
class Drawing:
    """What a kind of fault is drawn with.

    Attributes:
        rng: for its size.
        body: that is thrown.
        others: bodies that it may be taken for.
        rate: frames a second.
    """

    rng: np.random.Generator
    body: Body
    others: tuple[Body, ...]
    rate: int

    def size(self, least: float, most: float) -> float:
        """Between two."""
        return float(self.rng.uniform(least, most))

    def signed(self, least: float, most: float) -> float:
        """Likewise, up or down."""
        return float(self.rng.choice([-1.0, 1.0])) * self.size(least, most)

    def across(self, angle: float) -> Array:
        """(3,) a turn by so many degrees about a horizontal axis [rad]."""
        heading = self.size(0.0, 2.0 * np.pi)
        return np.asarray(np.radians(angle) * np.array([np.cos(heading), np.sin(heading), 0.0]))

    def along(self, length: float) -> Array:
        """(3,) any vector of a length."""
        vector = self.rng.standard_normal(3)
        return np.asarray(length * vector / np.linalg.norm(vector))


type Kind = Callable[[Drawing], Fault]


def of_unit(d: Drawing) -> Fault:
    """Poses in another unit."""
    name, factor = [("millimetres", 1000.0), ("centimetres", 100.0), ("inches", 39.3701), ("feet", 3.28084)][d.rng.integers(4)]
    return Fault(name, fixed.scaled(factor), name)


def off_axis(d: Drawing) -> Fault:
    """A frame that is turned by a right angle, or by any."""
    angle = float(d.rng.choice([0.0, 90.0]))
    if angle:
        turn = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])[d.rng.integers(2)] * d.rng.choice([-1.0, 1.0])
        return Fault("z across", fixed.turned(0.5 * np.pi * turn), "fall along")
    angle = d.size(25.0, 60.0)
    return Fault(f"{angle:.0f} degrees off", fixed.turned(d.across(angle)), "degrees away from -z")


def z_down(d: Drawing) -> Fault:
    """Half a turn about any horizontal axis."""
    return Fault("z down", fixed.turned(d.across(180.0)), "z-down")


def stamps_back(d: Drawing) -> Fault:
    """Every few stamps too early."""
    every, back = int(d.rng.integers(4, 10)), round(1e9 * d.size(0.012, 0.05))
    change = fixed.restamped(lambda stamps, rng: stamps - back * (np.arange(len(stamps)) % every == 0))
    return Fault(f"stamps go back {back / 1e6:.0f} ms", change, "go back")


def jittering(d: Drawing) -> Fault:
    """Stamps that scatter."""
    spread = d.size(4e-4, 3e-3)
    return Fault(f"jitter {1e3 * spread:.1f} ms", fixed.jittering(spread), "jitter", ok=True)


def slow(d: Drawing) -> Fault:
    """So few frames that less than 50 a second are left."""
    step = int(np.ceil(d.rate / d.size(22.0, 48.0)))
    return Fault(f"{d.rate / step:.0f} Hz", fixed.every(step), "Hz, expected 60 Hz")


def dropped(d: Drawing) -> Fault:
    """Frames lost at random."""
    share = d.size(0.1, 0.25)
    return Fault(f"{100 * share:.0f} % dropped", fixed.dropped(share), "frames are missing")


def held(d: Drawing) -> Fault:
    """Poses sent again."""
    times = int(d.rng.integers(2, 4))

    def change(made: Session, rng: np.random.Generator) -> Session:
        return replace(made, poses=made.poses[(np.arange(len(made.poses)) // times) * times])

    return Fault(f"each sent {times} times", change, "repeat the one before")


def mean(d: Drawing) -> Fault:
    """A moving mean over 25 to 70 ms."""
    frames = max(4, round(d.rate * d.size(0.025, 0.07)))
    return Fault(f"mean of {frames} at {d.rate} Hz", fixed.filtered(fixed.mean_of(frames)), "smoothed")


def low_pass(d: Drawing) -> Fault:
    """Butterworth."""
    hertz = d.size(8.0, 20.0)
    return Fault(f"low pass {hertz:.0f} Hz", fixed.filtered(fixed.low_pass(hertz, float(d.rate))), "smoothed")


def exponential(d: Drawing) -> Fault:
    """With a time constant of 12 to 40 ms."""
    share = 1.0 - float(np.exp(-1.0 / (d.rate * d.size(0.012, 0.04))))
    return Fault(f"exponential {share:.2f} at {d.rate} Hz", fixed.filtered(fixed.exponential(share)), "smoothed")


def rounded(d: Drawing) -> Fault:
    """To 0.5 to 5 mm."""
    grid = float(d.rng.choice([5e-4, 1e-3, 5e-3]))

    def published(poses: Array) -> Array:
        return np.concatenate([grid * np.rint(poses[:, :3] / grid), poses[:, 3:]], axis=1)

    return Fault(f"rounded to {1e3 * grid:g} mm", fixed.published(published), "rounded")


def noise(d: Drawing) -> Fault:
    """Six to 14 times the rig's, and what there is."""
    multiple = d.size(6.0, 14.0)
    return Fault(f"noise x {multiple:.0f}", fixed.noisier(multiple), "scatter")


def outliers(d: Drawing) -> Fault:
    """Of 5 to 20 mm, in 3 to 8 % of the frames."""
    share, length = d.size(0.03, 0.08), d.size(0.005, 0.02)

    def change(made: Session, rng: np.random.Generator) -> Session:
        hit = rng.random(len(made.poses)) < share
        return made.moved(lambda p: p + np.where(hit[:, np.newaxis], length * rng.standard_normal((len(p), 3)), 0.0))

    return Fault(f"outliers {1e3 * length:.0f} mm", change, "outliers|jump|rejected")


def xyzw_backwards(d: Drawing) -> Fault:
    """Numbers of a quaternion the wrong way round."""
    return Fault(
        "zyxw", fixed.published(lambda poses: poses[:, [0, 1, 2, 4, 5, 6, 3]]), "flat with another order|off every face"
    )


def tilted(d: Drawing) -> Fault:
    """By 1.2 to 4 degrees."""
    angle = d.size(1.2, 4.0)
    return Fault(f"tilted {angle:.1f} degrees", fixed.turned(d.across(angle)), "tilted")


def raised(d: Drawing) -> Fault:
    """By 4 to 30 mm."""
    by = d.signed(0.004, 0.03)
    where = "over" if by > 0.0 else "under"
    return Fault(f"{1e3 * by:.0f} mm high", fixed.raised(by), f"mm {where} the board")


def longer(d: Drawing) -> Fault:
    """Lengths 4 to 10 % off."""
    by = d.signed(0.04, 0.10)
    return Fault(f"lengths {100 * by:+.0f} %", fixed.scaled(1.0 + by), "too long" if by > 0.0 else "too short")


def misdescribed(d: Drawing) -> Fault:
    """8 to 15 % too large or too small."""
    by = d.signed(0.08, 0.15)
    body = replace(d.body, vertices=(1.0 + by) * d.body.vertices)
    return Fault(f"described {100 * by:+.0f} %", fixed.same, "smaller than" if by > 0.0 else "larger than", body=body)


def in_mm(d: Drawing) -> Fault:
    """A description in millimetres."""
    return Fault("described in mm", fixed.same, "vertices in mm", body=replace(d.body, vertices=1000.0 * d.body.vertices))


def another(d: Drawing) -> Fault:
    """The description of another body, under this one's name."""
    other = d.others[d.rng.integers(len(d.others))]
    body = replace(other, name=d.body.name)
    return Fault(
        f"described as {other.name}", fixed.same, "off every face|from face to face|larger than|smaller than", body=body
    )


def aside(d: Drawing) -> Fault:
    """A marker 4 to 10 mm off."""
    length = d.size(0.004, 0.010)
    return Fault(f"marker {1e3 * length:.0f} mm aside", fixed.marked(offset=d.along(length)), "tracked frame")


def askew(d: Drawing) -> Fault:
    """A marker turned by 1.5 to 4 degrees."""
    angle = d.size(1.5, 4.0)
    return Fault(f"marker {angle:.1f} degrees askew", fixed.marked(turn=d.along(np.radians(angle))), "tracked frame")


def as_fixed(name: str) -> Kind:
    """One without a size."""
    found = next(fault for fault in fixed.FAULTS if fault.name == name)
    return lambda d: found


KINDS: tuple[Kind, ...] = (
    *map(as_fixed, ("sound", "metadata of another clock", "cut short", "stamps 0", "stamps in pairs", "gaps in tosses")),
    *map(as_fixed, ("poses interpolated", "wxyz", "inverse rotations", "inverted poses", "nothing moves", "caught")),
    *map(as_fixed, ("no transform", "another board", "no frame_id", "not numbers", "no unit quaternions", "garbage")),
    *(of_unit, off_axis, z_down, stamps_back, jittering, slow, dropped, held, mean, low_pass, exponential, rounded, noise),
    *(outliers, xyzw_backwards, tilted, raised, longer, misdescribed, in_mm, another, aside, askew),
)
"""What is drawn from; all of them before any twice."""


def sources(rng: np.random.Generator) -> list[Source]:
    """Some simulated bodies, and the real cube."""
    all_of_them = bodies()
    found = []
    for place in sorted(rng.choice(len(all_of_them), SIMULATED_BODIES, replace=False).tolist()):
        others = tuple(one.body for one in all_of_them if one is not all_of_them[place])
        motions = _motions(all_of_them[place], rng)
        found.append(Source(all_of_them[place].body.name, all_of_them[place].body, motions, None, others))
    folder = contactnets_folder()
    if folder is not None:
        others = tuple(one.body for one in all_of_them[1:])
        found.append(Source("real", CONTACTNETS_CUBE, (), folder, others))
    return found


def _motions(thrower: ThrownBody, rng: np.random.Generator) -> tuple[Array, ...]:
    motions: list[Array] = []
    while len(motions) < THROWS:
        flown = thrown(thrower, release(thrower.body, rng))
        motions += [] if flown is None else [flown]
    return tuple(motions)


def cases(folder: Path, seed: int, count: int, only: str = "") -> Iterator[dict[str, object]]:
    """A row for each recording."""
    rng = np.random.default_rng(seed)
    made_of = sources(rng)
    order = np.concatenate([rng.permutation(len(KINDS)) for _ in range(count // len(KINDS) + 1)])[:count]
    for number, kind in enumerate(order.tolist()):
        mine = np.random.default_rng([seed, number])
        real = len(made_of) > SIMULATED_BODIES and mine.random() < REAL_SHARE
        source = made_of[-1] if real else made_of[mine.integers(SIMULATED_BODIES)]
        made, rate = source.session(mine)
        fault = KINDS[kind](Drawing(mine, source.body, source.others, rate))
        if fault.body is CONTACTNETS_CUBE:
            fault = replace(fault, body=source.body)
        if only not in f"{source.name} {fault.name}":
            continue
        path = fixed.spoilt_bag(folder / f"{number}.mcap", fault, made, seed=number)
        found = fixed.diagnosed(path, fault)
        row = {"source": source.name, "rate": rate, "fault": fault.name, "right": fixed.is_right(fault, found)}
        yield row | {"ok": found.ok, "verdict": found.verdict}


def main(argv: Sequence[str] | None = None) -> int:
    """Runs the command."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=0, help="of everything (default 0)")
    parser.add_argument("--cases", type=int, default=CASES, help=f"how many recordings (default {CASES})")
    parser.add_argument("--folder", type=Path, help="keep the recordings there")
    parser.add_argument("--only", default="", help="cases whose names hold this")
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args(argv)
    rows = []
    with tempfile.TemporaryDirectory() as made:
        for row in cases(arguments.folder or Path(made), arguments.seed, arguments.cases, arguments.only):
            rows.append(row)
            if not arguments.json:
                mark = "right" if row["right"] else "WRONG"
                print(f"{mark}  {row['source']:15}  {row['fault']:26}  {row['verdict']}", flush=True)
    right = sum(bool(row["right"]) for row in rows)
    if arguments.json:
        print(json.dumps({"seed": arguments.seed, "rows": rows, "right": right, "of": len(rows)}))
    else:
        print(f"{right} of {len(rows)} right ({100.0 * right / max(len(rows), 1):.0f} %), seed {arguments.seed}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
