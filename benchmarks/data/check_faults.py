"""Does `check` name what is wrong with a recording? Recordings with one fault each, and sound ones: is its first line right?

Each fault is put into a simulated session (as bags/golden.mcap, without noise of its own beyond the rig's) and, where there are
ContactNets' tosses, into a bag made of some of them. A verdict is right where it holds the words that belong to its fault; a
sound recording must be ok. Time is that of a recording of 100 MB that holds odometry alone, the longest there is to read.

    python -m benchmarks.data.check_faults [--folder FOLDER] [--json] [--only WORD]
"""

import argparse
import json
import re
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from rosbags.typesys import Stores, get_typestore
from scipy.signal import butter, lfilter

from bags.make_golden import BOARD, session
from benchmarks._data import contactnets_folder
from contact_curation.contact.body import CONTACTNETS_CUBE, Body
from contact_curation.geometry import quaternions
from contact_curation.geometry.polytopes import box
from contact_curation.geometry.quaternions import Array
from contact_curation.motion.lead_in import surrounded
from contact_curation.motion.segmenter_config import SegmenterConfig
from contact_curation.motion.toss import NANOSECONDS, Toss
from contact_curation.pipeline.diagnosis import Diagnosis, diagnose
from contact_curation.pipeline.reading import ReadingConfig
from contact_curation.storage.bags.writer import BagWriter
from contact_curation.storage.inputs.inputs import InputsConfig, open_inputs

STORE = get_typestore(Stores.ROS2_JAZZY)
TOPIC = "/tagslam/odom/body_cube"
SIMULATED, REAL = 10, range(40, 64)
"""Tosses of the simulated session, and the numbers of the real ones."""

LARGE_CASE = "large"
"""With `--only`: the time alone."""

LARGE = 100_000_000
"""Bytes."""


@dataclass(frozen=True, eq=False)
class Session:
    """What a tracker gives, and how it is recorded.

    Attributes:
        stamps_ns: (T,) of headers.
        logged_ns: (T,).
        poses: (T, 7) of the body on the board, position and wxyz.
        board: (7,) of the board in the map; None where it is not recorded.
        releases: indices near which bodies are in the air.
        parent, board_frame, body_frame, topic: names.
        type: of the poses' messages.
        published: what becomes of poses (T, 7) in the map before they are sent.
    """

    stamps_ns: NDArray[np.int64]
    logged_ns: NDArray[np.int64]
    poses: Array
    board: Array | None
    releases: tuple[int, ...]
    parent: str = "map"
    board_frame: str = "body_surface"
    body_frame: str = "body_cube"
    topic: str = TOPIC
    published: Callable[[Array], Array] = field(default=lambda poses: poses)

    def moved(self, change: Callable[[Array], Array]) -> "Session":
        """With other positions (T, 3)."""
        return replace(self, poses=np.concatenate([change(self.poses[:, :3]), self.poses[:, 3:]], axis=1))

    def only(self, kept: NDArray[np.bool_]) -> "Session":
        """Some of the frames."""
        return replace(self, stamps_ns=self.stamps_ns[kept], logged_ns=self.logged_ns[kept], poses=self.poses[kept])


def simulated_session(seed: int = 7, tosses: int = SIMULATED) -> Session:
    """A session like the golden one."""
    made = session(seed, tosses)
    board = np.concatenate([BOARD.position, BOARD.orientation_wxyz])
    places = np.searchsorted(made.stamps_ns, [toss.release_stamp_ns for toss in made.tosses])
    return Session(made.stamps_ns, made.stamps_ns + 12_000_000, made.poses, board, tuple(places.tolist()))


def real_session(folder: Path, numbers: Iterable[int] = REAL) -> Session:
    """Some of ContactNets' tosses one after the other, with the frames that `import` puts around them."""
    files = [folder / f"{number}.pt" for number in numbers]
    tosses = [one for one in open_inputs(files, CONTACTNETS_CUBE) if isinstance(one, Toss)]
    stamps: list[NDArray[np.int64]] = []
    poses: list[Array] = []
    releases: list[int] = []
    start = 1_600_000_000 * NANOSECONDS
    for toss in tosses:
        made = surrounded(toss, 16, 4, SegmenterConfig())
        releases.append(sum(len(part) for part in stamps) + 16)
        stamps.append(start + made.stamps_ns)
        poses.append(np.concatenate([made.positions, made.orientations_wxyz], axis=1))
        start = int(stamps[-1][-1]) + NANOSECONDS
    board = np.concatenate([BOARD.position, BOARD.orientation_wxyz])
    together = np.concatenate(stamps)
    return Session(together, together + 5_000_000, np.concatenate(poses), board, tuple(releases))


type Change = Callable[[Session, np.random.Generator], Session]


@dataclass(frozen=True)
class Fault:
    """One fault.

    Attributes:
        name: of it.
        change: puts it into a session.
        verdict: a pattern that the right first line holds.
        ok: whether tosses can be learned from all the same.
        body: that is said to have been thrown.
        bag: what becomes of the bytes of the bag.
        real: whether it is put into real tosses, too.
    """

    name: str
    change: Change
    verdict: str
    ok: bool = False
    body: Body = CONTACTNETS_CUBE
    bag: Callable[[bytes], bytes] = field(default=lambda data: data)
    real: bool = True


def same(made: Session, rng: np.random.Generator) -> Session:
    """No fault."""
    return made


def scaled(factor: float) -> Change:
    """Poses, and the board, in another unit or by a wrong size of tags."""

    def change(made: Session, rng: np.random.Generator) -> Session:
        board = None if made.board is None else np.concatenate([made.board[:3] * factor, made.board[3:]])
        return replace(made.moved(lambda positions: positions * factor), board=board)

    return change


def turned(rotation_vector: ArrayLike) -> Change:
    """A board's frame that is turned against the board."""

    def change(made: Session, rng: np.random.Generator) -> Session:
        turn = quaternions.exp(np.array(rotation_vector, dtype=float))
        return replace(
            made,
            poses=np.concatenate(
                [quaternions.rotate(turn, made.poses[:, :3]), quaternions.multiply(turn, made.poses[:, 3:])], axis=1
            ),
        )

    return change


def raised(by: float) -> Change:
    """A board's frame under or over the board [m]."""
    return lambda made, rng: made.moved(lambda positions: positions + np.array([0.0, 0.0, by]))


def marked(turn: ArrayLike = (0, 0, 0), offset: ArrayLike = (0, 0, 0)) -> Change:
    """A tracked frame that is not the body's."""

    def change(made: Session, rng: np.random.Generator) -> Session:
        positions = made.poses[:, :3] + quaternions.rotate(made.poses[:, 3:], np.array(offset, dtype=float))
        orientations = quaternions.multiply(made.poses[:, 3:], quaternions.exp(np.array(turn, dtype=float)))
        return replace(made, poses=np.concatenate([positions, orientations], axis=1))

    return change


def runs(made: Session) -> list[NDArray[np.int64]]:
    """Indices of frames without gaps between them."""
    steps = np.diff(made.stamps_ns)
    return np.split(np.arange(len(made.poses)), np.flatnonzero(steps > 3 * np.median(steps)) + 1)


def filtered(kernel: Callable[[Array], Array]) -> Change:
    """A filter over the positions of each run."""

    def change(made: Session, rng: np.random.Generator) -> Session:
        return made.moved(lambda positions: np.concatenate([kernel(positions[part]) for part in runs(made)]))

    return change


def mean_of(frames: int) -> Callable[[Array], Array]:
    """A moving mean of the last frames."""
    return lambda p: np.stack(
        [np.convolve(np.pad(column, (frames - 1, 0), mode="edge"), np.ones(frames) / frames, "valid") for column in p.T], axis=1
    )


def low_pass(hertz: float, rate: float = 148.0) -> Callable[[Array], Array]:
    """Butterworth, second order."""
    b, a = butter(2, hertz / (0.5 * rate))
    return lambda p: p[:1] + lfilter(b, a, p - p[:1], axis=0)


def exponential(share: float) -> Callable[[Array], Array]:
    """What a complementary filter does."""
    return lambda p: p[:1] + lfilter([share], [1.0, share - 1.0], p - p[:1], axis=0)


def held(made: Session, rng: np.random.Generator) -> Session:
    """Each second pose sent twice."""
    return replace(made, poses=made.poses[(np.arange(len(made.poses)) // 2) * 2])


def interpolated(made: Session, rng: np.random.Generator) -> Session:
    """Each second pose is the mean of its neighbours."""
    poses = made.poses.copy()
    poses[1:-1:2, :3] = 0.5 * (poses[:-2:2, :3] + poses[2::2, :3])[: len(poses[1:-1:2])]
    return replace(made, poses=poses)


def restamped(change: Callable[[NDArray[np.int64], np.random.Generator], NDArray[np.int64]]) -> Change:
    """Other header stamps."""
    return lambda made, rng: replace(made, stamps_ns=change(made.stamps_ns, rng))


def jittering(seconds: float) -> Change:
    """Stamps that are random by so much, in order all the same."""

    def change(stamps: NDArray[np.int64], rng: np.random.Generator) -> NDArray[np.int64]:
        return np.asarray(np.sort(stamps + np.rint(seconds * NANOSECONDS * rng.standard_normal(len(stamps))).astype(np.int64)))

    return restamped(change)


def with_spikes(made: Session, rng: np.random.Generator) -> Session:
    """A jump of 8 mm of one frame in four, all the time."""

    def change(positions: Array) -> Array:
        hit = rng.random(len(positions)) < 0.05
        return positions + np.where(hit[:, np.newaxis], 0.008 * rng.standard_normal((len(positions), 3)), 0.0)

    return made.moved(change)


def with_gaps(made: Session, rng: np.random.Generator) -> Session:
    """Six frames are lost in every toss."""
    kept = np.ones(len(made.poses), dtype=bool)
    for release in made.releases:
        kept[release + 30 : release + 36] = False
    return made.only(kept)


def dropped(share: float) -> Change:
    """Frames are lost at random."""
    return lambda made, rng: made.only(rng.random(len(made.poses)) >= share)


def closed_up(after: int) -> Change:
    """One frame of each throw is lost, `after` its release, and the stamps of the others are written anew, one period apart."""

    def change(made: Session, rng: np.random.Generator) -> Session:
        left = made.only(~np.isin(np.arange(len(made.poses)), np.array(made.releases) + after))
        frames = len(left.poses)
        return replace(left, stamps_ns=made.stamps_ns[:frames], logged_ns=made.logged_ns[:frames])

    return change


def every(step: int) -> Change:
    """A slower tracker."""
    return lambda made, rng: made.only(np.arange(len(made.poses)) % step == 0)


def noisier(multiple: float) -> Change:
    """More of the rig's noise."""
    return lambda made, rng: made.moved(lambda p: p + multiple * 2.2e-5 * rng.standard_normal(p.shape))


def carried(made: Session, rng: np.random.Generator) -> Session:
    """Nothing is let go: everything moves as a hand would, within 0.8 s."""
    return made.moved(
        lambda p: np.stack([np.convolve(np.pad(c, (60, 60), mode="edge"), np.ones(121) / 121, "valid") for c in p.T], axis=1)
    )


def still(made: Session, rng: np.random.Generator) -> Session:
    """It lies there."""
    noise = 2.2e-5 * rng.standard_normal((len(made.poses), 3))
    return replace(made, poses=np.tile(made.poses[0], (len(made.poses), 1))).moved(lambda p: p + noise)


def caught(made: Session, rng: np.random.Generator) -> Session:
    """The tracker loses sight before the body rests."""
    kept = np.zeros(len(made.poses), dtype=bool)
    for release in made.releases:
        kept[max(release - 16, 0) : release + 45] = True
    return made.only(kept)


def inverted(poses: Array) -> Array:
    """The map in the body's frame."""
    back = quaternions.conjugate(poses[:, 3:])
    return np.concatenate([-quaternions.rotate(back, poses[:, :3]), back], axis=1)


def spoilt(share: float, value: float) -> Change:
    """Numbers that are none in a share of the messages."""

    def change(made: Session, rng: np.random.Generator) -> Session:
        hit = rng.random(len(made.poses)) < share

        def published(poses: Array) -> Array:
            poses = poses.copy()
            poses[hit] *= value
            return poses

        return replace(made, published=published)

    return change


def published(how: Callable[[Array], Array]) -> Change:
    """Poses in the map that are sent in another form."""
    return lambda made, rng: replace(made, published=how)


def named(**names: Any) -> Change:
    """Other names."""
    return lambda made, rng: replace(made, **names)


def body_of(scale: float) -> Body:
    """The cube, described larger or smaller; its mass properties do not matter here."""
    return replace(CONTACTNETS_CUBE, vertices=scale * CONTACTNETS_CUBE.vertices)


WEDGE = replace(
    CONTACTNETS_CUBE,
    vertices=0.05 * np.array([[-1, -1, -0.6], [1, -1, -0.6], [-1, 1, -0.6], [1, 1, -0.6], [-1, -1, 1.2], [1, -1, 1.2]], float),
)
SLAB = replace(CONTACTNETS_CUBE, vertices=box([0.06, 0.04, 0.02]).vertices)

FAULTS = (
    Fault("sound", same, "^ok", ok=True),
    Fault("metadata of another clock", lambda made, rng: replace(made, logged_ns=made.logged_ns + 10**17), "^ok", ok=True),
    Fault("cut short", same, "^ok", ok=True, bag=lambda data: data[: int(0.9 * len(data))]),
    Fault("millimetres", scaled(1000.0), "millimetres"),
    Fault("inches", scaled(39.3701), "inches"),
    Fault("centimetres", scaled(100.0), "centimetres"),
    Fault("z down", turned([np.pi, 0.0, 0.0]), "z-down"),
    Fault("y up", turned([-0.5 * np.pi, 0.0, 0.0]), "fall along"),
    Fault("a camera's frame", turned([0.6, 0.3, 0.0]), "degrees away from -z"),
    Fault("stamps 0", restamped(lambda stamps, rng: np.zeros_like(stamps)), "stamps .* are 0"),
    Fault("stamps in pairs", restamped(lambda stamps, rng: stamps[(np.arange(len(stamps)) // 2) * 2]), "stand still"),
    Fault("stamps go back", restamped(lambda stamps, rng: stamps - 20_000_000 * (np.arange(len(stamps)) % 5 == 0)), "go back"),
    Fault("jitter 0.5 ms", jittering(5e-4), "jitter", ok=True),
    Fault("jitter 2 ms", jittering(2e-3), "jitter", ok=True),
    Fault("30 Hz", every(5), "Hz, expected 60 Hz"),
    Fault("frames dropped", dropped(0.15), "frames are missing"),
    Fault("gaps in tosses", with_gaps, "gap|missing"),
    Fault("poses repeated", held, "repeat the one before"),
    Fault("poses interpolated", interpolated, "interpolated"),
    Fault("mean of 5", filtered(mean_of(5)), "smoothed"),
    Fault("mean of 9", filtered(mean_of(9)), "smoothed"),
    Fault("low pass 20 Hz", filtered(low_pass(20.0)), "smoothed"),
    Fault("low pass 10 Hz", filtered(low_pass(10.0)), "smoothed"),
    Fault("exponential filter", filtered(exponential(0.3)), "smoothed"),
    Fault("rounded", published(lambda poses: np.concatenate([np.round(poses[:, :3], 3), poses[:, 3:]], axis=1)), "rounded"),
    Fault("noise x 8", noisier(8.0), "scatter", ok=True),
    Fault("outliers", with_spikes, "outliers|jump|rejected"),
    Fault("wxyz", published(lambda poses: poses[:, [0, 1, 2, 6, 3, 4, 5]]), "wxyz"),
    Fault("inverse rotations", published(lambda p: np.concatenate([p[:, :3], quaternions.conjugate(p[:, 3:])], 1)), "inverse"),
    Fault("inverted poses", published(inverted), "inverted"),
    Fault("nothing moves", still, "never moved"),
    Fault("only carried", carried, "never let go", real=False),
    Fault("caught", caught, "come to rest|rests"),
    Fault("no transform", named(board=None), "taken as given on it"),
    Fault("another board", named(board_frame="table"), "frames there: .*table"),
    Fault("no frame_id", named(parent=""), "frame_id"),
    Fault("not numbers", spoilt(0.7, np.nan), "unusable"),
    Fault("no unit quaternions", spoilt(1.0, 2.0), "unusable.*norm"),
    Fault("another body's topic", named(topic="/tagslam/odom/body_wedge"), "named after cube"),
    Fault("tilted 2 degrees", turned(np.radians([2.0, 0.5, 0.0])), "tilted"),
    Fault("tilted 1.5 degrees", turned(np.radians([0.0, 1.5, 0.0])), "tilted"),
    Fault("10 mm high", raised(0.010), "mm over the board"),
    Fault("10 mm low", raised(-0.010), "mm under the board"),
    Fault("5 mm low", raised(-0.005), "mm under the board"),
    Fault("60 mm low", raised(-0.060), "mm under the board"),
    Fault("lengths 5 % short", scaled(0.95), "too short"),
    Fault("lengths 6 % long", scaled(1.06), "too long"),
    Fault("described 12 % small", same, "larger than", body=body_of(1.0 / 1.12)),
    Fault("described 12 % large", same, "smaller than", body=body_of(1.12)),
    Fault("described in mm", same, "vertices in mm", body=body_of(1000.0)),
    Fault("described as a wedge", same, "off every face", body=WEDGE),
    Fault("marker aside", marked(offset=(0.006, 0.004, 0.0)), "tracked frame"),
    Fault("marker askew", marked(turn=np.radians([2.0, 1.0, 0.0])), "tracked frame"),
    Fault("empty", same, "cannot be read.*empty", bag=lambda data: b"", real=False),
    Fault("garbage", same, "cannot be read", bag=lambda data: b"garbage" * 1000, real=False),
)
"""Each with the words of the right first line."""


def write(path: Path, made: Session) -> None:
    """A session as a bag."""
    types = STORE.types

    def header(stamp: int, frame: str) -> Any:
        stamped = types["builtin_interfaces/msg/Time"](*divmod(stamp, NANOSECONDS))
        return types["std_msgs/msg/Header"](stamped, frame)

    def quaternion(w: float, x: float, y: float, z: float) -> Any:
        return types["geometry_msgs/msg/Quaternion"](x, y, z, w)

    zero = types["geometry_msgs/msg/Vector3"](0.0, 0.0, 0.0)
    twist = types["geometry_msgs/msg/TwistWithCovariance"](types["geometry_msgs/msg/Twist"](zero, zero), np.zeros(36))
    poses = made.published(in_map(made))
    with BagWriter(path, STORE) as bag:
        if made.board is not None:
            vector = types["geometry_msgs/msg/Vector3"](*made.board[:3].tolist())
            transform = types["geometry_msgs/msg/Transform"](vector, quaternion(*made.board[3:].tolist()))
            stamped = types["geometry_msgs/msg/TransformStamped"](header(0, "map"), made.board_frame, transform)
            bag.write("/tf_static", types["tf2_msgs/msg/TFMessage"]([stamped]), int(made.logged_ns[0]), latched=True)
        for stamp, logged, row in zip(made.stamps_ns.tolist(), made.logged_ns.tolist(), poses.tolist(), strict=True):
            pose = types["geometry_msgs/msg/Pose"](types["geometry_msgs/msg/Point"](*row[:3]), quaternion(*row[3:]))
            with_covariance = types["geometry_msgs/msg/PoseWithCovariance"](pose, np.zeros(36))
            message = types["nav_msgs/msg/Odometry"](header(stamp, made.parent), made.body_frame, with_covariance, twist)
            bag.write(made.topic, message, logged)


def in_map(made: Session) -> Array:
    """Poses (T, 7) in the parent's frame; on the board where none is recorded."""
    if made.board is None:
        return made.poses
    place, turn = made.board[:3], made.board[3:]
    return np.concatenate(
        [place + quaternions.rotate(turn, made.poses[:, :3]), quaternions.multiply(turn, made.poses[:, 3:])], axis=1
    )


def spoilt_bag(path: Path, fault: Fault, made: Session, seed: int = 5) -> Path:
    """A recording with a fault."""
    write(path, fault.change(made, np.random.default_rng(seed)))
    path.write_bytes(fault.bag(path.read_bytes()))
    return path


def diagnosed(path: Path, fault: Fault) -> Diagnosis:
    """What check says of it."""
    return diagnose([path], ReadingConfig(fault.body, InputsConfig()))


def is_right(fault: Fault, found: Diagnosis) -> bool:
    """Whether the first line names the fault, or a sound recording is ok."""
    return found.ok == fault.ok and re.search(fault.verdict, found.verdict) is not None


def cases(folder: Path, only: str = "") -> Iterator[tuple[str, Fault, Diagnosis]]:
    """Every fault in every session."""
    sessions = {"simulated": simulated_session()}
    real = contactnets_folder()
    if real is not None:
        sessions["real"] = real_session(real)
    for source, made in sessions.items():
        for number, fault in enumerate(FAULTS):
            if (source == "simulated" or fault.real) and only in f"{source} {fault.name}":
                path = spoilt_bag(folder / f"{source}_{number}.mcap", fault, made)
                yield source, fault, diagnosed(path, fault)


def seconds_for_large(folder: Path) -> tuple[float, float]:
    """Size [MB] and processor time [s] of a recording of `LARGE` bytes, one session again and again."""
    made = simulated_session()
    path = folder / "large.mcap"
    write(path, made)
    times = LARGE // path.stat().st_size + 1
    length = int(made.stamps_ns[-1] - made.stamps_ns[0]) + NANOSECONDS
    again = [made.stamps_ns + k * length for k in range(times)]
    write(
        path,
        replace(
            made,
            stamps_ns=np.concatenate(again),
            logged_ns=np.concatenate(again),
            poses=np.tile(made.poses, (times, 1))
            + 1e-9 * np.random.default_rng(0).standard_normal((times * len(made.poses), 7)),
        ),
    )
    begun = time.process_time()
    diagnosed(path, FAULTS[0])
    return path.stat().st_size / 1e6, time.process_time() - begun


def main(argv: Sequence[str] | None = None) -> int:
    """Runs the command."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--folder", type=Path, help="keep the recordings there")
    parser.add_argument("--only", default="", help="cases whose names hold this")
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args(argv)
    with tempfile.TemporaryDirectory() as made:
        folder = arguments.folder or Path(made)
        rows = []
        for source, fault, found in cases(folder, arguments.only):
            right = is_right(fault, found)
            rows.append({"source": source, "fault": fault.name, "right": right, "ok": found.ok, "verdict": found.verdict})
            if not arguments.json:
                print(f"{'right' if right else 'WRONG'}  {source:9}  {fault.name:22}  {found.verdict}", flush=True)
        large = seconds_for_large(folder) if arguments.only in ("", LARGE_CASE) else None
    named = sum(bool(row["right"]) for row in rows)
    if arguments.json:
        print(json.dumps({"rows": rows, "right": named, "of": len(rows), "large": large}))
    else:
        print(f"{named} of {len(rows)} right ({100.0 * named / max(len(rows), 1):.0f} %)")
        if large:
            print(f"a recording of {large[0]:.0f} MB of odometry takes {large[1]:.1f} s of processor time")
    return 0


if __name__ == "__main__":
    sys.exit(main())
