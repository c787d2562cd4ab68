"""Checks of stored sites: what a damaged or hostile file could hold."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semgp.blocks.accumulate import PLACE_UNIT
from semgp.blocks.arrays import F64, I64
from semgp.blocks.cells import CELL, cell_keys
from semgp.errors import InputError
from semgp.maps.settings import stored_array

_Shape = tuple[int | None, ...]
_DAMAGED = "the stored sites are damaged:"


def require_sites(arrays: Mapping[str, NDArray[Any]]) -> None:
    """Raise InputError for sites that cannot be: see `Sites.to_arrays` for the arrays."""
    keys, place = arrays["voxels"], arrays["place"]
    if len(np.unique(keys)) != len(keys):
        raise InputError(f"{_DAMAGED} a voxel occurs twice.")
    if (arrays["origin"] % CELL).any():
        raise InputError(f"{_DAMAGED} their origin is no corner of a cell.")
    total = arrays["mass"].sum(axis=1, dtype=np.int64)
    inside = place[:, :3] <= total[:, None] * PLACE_UNIT
    if (keys < 0).any() or not ((total > 0).all() and inside.all() and (place[:, :3] >= 0).all()):
        raise InputError(f"{_DAMAGED} a voxel out of range, without mass, or left by its site.")
    if "spread" in arrays and (arrays["spread"] < 0).any():
        raise InputError(f"{_DAMAGED} a variance is negative.")


def require_times(cells: I64, times: F64) -> None:
    """Raise InputError for times (n + 1,) of cells (n,), the clock last, that cannot be."""
    if not np.isfinite(times).all() or (times > times[-1]).any():
        raise InputError(f"{_DAMAGED} a time is not finite, or later than the clock.")
    if len(np.unique(cells)) != len(cells) or (cell_keys(cells) != cells).any() or (cells < 0).any():
        raise InputError(f"{_DAMAGED} the cells that have times are none.")


def stored_sites(
    arrays: Mapping[str, NDArray[Any]], prefix: str, n_classes: int, n_dims: int
) -> dict[str, NDArray[Any]]:
    """Return the stored arrays of a field's sites, their names without the prefix, of the right shapes.

    Raises
    ------
    InputError
        Arrays that are missing or of another type or shape.
    """
    n = len(stored_array(arrays, prefix + "voxels", np.int64, (None,)))
    shapes: dict[str, tuple[type[np.generic], _Shape]] = {
        "voxels": (np.int64, (n,)),
        "mass": (np.uint32, (n, n_classes)),
        "place": (np.int64, (n, n_dims)),
        "origin": (np.int64, (3,)),
    }
    if prefix + "spread" in arrays:
        shapes["spread"] = (np.int64, (n, 4))
    if prefix + "time" in arrays:
        cells = len(stored_array(arrays, prefix + "cells", np.int64, (None,)))
        shapes |= {"cells": (np.int64, (cells,)), "time": (np.float64, (cells + 1,))}
    return {name: stored_array(arrays, prefix + name, *wanted) for name, wanted in shapes.items()}
