"""Where a viewer asks a map: points on the mapped surface, coarse or fine, never more than it can show."""

from __future__ import annotations

import math
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from semgp.checks import require_finite
from semgp.errors import InputError
from semgp.maps.protocol import SemanticMap, SpatialMap
from semgp.picture.coverage import spacing_of
from semgp.voxels import voxel_keys, voxel_origin

F64 = NDArray[np.float64]

_NEIGHBOURS = 32
"""Data, itself included, whose plane a patch lies in."""
_OVERLAP = 1.4
"""Edge of a patch in spacings: patches of data that lie unevenly leave few gaps."""
_SEERS = 12
"""Free places next to a datum, which tell the side from which it is seen."""


class Surface:
    """The surface that a map's data lie on.

    Coarser than the data, a point is the mean of a voxel's data. Finer, each datum stands for a square patch of
    the plane through its neighbours: a GP says something between its data, too.

    Parameters
    ----------
    positions : (n, 3) array
        Where the map has data, metres.
    free : (m, 3) array, optional
        Where the map knows that there is nothing: the sides from which the surface is seen.

    Raises
    ------
    InputError
        No data, or positions that are not finite.
    """

    def __init__(self, positions: F64, free: F64 | None = None) -> None:
        if not len(positions):
            raise InputError("the map is empty, there is nothing to see: build it from scans with labels.")
        require_finite("positions", positions)
        self.positions, self.free = positions, free

    @classmethod
    def of(cls, semantic_map: SemanticMap) -> Surface:
        """Return the surface of a map.

        Raises
        ------
        InputError
            An empty map.
        """
        return cls(semantic_map.positions, free_positions(semantic_map))

    @property
    def oriented(self) -> bool:
        """Whether the normals point to free space."""
        return self.free is not None

    @cached_property
    def low(self) -> F64:
        """Least coordinates (3,) of the data, metres."""
        return np.asarray(self.positions.min(axis=0))

    @cached_property
    def high(self) -> F64:
        """Greatest coordinates (3,) of the data, metres."""
        return np.asarray(self.positions.max(axis=0))

    @cached_property
    def spacing(self) -> float:
        """Usual distance in metres from a datum to those around it; of data in one place, their extent or 1 m."""
        return spacing_of(self.positions) or float((self.high - self.low).max()) or 1.0

    def points(self, resolution: float, most: int) -> tuple[F64, float]:
        """Return points on the surface, and how far apart they are.

        Parameters
        ----------
        resolution : float
            How far apart they are to be, metres; more where that would be too many.
        most : int
            The most points to return.

        Returns
        -------
        points : (M, 3) array
            Metres.
        resolution : float
            What was kept to.

        Raises
        ------
        InputError
            A resolution or number that is not positive.
        """
        if not (math.isfinite(resolution) and resolution > 0):
            raise InputError(f"the resolution must be a positive number of metres, not {resolution}.")
        if most < 1:
            raise InputError(f"a view needs room for at least one point, not {most}.")
        while True:
            across = math.ceil(_OVERLAP * self.spacing / resolution - 1e-9) if resolution < self.spacing else 1
            if across == 1 or len(self.positions) * across**2 <= 4 * most:
                points = _voxel_means(self._patches(across) if across > 1 else self.positions, resolution)
                if len(points) <= most:
                    return points, resolution
                resolution *= max(1.0, 0.8 * math.sqrt(len(points) / most))
            resolution *= 1.15

    def _patches(self, across: int) -> F64:
        """Return `across` by `across` points of the patch around each datum."""
        axes = self._principal[1]
        steps = ((np.arange(across) + 0.5) / across - 0.5) * _OVERLAP * self.spacing
        u, v = (a.ravel()[None, :, None] for a in np.meshgrid(steps, steps))
        return np.asarray(
            (self.positions[:, None] + u * axes[:, None, :, 1] + v * axes[:, None, :, 2]).reshape(-1, 3)
        )

    def normals(self, points: F64) -> F64:
        """Return the normal (M, 3) of the surface at points on it.

        Where the map has free space, they point to it. Else they point to either side, and are zero where no plane
        fits: none fits the data of a line, such as a lidar's ring, or of a bush.
        """
        return np.asarray(self._normals[self._tree.query(points)[1]])

    @cached_property
    def _normals(self) -> F64:
        """Normals (n, 3) of the data."""
        spread, axes = self._principal
        flat = (spread[:, 1] > 0.05 * spread[:, 2]) & (spread[:, 0] < 0.5 * spread[:, 1])
        normals = np.where(flat[:, None], axes[:, :, 0], 0.0)
        if self.free is None:
            return normals
        around = self.free[cKDTree(self.free).query(self.positions, k=min(_SEERS, len(self.free)))[1]]
        outward = around.reshape(len(normals), -1, 3).mean(axis=1) - self.positions
        outward /= np.maximum(np.linalg.norm(outward, axis=1, keepdims=True), np.finfo(float).tiny)
        away = (normals * outward).sum(axis=1, keepdims=True) < 0
        return np.where(flat[:, None], np.where(away, -normals, normals), outward)

    @cached_property
    def _principal(self) -> tuple[F64, F64]:
        """Spread (n, 3), rising, and axes (n, 3, 3), in columns, of each datum's neighbours."""
        k = min(_NEIGHBOURS, len(self.positions))
        near = self.positions[self._tree.query(self.positions, k=k)[1].reshape(-1, k)]
        apart = near - near.mean(axis=1, keepdims=True)
        spread, axes = np.linalg.eigh(np.swapaxes(apart, 1, 2) @ apart)
        return spread, axes

    @cached_property
    def _tree(self) -> cKDTree:
        return cKDTree(self.positions)


def free_positions(semantic_map: SemanticMap) -> F64 | None:
    """Return where a map knows that there is nothing, (m, 3), metres; None where it keeps no free space."""
    if not len(semantic_map.positions) or semantic_map.query(semantic_map.positions[:1]).occupancy is None:
        return None
    assert isinstance(semantic_map, SpatialMap)
    free = semantic_map.free_positions
    return free if len(free) else None


def _voxel_means(points: F64, resolution: float) -> F64:
    """Return the mean of the points of each voxel, in the order of the voxels' keys."""
    near = points - points[0]  # sums of small numbers: UTM coordinates keep their millimetres
    keys = voxel_keys(near, resolution, voxel_origin(near, resolution))
    _, place = np.unique(keys, return_inverse=True)
    sums = np.stack([np.bincount(place, along) for along in near.T], axis=1)
    return np.asarray(points[0] + sums / np.bincount(place)[:, None])
