"""Fields of configs: changed together, and the ranges in which their classes accept them."""

import json
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

import numpy as np
import pytest

from contact_curation.cli.options.settings import with_settings
from contact_curation.configs import accepted_range, changed_fields, check_not_negative, check_positive, field_of, with_fields
from contact_curation.contact.loss_config import LossConfig
from contact_curation.errors import InvalidValueError
from contact_curation.motion.calibration import RigCalibration
from contact_curation.solver.cone_problem import Cone
from contact_curation.storage.inputs.pose_source import PoseTopicConfig


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


@dataclass(frozen=True)
class _With:
    share: object


def test_fields_that_are_sound_together_only_are_changed_together() -> None:
    changed = with_fields(Outer(), {"inner.low": 5.0, "inner.high": 6.0, "name": "b"})
    assert (changed.inner.low, changed.inner.high, changed.name) == (5.0, 6.0, "b")
    with pytest.raises(InvalidValueError):
        with_fields(Outer(), {"inner.low": 5.0})


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        (Outer(Inner(free=0.1 + 0.2), "b"), ["of.inner.free=0.30000000000000004", "of.name=b"]),
        (LossConfig(balanced=False, cone=Cone.POLYHEDRAL), ["of.cone=polyhedral", "of.balanced=false"]),
        (PoseTopicConfig(array_index=2), ["of.array_index=2"]),
        (RigCalibration(normal=(0.0, 0.6, 0.8)), ["of.normal=0.0,0.6,0.8"]),
    ],
)
def test_fields_that_are_changed_are_said_as_options_take_them(changed: Any, words: list[str]) -> None:
    default = type(changed)()
    assert list(changed_fields(changed, default, "of.")) == words
    assert list(changed_fields(default, default, "of.")) == []
    assert with_settings({"of": default}, words) == {"of": changed}


@pytest.mark.parametrize(("path", "accepted"), [("share", (0.0, 1.0)), ("count", (1.0, 1e9)), ("free", None)])
def test_the_range_of_a_field_is_what_its_class_accepts(path: str, accepted: tuple[float, float] | None) -> None:
    assert accepted_range(Inner(), field_of(Inner(), path)) == accepted


@pytest.mark.parametrize("value", [-1.0, np.nan, np.inf, "0.5", None, True, [1.0]])
def test_what_is_no_positive_number_is_refused_by_its_name(value: object) -> None:
    for check in (check_positive, check_not_negative):
        with pytest.raises(InvalidValueError, match=r"^loss\.share: found "):
            check(_With(value), ("share",), "loss.")


def test_numbers_of_numpy_are_numbers_and_0_is_not_positive() -> None:
    check_positive(_With(np.float32(0.5)), ("share",))
    check_not_negative(_With(np.int64(0)), ("share",))
    check_positive(_With(np.inf), ("share",), infinite=True)
    for value in (-np.inf, np.nan, "inf"):
        with pytest.raises(InvalidValueError):
            check_positive(_With(value), ("share",), infinite=True)
    with pytest.raises(InvalidValueError, match=r"^share: found 0, expected a positive number of metres$"):
        check_positive(_With(0), ("share",), unit="of metres")


def test_numbers_that_json_cannot_hold_become_floats() -> None:
    for value in (np.float32(0.5), np.int64(2), Fraction(1, 2)):
        for check in (check_positive, check_not_negative):
            config = _With(value)
            check(config, ("share",))
            assert json.dumps(config.share) == json.dumps(float(value))
