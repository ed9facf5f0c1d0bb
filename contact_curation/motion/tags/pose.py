"""The pose of a body, or of the board, in a camera from all its tags in one image; or the reason why there is none.

A pose is given only when its corners fit, when no other pose fits nearly as well (a flat tag that is seen from the front may
be tilted one way or the other), and when it is known well enough. Nothing is remembered from image to image, so that what
comes out hangs on the image alone; jumps from one to the next are the tracker's to judge (`motion.body_tracker`).
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from contact_curation.configs import check_positive
from contact_curation.errors import InvalidValueError
from contact_curation.geometry import quaternions
from contact_curation.geometry.pinhole import Pinhole
from contact_curation.geometry.poses import Pose
from contact_curation.geometry.quaternions import Array
from contact_curation.geometry.tags import CornerOrder, TagMap, in_our_order
from contact_curation.motion.tags.pnp import CornerNoise, Minima, SeenTag, area, minima, undistorted

PRIOR_WEIGHT = 8.0
"""The expected corner noise counts as so many residuals: of a single tag there are but two more than unknowns."""


FARTHEST = 2.0
"""Corners are within so many sizes of the image."""

SMALLEST = 16.0
"""[px^2] No detector reads a smaller tag."""


class DetectedTag(NamedTuple):
    """A tag as a detector gives it.

    Attributes:
        tag_id: of the family 36h11.
        corners: (4, 2) [px] in the detector's order.
        hamming: corrected bits.
    """

    tag_id: int
    corners: Array
    hamming: int = 0


@dataclass(frozen=True)
class TagPoseConfig:
    """What a pose must fulfil.

    Attributes:
        corner_order: order in which the detector lists corners.
        fewest_tags: smallest number of tags of a frame in one image.
        largest_hamming: tags with more corrected bits are ignored.
        noise: noise of the corners.
        largest_misfit: largest root mean square of the residuals, in standard deviations of the corners; with three tags or
            more the worst one is removed until the others fit.
        flip_angle: two solutions that differ by less than this count as one [rad].
        flip_ratio: a pose is ambiguous if the misfit of another solution, at least 1, is less than this multiple of the best
            one's.
        largest_turn_deviation: largest standard deviation of the orientation about its least certain axis [rad].
    """

    corner_order: CornerOrder = CornerOrder.APRILTAG
    fewest_tags: int = 1
    largest_hamming: int = 1
    noise: CornerNoise = field(default_factory=CornerNoise)
    largest_misfit: float = 4.0
    flip_angle: float = 0.03
    flip_ratio: float = 3.0
    largest_turn_deviation: float = 0.03

    def __post_init__(self) -> None:
        if self.fewest_tags < 1 or self.largest_hamming < 0:
            raise InvalidValueError("fewest_tags, largest_hamming", (self.fewest_tags, self.largest_hamming), "1, 0 or more")
        check_positive(self, ("largest_misfit", "flip_angle", "flip_ratio", "largest_turn_deviation"), infinite=True)


@dataclass(frozen=True, eq=False)
class TagPose:
    """Where a thing is.

    Attributes:
        pose: in the camera's frame, or on the board [m].
        covariance: (6, 6) of position [m] and turn [rad], both about the axes of the frame that the pose is given in.
        tag_ids: that it comes from.
        misfit: root mean square of the residuals, in expected deviations.
    """

    pose: Pose
    covariance: Array
    tag_ids: tuple[int, ...]
    misfit: float


@dataclass(frozen=True)
class NoTagPose:
    """Why there is no pose.

    Attributes:
        kind: "lost", "misfit", "flip" or "unsure".
        why: one line.
    """

    kind: str
    why: str


def tag_pose(detected: Sequence[DetectedTag], tags: TagMap, camera: Pinhole, config: TagPoseConfig) -> TagPose | NoTagPose:
    """The pose in the camera of what carries `tags`.

    Args:
        detected: all tags of an image; those of other things are left out, and those that are there twice.
        tags: what carries which tags where.
        camera: that took it.
        config: what is asked of a pose.
    """
    seen = _seen(detected, tags, camera, config)
    if len(seen) < config.fewest_tags:
        return NoTagPose("lost", f"tags of {tags.frame}: found {len(seen)}, expected {config.fewest_tags} or more")
    found = minima(seen, camera, config.noise)
    while found is not None and found.misfits[0] > config.largest_misfit and len(seen) > max(config.fewest_tags, 2):
        seen = _without_worst(seen, found)
        found = minima(seen, camera, config.noise)
    if found is None:
        return NoTagPose("misfit", f"tags of {tags.frame}: found no pose with all of them facing the camera, expected one")
    return _judged(found, tuple(one.tag.tag_id for one in seen), tags.frame, config)


def on_board(body: TagPose, board: TagPose) -> TagPose:
    """The body on the board, from both in one image.

    With the board's rotation R, the difference d of the positions, and turns from the left, the position on the board R^T d
    changes by R^T (dp_body - dp_board - dtheta_board x d), and the turn by R^T (dtheta_body - dtheta_board).
    """
    pose = board.pose.inverse().compose(body.pose)
    back = quaternions.to_matrix(board.pose.orientation_wxyz).T
    x, y, z = body.pose.position - board.pose.position
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    by_body = np.kron(np.eye(2), back)
    by_board = -by_body
    by_board[:3, 3:] = back @ cross
    covariance = by_body @ body.covariance @ by_body.T + by_board @ board.covariance @ by_board.T
    return TagPose(pose, covariance, body.tag_ids + board.tag_ids, max(body.misfit, board.misfit))


def _seen(detected: Sequence[DetectedTag], tags: TagMap, camera: Pinhole, config: TagPoseConfig) -> tuple[SeenTag, ...]:
    known, times = set(tags.ids), Counter(one.tag_id for one in detected)
    good = [
        one
        for one in sorted(detected, key=lambda one: one.tag_id)
        if one.tag_id in known and times[one.tag_id] == 1 and one.hamming <= config.largest_hamming and _in_sight(one, camera)
    ]
    pixels = [undistorted(in_our_order(one.corners, config.corner_order), camera) for one in good]
    return tuple(SeenTag(tags.tag(one.tag_id), at) for one, at in zip(good, pixels) if np.isfinite(at).all())


def _in_sight(one: DetectedTag, camera: Pinhole) -> bool:
    """Whether the corners are four, in the image or not far outside of it, and not all in one place."""
    if one.corners.shape != (4, 2) or not np.isfinite(one.corners).all():
        return False
    return bool(np.abs(one.corners).max() < FARTHEST * max(camera.width, camera.height) and area(one.corners) > SMALLEST)


def _without_worst(seen: tuple[SeenTag, ...], found: Minima) -> tuple[SeenTag, ...]:
    """All but the tag that fits worst: one that is half hidden is read rightly, but has its corners elsewhere."""
    errors = ((found.residuals[0] / found.deviations[0][:, None]) ** 2).reshape(len(seen), -1).sum(axis=1)
    worst = int(np.argmax(errors))
    return tuple(one for place, one in enumerate(seen) if place != worst)


def _judged(found: Minima, tag_ids: tuple[int, ...], frame: str, config: TagPoseConfig) -> TagPose | NoTagPose:
    """The best minimum, if it passes."""
    misfit = float(found.misfits[0])
    if misfit > config.largest_misfit:
        return NoTagPose("misfit", f"corners of {frame}: found {misfit:.1f} deviations, expected {config.largest_misfit:g}")
    ratio = _second_misfit(found, config.flip_angle) / max(misfit, 1.0)
    if ratio < config.flip_ratio:
        return NoTagPose("flip", f"second pose of {frame}: found {ratio:.2f} times the misfit, expected {config.flip_ratio:g}")
    residuals = found.residuals[0].size
    scale = (residuals * misfit**2 + PRIOR_WEIGHT) / (residuals - 6 + PRIOR_WEIGHT)
    covariance = scale * np.linalg.inv(found.informations[0])
    turn = float(np.sqrt(np.linalg.eigvalsh(covariance[3:, 3:])[-1]))
    if turn > config.largest_turn_deviation:
        limit = config.largest_turn_deviation
        return NoTagPose("unsure", f"turn of {frame}: found a deviation of {turn:.3f} rad, expected {limit:g} at most")
    return TagPose(Pose(found.positions[0], found.orientations_wxyz[0]), covariance, tag_ids, misfit)


def _second_misfit(found: Minima, angle: float) -> float:
    """The least misfit of a pose that is turned from the best one by more than `angle`; inf where there is none.

    A first guess counts as it is: where two minima are about to merge, refinement leads both guesses down one flat valley.
    """
    orientations = np.concatenate([found.orientations_wxyz, found.guessed_wxyz])
    misfits = np.concatenate([found.misfits, found.guessed_misfits])
    others = quaternions.angle_between(found.orientations_wxyz[0], orientations) > angle
    return float(misfits[others].min(initial=np.inf))
