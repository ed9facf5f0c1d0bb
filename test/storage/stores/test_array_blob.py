"""Arrays go through blobs bit for bit, and broken blobs are refused."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays_of

from contact_curation.errors import InvalidValueError
from contact_curation.storage.stores.record_table import arrays_from_blob, arrays_to_blob

KINDS: list[np.dtype[Any]] = [np.dtype(name) for name in ("f8", "i8", "f4")]
SHAPES = arrays_of.array_shapes(min_dims=1, max_dims=3, min_side=0, max_side=4)


@given(st.lists(arrays_of.arrays(st.sampled_from(KINDS), SHAPES), max_size=3))
def test_arrays_come_back_bit_for_bit(values: list[np.ndarray]) -> None:
    named = {f"a{index}": value for index, value in enumerate(values)}
    back = arrays_from_blob(arrays_to_blob(named))
    assert list(back) == list(named)
    for name, value in named.items():
        assert (back[name].shape, back[name].dtype) == (value.shape, value.dtype)
        assert back[name].tobytes() == value.tobytes()


def test_big_endian_arrays_come_back_with_the_same_values() -> None:
    back = arrays_from_blob(arrays_to_blob({"a": np.array([1.5, -2.0], dtype=">f8")}))
    np.testing.assert_array_equal(back["a"], [1.5, -2.0])


def test_other_dtypes_are_refused() -> None:
    with pytest.raises(InvalidValueError, match="float16"):
        arrays_to_blob({"a": np.zeros(2, dtype=np.float16)})
    with pytest.raises(InvalidValueError, match="object"):
        arrays_to_blob({"a": np.array([{}])})


@pytest.mark.parametrize("damage", [lambda blob: blob[:-1], lambda blob: blob + b"x", lambda blob: b"", lambda blob: blob[:5]])
def test_broken_blobs_are_refused(damage: "object") -> None:
    blob = arrays_to_blob({"a": np.arange(3.0)})
    with pytest.raises(InvalidValueError, match="array blob"):
        arrays_from_blob(damage(blob))  # type: ignore[operator]


def test_a_blob_that_declares_a_huge_array_is_refused_without_making_it() -> None:
    blob = arrays_to_blob({"a": np.arange(3.0)})
    with pytest.raises(InvalidValueError, match="array blob"):
        arrays_from_blob(blob.replace(b"[3]", b"[9]"))
    with pytest.raises(InvalidValueError, match="array blob"):
        arrays_from_blob(blob.replace(b'"<f8"', b'"|O8"'))
