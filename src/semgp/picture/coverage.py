"""Points that cover what a map has seen, as densely as a picture needs them."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from semgp.errors import InputError
from semgp.parallel import n_workers
from semgp.voxels import voxel_keys, voxel_origin

F64 = NDArray[np.float64]

MOST = 600_000
"""About as many points as a picture is made of unless a resolution is asked for."""
_NEIGHBOURS = 9
"""Points, with the one in the middle, that tell the slope of a surface."""
_DISC = 0.75
"""Radius of the disc that stands for a point, as a share of the distance to its fifth neighbour."""
_LONGEST = 2.0
"""Largest radius of such a disc, in usual distances: stray points stay small."""
_FINEST = 12
"""A point stands for at most so many times so many."""


def spacing_of(positions: F64) -> float:
    """Return the usual distance in metres between points (n, 3) and their third neighbour."""
    some = positions[:: -(-len(positions) // 20_000)]
    k = min(4, len(positions))
    distance = cKDTree(positions).query(some, k=[k], workers=n_workers())[0]
    return float(np.median(distance))


def picture_resolution(positions: F64, pixels: int) -> float:
    """Return the spacing of points at which a picture of so many pixels from side to side looks closed and crisp.

    That is a pixel and a half, or more where `MOST` points would not cover the positions so densely.

    Parameters
    ----------
    positions : (n, 3) array
        Where the map has data, n at least 1.
    pixels : int
        Columns or rows of the picture, whichever are more.
    """
    low, high = np.quantile(positions, (0.005, 0.995), axis=0)
    pixel = float(np.linalg.norm(high - low)) / pixels
    densest = spacing_of(positions) * math.sqrt(3 * len(positions) / MOST)  # a disc overlaps its neighbours
    return max(1.5 * pixel, densest, 1e-4)


def surface_points(positions: F64, resolution: float) -> F64:
    """Return points (M, 3) along a surface, about a resolution apart.

    Where positions are closer than half of that, the mean of those in each voxel. Otherwise, each becomes a small
    disc of points in the plane of its neighbours: the map is continuous, and says what lies between its data.

    Parameters
    ----------
    positions : (n, 3) array
        Where the map has data, metres.
    resolution : float
        Metres.

    Raises
    ------
    InputError
        No positions, or a resolution that is not positive.
    """
    if not (math.isfinite(resolution) and resolution > 0):
        raise InputError(f"the resolution must be a positive number of metres, not {resolution}.")
    if not len(positions):
        raise InputError("the map is empty: build it from scans with labels.")
    spacing = spacing_of(positions)
    if 2 * spacing <= resolution or len(positions) < _NEIGHBOURS:
        return _thinned(positions, resolution)
    return _filled(positions, resolution, _LONGEST * spacing)


def _thinned(positions: F64, resolution: float) -> F64:
    """Return the means of the positions in each voxel."""
    keys = voxel_keys(positions, resolution, voxel_origin(positions, resolution))
    _, voxel, count = np.unique(keys, return_inverse=True, return_counts=True)
    corner = positions.min(axis=0)
    sums = [np.bincount(voxel, along) for along in (positions - corner).T]
    return np.asarray(corner + np.stack(sums, axis=1) / count[:, None])


def _filled(positions: F64, resolution: float, longest: float) -> F64:
    """Return discs of points in the planes of the positions' neighbours, as wide as their distances."""
    distance, neighbour = cKDTree(positions).query(positions, k=_NEIGHBOURS, workers=n_workers())
    middle = positions[neighbour].mean(axis=1)
    around = positions[neighbour] - middle[:, None]
    _, axes = np.linalg.eigh(np.swapaxes(around, 1, 2) @ around)
    normal = axes[:, :, 0]
    smooth = positions + normal * np.einsum("ni,ni->n", middle - positions, normal)[:, None]
    radius = np.minimum(_DISC * distance[:, 5], longest)
    n = np.clip(np.ceil(2 * radius / resolution), 1, _FINEST).astype(int)
    parts = [_discs(smooth[n == k], radius[n == k], axes[n == k], k) for k in np.unique(n)]
    return np.concatenate(parts)


def _discs(centres: F64, radius: F64, axes: F64, n: int) -> F64:
    """Return the points of a grid of n x n that lie in a disc around each centre."""
    steps = (2 * np.arange(n) + 1) / n - 1
    a, b = (v.ravel() for v in np.meshgrid(steps, steps))
    disc = np.flatnonzero(a**2 + b**2 <= 1)
    across = a[disc, None] * axes[:, None, :, 2] + b[disc, None] * axes[:, None, :, 1]
    return np.asarray((centres[:, None] + radius[:, None, None] * across).reshape(-1, 3))
