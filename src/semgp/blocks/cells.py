"""Cells: the cubes of voxels that are solved together, aligned to the world's origin."""

from __future__ import annotations

import numpy as np

from semgp.blocks.arrays import F64, I64
from semgp.voxels import voxel_origin

CELL_BITS = 6
CELL = 1 << CELL_BITS
"""Voxels along the edge of a cell."""


def cell_origin(points: F64, resolution: float) -> I64:
    """Return the origin (3,) of the keys of a map that begins with `points`: the corner of a cell."""
    return cell_corner(voxel_origin(points, resolution))


def cell_corner(voxel: I64) -> I64:
    """Return the lowest voxel (3,) of the cell that a voxel lies in."""
    return np.asarray(voxel >> CELL_BITS << CELL_BITS)


def cell_keys(keys: I64) -> I64:
    """Return the keys of the cells that voxels lie in: those of their lowest voxels."""
    low = (1 << CELL_BITS) - 1
    return keys & ~np.int64(low << 42 | low << 21 | low)
