"""Simulated tosses as a detector of tags would tell of them: stamps and tags, corners with little noise."""

from collections.abc import Sequence
from functools import cache
from typing import NamedTuple

import numpy as np

from contact_curation.geometry.poses import Pose
from contact_curation.motion.tags.pose import DetectedTag
from test.simulated import FIRST_STAMP_NS, PAUSE_NS, motion_to_rest, release_states, stamps_ns
from test.tag_scene import scene

CORNER_NOISE = 0.005
"""[px] So little that no toss is rejected for it."""


class TaggedImage(NamedTuple):
    """What was detected in an image.

    Attributes:
        stamp_ns: of the image.
        true: pose of the body on the board.
        tags: found.
    """

    stamp_ns: int
    true: Pose
    tags: list[DetectedTag]


@cache
def tagged_tosses(count: int, seed: int = 0) -> tuple[TaggedImage, ...]:
    """Tosses one after the other, with time without images in between."""
    rng = np.random.default_rng(seed)
    images: list[TaggedImage] = []
    for number, release in enumerate(release_states(count, rng)):
        states = motion_to_rest(release)
        for stamp_ns, state in zip(stamps_ns(len(states), FIRST_STAMP_NS + number * PAUSE_NS).tolist(), states):
            true = Pose(state[:3], state[3:7])
            images.append(TaggedImage(stamp_ns, true, scene(true, CORNER_NOISE, rng)))
    return tuple(images)


def without_tags(images: Sequence[TaggedImage], first: int, last: int) -> list[TaggedImage]:
    """The images, those from `first` to `last` with no tag in them."""
    return [one._replace(tags=[]) if first <= place <= last else one for place, one in enumerate(images)]
