"""sensor_msgs/PointCloud2: from the message's bytes to columns, and back."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semgp.errors import InputError

DATATYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}
"""The types of sensor_msgs/PointField by their numbers."""

_NUMBERS = {kind: number for number, kind in DATATYPES.items()}


def columns_of(message: Any) -> dict[str, NDArray[Any]]:
    """Return the fields of a PointCloud2 as columns (N,), row by row of an organised cloud.

    A field of several values a point gives one column for each: "probabilities" of count 3 becomes `prob_0` to
    `prob_2`, as do "probability", "prob" and "p"; any other field `name_0` and so on. Colours that PCL packs
    into a field `rgb` or `rgba` become `red`, `green` and `blue`. Points whose x, y or z is NaN or infinite, as
    organised clouds and REP-117 mark what gave no return, are left out.

    Raises
    ------
    InputError
        Fields that do not fit the points, or fewer bytes than points.
    """
    rows = _rows(message)
    columns: dict[str, NDArray[Any]] = {}
    for name in rows.dtype.names or ():
        column = rows[name]
        if column.ndim == 1:
            columns[name] = column
            continue
        stem = "prob" if re.fullmatch(r"p|prob(abilit(y|ies))?", name.lower()) else name
        columns |= {f"{stem}_{i}": column[:, i] for i in range(column.shape[1])}
    for name in ("rgb", "rgba"):
        if name in columns and columns[name].dtype.itemsize == 4:
            columns |= _unpacked(columns.pop(name))
    if {"x", "y", "z"} <= columns.keys():
        kept = np.isfinite(columns["x"]) & np.isfinite(columns["y"]) & np.isfinite(columns["z"])
        if not kept.all():
            columns = {name: column[kept] for name, column in columns.items()}
    return columns


def _rows(message: Any) -> NDArray[np.void]:
    """Return the points as an array of structures, shape (N,)."""
    dtype = _dtype(message)
    height, width, step = int(message.height), int(message.width), dtype.itemsize
    row_step = int(message.row_step) if height > 1 else width * step
    if row_step < width * step:
        raise InputError(
            f"its rows of {width} points of {step} bytes do not fit into row_step = {row_step} bytes."
        )
    data = np.frombuffer(message.data, dtype=np.uint8)
    needed = (height - 1) * row_step + width * step if height and width else 0
    if len(data) < needed:
        raise InputError(f"it has {len(data)} bytes where {height} x {width} points need {needed}.")
    if not needed:
        return np.empty(0, dtype=dtype)
    return np.ndarray((height, width), dtype, data, strides=(row_step, step)).reshape(-1)


def _dtype(message: Any) -> np.dtype[np.void]:
    """Return the layout of a point."""
    step, order = int(message.point_step), ">" if message.is_bigendian else "<"
    names, formats, offsets = [], [], []
    for field in message.fields:
        kind = DATATYPES.get(int(field.datatype))
        if kind is None:
            raise InputError(f"its field {field.name!r} has the unknown datatype {field.datatype}.")
        count = max(int(field.count), 1)  # some drivers leave it at 0
        end = int(field.offset) + count * int(kind[1])
        if end > step:
            raise InputError(f"its field {field.name!r} ends at byte {end} of points of {step} bytes.")
        names.append(field.name)
        formats.append(order + kind if count == 1 else f"({count},){order}{kind}")
        offsets.append(int(field.offset))
    if twice := sorted({name for name in names if names.count(name) > 1}):
        raise InputError(f"it has two fields {twice[0]!r}.")
    if "" in names:
        raise InputError("it has a field without a name.")
    if step < 1:
        raise InputError("its points have no bytes: point_step is 0.")
    return np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": step})


def _unpacked(column: NDArray[Any]) -> dict[str, NDArray[np.uint8]]:
    """Return the colours in words 0xAARRGGBB, which may be called a float."""
    words = np.ascontiguousarray(column).view(column.dtype.byteorder + "u4")
    return {
        name: (words >> shift & 255).astype(np.uint8) for name, shift in (("red", 16), ("green", 8), ("blue", 0))
    }


def packed(colours: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Return colours (N, 3) as the floats that PCL and RViz know as `rgb`, 0x00RRGGBB."""
    red, green, blue = colours.astype(np.uint32).T
    return np.asarray((red << 16 | green << 8 | blue).view(np.float32))


def content_of(columns: Mapping[str, NDArray[Any]]) -> dict[str, Any]:
    """Return what a PointCloud2 has besides its header, for one row of points with columns (N,) of numbers.

    `fields` are tuples of name, offset, datatype and count.
    """
    kinds = {name: np.dtype(column.dtype).newbyteorder("<") for name, column in columns.items()}
    rows = np.empty(len(next(iter(columns.values()))), dtype=list(kinds.items()))
    for name, column in columns.items():
        rows[name] = column
    layout: Mapping[str, Any] = rows.dtype.fields or {}
    return {
        "height": 1,
        "width": len(rows),
        "fields": [(name, layout[name][1], _NUMBERS[kind.str[1:]], 1) for name, kind in kinds.items()],
        "is_bigendian": False,
        "point_step": rows.dtype.itemsize,
        "row_step": rows.nbytes,
        "data": rows.view(np.uint8) if len(rows) else np.empty(0, np.uint8),
        "is_dense": True,
    }
