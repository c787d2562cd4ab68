"""Tile files as archives: bombs, pickles and random bytes are refused, and take little memory."""

import io
import os
import struct
import tracemalloc
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from semgp.errors import InputError
from semgp.store import MapStore
from semgp.store.tile_files import decode
from tests.store.hostile import Plain, assert_refused, first_tile, packed, unpacked, zipped
from tests.store.scenes import (
    replace_tile,
)


def test_nothing_is_unpickled(store: MapStore) -> None:
    key, path = first_tile(store)
    arrays = unpacked(path.read_bytes()) | {"extra": np.array([os.getcwd, None], dtype=object)}
    assert "Python objects" in str(assert_refused(store, replace_tile(store, key, packed(arrays))))


def claims() -> bytes:
    """A tile whose array claims to be of 2^53 bytes."""
    header = io.BytesIO()
    np.lib.format.write_array_header_1_0(header, {"descr": "<i8", "fortran_order": False, "shape": (1 << 50,)})
    return zipped({"voxels": header.getvalue()})


def wide() -> bytes:
    """Sites without a class, so that little would become S x 65535 masses."""
    n = 6 << 20
    none: Plain = {"class": np.zeros(0, np.uint16), "mass": np.zeros(0, np.uint32)}
    return packed({"voxels": np.ones(n, np.int64), "n_classes": np.zeros(n, np.uint16), **none})


def many_classes() -> bytes:
    """Sites that are well, but of 65535 classes."""
    n = 1 << 18
    sites: Plain = {"voxels": np.ones(n, np.int64), "place": np.zeros((n, 3), np.int64)}
    masses = {"n_classes": np.ones(n, np.uint16), "class": np.zeros(n, np.uint16), "mass": np.ones(n, np.uint32)}
    return packed(sites | masses)


def lying() -> bytes:
    """An archive whose directory says that its member has 100 bytes."""
    data = bytearray(packed({"voxels": np.zeros(1 << 24, np.int64)}))
    at = data.rindex(b"PK\x01\x02")
    data[at + 24 : at + 28] = struct.pack("<I", 100)
    return bytes(data)


BOMBS: dict[str, Callable[[], bytes]] = {
    "zeros": lambda: packed({"voxels": np.zeros(1 << 24, np.int64)}),
    "claims": claims,
    "wide": wide,
    "many classes": many_classes,
    "lying": lying,
    "many": lambda: zipped({str(i): b"" for i in range(5000)}),
}


@pytest.mark.parametrize("name", BOMBS)
def test_bombs_do_not_go_off(name: str) -> None:
    data = BOMBS[name]()
    tracemalloc.start()
    try:
        with pytest.raises(InputError):
            decode(data, {"": 65535})
        assert tracemalloc.get_traced_memory()[1] < 1 << 28
    finally:
        tracemalloc.stop()


@given(data=st.data())
@settings(deadline=None, max_examples=200)
def test_whatever_a_signed_tile_holds_it_is_read_or_refused(whole: Path, data: st.DataObject) -> None:
    raw = bytearray(first_tile(MapStore(whole))[1].read_bytes())
    kind = data.draw(st.sampled_from(["bytes", "cut", "array"]))
    if kind == "bytes":
        for _ in range(data.draw(st.integers(1, 8))):
            raw[data.draw(st.integers(0, len(raw) - 1))] = data.draw(st.integers(0, 255))
    elif kind == "cut":
        a, b = sorted(data.draw(st.tuples(*[st.integers(0, len(raw))] * 2)))
        del raw[a:b]
    else:
        arrays = unpacked(bytes(raw))
        name = data.draw(st.sampled_from(sorted(arrays)))
        dtype = data.draw(
            st.sampled_from(["<i8", "<u2", "<u4", "<f8", ">i8", "<U3", "?", "S2", "<c16", "M8[s]", "V4"])
        )
        shape = data.draw(st.sampled_from([(), (0,), (1,), (40,), (40, 3), (3, 0), arrays[name].shape]))
        size = int(np.prod(shape)) * np.dtype(dtype).itemsize
        arrays[name] = np.frombuffer(data.draw(st.binary(min_size=size, max_size=size)), dtype).reshape(shape)
        raw = bytearray(packed(arrays))
    try:
        decode(bytes(raw), {"": 3, "free.": 2})
    except InputError:
        return
