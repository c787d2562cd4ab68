"""Dense grids: a map's answers at the centres of voxels, as a Zarr group (extra `zarr`)."""

from __future__ import annotations

import math
import secrets
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semgp.errors import InputError, MissingExtraError
from semgp.maps.protocol import SemanticMap
from semgp.prediction import Prediction
from semgp.voxels import EXACT

CHUNK = 32
"""Voxels along the edge of a chunk."""

_MOST_VOXELS = 1 << 40


def write_grid(
    semantic_map: SemanticMap,
    path: str | Path,
    resolution: float,
    steps: Callable[[int, int], Any] = lambda done, total: None,
) -> tuple[int, int, int]:
    """Write a map's answers on a dense grid, and return its shape.

    A Zarr group (format 3) with the arrays `label` (-1 where nothing is observed), `probability`, `observed` and,
    where the map has them, `variance` and, from maps with free space, `occupancy` and `known`; axes x, y, z and,
    of probability, the class. Its attributes tell `resolution` and `low`, the corner of the grid, in metres, and
    class names and colours. Only chunks with data in them or beside them are asked for and stored; elsewhere label
    is -1, observed and known are False, and all else is NaN.

    Parameters
    ----------
    semantic_map : SemanticMap
        Any map with data.
    path : str or Path
        A folder that is made, by custom `*.zarr`.
    resolution : float
        Edge of a voxel in metres; any will do, the map is continuous.
    steps : callable, optional
        Called with the number of chunks that are done, and of all.

    Raises
    ------
    InputError
        A resolution that is no length, a map without data, a grid beyond 2^40 voxels, or a folder that is there
        already; MissingExtraError without Zarr.
    """
    try:
        import zarr
    except ImportError as error:
        raise MissingExtraError("a dense grid", "zarr") from error
    path = Path(path)
    if path.exists():
        raise InputError(f"{path} is there already: choose another name, or remove it.")
    low, shape, chunks = _chunks(semantic_map.positions, resolution)
    partial = path.with_name(f".{path.stem}-{secrets.token_hex(6)}.zarr")
    try:
        group = zarr.create_group(partial)
        group.attrs.update(_attributes(semantic_map, low, resolution))
        inside = np.stack(np.meshgrid(*[np.arange(CHUNK)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
        for i, chunk in enumerate(chunks):
            X = (low + chunk * CHUNK + inside + 0.5) * resolution
            for name, values in _values(semantic_map.query(X)).items():
                array: Any = group[name] if name in group else _array(group, name, shape, values)
                where = tuple(slice(int(c) * CHUNK, int(c + 1) * CHUNK) for c in chunk)
                array[where] = values.reshape(CHUNK, CHUNK, CHUNK, *values.shape[1:])
            steps(i + 1, len(chunks))
        partial.rename(path)
    finally:
        shutil.rmtree(partial, ignore_errors=True)
    return shape


def _chunks(
    positions: NDArray[np.float64], resolution: float
) -> tuple[NDArray[np.int64], tuple[int, int, int], NDArray[np.int64]]:
    """The lowest voxel of the grid, its shape, and the chunks (n, 3) with data in them or a voxel from them."""
    if not (math.isfinite(resolution) and resolution > 0):
        raise InputError(f"the resolution must be a positive number of metres, not {resolution}.")
    if not len(positions):
        raise InputError("the map is empty: build it from scans with labels.")
    v = np.floor(positions / resolution)
    if not (np.abs(v) < EXACT).all():
        raise InputError(f"the map's coordinates are too large for voxels of {resolution:g} m: take larger ones.")
    voxel = np.unique(v.astype(np.int64), axis=0)
    low = voxel.min(axis=0) - 1
    beside = [np.unique((voxel - low + np.array(step) - 1) // CHUNK, axis=0) for step in np.ndindex(3, 3, 3)]
    chunks = np.unique(np.concatenate(beside), axis=0)
    x, y, z = ((chunks.max(axis=0) + 1) * CHUNK).tolist()
    if x * y * z > _MOST_VOXELS:
        raise InputError(
            f"a grid of {x:,} x {y:,} x {z:,} voxels is too large: crop the map, or take larger voxels."
        )
    return low, (x, y, z), chunks


def _attributes(semantic_map: SemanticMap, low: NDArray[np.int64], resolution: float) -> dict[str, Any]:
    classes = semantic_map.classes
    return {
        "resolution": resolution,
        "low": (low * resolution).tolist(),
        "unit": "metre",
        "classes": list(classes.names),
        "colours": [list(colour) for colour in classes.colours],
    }


def _values(prediction: Prediction) -> dict[str, NDArray[Any]]:
    """The arrays of the grid at some points."""
    values: dict[str, NDArray[Any]] = {
        "label": prediction.label.astype(np.int16),
        "probability": prediction.probability.astype(np.float32),
        "observed": prediction.observed,
    }
    if prediction.variance is not None:
        best = prediction.probability.argmax(axis=1)
        values["variance"] = np.take_along_axis(prediction.variance, best[:, None], axis=1)[:, 0].astype(
            np.float32
        )
    if prediction.occupancy is not None:
        values["occupancy"] = prediction.occupancy.probability.astype(np.float32)
        values["known"] = prediction.occupancy.known
    return values


def _array(group: Any, name: str, shape: tuple[int, int, int], values: NDArray[Any]) -> Any:
    more = values.shape[1:]
    fill = {"i": -1, "b": False, "f": math.nan}[values.dtype.kind]
    return group.create_array(
        name,
        shape=(*shape, *more),
        chunks=(CHUNK, CHUNK, CHUNK, *more),
        dtype=values.dtype,
        fill_value=fill,
        dimension_names=("x", "y", "z", *(["class"] if more else [])),
    )
