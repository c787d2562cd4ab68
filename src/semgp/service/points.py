"""Bodies of queries: points as .npy, as raw rows, or as JSON."""

from __future__ import annotations

import json

import numpy as np
from numpy.typing import NDArray

from semgp.errors import InputError
from semgp.readers.npz import DAMAGE, read_npy
from semgp.service.formats import JSON, NPY

F64 = NDArray[np.float64]

DTYPES = {"float32": "<f4", "float64": "<f8"}
"""Numbers of raw rows; UTM coordinates need float64."""


def decode_points(body: bytes, media: str, dtype: str = "float32") -> F64:
    """Return the points (n, 3) that a body holds; whether they are finite, the map looks.

    Parameters
    ----------
    body : bytes
        The body.
    media : str
        `NPY`, `RAW` or `JSON`.
    dtype : str
        Of raw rows: one of `DTYPES`.

    Raises
    ------
    InputError
        A body that does not hold points.
    """
    if media == JSON:
        return _from_json(body)
    points = _from_npy(body) if media == NPY else _from_rows(body, dtype)
    if points.ndim != 2 or points.shape[1] != 3:
        raise InputError(f"points must have shape (n, 3), not {points.shape}.")
    with np.errstate(over="ignore", invalid="ignore"):  # what is not finite the map refuses
        return points.astype(np.float64, order="C")


def _from_npy(body: bytes) -> NDArray[np.generic]:
    try:
        points = read_npy(body)
    except (
        *DAMAGE,
        MemoryError,
        Warning,
    ) as error:  # numpy parses headers as Python, which may be nested too deep
        raise InputError(f"the body is no .npy array, or is damaged: {error}") from error
    if points.dtype.kind not in "fiu":
        raise InputError(f"points must be numbers, not of type {points.dtype}.")
    return points


def _from_rows(body: bytes, dtype: str) -> NDArray[np.generic]:
    if dtype not in DTYPES:
        raise InputError(f"dtype is {' or '.join(DTYPES)}, not {dtype!r}.")
    width = 3 * np.dtype(DTYPES[dtype]).itemsize
    if len(body) % width:
        raise InputError(f"{len(body):,} bytes are no whole rows of three {dtype} numbers, {width} bytes each.")
    return np.frombuffer(body, DTYPES[dtype]).reshape(-1, 3)


def _from_json(body: bytes) -> F64:
    try:
        asked = json.loads(body)
    except (ValueError, RecursionError) as error:
        raise InputError(f"the body is no JSON: {error}.") from error
    rows = asked.get("points") if isinstance(asked, dict) else None
    if not isinstance(rows, list) or not all(_is_point(row) for row in rows):
        raise InputError('JSON must be {"points": [[x, y, z], ...]}, each point three numbers.')
    try:
        return np.array(rows, dtype=np.float64).reshape(-1, 3)
    except OverflowError as error:
        raise InputError(f"a coordinate is too large: {error}.") from error


def _is_point(row: object) -> bool:
    return isinstance(row, list) and len(row) == 3 and all(type(v) in (int, float) for v in row)
