"""PointCloud2: every layout of fields, read against struct, and layouts that lie."""

import struct
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from semgp.errors import InputError
from semgp.logs.pointcloud2 import columns_of, content_of, packed

LETTERS = {1: "b", 2: "B", 3: "h", 4: "H", 5: "i", 6: "I", 7: "f", 8: "d"}
"""Letters of the module struct for the types of PointField."""


def field(name: str, offset: int, datatype: int, count: int = 1) -> Any:
    return SimpleNamespace(name=name, offset=offset, datatype=datatype, count=count)


def cloud(fields: list[Any], data: bytes, width: int, step: int, **more: Any) -> Any:
    given = {"height": 1, "row_step": width * step, "is_bigendian": False} | more
    data_array = np.frombuffer(data, np.uint8)
    return SimpleNamespace(fields=fields, data=data_array, width=width, point_step=step, **given)


def xyz(width: int = 2, **more: Any) -> Any:
    fields = [field(name, 4 * axis, 7) for axis, name in enumerate("xyz")]
    return cloud(fields, np.arange(3 * width, dtype="<f4").tobytes(), width, 12, **more)


@st.composite
def layouts(draw: st.DrawFn) -> tuple[Any, dict[str, list[Any]]]:
    """Return a message with any order of fields, gaps and row padding, and what struct packed into it."""
    kinds = draw(st.lists(st.sampled_from(sorted(LETTERS)), min_size=1, max_size=5))
    big, height, width = draw(st.booleans()), draw(st.integers(1, 3)), draw(st.integers(1, 4))
    order = ">" if big else "<"
    fields, offset = [], draw(st.integers(0, 3))
    for k, kind in enumerate(kinds):
        fields.append(field(f"f{k}", offset, kind))
        offset += struct.calcsize(LETTERS[kind]) + draw(st.integers(0, 3))
    row_step = width * offset + draw(st.integers(0, 5))
    data = bytearray(draw(st.binary(min_size=height * row_step, max_size=height * row_step)))
    values: dict[str, list[Any]] = {f.name: [] for f in fields}
    for row in range(height):
        for column in range(width):
            at = row * row_step + column * offset
            for f in fields:
                letter = order + LETTERS[f.datatype]
                (value,) = struct.unpack_from(letter, data, at + f.offset)
                values[f.name].append(value)
    shuffled = draw(st.permutations(fields))
    shape = {"height": height, "row_step": row_step, "is_bigendian": big}
    return cloud(list(shuffled), bytes(data), width, offset, **shape), values


@given(layouts())
def test_any_layout_is_read_as_struct_reads_it(sample: tuple[Any, dict[str, list[Any]]]) -> None:
    message, values = sample
    columns = columns_of(message)
    assert columns.keys() == values.keys()
    for name, column in columns.items():
        with np.errstate(invalid="ignore"):  # a signalling NaN is a NaN like any other
            np.testing.assert_array_equal(column.astype(np.float64), np.array(values[name], dtype=np.float64))


@given(
    st.lists(st.tuples(st.integers(0, 2**32 - 1), st.integers(0, 10), st.integers(0, 2**32 - 1)), max_size=3),
    st.integers(0, 2**32 - 1),
    st.integers(0, 2**32 - 1),
    st.integers(0, 2**32 - 1),
    st.binary(max_size=64),
)
def test_layouts_that_lie_are_refused_or_read_within_the_data(
    fields: list[tuple[int, int, int]], step: int, width: int, height: int, data: bytes
) -> None:
    described = [field(f"f{k}", *numbers) for k, numbers in enumerate(fields)]
    try:
        columns = columns_of(cloud(described, data, width, step % 40, height=height % 5, row_step=step))
    except InputError:
        return
    assert all(len(column) * max(step % 40, 1) <= len(data) for column in columns.values())


LIES: dict[str, tuple[Callable[[Any], None], str]] = {
    "offset beyond the point": (
        lambda m: setattr(m.fields[2], "offset", 9),
        "'z' ends at byte 13 of points of 12",
    ),
    "huge count": (lambda m: setattr(m.fields[2], "count", 2**32 - 1), "'z' ends at byte 17179869188"),
    "huge width": (lambda m: setattr(m, "width", 2**32 - 1), "24 bytes where 1 x 4294967295 points need"),
    "short data": (lambda m: setattr(m, "data", m.data[:-1]), "23 bytes where 1 x 2 points need 24"),
    "unknown type": (lambda m: setattr(m.fields[0], "datatype", 9), "'x' has the unknown datatype 9"),
    "two of one name": (lambda m: setattr(m.fields[1], "name", "x"), "two fields 'x'"),
    "no name": (lambda m: setattr(m.fields[1], "name", ""), "field without a name"),
    "rows too short": (
        lambda m: m.__dict__.update(height=2, width=1, row_step=11),
        "do not fit into row_step = 11",
    ),
    "empty points": (lambda m: m.__dict__.update(fields=[], point_step=0), "point_step is 0"),
}


@pytest.mark.parametrize("lie", LIES)
def test_lies_are_named(lie: str) -> None:
    message = xyz()
    change, problem = LIES[lie]
    change(message)
    with pytest.raises(InputError, match=problem):
        columns_of(message)


def test_points_without_a_return_are_dropped() -> None:
    points = np.zeros((2, 2), dtype=[("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("label", "u1"), ("pad", "V3")])
    points["label"] = [[1, 2], [3, 4]]
    points["y"][0, 1], points["z"][1, 0] = np.nan, np.inf
    fields = [field("x", 0, 7), field("y", 4, 7), field("z", 8, 7), field("label", 12, 2)]
    columns = columns_of(cloud(fields, points.tobytes(), 2, 16, height=2, row_step=32))
    np.testing.assert_array_equal(columns["label"], [1, 4])
    assert len(columns["x"]) == 2


def test_fields_of_several_values() -> None:
    fields = [field("probability", 0, 7, 2), field("normal", 8, 7, 3), field("ring", 20, 4, 0)]
    columns = columns_of(cloud(fields, bytes(44), 2, 22))
    assert list(columns) == ["prob_0", "prob_1", "normal_0", "normal_1", "normal_2", "ring"]


@pytest.mark.parametrize("big", [False, True])
@pytest.mark.parametrize(("name", "datatype"), [("rgb", 7), ("rgb", 6), ("rgba", 6), ("rgba", 5)])
def test_packed_colours(name: str, datatype: int, big: bool) -> None:
    words = np.array([0xFF102030, 0x00FFFE01], dtype=">u4" if big else "<u4")
    columns = columns_of(cloud([field(name, 0, datatype)], words.tobytes(), 2, 4, is_bigendian=big))
    rgb = np.stack([columns[c] for c in ("red", "green", "blue")], axis=1)
    np.testing.assert_array_equal(rgb, [(0x10, 0x20, 0x30), (0xFF, 0xFE, 0x01)])


@given(st.integers(0, 5))
def test_what_is_written_is_read(n: int) -> None:
    rng = np.random.default_rng(n)
    colours = rng.integers(0, 256, (n, 3), np.uint8)
    written: dict[str, NDArray[Any]] = {
        **{name: rng.normal(size=n).astype(np.float32) for name in "xyz"},
        "label": rng.integers(-1, 9, n, np.int32),
        "rgb": packed(colours),
        "far": rng.normal(size=n),
    }
    content = content_of(written)
    fields = [field(*f) for f in content.pop("fields")]
    read = columns_of(SimpleNamespace(fields=fields, **content))
    np.testing.assert_array_equal(np.stack([read.pop(c) for c in ("red", "green", "blue")], axis=1), colours)
    del written["rgb"]
    assert read.keys() == written.keys()
    for name, column in written.items():
        np.testing.assert_array_equal(read[name], column)
