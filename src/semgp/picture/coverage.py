"""Points that cover what a map has seen, as densely as a picture needs them.

The viewer (`semgp.viewer.surface`) lays its points on the same discs, but thins them, because it cannot show too
many, and leaves the discs where the data are: who clicks wants to know what the map says there.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Self

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
    require_resolution(resolution)
    if not len(positions):
        raise InputError("the map is empty: build it from scans with labels.")
    spacing = spacing_of(positions)
    if 2 * spacing <= resolution or len(positions) < _NEIGHBOURS:
        return thinned(positions, resolution)
    planes = Planes.through(positions, _NEIGHBOURS)
    return Discs.of(planes.onto(positions), planes, spacing).points(resolution, _FINEST)


def require_resolution(resolution: float) -> None:
    """Raise an InputError unless a resolution is positive."""
    if not (math.isfinite(resolution) and resolution > 0):
        raise InputError(f"the resolution must be a positive number of metres, not {resolution}.")


def thinned(points: F64, resolution: float) -> F64:
    """Return the mean (M, 3) of the points in each voxel with this edge, in the order of the voxels."""
    keys = voxel_keys(points, resolution, voxel_origin(points, resolution))
    _, voxel, count = np.unique(keys, return_inverse=True, return_counts=True)
    sums = [np.bincount(voxel, along) for along in (points - points[0]).T]  # small: UTM keeps its millimetres
    return np.asarray(points[0] + np.stack(sums, axis=1) / count[:, None])


@dataclass(frozen=True, eq=False)
class Discs:
    """A surface as discs: one a datum, in the plane of its neighbours, as wide as their distances.

    Parameters
    ----------
    centres : (n, 3) array
        Metres.
    radius : (n,) array
        Metres.
    axes : (n, 2, 3) array
        Two unit vectors each that span the plane.
    """

    centres: F64
    radius: F64
    axes: F64

    @classmethod
    def of(cls, centres: F64, planes: Planes, spacing: float) -> Self:
        """Return discs around centres (n, 3) in planes through them, of data that are usually so far apart."""
        radius = np.minimum(_DISC * planes.distance[:, :6][:, -1], _LONGEST * spacing)
        return cls(centres, radius, planes.axes[:, 1:])

    def across(self, resolution: float, most: int | None = None) -> NDArray[np.int64]:
        """Return how many points from side to side (n,) each disc has, at the resolution or at `most` so many."""
        return np.clip(np.ceil(2 * self.radius / resolution), 1, most).astype(np.int64)

    def points(self, resolution: float, most: int | None = None) -> F64:
        """Return points (M, 3) on the discs, about a resolution apart, of each at most `most` by `most`."""
        n = self.across(resolution, most)
        parts = [
            _grids(self.centres[n == k], self.radius[n == k], self.axes[n == k], int(k)) for k in np.unique(n)
        ]
        return np.concatenate(parts)


@dataclass(frozen=True, eq=False)
class Planes:
    """Planes through the nearest neighbours of each datum, itself included.

    Parameters
    ----------
    distance : (n, k) array
        From the datum, rising, metres.
    middle : (n, 3) array
        Their mean, metres.
    spread : (n, 3) array
        Sums of squares along the axes, rising, square metres.
    axes : (n, 3, 3) array
        Unit vectors, the normal of the plane first.
    """

    distance: F64
    middle: F64
    spread: F64
    axes: F64

    @classmethod
    def through(cls, positions: F64, k: int) -> Self:
        """Return the planes through `k` neighbours of each position (n, 3), or all there are."""
        k = min(k, len(positions))
        distance, neighbour = cKDTree(positions).query(positions, k=range(1, k + 1), workers=n_workers())
        near = positions[neighbour]
        middle = near.mean(axis=1)
        apart = near - middle[:, None]
        spread, axes = np.linalg.eigh(np.swapaxes(apart, 1, 2) @ apart)
        return cls(distance, middle, spread, np.swapaxes(axes, 1, 2))

    def onto(self, positions: F64) -> F64:
        """Return positions (n, 3) moved onto their planes: without noise, but rounded at corners."""
        normal = self.axes[:, 0]
        return np.asarray(positions + normal * np.einsum("ni,ni->n", self.middle - positions, normal)[:, None])


def _grids(centres: F64, radius: F64, axes: F64, n: int) -> F64:
    """Return the points of a grid of n x n that lie in a disc around each centre."""
    steps = (2 * np.arange(n) + 1) / n - 1
    a, b = (v.ravel() for v in np.meshgrid(steps, steps))
    disc = np.flatnonzero(a**2 + b**2 <= 1)
    across = a[disc, None] * axes[:, None, 1] + b[disc, None] * axes[:, None, 0]
    return np.asarray((centres[:, None] + radius[:, None, None] * across).reshape(-1, 3))
