"""A toss is checked when it is made, and known by its digest."""

import copy
import pickle
import re
from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest
import torch

from contact_curation.errors import InvalidValueError
from contact_curation.geometry import quaternions
from contact_curation.motion.toss import Rejected, Toss, toss_identity


def made(**changed: Any) -> Toss:
    parts: dict[str, Any] = {
        "toss_id": "7",
        "body": "cube",
        "source": "/odom",
        "frame_period": 1.0 / 148.0,
        "stamps_ns": np.arange(5) * 6_756_757,
        "positions": np.ones((5, 3)),
        "orientations_wxyz": np.tile(quaternions.IDENTITY, (5, 1)),
        "linear_velocities": np.zeros((5, 3)),
        "angular_velocities": np.zeros((5, 3)),
    }
    return Toss(**(parts | changed))


def test_the_identity_depends_on_body_source_and_first_stamp_and_on_nothing_else() -> None:
    assert toss_identity("cube", "/odom", 5) == toss_identity("cube", "/odom", 5)
    others = {toss_identity("cube", "/odom", 5), toss_identity("cube", "/odom", 6), toss_identity("cube", "/pose", 5)}
    assert len(others | {toss_identity("brick", "/odom", 5)}) == 4


def test_first_poses_are_part_of_the_identity_only_where_stamps_are_no_wall_time() -> None:
    here, there = (0.1, 0.2, -1.0), (0.1, 0.2000011, -1.0)
    assert toss_identity("cube", "/odom", 5, here) != toss_identity("cube", "/odom", 5, there)
    assert toss_identity("cube", "/odom", 5, here) == toss_identity("cube", "/odom", 5, (0.1, 0.2 + 1e-9, 1.0))
    assert toss_identity("cube", "/odom", 10**18, here) == toss_identity("cube", "/odom", 10**18)


@pytest.mark.parametrize(
    ("changed", "why"),
    [
        ({"stamps_ns": np.array([0, 1, 1, 2, 3])}, "strictly increasing"),
        ({"stamps_ns": np.array([0])}, r"\(T,\) with T >= 2"),
        ({"stamps_ns": None}, "toss stamps: found None, expected whole numbers"),
        ({"stamps_ns": [0, 1, 2, 3, 2**63]}, "expected whole numbers of nanoseconds below"),
        ({"stamps_ns": np.arange(5) + 0.5}, "expected whole numbers of nanoseconds"),
        *(
            ({"stamps_ns": stamps}, "toss stamps: found .*, expected whole numbers of nanoseconds")
            for stamps in ([False, True], np.arange(5).astype("timedelta64[ns]"), np.arange(5).astype(complex))
        ),
        ({"stamps_ns": 2.0**53 + 2.0 * np.arange(5)}, r"found floats from 2\^53 on, which are rounded, expected integers"),
        *(({"toss_id": name}, "toss_id: found .*, expected a text of one line") for name in (None, "", "a\nb", 7)),
        ({"source": None}, "source: found None, expected a text$"),
        ({"body": None}, "body: found None, expected a text of one line"),
        ({"frame_period": 0.0}, "frame_period: found 0.0"),
        ({"frame_period": "soon"}, "frame_period: found soon, expected numbers"),
        ({"frame_period": np.ones(2)}, "frame_period: found .*, expected one number"),
        ({"positions": [[1.0], [1.0, 2.0]]}, "toss positions: found .*, expected numbers"),
        *(
            ({"positions": np.ones((5, 3)).astype(kind)}, f"toss positions: found {re.escape(kind)} .*, expected numbers")
            for kind in ("bool", "complex128", "datetime64[s]", "timedelta64[ns]")
        ),
        ({"positions": np.array([[True] * 3] * 5, object)}, "toss positions: found .*, expected numbers"),
        ({"positions": np.ma.masked_less(np.eye(5)[:, :3], 0.5)}, r"toss positions: found masked .*, expected numbers"),
        ({"positions": [[np.ma.masked] * 3] * 5}, "toss positions: found .*, expected numbers"),
        ({"positions": torch.ones(5, 3, requires_grad=True)}, r"found a tensor that NumPy cannot read, .* tensor\.detach"),
        ({"positions": np.full((5, 3), np.nan)}, "toss positions: found a value that is not finite"),
        ({"angular_velocities": np.zeros((4, 3))}, r"found shape \(4, 3\), expected \(5, 3\)"),
        ({"orientations_wxyz": np.full((5, 4), 0.51)}, "quaternion norm"),
    ],
)
def test_what_is_no_toss_is_refused_with_what_was_found(changed: dict[str, Any], why: str) -> None:
    with pytest.raises(InvalidValueError, match=why):
        made(**changed)


def test_a_toss_keeps_copies_that_cannot_be_written_to() -> None:
    given = {"stamps_ns": np.arange(5) * 6_756_757, "positions": np.ones((5, 3))}
    toss = made(**given)
    for name, array in given.items():
        array[:] = 7
        assert not (getattr(toss, name) == 7).any()
        with pytest.raises(ValueError, match="read-only"):
            getattr(toss, name)[0] = 7


def test_a_toss_that_was_pickled_or_copied_cannot_be_written_to_either() -> None:
    toss = made()
    for again in (pickle.loads(pickle.dumps(toss)), copy.deepcopy(toss), copy.copy(toss)):
        assert again.digest() == toss.digest()
        with pytest.raises(ValueError, match="read-only"):
            again.positions[0] = 7


def test_texts_of_numpy_are_texts_like_others() -> None:
    toss = made(**{name: np.str_(getattr(made(), name)) for name in ("toss_id", "body", "source")})
    assert (toss.digest(), type(toss.toss_id)) == (made().digest(), str)


def test_a_toss_is_shown_in_one_line() -> None:
    assert repr(made()) == "<toss 7 of cube: 5 frames in 0.03 s>"
    assert repr(Rejected(made(), ("gap: found 1 s",))) == "<rejected toss 7 of cube: 5 frames in 0.03 s; gap: found 1 s>"


def test_every_field_is_in_the_digest() -> None:
    toss = made()
    assert made().digest() == toss.digest()
    other: dict[str, Any] = {"toss_id": "8", "body": "b", "source": "s", "frame_period": 0.1, "stamps_ns": toss.stamps_ns + 1}
    for field in fields(Toss):
        value = getattr(toss, field.name)
        if field.name not in other:
            other[field.name] = value + 5e-4 * np.eye(*value.shape)
        changed = replace(toss, **{field.name: other[field.name]})
        assert changed.digest() != toss.digest(), field.name


def test_a_rejected_toss_has_a_reason() -> None:
    with pytest.raises(InvalidValueError, match="reasons to reject toss 7: found none"):
        Rejected(made(), ())
