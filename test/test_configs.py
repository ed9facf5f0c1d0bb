"""Fields of configs: changed together, and the ranges in which their classes accept them."""

from dataclasses import dataclass, field

import pytest

from contact_curation.configs import accepted_range, field_of, with_fields
from contact_curation.errors import InvalidValueError


@dataclass(frozen=True)
class Inner:
    """Two numbers.

    Attributes:
        low: the smaller.
        high: the larger.
        share: of a whole.
        free: any.
    """

    low: float = 1.0
    high: float = 2.0
    share: float = 0.2
    free: float = 0.0
    count: int = 4

    def __post_init__(self) -> None:
        if not self.low < self.high:
            raise InvalidValueError("low", self.low, f"less than {self.high}")
        if not 0.0 < self.share < 1.0:
            raise InvalidValueError("share", self.share, "a number between 0 and 1")
        if self.count < 1:
            raise InvalidValueError("count", self.count, "at least 1")


@dataclass(frozen=True)
class Outer:
    """Holds one.

    Attributes:
        inner: it.
        name: a word.
    """

    inner: Inner = field(default_factory=Inner)
    name: str = "a"


def test_fields_that_are_sound_together_only_are_changed_together() -> None:
    changed = with_fields(Outer(), {"inner.low": 5.0, "inner.high": 6.0, "name": "b"})
    assert (changed.inner.low, changed.inner.high, changed.name) == (5.0, 6.0, "b")
    with pytest.raises(InvalidValueError):
        with_fields(Outer(), {"inner.low": 5.0})


@pytest.mark.parametrize(("path", "accepted"), [("share", (0.0, 1.0)), ("count", (1.0, 1e9)), ("free", None)])
def test_the_range_of_a_field_is_what_its_class_accepts(path: str, accepted: tuple[float, float] | None) -> None:
    assert accepted_range(Inner(), field_of(Inner(), path)) == accepted
