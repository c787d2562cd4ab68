"""RVL streams, against a hand-computed one and an encoder that works group by group."""

import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from semgp.errors import InputError
from semgp.logs.rvl import unpacked
from tests.log_encoders import rvl

runs = st.lists(
    st.one_of(
        st.integers(1, 70).map(lambda n: [0] * n),
        st.lists(st.integers(1, 65535), min_size=1, max_size=20),
        st.lists(st.integers(900, 1100), min_size=1, max_size=200),
    ),
    min_size=1,
    max_size=12,
)


def test_a_stream_by_hand() -> None:
    """Two zeros, two others: +5 is 10 = 001 010, so groups a 1; -1 is 1. 42 = 101 010 is a 5."""
    assert unpacked(struct.pack("<I", 0x22A11000), 4).tolist() == [0, 0, 5, 4]
    assert unpacked(struct.pack("<I", 0x01A50000), 1).tolist() == [21]
    assert unpacked(struct.pack("<I", 0xA5000000), 42).tolist() == [0] * 42


@given(runs)
def test_round_trip(parts: list[list[int]]) -> None:
    pixels = [pixel for part in parts for pixel in part]
    found = unpacked(rvl(pixels), len(pixels))
    assert found.dtype == np.uint16
    assert found.tolist() == pixels


@given(runs, st.data())
def test_streams_that_are_cut_off(parts: list[list[int]], data: st.DataObject) -> None:
    pixels = [pixel for part in parts for pixel in part]
    whole = rvl(pixels)
    cut = whole[: data.draw(st.integers(0, len(whole) - 1))]
    with pytest.raises(InputError, match="RVL stream is damaged or truncated"):
        unpacked(cut, len(pixels))
    with pytest.raises(InputError, match="RVL stream is damaged or truncated"):
        unpacked(whole, len(pixels) + 1)
    if len(pixels) > 1 and (pixels[-1] == 0) == (pixels[-2] == 0):
        with pytest.raises(InputError, match="RVL stream is damaged or truncated"):
            unpacked(whole, len(pixels) - 1)


@given(st.binary(max_size=200), st.integers(1, 300))
def test_any_bytes_at_all(data: bytes, n: int) -> None:
    try:
        found = unpacked(data, n)
    except InputError:
        return
    assert len(found) == n
