"""How well detected corners fit a tag map in a sample of images, and by what settings they would fit better.

The measure is the median over images, of body or board whichever is larger, of the misfit of the best pose, without any bound:
with wrong settings no pose fits, or the best one fits much worse than the right settings let it fit.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from math import inf

import numpy as np
from numpy.typing import NDArray

from contact_curation.geometry.pinhole import Pinhole
from contact_curation.geometry.quaternions import Array
from contact_curation.geometry.tag_rig import TagRig
from contact_curation.geometry.tags import CornerOrder, TagAxes, TagMap, in_our_axes
from contact_curation.motion.tags.pose import DetectedTag, NoTagPose, TagPose, TagPoseConfig, tag_pose

BETTER, MUCH_BETTER = 0.5, 0.1
"""Other settings explain a misfit if they leave less than the first share of it, and either poses are accepted or less than the
second share is left."""

LEAST = 0.05
"""Smaller misfits need no explanation."""

WORTH_A_SEARCH = 1.5
"""Misfit from which on all settings are tried."""

SCALES = (0.75, 0.8, 0.85, 0.9, 0.95, 1.05, 1.1, 1.15, 1.2, 1.25, 1.3)
"""Of edges, tried first."""

STEP_OF_SCALES, FINEST_SCALE = 0.05, 0.004

FEWEST_IMAGES, FEW_IMAGES = 5, 10
"""With tags of body or board, and those that searches look at."""

FEWEST_BAD, MOST_BAD, MOSTLY = 3, 12, 0.8
"""Images that fit badly, and the share of them that fit without a tag that is elsewhere than in the map."""

OFTEN = 0.25
"""Share of the images with a tag that is elsewhere, beside others, that fit badly."""


@dataclass(frozen=True, eq=False)
class TagImage:
    """An image of a sample.

    Attributes:
        detected: all tags in it.
        raw: its camera by K and D; None where that is no camera.
        rectified: its camera by P, likewise.
    """

    detected: tuple[DetectedTag, ...]
    raw: Pinhole | None
    rectified: Pinhole | None


@dataclass(frozen=True)
class Explanation:
    """What makes corners fit.

    Attributes:
        misfit: with it.
        rectified: another value of this setting; None for the one that holds.
        corner_order: likewise.
        other_axes: whether the axes of the map's tags are the other ones.
        frames: whose tags are described wrongly; empty for none.
        scale: that their edges are to be multiplied by.
        tag_id: tag of the frame that is not where the map has it; None for none.
    """

    misfit: float
    rectified: bool | None = None
    corner_order: CornerOrder | None = None
    other_axes: bool = False
    frames: tuple[str, ...] = ()
    scale: float = 1.0
    tag_id: int | None = None


@dataclass(frozen=True)
class TagFit:
    """How the corners of a recording fit.

    Attributes:
        has_board: whether the map has tags of the board.
        misfit: median over images, in expected deviations; inf where most images give no pose at all.
        better: settings with which they fit; None where there are none.
    """

    has_board: bool
    misfit: float
    better: Explanation | None


def tag_fit(images: Sequence[TagImage], rig: TagRig, config: TagPoseConfig, *, rectified: bool) -> TagFit | None:
    """Looks at a sample of images; None where it has too few with known tags."""
    unbounded = replace(config, largest_misfit=inf, flip_ratio=1e-9, largest_turn_deviation=inf, fewest_tags=1)
    maps = (rig.body,) if rig.board is None else (rig.body, rig.board)
    by_map = [_misfits(images, one, unbounded, rectified) for one in maps]
    if max(np.count_nonzero(~np.isnan(one)) for one in by_map) < FEWEST_IMAGES:
        return None
    misfit = _level(by_map)
    few = images[:: max(len(images) // FEW_IMAGES, 1)]
    better = _better(few, maps, unbounded, rectified, misfit, config.largest_misfit)
    for one, found in zip(maps, by_map, strict=True) if better is None else ():
        better = better or _wrong_tag(images, found > config.largest_misfit, one, unbounded, rectified, config.largest_misfit)
    return TagFit(rig.board is not None, misfit, better)


def _better(
    images: Sequence[TagImage], maps: Sequence[TagMap], config: TagPoseConfig, rectified: bool, misfit: float, largest: float
) -> Explanation | None:
    """The settings that fit best, of those that need fewest changes."""
    if misfit <= LEAST:
        return None
    wanted = min(BETTER * misfit, max(largest, MUCH_BETTER * misfit if misfit < inf else 0.0))
    for search in (_conventions, _scales) if misfit > WORTH_A_SEARCH else (_conventions,):
        best = min(search(images, maps, config, rectified), key=lambda one: one.misfit, default=None)
        if best is not None and best.misfit < wanted:
            return best
    return None


def _conventions(
    images: Sequence[TagImage], maps: Sequence[TagMap], config: TagPoseConfig, rectified: bool
) -> Iterator[Explanation]:
    """Raw or rectified images, orders of corners, axes of the map."""
    turned = [
        TagMap(one.frame, tuple(replace(tag, pose=in_our_axes(tag.pose, TagAxes.INTO)) for tag in one.tags)) for one in maps
    ]
    for order in CornerOrder:
        for flat in (True, False):
            for described, axes in ((maps, False), (turned, True)):
                changed = (flat != rectified, order is not config.corner_order, axes)
                if any(changed):
                    ordered = replace(config, corner_order=order)
                    level = _level([_misfits(images, one, ordered, flat) for one in described])
                    yield Explanation(level, flat if changed[0] else None, order if changed[1] else None, axes)


def _scales(
    images: Sequence[TagImage], maps: Sequence[TagMap], config: TagPoseConfig, rectified: bool
) -> Iterator[Explanation]:
    """Edges that are longer or shorter in one of the maps, or in all of them."""
    for scaled in dict.fromkeys([*((one,) for one in maps), tuple(maps)]):
        others = [_misfits(images, one, config, rectified) for one in maps if one not in scaled]

        @cache
        def level(scale: float, scaled: Sequence[TagMap] = scaled, others: Sequence[Array] = others) -> float:
            tags = [TagMap(one.frame, tuple(replace(tag, edge=tag.edge * scale) for tag in one.tags)) for one in scaled]
            return _level([*(_misfits(images, one, config, rectified) for one in tags), *others])

        best, step = min(SCALES, key=level), STEP_OF_SCALES
        while step > FINEST_SCALE:
            step /= 2.0
            best = min((best - step, best, best + step), key=level)
        yield Explanation(level(best), frames=tuple(one.frame for one in scaled), scale=best)


def _wrong_tag(
    images: Sequence[TagImage], misfits: NDArray[np.bool_], tags: TagMap, config: TagPoseConfig, rectified: bool, largest: float
) -> Explanation | None:
    """The single tag without which images that fit badly fit; none where others fit with it: something hides it in part."""
    bad = [image for image, misfit in zip(images, misfits, strict=True) if misfit][:MOST_BAD]
    if len(bad) < FEWEST_BAD or len(tags.tags) < 2:
        return None
    without: list[Explanation] = []
    fitting: list[float] = []
    for wrong in tags.tags:
        rest = TagMap(tags.frame, tuple(tag for tag in tags.tags if tag is not wrong))
        found = _misfits(bad, rest, config, rectified)
        fitting.append(float(np.mean(found <= largest)))  # where no other tag is seen it is NaN
        without.append(Explanation(_level([found]), frames=(tags.frame,), tag_id=wrong.tag_id))
    best = int(np.argmax(fitting))
    known = {tag.tag_id for tag in tags.tags}
    seen = [known.intersection(tag.tag_id for tag in image.detected) for image in images]
    beside = np.array([without[best].tag_id in ids and len(ids) > 1 for ids in seen])
    if np.count_nonzero(misfits & beside) < OFTEN * np.count_nonzero(beside):
        return None
    return without[best] if fitting[best] >= MOSTLY and fitting.count(fitting[best]) == 1 else None


def _level(by_map: Sequence[Array]) -> float:
    """The median over images of the map that fits worst."""
    return max((float(np.median(seen)) for one in by_map if len(seen := one[~np.isnan(one)])), default=inf)


def _misfits(images: Sequence[TagImage], tags: TagMap, config: TagPoseConfig, rectified: bool) -> Array:
    """By image; inf where no pose has all tags facing the camera, NaN where none is seen or there is no camera."""
    found: list[float] = []
    for image in images:
        camera = image.rectified if rectified else image.raw
        pose = NoTagPose("lost", "") if camera is None else tag_pose(image.detected, tags, camera, config)
        found.append(pose.misfit if isinstance(pose, TagPose) else np.nan if pose.kind == "lost" else inf)
    return np.array(found)
