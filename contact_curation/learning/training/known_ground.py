"""What a protocol takes as known of the ground: that it lies near the zero of the board's frame.

A body that is larger by some length over a ground that lies lower by as much rests at the same height; only edges and corners
tell the two apart, and the noise of a tracker is enough to hide it. So the protocol holds the height, where a model learns one,
near zero by w h^2, like a measurement of the board would. It is no part of the likelihood and enters no score (METHOD A4).
"""

from torch import Tensor

from contact_curation.contact.models.model import Model


def height_parameters(model: Model) -> tuple[Tensor, ...]:
    """The ground's heights that a model learns, in characteristic lengths; none where it learns none."""
    return tuple(value for name, value in model.named_parameters() if name.rsplit(".", 1)[-1] == "height")


def ground_excess(heights: tuple[Tensor, ...]) -> Tensor:
    """The sum () of their squares; of the only one, where there is one, with no further operation."""
    return sum((height.square() for height in heights[1:]), start=heights[0].square())
