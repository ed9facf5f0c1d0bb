"""Searches for release postures: the pad on a face of the body, and joint speeds that give the body the commanded twist.

Position and axis of the pad are five conditions on seven joints, and the face can be chosen, so there are many solutions. A
table of postures gives starting points. (It is symmetric under the first joint, so it covers one angle of that joint only.)
Differential inverse kinematics (mink) moves the best ones to the release pose. Of the joint speeds that give the twist, which
form a line, those are taken whose largest share of a speed limit is smallest.
"""

from collections.abc import Callable
from dataclasses import dataclass

import mink
import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from contact_curation.geometry.quaternions import Array
from contact_curation.simulation.arm.grasps import Grasps
from contact_curation.simulation.arm.kinematics import Postures, about_z
from contact_curation.simulation.arm.limits import JointLimits
from contact_curation.simulation.arm.model import PAD
from contact_curation.simulation.arm.throwing_arm import ThrowingArm

Indices = NDArray[np.int64]

REACHED = 1e-6
"""Largest accepted distance of a posture from the release pose [m, rad]."""


@dataclass(frozen=True)
class SearchConfig:
    """Size of the search for postures.

    Attributes:
        table: number of random postures that are drawn for the table.
        neighbours: number of starting points from the table for each face.
        refined: number of starting points that are moved to the release pose.
        iterations: largest number of iterations of the inverse kinematics.
        place_scale: difference in position that counts as much as a rotation by `turn_scale` [m].
        turn_scale: rotation that counts as much as a difference in position by `place_scale` [rad].
        seed: random seed of the table.
    """

    table: int = 120_000
    neighbours: int = 80
    refined: int = 10
    iterations: int = 12
    place_scale: float = 0.10
    turn_scale: float = 0.35
    seed: int = 0


DEFAULT_SEARCH = SearchConfig()


@dataclass(frozen=True, eq=False)
class Candidate:
    """One way to release a body.

    Attributes:
        joints: (7,) joint angles [rad].
        speeds: (7,) joint speeds [rad/s].
        miss: distance of the pad from its position plus angle from its axis [m + rad].
        speed_use: (J,) used shares of the joints' speed limits.
        range_use: (J,) used shares of the joints' ranges, on the way from rest to release and to rest again.
    """

    joints: Array
    speeds: Array
    miss: float
    speed_use: Array
    range_use: Array

    @property
    def cost(self) -> float:
        """The largest used share of any limit; at most 1 for a feasible candidate."""
        return float(max(self.speed_use.max(), self.range_use.max()))


@dataclass(frozen=True, eq=False)
class Target:
    """Pose and twist of the pad at the release, in the frame of the arm's base, for each of G faces.

    Attributes:
        places: (G, 3) positions of the pad [m].
        axes: (G, 3) unit vectors of the pad's axis, into the body.
        twists: (G, 6) velocities [m/s] and angular velocities [rad/s] of the pad.
    """

    places: Array
    axes: Array
    twists: Array


def pad_targets(release: Array, grasps: Grasps, config: ThrowingArm) -> Target:
    """Computes where the pad must be and how it must move to release a body in state (13,)."""
    turned = Rotation.from_quat(release[3:7], scalar_first=True)
    home = Rotation.from_euler("z", -config.yaw)
    arms, axes = turned.apply(grasps.places), -turned.apply(grasps.normals)
    spin = turned.apply(release[10:])
    velocities = release[7:10] + np.cross(spin, arms)
    twists = np.hstack([home.apply(velocities), np.tile(home.apply(spin), (len(grasps), 1))])
    return Target(home.apply(release[:3] + arms - config.base), home.apply(axes), twists)


class PostureSearch:
    """Finds release postures of an arm. Make it once: computing the table takes a while.

    Args:
        model: the arm with a body in its gripper, see `model.planning_model`.
        config: configuration of the arm.
        way: how far joints move from rest to release speeds (N, J), (N, J) [rad].
        search: size of the search.
    """

    def __init__(
        self, model: mujoco.MjModel, config: ThrowingArm, way: Callable[[Array], Array], search: SearchConfig = DEFAULT_SEARCH
    ) -> None:
        self._arm, self._limits, self._way, self._search, self._margin = config, config.limits, way, search, config.margin
        self._yaw, self._base = config.yaw, np.asarray(config.base)
        self._configuration = mink.Configuration(model)
        self._bounds = [mink.ConfigurationLimit(model)]
        self._table = _table(config, search)
        self._azimuths = np.arctan2(self._table.places[:, 1], self._table.places[:, 0])
        back = about_z(-self._azimuths)
        self._jacobians = np.concatenate([back @ self._table.jacobians[:, :3], back @ self._table.jacobians[:, 3:]], axis=1)
        axes = np.einsum("nij,nj->ni", back, self._table.frames[:, :, 2])
        radii = np.hypot(self._table.places[:, 0], self._table.places[:, 1])
        self._tree = cKDTree(self._features(radii, self._table.places[:, 2], axes))

    def candidates(self, target: Target) -> list[Candidate]:
        """Ways to release, best first: those that reach the release pose, or the nearest if none does."""
        seeds, faces = self._seeds(target)
        refined = np.array([self._refined(seed, target.places[face], target.axes[face]) for seed, face in zip(seeds, faces)])
        exact = self._arm.postures(refined)
        off = np.linalg.norm(exact.places - target.places[faces], axis=1)
        off += np.arccos(np.clip((exact.frames[:, :, 2] * target.axes[faces]).sum(axis=1), -1.0, 1.0))
        speeds = least_speeds(exact.jacobians, target.twists[faces], self._limits)
        use, ranges = self._use(refined, speeds)
        found = [Candidate(refined[k], speeds[k], float(off[k]), use[k], ranges[k]) for k in range(len(refined))]
        reached = [one for one in found if one.miss <= 1e3 * REACHED]
        return sorted(reached, key=lambda one: one.cost) or sorted(found, key=lambda one: one.miss)[:1]

    def _seeds(self, target: Target) -> tuple[Array, Indices]:
        """The most promising postures (R, 7) of the table, and the face that each is for (R,)."""
        azimuths = np.arctan2(target.places[:, 1], target.places[:, 0])
        back = about_z(-azimuths)
        axes = np.einsum("gij,gj->gi", back, target.axes)
        radii = np.hypot(target.places[:, 0], target.places[:, 1])
        distances, rows = self._tree.query(self._features(radii, target.places[:, 2], axes), k=self._search.neighbours)
        faces = np.repeat(np.arange(len(radii)), self._search.neighbours)
        rows, distances = rows.ravel(), distances.ravel()
        joints = self._table.joints[rows].copy()
        joints[:, 0] = _wrapped(azimuths[faces] - self._azimuths[rows])
        twists = np.concatenate([np.einsum("gij,gj->gi", back, target.twists[:, part]) for part in (slice(3), slice(3, 6))], 1)
        speeds = least_speeds(self._jacobians[rows], twists[faces], self._limits)
        use, ranges = self._use(joints, speeds)
        cost = np.maximum(use.max(axis=1), ranges.max(axis=1)) + 0.1 * distances
        best = np.argsort(cost, kind="stable")[: self._search.refined]
        return np.clip(joints[best], self._limits.lowest + 1e-3, self._limits.highest - 1e-3), faces[best]

    def _refined(self, seed: Array, place: Array, axis: Array) -> Array:
        """The posture (7,) near `seed` with the pad at `place` along `axis` (base frame), within the joints' ranges."""
        configuration = self._configuration
        configuration.update(seed)
        turn = Rotation.from_euler("z", self._yaw)
        wanted, there = self._base + turn.apply(place), turn.apply(axis)
        frame = configuration.get_transform_frame_to_world(PAD, "site").rotation().as_matrix()
        task = mink.FrameTask(PAD, "site", position_cost=1.0, orientation_cost=1.0)
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = _swung(frame[:, 2], there) @ frame, wanted
        task.set_target(mink.SE3.from_matrix(pose))
        for _ in range(self._search.iterations):
            step = mink.solve_ik(configuration, [task], 1.0, "daqp", damping=1e-9, limits=self._bounds)
            configuration.integrate_inplace(step, 1.0)
            if np.linalg.norm(task.compute_error(configuration)) < REACHED:
                break
        return np.array(configuration.q)

    def _use(self, joints: Array, speeds: Array) -> tuple[Array, Array]:
        """Used shares of the speed limits and of the ranges, (N, 7) each, for postures (N, 7) passed at speeds (N, 7)."""
        limits = self._limits
        use = limits.speed_use(joints, speeds) / self._margin
        way = np.abs(self._way(speeds))
        middle, half = 0.5 * (limits.highest + limits.lowest), 0.5 * (limits.highest - limits.lowest)
        return use, (np.abs(joints - middle) + way) / half

    def _features(self, radii: Array, heights: Array, axes: Array) -> Array:
        place, turn = self._search.place_scale, self._search.turn_scale
        return np.column_stack([radii / place, heights / place, axes / turn])


def least_speeds(jacobians: Array, twists: Array, limits: JointLimits) -> Array:
    """Joint speeds (N, J) that give twists (N, 6) with the smallest possible largest share of a speed limit.

    With seven joints the solutions form a line: the least-squares one plus any multiple of the motion that keeps the pad still.
    Along it the largest share is a convex function. With six joints there is one solution.
    """
    scaled = jacobians * limits.speed  # (N, 6, J)
    transposed = scaled.transpose(0, 2, 1)
    gram = scaled @ transposed + 1e-9 * np.eye(6)
    probe = np.random.default_rng(0).standard_normal(scaled.shape[2])
    solved = np.linalg.solve(gram, np.stack([twists, scaled @ probe], axis=2))  # (N, 6, 2)
    both = transposed @ solved
    least, idle = both[:, :, 0], probe - both[:, :, 1]
    if scaled.shape[2] <= 6:
        return np.asarray(least * limits.speed)
    idle /= np.maximum(np.linalg.norm(idle, axis=1, keepdims=True), 1e-12)
    low = -np.full(len(least), 2.0) * (1.0 + np.abs(least).max(axis=1))
    high = -low
    for _ in range(40):  # ternary search
        third = (high - low) / 3.0
        left = np.abs(least + (low + third)[:, None] * idle).max(axis=1)
        right = np.abs(least + (high - third)[:, None] * idle).max(axis=1)
        low, high = np.where(left > right, low + third, low), np.where(left > right, high, high - third)
    return np.asarray((least + (0.5 * (low + high))[:, None] * idle) * limits.speed)


def _table(config: ThrowingArm, search: SearchConfig) -> Postures:
    """Draws postures with the pad over the board, with the first joint at 0."""
    rng = np.random.default_rng(search.seed)
    joints = rng.uniform(config.limits.lowest, config.limits.highest, (search.table, len(config.limits.lowest)))
    joints[:, 0] = 0.0
    postures = config.postures(joints)
    heights = postures.places[:, 2] + config.base[2]
    kept = np.flatnonzero((heights > 0.0) & (heights < 0.5))
    return Postures(postures.joints[kept], postures.places[kept], postures.frames[kept], postures.jacobians[kept])


def _swung(axis: Array, wanted: Array) -> Array:
    """The smallest rotation (3, 3) that takes one unit vector to another."""
    normal, angle = np.cross(axis, wanted), np.arccos(np.clip(axis @ wanted, -1.0, 1.0))
    length = np.linalg.norm(normal)
    return np.asarray(Rotation.from_rotvec(normal / max(length, 1e-12) * angle).as_matrix())


def _wrapped(angles: Array) -> Array:
    return np.asarray((angles + np.pi) % (2.0 * np.pi) - np.pi)
