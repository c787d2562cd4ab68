"""Voxels as Morton codes: three 16-bit keys interleaved, so that the cells of an octree are prefixes of codes.

Bit 3 j of a voxel's 48-bit code is bit j of its x key, bit 3 j + 1 that of y, bit 3 j + 2 that of z. The cell
of depth d that holds the voxel is `code >> 3 * (16 - d)`; the last three bits of a cell number it among the
eight children of its parent, as OctoMap does. A cell of depth 14, 4 x 4 x 4 voxels, is called a brick here.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

DEPTH = 16
"""Depth of the voxels. The root has depth 0 and holds 65,536 voxels along each axis."""

HALF = 1 << (DEPTH - 1)
"""Key of the voxels just above zero on an axis."""

BRICK_DEPTH = 14
"""Depth of the bricks."""

BRICK_BITS = 6
"""A voxel's place in its brick is the last six bits of its code."""

OUTSIDE = -1
"""Code of a point outside the root."""

X_BITS = 0x249249249249
Y_BITS = X_BITS << 1
Z_BITS = X_BITS << 2


def voxel_codes(points: NDArray[np.float32], resolution: float) -> NDArray[np.int64]:
    """Return the code (N,) of the voxel that each point (N, 3) lies in; `OUTSIDE` beyond the root.

    Coordinates are rounded to float32 first, as in OctoMap (`point3d`, `coordToKey`).
    """
    codes = np.empty(len(points), dtype=np.int64)
    _fill_codes(points, 1.0 / resolution, codes)
    return codes


def cell_centres(first: NDArray[np.int64], depth: NDArray[np.integer], resolution: float) -> NDArray[np.float64]:
    """Return the centres (M, 3) of cells, each given by the code of its first voxel and its depth."""
    keys = np.empty((len(first), 3), dtype=np.int64)
    _fill_keys(first, keys)
    half_size = 0.5 * (1 << (DEPTH - np.asarray(depth, dtype=np.int64)))
    return np.asarray((keys - HALF + half_size[..., None]) * resolution)


@njit(cache=True, nogil=True)
def voxel_code(x: np.float32, y: np.float32, z: np.float32, factor: float) -> int:
    """Return the code of the voxel that a point lies in, given one over the resolution."""
    i, j, k = np.floor(factor * x) + HALF, np.floor(factor * y) + HALF, np.floor(factor * z) + HALF
    if not (0 <= i < 2 * HALF and 0 <= j < 2 * HALF and 0 <= k < 2 * HALF):
        return OUTSIDE
    return _spread(int(i)) | (_spread(int(j)) << 1) | (_spread(int(k)) << 2)


@njit(cache=True, nogil=True)
def key_along(axis: int, code: int) -> int:
    """Return a voxel's key along axis 0, 1 or 2."""
    k = (code >> axis) & X_BITS
    k = (k | (k >> 2)) & 0x0C30C30C30C3
    k = (k | (k >> 4)) & 0xF00F00F00F
    k = (k | (k >> 8)) & 0xFF0000FF
    return (k | (k >> 16)) & 0xFFFF


@njit(cache=True, nogil=True)
def _spread(k: int) -> int:
    """Return 16 bits with two zeros between neighbours."""
    k = (k | (k << 16)) & 0xFF0000FF
    k = (k | (k << 8)) & 0xF00F00F00F
    k = (k | (k << 4)) & 0x0C30C30C30C3
    return (k | (k << 2)) & X_BITS


@njit(cache=True, nogil=True)
def _fill_codes(points: NDArray[np.float32], factor: float, codes: NDArray[np.int64]) -> None:
    for i in range(len(points)):
        codes[i] = voxel_code(points[i, 0], points[i, 1], points[i, 2], factor)


@njit(cache=True, nogil=True)
def _fill_keys(codes: NDArray[np.int64], keys: NDArray[np.int64]) -> None:
    for i in range(len(codes)):
        for axis in range(3):
            keys[i, axis] = key_along(axis, codes[i])
